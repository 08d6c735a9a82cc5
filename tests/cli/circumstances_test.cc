// Where a program may find itself: a folder it may not write to, no home, no environment, a locale
// with decimal commas.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <clocale>
#include <cstdlib>
#include <string>
#include <utility>
#include <vector>

#include "tests/cli/small_jobs.h"

namespace unfurl::cli::circumstances_test {
namespace {

class Circumstances : public SmallJobsTest {
 protected:
  Outcome RunAfter(const std::vector<std::string>& command,
                   const std::function<void()>& in_child) const {
    return RunProgram(command, folder_, 0, 0, SIGINT, in_child);
  }
};

TEST_F(Circumstances, AFolderThatMayNotBeWrittenTo) {
  constexpr uid_t kNobody = 65534;
  chmod(folder_.c_str(), 0555);
  const std::vector<std::string> before = Files();
  for (const SmallJob& job : jobs_) {
    const Outcome outcome = RunAfter(job.command, [] {
      // Root writes everywhere.
      if (geteuid() == 0 && (setgid(kNobody) != 0 || setuid(kNobody) != 0)) _exit(119);
    });
    ASSERT_NE(outcome.code, 119);
    SCOPED_TRACE(job.name());
    ExpectRefused(outcome, {"Permission denied; name a "}, before, 4);
  }
  chmod(folder_.c_str(), 0755);
}

// What is longer than the buffer is lost before the end: only the stream remembers it.
TEST_F(Circumstances, AFullDeviceBehindStandardOutput) {
  const std::vector<std::string> before = Files();
  const auto full = [] {
    if (dup2(open("/dev/full", O_WRONLY), STDOUT_FILENO) < 0) _exit(119);
  };
  const std::vector<std::vector<std::string>> commands = {{"--version"}, {"calibrate", "--help"}};
  const auto length = [&](std::size_t k) { return Run(commands[k]).out.size(); };
  ASSERT_LT(length(0), 100u);
  ASSERT_GT(length(1), 4096u);  // bytes, the buffer of a device
  for (const std::vector<std::string>& command : commands) {
    ExpectRefused(RunAfter(command, full), {"standard output", "cannot write"}, before, 4);
  }
}

TEST_F(Circumstances, NoHomeAndNoEnvironment) {
  for (const SmallJob& job : jobs_) {
    const std::string fresh = Undisturbed(job);
    const std::string path = std::getenv("PATH");
    const Outcome outcome = RunAfter(job.command, [&] {
      std::vector<std::pair<const char*, std::string>>
          kept;  // how a sanitized build was told to run
      for (const char* name : {"ASAN_OPTIONS", "LSAN_OPTIONS", "UBSAN_OPTIONS"}) {
        if (const char* value = std::getenv(name)) kept.emplace_back(name, value);
      }
      clearenv();
      for (const auto& [name, value] : kept) setenv(name, value.c_str(), 1);
      if (job.command[0] == "fit") setenv("PATH", path.c_str(), 1);  // of the program it runs
    });
    EXPECT_LE(outcome.code, 1) << job.name() << outcome.err;
    EXPECT_TRUE(job.tells_times || Get(job.output) == fresh) << job.name();
    std::filesystem::remove(folder_ / job.output);
  }
}

// The locale is made here, and set in the program before its main by a library of the test: what
// is read and written does not follow it, though it be in force.
TEST_F(Circumstances, DecimalCommas) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "the sanitizer's library must be loaded before any other";
#endif
  const std::filesystem::path locales = folder_.string() + ".locales";
  std::filesystem::create_directories(locales);
  const std::string make =
      "localedef -i de_DE -f UTF-8 '" + (locales / "de_DE.UTF-8").string() + "' >/dev/null 2>&1";
  const bool made = std::system(make.c_str()) == 0;
  if (!made) {
    std::filesystem::remove_all(locales);
    GTEST_SKIP() << "no localedef, or no sources of locales (package locales)";
  }
  for (const SmallJob& job : jobs_) {
    const std::string fresh = Undisturbed(job);
    const Outcome outcome = RunAfter(job.command, [&] {
      setenv("LOCPATH", locales.c_str(), 1);
      setenv("LC_ALL", "de_DE.UTF-8", 1);
      setenv("LANG", "de_DE.UTF-8", 1);
      setenv("LD_PRELOAD", UNFURL_LOCALE, 1);
    });
    EXPECT_LE(outcome.code, 1) << job.name() << outcome.err;
    EXPECT_EQ(outcome.err.find("no such locale"), std::string::npos);
    EXPECT_TRUE(job.tells_times || Get(job.output) == fresh) << job.name();
    std::filesystem::remove(folder_ / job.output);
  }
  std::filesystem::remove_all(locales);
}

}  // namespace
}  // namespace unfurl::cli::circumstances_test
