#pragma once

#include <functional>
#include <mutex>
#include <string>
#include <vector>

#include "correlate/fit/workers.h"

namespace unfurl::correlate {

/// How far a fit has come.
struct FitProgress {
  std::string phase;            // in words: "screening", "2 starts", "sharpening", "profiles"
  std::size_t evaluations = 0;  // asked for so far, those of a journal included
  std::size_t expected = 0;     // of the whole fit, as far as can be told now
  double best_cost = 0.0;       // half the sum of squares of the latest stage; 0: not known yet [-]
  std::vector<double> best_theta;  // [units of the parameters]
};

// Workers that count the evaluations which others carry out, and report how far a fit is.
class ProgressWorkers : public Workers {
 public:
  // `inner` must outlive it. `report` is called from any thread, one at a time; may be empty.
  ProgressWorkers(Workers& inner, std::function<void(const FitProgress&)> report)
      : inner_(inner), report_(std::move(report)) {}

  void Run(std::span<const Job> jobs,
           const std::function<void(std::size_t, Prediction)>& done) override;
  // A new phase begins, after which about `expected_more` evaluations are left.
  void Phase(const std::string& phase, std::size_t expected_more);
  void Best(double cost, const std::vector<double>& theta);

 private:
  void Report() const {
    if (report_) report_(progress_);
  }
  Workers& inner_;
  std::function<void(const FitProgress&)> report_;
  std::mutex mutex_;
  FitProgress progress_;
};

}  // namespace unfurl::correlate
