// Killed at any moment, two at once, on a disk that fills up: what was there before is whole, or
// what was to be made is; and the next run leaves nothing behind but its result.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <sys/mount.h>
#include <sys/stat.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <random>
#include <thread>

#include "tests/cli/small_jobs.h"

namespace unfurl::cli::kills_slow_test {
namespace {

constexpr char kOld[] = "the old result", kEnd[] = "</html>\n";
constexpr char kParts[] = "plan.runs";  // of a campaign: the runs so far

class Kills : public SmallJobsTest {
 protected:
  void SetUp() override {
    SmallJobsTest::SetUp();
    scratch_ = folder_.string() + ".scratch";
    std::filesystem::create_directories(scratch_);
    setenv("TMPDIR", scratch_.c_str(), 1);
  }
  void TearDown() override {
    unsetenv("TMPDIR");
    std::filesystem::remove_all(scratch_);
    SmallJobsTest::TearDown();
  }

  // What a program that has just been killed left is not touched at once: another may have made it.
  void Age(const std::filesystem::path& folder) const {
    const timespec long_ago[2] = {{1000000000, 0}, {1000000000, 0}};
    for (const auto& entry : std::filesystem::directory_iterator(folder)) {
      utimensat(AT_FDCWD, entry.path().c_str(), long_ago, AT_SYMLINK_NOFOLLOW);
    }
  }

  std::filesystem::path scratch_;
};

TEST_F(Kills, AtRandomMoments) {
  constexpr int kKills = 50;
  std::mt19937 random(7);
  for (const SmallJob& job : jobs_) {
    const auto start = std::chrono::steady_clock::now();
    const std::string fresh = Undisturbed(job);
    const double whole =
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
    Put(job.output, kOld);
    const std::vector<std::string> before = Files();
    int killed = 0, done = 0, partials = 0;
    for (int k = 0; k < kKills; ++k) {
      const int after = 1 + static_cast<int>(std::uniform_real_distribution<>(0.0, whole)(random));
      const Outcome outcome = RunProgram(job.command, folder_, 0, after, SIGKILL);
      ++(outcome.code == 128 + SIGKILL ? killed : done);
      SCOPED_TRACE(job.name() + " killed after " + std::to_string(after) + " ms");
      const std::string now = Get(job.output);
      EXPECT_TRUE(now == kOld || now == fresh || (job.tells_times && now.ends_with(kEnd)))
          << now.size() << " bytes, neither old nor new";
      partials += std::filesystem::exists(folder_ / (job.output + ".partial")) ? 1 : 0;
      Put(job.output, kOld);
    }
    Age(folder_);
    Age(scratch_);
    std::vector<std::string> again = job.command;
    if (job.command[0] == "fit" && std::filesystem::exists(folder_ / (job.output + ".partial"))) {
      again.push_back("--resume");
    }
    Good(again);
    EXPECT_TRUE(job.tells_times || Get(job.output) == fresh)
        << job.name() << ": the run after the kills differs";
    std::vector<std::string> after = Files();
    std::erase(after, job.output + ".partial~");  // of a fit: earlier evaluations, set aside
    EXPECT_EQ(after, before) << job.name();
    EXPECT_TRUE(std::filesystem::is_empty(scratch_)) << job.name();
    std::printf("found: %-24s %d killed in %.0f ms, %d were done before, %d left a partial\n",
                job.name().c_str(), killed, whole, done, partials);
    std::fflush(stdout);
    std::filesystem::remove(folder_ / job.output);
    std::filesystem::remove(folder_ / (job.output + ".partial~"));
  }
}

// A start is several files: each is whole or not there, and what was in the folder stays.
TEST_F(Kills, StartsAtRandomMoments) {
  constexpr int kKills = 50;
  const std::vector<std::string> command = {"new", "study", "mine"};
  const auto start = std::chrono::steady_clock::now();
  Good(command);
  const double whole =
      std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  std::map<std::string, std::string> fresh;
  for (const char* name : {"study.toml", "scene.toml", "tracks.csv", "README.md"}) {
    fresh[name] = Get(std::string("mine/") + name);
  }
  std::mt19937 random(8);
  int killed = 0, some = 0;
  for (int k = 0; k < kKills; ++k) {
    std::filesystem::remove_all(folder_ / "mine");
    std::filesystem::create_directories(folder_ / "mine");
    Put("mine/notes.txt", kOld);
    const int after = 1 + static_cast<int>(std::uniform_real_distribution<>(0.0, whole)(random));
    const Outcome outcome = RunProgram(command, folder_, 0, after, SIGKILL);
    killed += outcome.code == 128 + SIGKILL ? 1 : 0;
    EXPECT_EQ(Get("mine/notes.txt"), kOld);
    std::size_t there = 0;
    for (const auto& [name, text] : fresh) {
      if (!std::filesystem::exists(folder_ / "mine" / name)) continue;
      EXPECT_EQ(Get("mine/" + name), text) << name << " after " << after << " ms";
      ++there;
    }
    some += there > 0 && there < fresh.size() ? 1 : 0;
    // The next one makes them, or says which file is in the way.
    const Outcome again = Run(command);
    EXPECT_EQ(again.code, there == 0 ? 0 : 2) << again.err;
    EXPECT_EQ(again.err.find("is there already, and stays") != std::string::npos, there > 0);
  }
  std::printf("found: new: %d killed in %.0f ms, %d left some of its files\n", killed, whole, some);
}

TEST_F(Kills, TwoAtOnceOnOneOutput) {
  constexpr int kRounds = 4;
  const std::filesystem::path alias = folder_.string() + ".alias";
  std::filesystem::create_directory_symlink(folder_, alias);
  for (const SmallJob& job : jobs_) {
    const std::string fresh = Undisturbed(job);
    Put(job.output, kOld);
    const std::vector<std::string> before = Files();
    int refused = 0;
    for (int round = 0; round < kRounds; ++round) {
      Put(job.output, kOld);
      Outcome one, two;
      // By another name of the folder: the program's words go to files beside it.
      std::thread other([&] { two = RunProgram(job.command, alias); });
      one = Run(job.command);
      other.join();
      SCOPED_TRACE(job.name() + ": " + one.err + two.err);
      for (const Outcome& outcome : {one, two}) {
        if (outcome.code <= 1) continue;
        ++refused;
        EXPECT_EQ(outcome.code, 2);
        EXPECT_THAT(outcome.err, ::testing::HasSubstr("another program is writing it"));
      }
      EXPECT_TRUE(one.code <= 1 || two.code <= 1) << "neither came through";
      EXPECT_TRUE(job.tells_times || Get(job.output) == fresh);
      EXPECT_EQ(Files(), before);
    }
    std::printf("found: %-24s %d pairs, %d refused\n", job.name().c_str(), kRounds, refused);
    std::fflush(stdout);
    std::filesystem::remove(folder_ / job.output);
  }
  std::filesystem::remove(alias);
}

// Every write past so many bytes of a file fails; the program's words are one of them.
TEST_F(Kills, FilesThatMayNotGrow) {
  constexpr int kSizes = 12;
  constexpr long kWords = 600;
  for (const SmallJob& job : jobs_) {
    const std::string fresh = Undisturbed(job);
    Put(job.output, kOld);
    const std::vector<std::string> before = Files();
    int refused = 0;
    for (int k = 0; k < kSizes; ++k) {
      const long most = kWords + static_cast<long>(fresh.size()) * k / (kSizes - 1);
      const Outcome outcome = RunProgram(job.command, folder_, most);
      SCOPED_TRACE(job.name() + " in files of " + std::to_string(most) + " bytes: " + outcome.err);
      const std::string now = Get(job.output);
      // 1: a program of the job's could not write its own, so that there is no result.
      const bool none = outcome.code > 1 || (outcome.code == 1 && now == kOld);
      EXPECT_TRUE(none ? now == kOld : job.tells_times || now == fresh);
      EXPECT_FALSE(outcome.code == 1 && outcome.err.empty()) << "exit 1 without a word";
      std::vector<std::string> after = Files();
      std::erase(after, job.output + ".partial");  // evaluations and rows so far
      std::erase(after, kParts);
      EXPECT_EQ(after, before);
      if (outcome.code > 1) {
        ++refused;
        EXPECT_TRUE(outcome.code == 4 || outcome.code == 2) << outcome.code;
        EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1);
      }
      std::filesystem::remove(folder_ / (job.output + ".partial"));
      std::filesystem::remove_all(folder_ / kParts);
      Put(job.output, kOld);
    }
    EXPECT_GT(refused, 0) << job.name();
    std::filesystem::remove(folder_ / job.output);
  }
}

// A file system of some pages, where this machine lets us make one.
TEST_F(Kills, DiskFull) {
  const std::filesystem::path disk = folder_.string() + ".disk";
  std::filesystem::create_directories(disk);
  for (const SmallJob& job : jobs_) {
    const std::string fresh = Undisturbed(job);
    int refused = 0;
    for (const char* size : {"size=4k", "size=16k", "size=48k", "size=8m"}) {
      if (mount("tmpfs", disk.c_str(), "tmpfs", 0, size) != 0) {
        std::filesystem::remove(disk);
        GTEST_SKIP() << "may not mount here";
      }
      const std::string output = (disk / job.output).string();
      const auto put = [&] {
        std::FILE* file = std::fopen(output.c_str(), "wb");
        if (file == nullptr) return;
        std::fputs(kOld, file);
        std::fclose(file);
      };
      put();
      std::vector<std::string> command = job.command;
      std::replace(command.begin(), command.end(), job.output, output);
      const Outcome outcome = Run(command);
      SCOPED_TRACE(job.name() + " " + size + ": " + outcome.err);
      const std::string now = Get(output);
      if (outcome.code <= 1) {
        EXPECT_NE(now, kOld);
      } else {
        ++refused;
        EXPECT_EQ(outcome.code, 4);
        EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1);
        EXPECT_EQ(now, kOld);
        for (const auto& entry : std::filesystem::directory_iterator(disk)) {
          const std::string name = entry.path().filename().string();
          EXPECT_TRUE(name == job.output || name == job.output + ".partial") << name;
        }
      }
      umount(disk.c_str());
    }
    EXPECT_GT(refused, 0) << job.name();
  }
  std::filesystem::remove(disk);
}

}  // namespace
}  // namespace unfurl::cli::kills_slow_test
