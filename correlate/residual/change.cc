#include "correlate/residual/change.h"

#include <cmath>

namespace unfurl::correlate {

Change Difference(const Observations& observations, const Prediction& from, const Prediction& to,
                  double factor) {
  Change out;
  for (std::size_t m = 0; m < to.marks.size(); ++m) {
    out.marks.push_back(factor * (to.marks[m].p - from.marks[m].p));
  }
  for (const auto& kind : observations.others) {
    const Eigen::VectorXd change = factor * (kind->NumbersOf(to) - kind->NumbersOf(from));
    out.others.push_back(change.unaryExpr([](double x) { return std::isfinite(x) ? x : 0.0; }));
  }
  return out;
}

Change Sum(const Change& a, double factor, const Change& b) {
  Change out = a;
  for (std::size_t m = 0; m < out.marks.size(); ++m) out.marks[m] += factor * b.marks[m];
  for (std::size_t k = 0; k < out.others.size(); ++k) out.others[k] += factor * b.others[k];
  return out;
}

Change Scaled(const Change& a, double factor) {
  Change out = a;
  for (Eigen::Matrix3Xd& m : out.marks) m *= factor;
  for (Eigen::VectorXd& k : out.others) k *= factor;
  return out;
}

}  // namespace unfurl::correlate
