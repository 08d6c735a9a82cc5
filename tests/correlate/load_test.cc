// A million evaluations in a journal, taken up again: what is found is printed. UNFURL_LOAD=0.01
// tries a hundredth.
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <string>

#include "correlate/fit/evaluation_store.h"

namespace unfurl::correlate::load_test {
namespace {

// Answers at once: 4 marks of 10 samples in a plane.
class Answers : public Workers {
 public:
  void Run(std::span<const Job> jobs,
           const std::function<void(std::size_t, Prediction)>& done) override {
    for (std::size_t i = 0; i < jobs.size(); ++i) {
      Prediction answer;
      answer.marks.resize(4);
      for (MarkMotion& mark : answer.marks) {
        mark.p.setZero(3, 10), mark.v.setZero(3, 10);
        mark.p.topRows(2).setConstant(jobs[i].theta[0]);
        mark.v.topRows(2).setConstant(jobs[i].theta[1]);
      }
      ++asked;
      done(i, std::move(answer));
    }
  }
  std::size_t asked = 0;
};

double Cpu() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

// What this process holds now [kB].
double HeldKb() {
  double pages = 0.0, resident = 0.0;
  std::ifstream("/proc/self/statm") >> pages >> resident;
  return resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1024.0;
}

void AskAll(Workers& workers, std::size_t evaluations, const Stamps& stamps) {
  constexpr std::size_t kBatch = 100;
  std::vector<Job> jobs(kBatch);
  for (std::size_t done = 0; done < evaluations; done += kBatch) {
    for (std::size_t i = 0; i < kBatch; ++i) {
      const auto x = static_cast<double>(done + i);
      jobs[i].theta = {x, 1.0 / (1.0 + x), 0.5, 2.0, 3.0};
      jobs[i].stamps = &stamps;
    }
    workers.Run(jobs, [&](std::size_t i, Prediction answer) {
      ASSERT_EQ(answer.marks.at(3).p(1, 9), jobs[i].theta[0]);
    });
  }
}

TEST(Load, EvaluationsInAJournal) {
  // An entry of the index: the question's 84 bytes and the allocator's, a node of a map, a place in
  // the file.
  constexpr double kMostKbEach = 0.3;
  const std::string result =
      (std::filesystem::temp_directory_path() / ("unfurl_load_" + std::to_string(getpid())))
          .string();
  const char* part = std::getenv("UNFURL_LOAD");
  const double all = 1e6 * (part != nullptr ? std::atof(part) : 1.0);
  Stamps stamps;
  for (const char* mark : {"mark1", "mark1b", "mark2", "mark3"}) {
    stamps.marks.push_back(mark);
    stamps.t.push_back(std::vector<double>(10, 0.5));
  }
  for (const double size : {all / 10.0, all}) {
    const auto evaluations = static_cast<std::size_t>(std::lround(size / 100.0)) * 100;
    const double before = HeldKb();
    double seconds[2] = {}, kb[2] = {};
    Answers model;
    double bytes = 0.0;
    for (const int again : {0, 1}) {
      const double start = Cpu();
      data::Journal journal(result, "load", again != 0);
      JournaledWorkers workers(model, journal);
      AskAll(workers, evaluations, stamps);
      seconds[again] = Cpu() - start;
      kb[again] = HeldKb() - before;
      EXPECT_EQ(model.asked, evaluations);  // none is asked twice
      EXPECT_EQ(workers.answered(), again != 0 ? evaluations : 0u);
      bytes = static_cast<double>(std::filesystem::file_size(journal.path()));
      if (again != 0) journal.Remove();
    }
    const double n = static_cast<double>(evaluations);
    std::printf(
        "found: %zu evaluations, %.2f GB: written in %.1f us each, taken up again in %.1f us each; "
        "memory %.3f and %.3f kB each\n",
        evaluations, bytes / 1e9, 1e6 * seconds[0] / n, 1e6 * seconds[1] / n, kb[0] / n, kb[1] / n);
    EXPECT_LT(kb[0], kMostKbEach * n + 2000.0);
    EXPECT_LT(kb[1], kMostKbEach * n + 2000.0);
  }
}

}  // namespace
}  // namespace unfurl::correlate::load_test
