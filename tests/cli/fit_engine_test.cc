// `unfurl fit` whose simulations other processes carry out: by hand, and by Slurm.
#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include <thread>

#include "tests/cli/campaign_slurm.h"
#include "tests/cli/fit_cases.h"

namespace unfurl::cli::fit_engine_test {
namespace {

constexpr char kOneTrial[] = "[trial]\ntracks = \"tracks.h5\"\n";

class FitEngine : public OnToyCluster<FitVerbTest> {
 protected:
  // The file of a fit in this process, and a study that gives it.
  std::string Local() {
    MakeTracks("tracks.h5", {}, 5);
    MakeStudy("study.toml", kOneTrial);
    Good({"fit", "study.toml", "-o", "fit.h5", "--quiet"});
    return Get("fit.h5");
  }
};

TEST_F(FitEngine, WorkersStartedByHandGiveTheSameFile) {
  const std::string local = Local();
  Outcome served;
  std::thread server([&] {
    while (!std::filesystem::exists(folder_ / "here" / "fit.json")) std::this_thread::yield();
    served = Run({"fit", "study.toml", "--serve", "here", "--workers", "2", "--json"});
  });
  const Outcome fit = Run({"fit", "study.toml", "-o", "fit.h5", "--engine", "folder", "--folder",
                           "here", "--workers", "5"});
  server.join();
  ASSERT_EQ(fit.code, 0) << fit.err;
  EXPECT_THAT(fit.err, ::testing::HasSubstr("fit study.toml --serve here"));
  EXPECT_TRUE(Get("fit.h5") == local);
  ASSERT_EQ(served.code, 0) << served.err;
  EXPECT_GT(nlohmann::json::parse(served.out).at("answered"), 10);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "here"));
}

TEST_F(FitEngine, SlurmGivesTheSameFile) {
  Start(2, 2);
  const std::string local = Local();
  const Outcome fit = Run({"fit", "study.toml", "-o", "fit.h5", "--quiet", "--engine", "slurm",
                           "--workers", "3", "--sbatch=--time=00:10:00"});
  ASSERT_EQ(fit.code, 0) << fit.err;
  EXPECT_TRUE(Get("fit.h5") == local);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "fit.h5.questions"));
  // Nothing of a fit that Slurm does not take is left.
  Put("other.toml", Get("study.toml"));
  const std::vector<std::string> before = Files();
  const Outcome refused = Run({"fit", "other.toml", "-o", "other.h5", "--engine", "slurm",
                               "--sbatch=--no-such-option"});
  EXPECT_EQ(refused.code, 4);
  EXPECT_THAT(refused.err, ::testing::HasSubstr("no-such-option"));
  EXPECT_EQ(Files(), before);
}

TEST_F(FitEngine, OptionsThatDoNotGoTogetherAreRefused) {
  Put("study.toml", "[trial]\n");
  const std::vector<std::string> before = Files();
  const auto refused = [&](const std::vector<std::string>& more, const char* named) {
    std::vector<std::string> words = {"fit", "study.toml"};
    words.insert(words.end(), more.begin(), more.end());
    ExpectRefused(Run(words), {named}, before);
  };
  refused({"--serve", "x", "--engine", "slurm"}, "--engine");
  refused({"--serve", "x", "--folder", "y"}, "--folder");
  refused({"--serve", "x", "--resume"}, "--resume");
  refused({"--folder", "y"}, "--folder");
  refused({"--sbatch=--time=1"}, "--sbatch");
  refused({"--engine", "folder", "--sbatch=--time=1"}, "--sbatch");
}

}  // namespace
}  // namespace unfurl::cli::fit_engine_test
