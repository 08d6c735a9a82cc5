#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "correlate/fit/fit_problem.h"

namespace unfurl::correlate {

// One question to a model: everything that the answer depends on.
struct Job {
  std::size_t trial = 0;
  Fidelity fidelity = Fidelity::kMain;
  const Model* model = nullptr;
  std::vector<double> theta;  // [units of the parameters]
  const Stamps* stamps = nullptr;
};

// The seam behind which evaluations are carried out. Here: threads of this program; MPI or a batch
// system can take their place, since a job names its trial, fidelity, parameters and stamps and the
// answer is a plain record. Results may not depend on the order in which jobs are done.
class Workers {
 public:
  virtual ~Workers() = default;
  // Hands each answer to `done(index, prediction)` as it comes, from any thread, and returns when
  // all are there. Throws Interrupted when the program is to stop; answers handed out by then
  // stand. May be called from several threads at once.
  virtual void Run(std::span<const Job> jobs,
                   const std::function<void(std::size_t, Prediction)>& done) = 0;
};

// At most `count` evaluations at a time (0: one per core), whoever asks.
std::unique_ptr<Workers> LocalWorkers(std::size_t count);

// One evaluation: a model that throws anything but Interrupted, that does not answer for every mark
// and stamp or answers with what is not finite is a failed evaluation with the reason in words.
Prediction EvaluateChecked(const Model& model, std::span<const double> theta, const Stamps& stamps);

}  // namespace unfurl::correlate
