// `unfurl reconstruct` of long recordings: in constant memory, and stopped on the way.
#include <gmock/gmock.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <fstream>
#include <thread>

#include "data/run.h"
#include "data/trial.h"
#include "tests/cli/program.h"

namespace unfurl::cli::streams_slow_test {
namespace {

using ::testing::HasSubstr;

class Streams : public ProgramTest {
 protected:
  // A short virtual trial of the shipped laboratory, over and over again.
  void PutTrial(const std::string& name, std::size_t lines) const {
    data::RunLayout layout;
    layout.marks = {"mark1", "mark1b", "mark2", "mark3"};
    for (const std::string& mark : layout.marks) {
      for (const char* axis : {".x", ".y", ".vx", ".vy"}) {
        layout.quantities.push_back({mark + axis, axis[1] == 'v' ? "m/s" : "m", ""});
      }
    }
    {
      data::RunWriter writer((folder_ / "run.h5").string(), {}, layout);
      for (int i = 0; i <= 200; ++i) {
        std::vector<double> values;
        for (int m = 0; m < 4; ++m) {
          const double at = M_PI * i / 100.0 + m;
          values.insert(values.end(), {0.8 + 0.2 * m * std::sin(at), 0.3 + 0.2 * std::cos(at),
                                       20.0 * M_PI * 0.1 * m * std::cos(at) / 10.0, 0.0});
        }
        writer.Append(1e-3 * i, values);
      }
      writer.Commit();
    }
    ASSERT_EQ(Run({"expose", "run.h5", "--lab", Shipped("lab.toml"), "-o", "short.h5", "--set",
                   "strobe.lead=[0.01, 0.02]", "--quiet"})
                  .code,
              0);
    const data::TrialReader reader((folder_ / "short.h5").string());
    data::TrialBlock block;
    reader.Read(0, reader.size() / 5 * 5, &block);  // whole rounds of the slots
    const std::size_t elements = reader.header().format.elements() * reader.header().cameras.size();
    data::TrialWriter writer((folder_ / name).string(), reader.header(), {});
    const std::vector<double> t = block.t;
    for (std::size_t done = 0; done < lines; done += block.size()) {
      const std::size_t more = std::min(block.size(), lines - done);
      block.t.resize(more);
      block.slot.resize(more);
      block.counts.resize(more * elements);
      for (std::size_t i = 0; i < more; ++i) {
        block.t[i] = t[i] + static_cast<double>(done) / reader.header().line_rate;
      }
      writer.Append(block);
    }
    writer.Commit();
    std::filesystem::remove(folder_ / "run.h5");
    std::filesystem::remove(folder_ / "short.h5");
  }
};

TEST_F(Streams, MemoryDoesNotGrowWithTheRecord) {
  // 17,000 lines more: 300 MB, from which come 13,600 samples of 0.8 kB, with the calibration's
  // part 11 MB. What grows a little is HDF5's index of the trial's chunks, by 0.1 kB a line, up to
  // the size of its cache.
  constexpr long kMostKb = 6000;
  PutTrial("short_trial.h5", 3000);
  PutTrial("long_trial.h5", 20000);
  const auto reconstruct = [&](const std::string& trial) {
    return Run({"reconstruct", trial, "--rig", Shipped("rig.h5"), "--quiet", "--report",
                "page.html", "--workers", "2"});
  };
  const Outcome once = reconstruct("short_trial.h5"), longer = reconstruct("long_trial.h5");
  ASSERT_EQ(once.code, 0) << once.err;
  ASSERT_EQ(longer.code, 0) << longer.err;
  std::printf("peak memory: 3000 lines %ld kB, 20000 lines %ld kB\n", once.peak_kb, longer.peak_kb);
  EXPECT_LT(longer.peak_kb - once.peak_kb, kMostKb);
}

TEST_F(Streams, CtrlCLeavesTheOldTracksAndNothingElse) {
  PutTrial("trial.h5", 12000);
  Put("tracks.h5", "of yesterday");
  const std::vector<std::string> before = Files();
  for (const int signal : {SIGINT, SIGTERM}) {
    const std::string words = folder_.string() + ".words";
    const pid_t child = fork();
    if (child == 0) {
      std::freopen(words.c_str(), "w", stderr);
      if (chdir(folder_.c_str()) != 0) _exit(120);
      const std::string rig = Shipped("rig.h5");
      execl(UNFURL_PROGRAM, UNFURL_PROGRAM, "reconstruct", "trial.h5", "--rig", rig.c_str(), "-o",
            "tracks.h5", "--workers", "1", nullptr);
      _exit(121);
    }
    // As soon as it has begun to write.
    for (int k = 0; k < 6000 && Files() == before; ++k) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    kill(child, signal);
    int status = 0;
    waitpid(child, &status, 0);
    std::ifstream stream(words);
    std::string complaint;
    std::getline(stream, complaint, '\0');
    std::filesystem::remove(words);
    ASSERT_TRUE(WIFEXITED(status));
    EXPECT_EQ(WEXITSTATUS(status), 128 + signal);
    EXPECT_THAT(complaint, HasSubstr("interrupted; nothing was written"));
    EXPECT_EQ(Files(), before);
    EXPECT_EQ(Get("tracks.h5"), "of yesterday");
  }
}

}  // namespace
}  // namespace unfurl::cli::streams_slow_test
