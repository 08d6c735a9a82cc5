// The number of threads changes no bit of a result.
#include <gmock/gmock.h>

#include "tests/cli/small_jobs.h"

namespace unfurl::cli {
namespace {

class SameBits : public SmallJobsTest {};

TEST_F(SameBits, WithOneTwoAndFourThreads) {
  int tried = 0;
  for (const SmallJob& job : jobs_) {
    const std::string help = Run({job.command[0], "--help"}).out;
    if (help.find("--workers") == std::string::npos) continue;
    std::string first;
    for (const char* workers : {"1", "2", "4"}) {
      std::vector<std::string> command = job.command;
      command.insert(command.end(), {"--workers", workers});
      Good(command);
      const std::string contents = ContentsOf((folder_ / job.output).string());
      if (first.empty()) first = contents;
      EXPECT_TRUE(contents == first) << job.name() << " with " << workers << " threads";
      ++tried;
      std::filesystem::remove(folder_ / job.output);
    }
  }
  EXPECT_GE(tried, 12);  // expose twice, calibrate, reconstruct, fit
}

}  // namespace
}  // namespace unfurl::cli
