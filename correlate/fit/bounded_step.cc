#include "correlate/fit/bounded_step.h"

#include <cmath>
#include <vector>

#include "base/dense.h"

namespace unfurl::correlate {

namespace {

// Unknowns of unit diagonal, the free ones solved for, the others at a bound.
class BoxSearch {
 public:
  BoxSearch(Eigen::MatrixXd normal, Eigen::VectorXd slope, Eigen::VectorXd low,
            Eigen::VectorXd high)
      : normal_(std::move(normal)),
        slope_(std::move(slope)),
        low_(std::move(low)),
        high_(std::move(high)),
        at_(Eigen::VectorXd::Zero(slope_.size())),
        free_(static_cast<std::size_t>(slope_.size()), false) {}

  const Eigen::VectorXd& at() const { return at_; }

  // Frees what falls steepest into the box; false: nothing does.
  bool FreeOne() {
    const Eigen::VectorXd rise = slope_ + normal_ * at_;
    double steepest = kFlat * slope_.cwiseAbs().maxCoeff();
    Eigen::Index which = -1;
    for (Eigen::Index j = 0; j < at_.size(); ++j) {
      const bool open = rise(j) < 0.0 ? at_(j) < high_(j) : at_(j) > low_(j);
      if (free_[static_cast<std::size_t>(j)] || !open || !(std::abs(rise(j)) > steepest)) continue;
      steepest = std::abs(rise(j));
      which = j;
    }
    if (which >= 0) free_[static_cast<std::size_t>(which)] = true;
    return which >= 0;
  }

  // To the lowest point of the free ones, or until one of them meets its bound, which then holds
  // it.
  void Descend() {
    for (;;) {
      std::vector<Eigen::Index> free;
      for (Eigen::Index j = 0; j < at_.size(); ++j) {
        if (free_[static_cast<std::size_t>(j)]) free.push_back(j);
      }
      if (free.empty()) return;
      const Eigen::VectorXd rise = slope_ + normal_ * at_;
      const Eigen::MatrixXd H = normal_(free, free);
      const Eigen::VectorXd by =
          -H.completeOrthogonalDecomposition().solve(Eigen::VectorXd(rise(free)));
      double part = 1.0;
      Eigen::Index first = -1;
      for (Eigen::Index k = 0; k < by.size(); ++k) {
        const Eigen::Index j = free[static_cast<std::size_t>(k)];
        const double room = (by(k) < 0.0 ? low_(j) : high_(j)) - at_(j);
        if (!(std::abs(by(k)) > std::abs(room))) continue;
        if (room / by(k) >= part && first >= 0) continue;
        part = room / by(k);
        first = k;
      }
      for (Eigen::Index k = 0; k < by.size(); ++k) {
        at_(free[static_cast<std::size_t>(k)]) += part * by(k);
      }
      if (first < 0) return;
      const Eigen::Index held = free[static_cast<std::size_t>(first)];
      at_(held) = by(first) < 0.0 ? low_(held) : high_(held);
      free_[static_cast<std::size_t>(held)] = false;
    }
  }

 private:
  static constexpr double kFlat = 1e-10;  // of the steepest slope: rounding of what was solved [-]

  Eigen::MatrixXd normal_;
  Eigen::VectorXd slope_, low_, high_, at_;
  std::vector<bool> free_;
};

}  // namespace

Eigen::VectorXd BoundedStep(const Eigen::MatrixXd& normal, const Eigen::VectorXd& slope,
                            const Eigen::VectorXd& low, const Eigen::VectorXd& high) {
  Eigen::VectorXd unit = Eigen::VectorXd::Zero(slope.size());  // steps of unit diagonal
  for (Eigen::Index j = 0; j < slope.size(); ++j) {
    if (normal(j, j) > 0.0) unit(j) = 1.0 / std::sqrt(normal(j, j));
  }
  auto bounds = [&](const Eigen::VectorXd& of) {
    Eigen::VectorXd out = Eigen::VectorXd::Zero(of.size());
    for (Eigen::Index j = 0; j < of.size(); ++j) {
      if (unit(j) > 0.0) out(j) = of(j) / unit(j);
    }
    return out;
  };
  BoxSearch search(unit.asDiagonal() * normal * unit.asDiagonal(), unit.cwiseProduct(slope),
                   bounds(low), bounds(high));
  // Each time another set of bounds holds: some rounds in practice, a hundred times their number
  // where rounding lets them take turns.
  constexpr Eigen::Index kMost = 100;  // rounds for each unknown
  for (Eigen::Index k = 0; k < kMost * slope.size() && search.FreeOne(); ++k) search.Descend();
  const Eigen::VectorXd out = unit.cwiseProduct(search.at());
  return out.cwiseMax(low).cwiseMin(high);
}

}  // namespace unfurl::correlate
