// Every kind of call fails once, somewhere in a small job of each verb: the exit code says what is
// so, standard error has its line, and what was there before is whole.
#include <gmock/gmock.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>

#include "tests/cli/small_jobs.h"

namespace unfurl::cli::faults_slow_test {
namespace {

constexpr char kOld[] = "the old result";

class Faults : public SmallJobsTest {
 protected:
  void SetUp() override {
    SmallJobsTest::SetUp();
    for (SmallJob& job : jobs_) {  // the threads of a job are not many
      if (job.command[0] == "expose" || job.command[0] == "reconstruct" ||
          job.command[0] == "calibrate" || job.command[0] == "fit") {
        job.command.insert(job.command.end(), {"--workers", "2"});
      }
    }
    jobs_.push_back({{"convert", "tracks.csv", "out.uff"}, "out.uff"});
    jobs_.push_back({{"correlate", "run.h5", "run.h5", "-o", "out.json"}, "out.json"});
    jobs_.push_back({{"info", "run.h5"}, ""});
    jobs_.push_back({{"completion", "bash"}, ""});
    jobs_.push_back({{"completion", "man"}, ""});
    jobs_.push_back({{"doctor"}, ""});
  }

  Outcome RunWith(const std::vector<std::string>& command, const std::string& fault) const {
    const std::string count = folder_.string() + ".count";
    setenv("LD_PRELOAD", UNFURL_FAULTS, 1);
    setenv("UNFURL_FAULT", fault.c_str(), 1);
    setenv("UNFURL_FAULT_COUNT", count.c_str(), 1);
    Outcome outcome = Run(command);
    for (const char* name : {"LD_PRELOAD", "UNFURL_FAULT", "UNFURL_FAULT_COUNT"}) unsetenv(name);
    return outcome;
  }

  long Count() const {
    long calls = 0;
    std::ifstream(folder_.string() + ".count") >> calls;
    std::filesystem::remove(folder_.string() + ".count");
    return calls;
  }
};

TEST_F(Faults, EachCallFailsOnce) {
  constexpr long kMost = 40;  // places tried of each kind and job
  int runs = 0, refused = 0;
  for (const SmallJob& job : jobs_) {
    const std::vector<std::string> before = [&] {
      if (!job.output.empty()) Put(job.output, kOld);
      return Files();
    }();
    const std::string fresh = [&] {
      RunWith(job.command, "none:0");
      return job.output.empty() ? std::string() : Get(job.output);
    }();
    for (const char* kind : {"new", "write", "read", "fsync", "rename", "open", "thread"}) {
      RunWith(job.command, std::string(kind) + ":0");
      const long calls = Count();
      for (long k = 0; k < std::min(calls, kMost); ++k) {
        // All of few; of many the first ones, the last ones, and some between.
        const long at = calls <= kMost ? k + 1 : 1 + k * (calls - 1) / (kMost - 1);
        if (!job.output.empty()) Put(job.output, kOld);
        const std::string fault = std::string(kind) + ":" + std::to_string(at);
        const Outcome outcome = RunWith(job.command, fault);
        std::filesystem::remove(folder_.string() + ".count");
        SCOPED_TRACE(fault + " of " + std::to_string(calls) + " in " + job.command[0] + " " +
                     job.output + ": " + outcome.err);
        ++runs;
        EXPECT_TRUE(outcome.code == 0 || outcome.code == 1 || outcome.code == 2 ||
                    outcome.code == 4)
            << outcome.code;
        std::vector<std::string> after = Files();
        std::erase(after, job.output + ".partial");
        std::erase(after, "plan.runs");  // of a campaign: the runs so far
        EXPECT_EQ(after, before);
        std::filesystem::remove(folder_ / (job.output + ".partial"));
        std::filesystem::remove_all(folder_ / "plan.runs");
        if (outcome.code == 0) continue;
        EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1);
        if (outcome.code == 1) continue;
        ++refused;
        if (!job.output.empty()) {
          // Whole, that is: what fails after the last output has its name leaves that.
          const std::string now = Get(job.output);
          const bool whole =
              job.tells_times ? now.ends_with(fresh.substr(fresh.size() - 20)) : now == fresh;
          EXPECT_TRUE(now == kOld || whole) << "the old result is gone";
        }
      }
    }
    if (!job.output.empty()) std::filesystem::remove(folder_ / job.output);
  }
  std::printf("found: %d runs with a fault, %d refused, the others did without\n", runs, refused);
}

// A start is made whole or not at all, and what was in its folder stays.
TEST_F(Faults, AStartIsWholeOrNotThere) {
  const std::vector<std::string> command = {"new", "study", "mine"};
  std::filesystem::create_directories(folder_ / "mine");
  Put("mine/notes.txt", kOld);
  const std::vector<std::string> before = Files();
  ASSERT_EQ(Run(command).code, 0);
  std::map<std::string, std::string> fresh;
  for (const char* name : {"study.toml", "scene.toml", "tracks.csv", "README.md"}) {
    fresh[name] = Get(std::string("mine/") + name);
    EXPECT_FALSE(fresh[name].empty()) << name;
  }
  const auto clear = [&] {
    for (const auto& [name, text] : fresh) std::filesystem::remove(folder_ / "mine" / name);
  };
  int runs = 0, refused = 0;
  for (const char* kind : {"new", "write", "read", "fsync", "rename", "open"}) {
    clear();
    RunWith(command, std::string(kind) + ":0");
    // The last ones are those of writing; of memory there are thousands before.
    constexpr long kMost = 150;
    const long calls = Count();
    for (long at = calls; at > std::max(0L, calls - kMost); --at) {
      clear();
      const std::string fault = std::string(kind) + ":" + std::to_string(at);
      const Outcome outcome = RunWith(command, fault);
      Count();
      SCOPED_TRACE(fault + ": " + outcome.err);
      ++runs;
      refused += outcome.code == 0 ? 0 : 1;
      EXPECT_TRUE(outcome.code == 0 || outcome.code == 2 || outcome.code == 4) << outcome.code;
      EXPECT_EQ(Get("mine/notes.txt"), kOld);
      std::size_t whole = 0;
      for (const auto& [name, text] : fresh) {
        if (!std::filesystem::exists(folder_ / "mine" / name)) continue;
        EXPECT_EQ(Get("mine/" + name), text);
        ++whole;
      }
      // What fails once they all have their names leaves them.
      EXPECT_TRUE(whole == fresh.size() || (whole == 0 && outcome.code != 0)) << whole;
    }
  }
  clear();
  EXPECT_EQ(Files(), before);
  std::printf("found: %d runs of new with a fault, %d refused\n", runs, refused);
}

}  // namespace
}  // namespace unfurl::cli::faults_slow_test
