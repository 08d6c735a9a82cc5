#include "correlate/hierarchy/next_trial.h"

#include <algorithm>
#include <cmath>

namespace unfurl::correlate {

namespace {

// The model to either side of the means in one parameter.
struct TrialSide {
  Prediction up, down;
  double width = 0.0;  // between them, in the coordinate that the solver moves
};

// Of the second difference of all marks [m^2].
double SquaredBend(const TrialSide& side, const Prediction& middle) {
  double sum = 0.0;
  for (std::size_t m = 0; m < middle.marks.size(); ++m) {
    sum += (side.up.marks[m].p + side.down.marks[m].p - 2.0 * middle.marks[m].p).squaredNorm();
  }
  return sum;
}

}  // namespace

NextTrial PredictNext(const Model& model, const std::vector<Parameter>& parameters,
                      const Hierarchy& hierarchy, const Stamps& stamps, double sample_sigma) {
  NextTrial out;
  const std::size_t p = parameters.size();
  Eigen::VectorXd u(static_cast<Eigen::Index>(p));
  for (std::size_t j = 0; j < p; ++j) {
    u(static_cast<Eigen::Index>(j)) = hierarchy.parameters()[j].value;
  }
  const auto evaluate = [&](const Eigen::VectorXd& at) {
    Prediction answer = model.Evaluate(Values(parameters, at.data()), stamps);
    if (answer.status != ModelStatus::kGood && out.failure.empty()) out.failure = answer.message;
    return answer;
  };
  const Prediction middle = evaluate(u);
  std::vector<TrialSide> sides(p);
  double bend = 0.0;
  for (std::size_t j = 0; j < p && out.failure.empty(); ++j) {
    const Interval& next = hierarchy.parameters()[j].next95;
    // One standard deviation of what is expected, within the bounds.
    const double half = 0.5 * (next.high - next.low) / kHalf95;
    const auto i = static_cast<Eigen::Index>(j);
    Eigen::VectorXd up = u, down = u;
    up(i) = std::min(u(i) + half, ToInternal(parameters[j], parameters[j].high));
    down(i) = std::max(u(i) - half, ToInternal(parameters[j], parameters[j].low));
    sides[j] = {evaluate(up), evaluate(down), up(i) - down(i)};
    if (!out.failure.empty()) break;
    bend = std::max(bend, SquaredBend(sides[j], middle));
  }
  if (!out.failure.empty()) return out;
  double halves = 0.0;
  for (std::size_t m = 0; m < stamps.marks.size(); ++m) {
    const Eigen::Matrix3Xd& at = middle.marks[m].p;
    Eigen::Matrix3Xd low = at, high = at;
    Eigen::VectorXd direction(u.size());
    for (Eigen::Index k = 0; k < at.size(); ++k) {
      for (std::size_t j = 0; j < p; ++j) {
        const TrialSide& s = sides[j];
        direction(static_cast<Eigen::Index>(j)) =
            s.width > 0.0 ? (s.up.marks[m].p(k) - s.down.marks[m].p(k)) / s.width : 0.0;
      }
      const Interval next = hierarchy.NextAlong(direction, sample_sigma * sample_sigma);
      const double center = direction.dot(u);
      low(k) = at(k) + (next.low - center);
      high(k) = at(k) + (next.high - center);
    }
    halves += 0.25 * (high - low).squaredNorm();
    out.middle.push_back(at);
    out.low.push_back(std::move(low));
    out.high.push_back(std::move(high));
  }
  // Half the second difference is the bend at one standard deviation.
  if (halves > 0.0) out.bend = std::sqrt(0.25 * bend / halves) * kHalf95;
  return out;
}

}  // namespace unfurl::correlate
