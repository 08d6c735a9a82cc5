#include "correlate/fit/workers.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <semaphore>

#include "base/error.h"
#include "base/progress.h"
#include "base/worker_pool.h"

namespace unfurl::correlate {

namespace {

// Of a program, say, that runs for a fixed time, while its record's clock is not yet known.
std::string Unanswered(const std::string& what, double t, double last) {
  return fmt::format(
      "{} is not known at {:.4g} s, and asked for until {:.4g} s (stamps.csv lists the times): "
      "answer for longer, or state trial.offset",
      what, t, last);
}

// Why the quantities of an answer cannot be used; empty: they can.
std::string QuantityFault(const Stamps& stamps, const Prediction& p) {
  if (p.quantities.size() != stamps.quantities.size()) {
    return ("the model did not answer for all quantities");
  }
  for (std::size_t q = 0; q < p.quantities.size(); ++q) {
    const QuantityStamps& asked = stamps.quantities[q];
    const Eigen::VectorXd& values = p.quantities[q].values;
    if (values.size() != static_cast<Eigen::Index>(asked.t.size())) {
      return ("the model did not answer at all stamps of " + asked.quantity);
    }
    if (values.size() > 0 && !values.array().isFinite().any()) {
      return ("the model has nothing of " + asked.quantity);
    }
    if (values.array().isInf().any()) {
      return ("the model's " + asked.quantity + " is not finite");
    }
    // As of marks: only what was before the start may be unknown.
    for (std::size_t i = 0; i < asked.t.size() && asked.t[i] <= asked.needed; ++i) {
      if (!std::isnan(values(static_cast<Eigen::Index>(i))) || asked.t[i] <= 0.0) continue;
      return Unanswered("the model's " + asked.quantity, asked.t[i],
                        std::min(asked.needed, asked.t.back()));
    }
  }
  return {};
}

// A model's answer is used only when it is whole: what is missing or not finite is a failure here
// and not a NaN somewhere later.
void CheckWhole(const Stamps& stamps, Prediction* p) {
  if (p->status != ModelStatus::kGood) return;
  auto fail = [&](const std::string& why) {
    p->status = ModelStatus::kFailed;
    p->message = why;
  };
  if (p->marks.size() != stamps.marks.size()) return fail("the model did not answer for all marks");
  for (std::size_t m = 0; m < p->marks.size(); ++m) {
    const MarkMotion& motion = p->marks[m];
    const auto n = static_cast<Eigen::Index>(stamps.t[m].size());
    if (motion.p.cols() != n || motion.v.cols() != n) {
      return fail("the model did not answer at all stamps of " + stamps.marks[m]);
    }
    if (!motion.p.allFinite() || !motion.v.allFinite()) {
      return fail("the model's motion of " + stamps.marks[m] + " is not finite");
    }
    // A model that starts in motion knows nothing of what was before; of all else it has to.
    for (std::size_t i = 0; i < motion.known.size(); ++i) {
      if (motion.known[i] || (!p->held_before && stamps.t[m][i] < 0.0)) continue;
      return fail(Unanswered("the model's motion of " + stamps.marks[m], stamps.t[m][i],
                             stamps.t[m].back()));
    }
  }
  const std::string fault = QuantityFault(stamps, *p);
  if (!fault.empty()) fail(fault);
}

class ThreadWorkers : public Workers {
 public:
  explicit ThreadWorkers(std::size_t count)
      : count_(WorkerCount(count)), slots_(static_cast<std::ptrdiff_t>(count_)) {}

  void Run(std::span<const Job> jobs,
           const std::function<void(std::size_t, Prediction)>& done) override {
    ParallelFor(jobs.size(), count_, [&](std::size_t i) {
      ThrowIfInterrupted();
      slots_.acquire();
      Prediction answer;
      try {
        answer = EvaluateChecked(*jobs[i].model, jobs[i].theta, *jobs[i].stamps);
      } catch (...) {
        slots_.release();
        throw;
      }
      slots_.release();
      done(i, std::move(answer));
    });
  }

 private:
  std::size_t count_;
  std::counting_semaphore<> slots_;
};

}  // namespace

std::unique_ptr<Workers> LocalWorkers(std::size_t count) {
  return std::make_unique<ThreadWorkers>(count);
}

Prediction EvaluateChecked(const Model& model, std::span<const double> theta,
                           const Stamps& stamps) {
  Prediction answer;
  try {
    answer = model.Evaluate(theta, stamps);
    CheckWhole(stamps, &answer);
  } catch (const Interrupted&) {
    throw;
  } catch (const std::exception& e) {
    answer.status = ModelStatus::kFailed;
    answer.message = e.what();
  }
  if (answer.status != ModelStatus::kGood) {
    answer.marks.clear();
    answer.quantities.clear();
  }
  return answer;
}

}  // namespace unfurl::correlate
