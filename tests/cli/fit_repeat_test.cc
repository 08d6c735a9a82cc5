// `unfurl fit --repeat`: trials that scatter, through the real program.
#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include <thread>

#include "tests/cli/fit_cases.h"

namespace unfurl::cli::fit_repeat_test {
namespace {

using ::testing::HasSubstr;

// Four deployments whose springs differ by a few percent.
class FitRepeat : public FitVerbTest {
 protected:
  void MakeDeployments() const {
    std::string trials;
    int seed = 20;
    for (const char* stiffness : {"0.210", "0.216", "0.221", "0.226"}) {
      const std::string name = "t" + std::to_string(++seed) + ".h5";
      MakeTracks(name, {std::string("joint.hinge.spring.stiffness=") + stiffness},
                 static_cast<std::uint64_t>(seed));
      trials += "[[trial]]\nname = \"" + name + "\"\ntracks = \"" + name + "\"\n";
    }
    MakeStudy("study.toml", trials, "[repeat]\nparameters = [\"stiffness\"]\n");
  }
};

TEST_F(FitRepeat, MeanAndScatterFromJsonFileAndPage) {
  MakeDeployments();
  const Outcome outcome =
      Good({"fit", "study.toml", "-o", "fit.h5", "--json", "--report", "fit.html"});
  const auto fit = nlohmann::json::parse(outcome.out);
  bool found = false;
  for (const auto& p : fit.at("repeat").at("parameters")) {
    if (p.at("name") != "stiffness") continue;
    found = true;
    // Mean of the four, and their scatter (0.0068 by hand), by many times the trials' own errors.
    EXPECT_NEAR(p.at("mean"), 0.21825, 0.004);
    EXPECT_LT(p.at("scatter_low95"), 0.0068);
    EXPECT_GT(p.at("scatter_high95"), 0.0068);
  }
  EXPECT_TRUE(found) << fit.dump(1);
  EXPECT_THAT(Get("fit.html"), HasSubstr("scatter"));
}

// Stopped at any moment, and by other processes.
TEST_F(FitRepeat, TheSameFileHoweverItWasMade) {
  MakeDeployments();
  Good({"fit", "study.toml", "-o", "fit.h5", "--json", "--report", "fit.html"});
  const std::string whole = Get("fit.h5");
  const std::vector<std::string> words = {"fit",    "study.toml", "-o",      "fit.h5",
                                          "--json", "--report",   "fit.html"};
  std::filesystem::remove(folder_ / "fit.h5");
  RunProgram(words, folder_, 0, 400, SIGKILL);
  std::vector<std::string> again = words;
  again.emplace_back("--resume");
  Good(again);
  EXPECT_TRUE(Get("fit.h5") == whole);
  std::thread server([&] {
    while (!std::filesystem::exists(folder_ / "here" / "fit.json")) std::this_thread::yield();
    Run({"fit", "study.toml", "--serve", "here", "--workers", "2", "--quiet"});
  });
  std::vector<std::string> shared = words;
  shared.insert(shared.end(), {"--engine", "folder", "--folder", "here"});
  const Outcome by_others = Run(shared);
  server.join();
  EXPECT_EQ(by_others.code, 0) << by_others.err;
  EXPECT_TRUE(Get("fit.h5") == whole);
}

TEST_F(FitRepeat, TwoTrialsAreTooFew) {
  MakeTracks("tracks.h5", {}, 5);
  MakeStudy("study.toml",
            "[[trial]]\nname = \"a\"\ntracks = \"tracks.h5\"\n[[trial]]\nname = \"b\"\n"
            "tracks = \"tracks.h5\"\n");
  const std::vector<std::string> before = Files();
  ExpectRefused(Run({"fit", "study.toml", "--repeat"}), {"at least three"}, before);
}

}  // namespace
}  // namespace unfurl::cli::fit_repeat_test
