// Every kind of call fails once, somewhere in a small job of each verb: the exit code says what is
// so, standard error has its line, and what was there before is whole.
#include <gmock/gmock.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>

#include "tests/cli/small_jobs.h"

namespace unfurl::cli {
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
        EXPECT_EQ(after, before);
        std::filesystem::remove(folder_ / (job.output + ".partial"));
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

}  // namespace
}  // namespace unfurl::cli
