#include "correlate/fit/choose_tolerance.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/worker_pool.h"
#include "correlate/fit/reduced_problem.h"
#include "correlate/residual/row_layout.h"

namespace unfurl::correlate {

ToleranceChoice ChooseTolerance(const std::function<std::shared_ptr<Model>(double rtol)>& at,
                                const Model* finer, const std::vector<double>& theta,
                                const Observations& observations, double part) {
  // Standard errors of the data that scatter of such a size may move an estimate by where all of it
  // looks like a change of one parameter: in quadrature 2% of the error.
  constexpr double kMoved = 0.2;
  constexpr double kPart = 0.01;  // of sigma where rows are few, and of what the mesh leaves
  constexpr double kLadder[] = {kLoosestTolerance, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10};
  constexpr std::size_t kRungs = std::size(kLadder);
  const Stamps stamps = observations.StampsAt(observations.Start());
  std::vector<Prediction> answers(kRungs);
  // In pairs, one for each core.
  auto run = [&](std::size_t from, std::size_t to) {
    ParallelFor(to - from, 0, [&](std::size_t i) {
      answers[from + i] = at(kLadder[from + i])->Evaluate(theta, stamps);
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
  const RowLayout layout(observations);
  const double rows = static_cast<double>(layout.rows);
  choice.wanted = choice.of_data = std::min(kPart, kMoved / std::sqrt(std::max(1.0, rows)));
  choice.sigma = TypicalSigma(observations);
  for (std::size_t i = 0; i + 1 < kRungs; ++i) {
    if (i == 0 || i % 2 == 1) {
      const std::size_t from = i == 0 ? 0 : i + 1;
      run(from, std::min(from + 2, kRungs));
    }
    // What cannot be simulated here is the fit's to say.
    if (!good(answers[i]) || !good(answers[i + 1])) return least.noise < 1e300 ? least : choice;
    choice.rtol = kLadder[i];
    choice.noise = difference(answers[i], answers[i + 1]);
    if (i == 0 && choice.noise > choice.wanted && finer != nullptr) {
      // The mesh's error allows more; where that is not needed the run is saved.
      const Prediction fine = finer->Evaluate(theta, stamps);
      if (good(fine)) {
        choice.wanted = std::hypot(choice.of_data, kPart * part * difference(fine, answers[1]));
      }
    }
    if (choice.noise < least.noise) least = choice;
    if (choice.noise <= choice.wanted) return choice;
  }
  return least;
}

}  // namespace unfurl::correlate
