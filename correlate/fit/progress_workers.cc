#include "correlate/fit/progress_workers.h"

namespace unfurl::correlate {

void ProgressWorkers::Run(std::span<const Job> jobs,
                          const std::function<void(std::size_t, Prediction)>& done) {
  inner_.Run(jobs, [&](std::size_t i, Prediction prediction) {
    done(i, std::move(prediction));
    const std::lock_guard<std::mutex> lock(mutex_);
    ++progress_.evaluations;
    Report();
  });
}

void ProgressWorkers::Phase(const std::string& phase, std::size_t expected_more) {
  const std::lock_guard<std::mutex> lock(mutex_);
  progress_.phase = phase;
  progress_.expected = progress_.evaluations + expected_more;
  Report();
}

void ProgressWorkers::Best(double cost, const std::vector<double>& theta) {
  const std::lock_guard<std::mutex> lock(mutex_);
  progress_.best_cost = cost;
  progress_.best_theta = theta;
  Report();
}

}  // namespace unfurl::correlate
