#include "correlate/fit/choose_tolerance.h"

#include <cmath>
#include <limits>

#include "base/worker_pool.h"
#include "correlate/fit/reduced_problem.h"

namespace unfurl::correlate {

ToleranceChoice ChooseTolerance(const std::function<std::unique_ptr<Model>(double rtol)>& at,
                                const Model* finer, const std::vector<double>& theta,
                                const Observations& observations, double part) {
  constexpr double kPart = 0.01;  // of the residuals to come
  constexpr double kLadder[] = {kLoosestTolerance, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10};
  constexpr std::size_t kRungs = std::size(kLadder);
  const Stamps stamps = observations.StampsAt(observations.Start());
  std::vector<Prediction> answers(kRungs);
  Prediction fine;
  // The finer mesh takes longest and goes first; the others in pairs, one for each core.
  auto run = [&](std::size_t from, std::size_t to, bool with_fine) {
    const std::size_t first = with_fine ? 1 : 0;
    ParallelFor(to - from + first, 0, [&](std::size_t i) {
      if (i < first) {
        fine = finer->Evaluate(theta, stamps);
      } else {
        answers[from + i - first] = at(kLadder[from + i - first])->Evaluate(theta, stamps);
      }
    });
  };
  auto good = [](const Prediction& p) {
    return p.status == ModelStatus::kGood && p.marks.size() + p.quantities.size() > 0;
  };

  auto difference = [&](const Prediction& a, const Prediction& b) {
    return RmsInSigmas(observations, observations.Start(), a, b);
  };

  ToleranceChoice choice, least;
  least.noise = std::numeric_limits<double>::infinity();
  run(0, 2, finer != nullptr);
  double error = 0.0;
  if (finer != nullptr && good(fine) && good(answers[1])) {
    error = part * difference(fine, answers[1]);
  }
  choice.wanted = kPart * std::hypot(1.0, error);
  choice.sigma = TypicalSigma(observations);
  for (std::size_t i = 0; i + 1 < kRungs; ++i) {
    if (i > 0 && i % 2 == 1) run(i + 1, std::min(i + 3, kRungs), false);
    // What cannot be simulated here is the fit's to say.
    if (!good(answers[i]) || !good(answers[i + 1])) return least.noise < 1e300 ? least : choice;
    choice.rtol = kLadder[i];
    choice.noise = difference(answers[i], answers[i + 1]);
    if (choice.noise < least.noise) least = choice;
    if (choice.noise <= choice.wanted) return choice;
  }
  return least;
}

}  // namespace unfurl::correlate
