// Every kind of call fails once, somewhere in a small job of each verb: the exit code says what is
// so, standard error has its line, and what was there before is whole.
#include <gmock/gmock.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>

#include "tests/cli/program.h"

namespace unfurl::cli {
namespace {

constexpr char kOld[] = "the old result";

struct Job {
  std::vector<std::string> command;
  std::string output;  // empty: none
};

class Faults : public ProgramTest {
 protected:
  void SetUp() override {
    ProgramTest::SetUp();
    const std::vector<std::string> simulate = {"simulate",   Shipped("scene_suspension.toml"),
                                               "--duration", "0.02",
                                               "--set",      "beam.beam1.segments=2",
                                               "--set",      "beam.beam2.segments=2",
                                               "--set",      "beam.beam3.segments=2",
                                               "--set",      "beam.beam4.segments=2",
                                               "-o",         "run.h5"};
    Good(simulate);
    Good({"expose", "run.h5", "--lab", Shipped("lab.toml"), "-o", "trial.h5", "--workers", "2"});
    Good({"convert", "run.h5", "run.csv"});
    Put("tracks.csv",
        "t [s],mark,x [m],y [m],z [m],cxx [m^2],cxy [m^2],cxz [m^2],cyy [m^2],cyz [m^2],"
        "czz [m^2]\n0,m,0,0,0,1e-8,0,0,1e-8,0,1e-8\n0.1,m,0,0,0,1e-8,0,0,1e-8,0,1e-8\n");
    auto again = simulate;
    again.back() = "out.h5";
    jobs_ = {
        {again, "out.h5"},
        {{"modes", Shipped("scene_suspension.toml"), "-o", "out.h5"}, "out.h5"},
        {{"expose", "run.h5", "--lab", Shipped("lab.toml"), "-o", "out.h5", "--workers", "2"},
         "out.h5"},
        {{"reconstruct", "trial.h5", "--rig", Shipped("rig.h5"), "-o", "out.h5", "--workers", "2"},
         "out.h5"},
        {{"convert", "run.h5", "out.csv"}, "out.csv"},
        {{"convert", "tracks.csv", "out.uff"}, "out.uff"},
        {{"correlate", "run.h5", "run.h5", "-o", "out.json"}, "out.json"},
        {{"info", "run.h5"}, ""},
        {{"plan", Shipped("rig.h5"), "--columns", "5", "--report", "out.html"}, "out.html"}};
  }

  void Good(const std::vector<std::string>& command) const {
    const Outcome outcome = Run(command);
    ASSERT_LE(outcome.code, 1) << outcome.err;
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

  std::vector<Job> jobs_;
};

TEST_F(Faults, EachCallFailsOnce) {
  constexpr long kMost = 40;  // places tried of each kind and job
  int runs = 0, refused = 0;
  for (const Job& job : jobs_) {
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
        if (outcome.code < 2) continue;
        ++refused;
        EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1);
        if (!job.output.empty()) {
          // Whole, that is: what fails after the last output has its name leaves that.
          const std::string now = Get(job.output);
          EXPECT_TRUE(now == kOld || now == fresh) << "the old result is gone";
        }
      }
    }
    if (!job.output.empty()) std::filesystem::remove(folder_ / job.output);
  }
  std::printf("found: %d runs with a fault, %d refused, the others did without\n", runs, refused);
}

}  // namespace
}  // namespace unfurl::cli
