// The number of threads changes no bit of a result; another build of the program changes the last
// ones at most.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <sstream>

#include "base/error.h"
#include "data/h5.h"
#include "data/h5_walk.h"
#include "tests/cli/small_jobs.h"

namespace unfurl::cli::same_bits_slow_test {
namespace {

class SameBits : public SmallJobsTest {};

TEST_F(SameBits, WithOneTwoAndFourThreads) {
  int tried = 0;
  for (const SmallJob& job : jobs_) {
    const std::string help = Run({job.command[0], "--help"}).out;
    if (help.find("--workers") == std::string::npos || job.tells_times) continue;
    std::vector<std::string> alone = job.command;
    const auto asked = std::find(alone.begin(), alone.end(), "--workers");
    if (asked != alone.end()) alone.erase(asked, asked + 2);
    std::string first;
    for (const char* workers : {"1", "2", "4"}) {
      std::vector<std::string> command = alone;
      command.insert(command.end(), {"--workers", workers});
      Good(command);
      // A page tells the command, too.
      std::string contents = ContentsOf((folder_ / job.output).string());
      const std::string said = std::string("--workers ") + workers;
      for (auto at = contents.find(said); at != std::string::npos; at = contents.find(said, at)) {
        contents.erase(at, said.size());
      }
      if (first.empty()) first = contents;
      EXPECT_TRUE(contents == first) << job.name() << " with " << workers << " threads";
      ++tried;
      std::filesystem::remove(folder_ / job.output);
    }
  }
  EXPECT_GE(tried, 12);  // expose twice, calibrate, reconstruct, fit
}

// By how much two HDF5 files differ: for each dataset over its largest value; infinite where texts
// or shapes do.
struct Difference {
  double most = 0.0;
  std::string where;
  void Add(double difference, const std::string& set) {
    if (difference <= most) return;
    most = difference;
    where = set;
  }
};

Difference Between(const std::string& one, const std::string& other) {
  constexpr double kAll = std::numeric_limits<double>::infinity();
  Difference out;
  const std::string schema = data::H5Reader::SchemaOf(one);
  const data::H5Reader a(one, schema, 1 << 30), b(other, schema, 1 << 30);
  if (data::H5ListDatasets(one) != data::H5ListDatasets(other)) out.Add(kAll, "list of datasets");
  for (const std::string& set : data::H5ListDatasets(one)) {
    // What is rounding itself has no digits in common.
    if (set.find("constraint.") != std::string::npos || set.find("residual") != std::string::npos ||
        set.find("drift") != std::string::npos) {
      continue;
    }
    std::vector<double> x, y;
    try {
      x = a.ReadDoubles(set), y = b.ReadDoubles(set);
    } catch (const Error&) {  // not numbers
      if (a.ReadStrings(set) != b.ReadStrings(set)) out.Add(kAll, set);
      continue;
    }
    if (x.size() != y.size()) {
      out.Add(kAll, set);
      continue;
    }
    double largest = 0.0, apart = 0.0;
    for (std::size_t i = 0; i < x.size(); ++i) {
      if (std::isnan(x[i]) != std::isnan(y[i])) apart = kAll;
      if (std::isnan(x[i]) || x[i] == y[i]) continue;
      largest = std::max(largest, std::abs(x[i]));
      apart = std::max(apart, std::abs(x[i] - y[i]));
    }
    for (const double v : x) largest = std::max(largest, std::isnan(v) ? 0.0 : std::abs(v));
    constexpr double kZero = 1e-20;  // terms that a prior holds at zero end at some 1e-28 px
    if (apart > 0.0 && largest > kZero) out.Add(apart / largest, set);
  }
  return out;
}

// Other builds are named by the environment:
// UNFURL_OTHERS=build/release/cli/unfurl:build/portable/cli/unfurl, with whole paths. Equal bits
// are not asked for: other vector widths add in another order.
TEST_F(SameBits, ByOtherBuilds) {
  const char* others = std::getenv("UNFURL_OTHERS");
  if (others == nullptr) GTEST_SKIP() << "UNFURL_OTHERS names no other program";
  // Sums in another order differ by 1e-13; iterations end within their own tolerances, an
  // adjustment of cameras at a relative change of the cost of 1e-10, and its covariance, the
  // inverse of what is barely determined, keeps six digits (measured: 3e-7 of the largest entry).
  constexpr double kMost = 1e-6;
  std::istringstream list(others);
  for (std::string other; std::getline(list, other, ':');) {
    int same = 0;
    for (const SmallJob& job : jobs_) {
      if (job.tells_times) continue;
      const std::string output = (folder_ / job.output).string(), own = folder_.string() + ".own";
      Good(job.command);
      std::filesystem::rename(output, own);
      const Outcome outcome = RunProgram(job.command, folder_, 0, 0, SIGINT, [&] {
        std::vector<char*> argv = {other.data()};
        for (const std::string& word : job.command) argv.push_back(const_cast<char*>(word.c_str()));
        argv.push_back(nullptr);
        execv(other.c_str(), argv.data());
        _exit(122);
      });
      ASSERT_LE(outcome.code, 1) << other << ": " << outcome.err;
      if (ContentsOf(own) == ContentsOf(output)) {
        ++same;
      } else if (job.output.ends_with(".h5")) {
        const Difference found = Between(own, output);
        std::printf("found: %s by %s: differs by %.2g of the largest in %s\n", job.name().c_str(),
                    other.c_str(), found.most, found.where.c_str());
        EXPECT_LT(found.most, kMost) << job.name() << " by " << other;
      } else {
        std::printf("found: %s by %s: other bytes\n", job.name().c_str(), other.c_str());
      }
      std::filesystem::remove(own);
      std::filesystem::remove(output);
    }
    std::printf("found: %s: %d of %zu jobs to the same bits\n", other.c_str(), same,
                jobs_.size() - 1);
  }
}

}  // namespace
}  // namespace unfurl::cli::same_bits_slow_test
