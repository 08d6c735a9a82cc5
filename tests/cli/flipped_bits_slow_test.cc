// One bit of a file wrong, in every kind of HDF5 file that a verb writes: read as it was, or
// refused; never other numbers, a crash or no end. UNFURL_FLIPS=ALL tries every bit; a number, so
// many a file, at random.
#include <fcntl.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <random>

#include "base/error.h"
#include "base/progress.h"
#include "data/fit.h"
#include "data/h5.h"
#include "data/rig.h"
#include "data/run.h"
#include "data/survey.h"
#include "data/tracks.h"
#include "data/trial.h"
#include "tests/cli/fit_cases.h"
#include "tests/cli/small_jobs.h"
#include "tests/source_dir.h"

namespace unfurl::cli::flipped_bits_slow_test {
namespace {

// As the verbs read it.
void ReadAsRecord(const std::string& path) {
  const std::string schema = data::H5Reader::SchemaOf(path);
  if (schema == "unfurl/run") data::ReadRun(path);
  if (schema == "unfurl/rig") data::ReadRig(path);
  if (schema == "unfurl/survey") data::ReadSurvey(path);
  if (schema == "unfurl/tracks") data::ReadTracks(path);
  if (schema == "unfurl/fit") data::ReadFit(path);
  if (schema == "unfurl/trial") {
    const data::TrialReader trial(path);
    data::TrialBlock block;
    trial.Read(0, trial.size(), &block);
  }
}

// Shared with the process that reads, so that a crash tells where it was.
struct Tally {
  std::size_t next = 0;  // index into the list of bits
  long refused = 0, same = 0, other = 0, broke = 0, hung = 0;
  long crash_told = 0;   // as damage of the file
  double longest = 0.0;  // [s]
  std::size_t first_other = 0;
};

class FlippedBits : public FitVerbTest {
 protected:
  void SetUp() override {
    FitVerbTest::SetUp();
    void* memory =
        mmap(nullptr, sizeof(Tally), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    ASSERT_NE(memory, MAP_FAILED);
    tally_ = new (memory) Tally;
  }
  void TearDown() override {
    munmap(tally_, sizeof(Tally));
    FitVerbTest::TearDown();
  }

  // Which bits: all of the first bytes, where superblock and root lie; of the rest, one of each so
  // many bytes.
  static std::vector<std::size_t> Bits(std::size_t bytes) {
    constexpr std::size_t kHead = 1024;  // bytes
    const char* how = std::getenv("UNFURL_FLIPS");
    const bool all = how != nullptr && std::strcmp(how, "ALL") == 0;
    const std::size_t most = how == nullptr ? 4000 : std::strtoull(how, nullptr, 10);
    std::vector<std::size_t> bits;
    std::mt19937_64 random(bytes);
    for (std::size_t bit = 0; bit < 8 * std::min(all ? bytes : kHead, bytes); ++bit)
      bits.push_back(bit);
    if (all || bytes <= kHead) return bits;
    std::shuffle(bits.begin(), bits.end(), random);
    if (most < 16 * kHead) bits.resize(most / 2);
    while (bits.size() < most) bits.push_back(8 * kHead + random() % (8 * (bytes - kHead)));
    return bits;
  }

  // Reads flipped copies from `bits[tally_->next]` on, so many, and ends.
  [[noreturn]] void ReadSome(const std::string& path, const std::vector<std::size_t>& bits,
                             const std::string& good) {
    constexpr std::size_t kAtATime = 2000;
    constexpr unsigned kHangs = 20;  // [s]
    const int file = open(path.c_str(), O_RDWR);
    if (file < 0) _exit(1);
    const std::size_t end = std::min(bits.size(), tally_->next + kAtATime);
    InstallInterruptHandler();  // as the program has it
    signal(SIGALRM, SIG_DFL);
    while (tally_->next < end) {
      const std::size_t bit = bits[tally_->next];
      const auto at = static_cast<off_t>(bit / 8);
      unsigned char byte = 0;
      if (pread(file, &byte, 1, at) != 1) _exit(1);
      const unsigned char flipped = static_cast<unsigned char>(byte ^ (1u << (bit % 8)));
      if (pwrite(file, &flipped, 1, at) != 1) _exit(1);
      const auto start = std::chrono::steady_clock::now();
      alarm(kHangs);
      try {
        if (ContentsOf(path) == good) {
          ReadAsRecord(path);
          ++tally_->same;
        } else {
          if (tally_->other++ == 0) tally_->first_other = bit;
        }
      } catch (const Error&) {
        ++tally_->refused;
      }
      alarm(0);
      tally_->longest =
          std::max(tally_->longest,
                   std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
      if (pwrite(file, &byte, 1, at) != 1) _exit(1);
      ++tally_->next;
    }
    _exit(0);
  }

  void TryAll(const std::string& name, bool guarded) {
    const std::string path = (folder_ / name).string(), whole = Get(name);
    const std::string good = ContentsOf(path);
    const std::vector<std::size_t> bits = Bits(whole.size());
    *tally_ = {};
    while (tally_->next < bits.size()) {
      const pid_t child = fork();
      if (child == 0) ReadSome(path, bits, good);
      int status = 0;
      waitpid(child, &status, 0);
      if (WIFEXITED(status) && WEXITSTATUS(status) == 0) continue;
      if (!guarded && WIFEXITED(status) && WEXITSTATUS(status) == kExitBadInput) {
        ++tally_->crash_told;
        ++tally_->next;
        Put(name, whole);
        continue;
      }
      const bool hung = WIFSIGNALED(status) && WTERMSIG(status) == SIGALRM;
      ADD_FAILURE() << name << ", bit " << bits[tally_->next]
                    << (hung ? ": no end" : ": breaks, status ") << status;
      ++(hung ? tally_->hung : tally_->broke);
      ++tally_->next;
      Put(name, whole);
    }
    EXPECT_TRUE(!guarded || tally_->other == 0)
        << name << ", bit " << tally_->first_other << " gives other contents";
    EXPECT_GT(tally_->refused, 0) << name;
    std::printf(
        "found: %-14s %8zu bytes %8zu flips: %ld silent, %ld refused, %ld harmless, %ld crashes "
        "(and %ld put down to the file), %ld hangs; "
        "longest %.2f s\n",
        name.c_str(), whole.size(), bits.size(), tally_->other, tally_->refused, tally_->same,
        tally_->broke, tally_->crash_told, tally_->hung, tally_->longest);
    std::fflush(stdout);
  }

  static std::string Set(const std::string& name) { return UNFURL_SOURCE_DIR "/data/sets/" + name; }

  Tally* tally_ = nullptr;
};

TEST_F(FlippedBits, OfEveryKindOfFile) {
  const std::string latch = Set("bouncing_latch/scene.toml");
  Good({"simulate", latch, "--duration", "0.05", "-o", "run.h5", "--quiet"});
  Good({"modes", latch, "-o", "modes.h5", "--quiet"});
  Good({"simulate", Shipped("scene_suspension_4.toml"), "--duration", "0.02", "-o", "deployment.h5",
        "--quiet"});
  Good({"expose", "deployment.h5", "--lab", Shipped("lab.toml"), "-o", "trial.h5", "--truth",
        "truth.h5", "--set", "strobe.lead=[0.0001, 0.0002]", "--quiet"});
  Good({"convert", UNFURL_SOURCE_DIR "/tests/fuzz/corpus/survey.csv", "survey.h5", "--quiet"});
  std::filesystem::copy_file(Shipped("rig.h5"), folder_ / "rig.h5");
  Good({"reconstruct", "trial.h5", "--rig", "rig.h5", "-o", "tracks.h5", "--quiet"});
  MakeTracks("measured.h5", {}, 5);
  MakeStudy("study.toml", "[trial]\ntracks = \"measured.h5\"\n",
            "[solver]\nstages = \"impacts\"\nscreened = 4\nstarts = 1\n");
  Run({"fit", "study.toml", "-o", "fit.h5", "--quiet"});
  // As a killed writer left it: still marked as growing.
  RunProgram({"simulate", Shipped("scene_suspension.toml"), "-o", "killed.h5", "--quiet"}, folder_,
             0, 1500, SIGKILL);
  for (const char* name : {"run.h5", "modes.h5", "trial.h5", "survey.h5", "rig.h5", "tracks.h5",
                           "fit.h5", "killed.h5.partial"}) {
    ASSERT_TRUE(std::filesystem::exists(folder_ / name)) << name;
    TryAll(name, true);
  }
}

// The earliest format of HDF5, which other programs write unless asked not to, has no checksums but
// those of chunks, if any: other numbers cannot be noticed there. What is asked is an end, and not
// by a crash, or by one that is put down to the file: HDF5 1.10.8 frees attributes that it could
// not read.
TEST_F(FlippedBits, OfFilesOfOthers) {
  for (const char* kind : {"run", "modes", "trial", "survey", "tracks", "fit"}) {
    const std::string name = fmt::format("{}.h5", kind);
    std::filesystem::copy_file(UNFURL_SOURCE_DIR "/tests/fuzz/foreign/" + name, folder_ / name);
    TryAll(name, false);
  }
}

}  // namespace
}  // namespace unfurl::cli::flipped_bits_slow_test
