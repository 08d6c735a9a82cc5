#pragma once

#include <vector>

#include "data/scene.h"
#include "sim/effects/joint_effect.h"

namespace unfurl::sim {

// A moment on the coordinate given by points, as measured on a tape spring: the monotone cubic
// through them (Fritsch and Butland, SIAM J. Sci. Stat. Comput. 5, 1984), which has no bulge that
// the points have not, and a straight line on beyond each end. The moment depends on the coordinate
// alone, so it has a potential, V = -integral of it, zero at the first point.
class MomentTable {
 public:
  using Record = data::SceneMomentTable;
  static constexpr EffectText kText = {"moment tables", "table", "potential of the moment tables"};
  static constexpr PowerKind kPower = PowerKind::kNone;
  static constexpr const char* kKey = "table";
  static constexpr const char* kOf = "of the table";

  // At least two points, the coordinates rising.
  explicit MomentTable(const Record& record);

  struct Value {
    double moment;     // [N m]
    double slope;      // d(moment)/d(coordinate) [N m/rad]
    double potential;  // [J]
  };
  Value At(double coordinate) const;

  // The coordinates of the points, and the largest less the smallest of their moments.
  const std::vector<double>& knots() const { return knots_; }  // [rad]
  double range() const { return range_; }                      // [N m]

  double Moment(const JointInstant& at) const { return At(at.value).moment; }
  MomentSlopes Slopes(const JointInstant& at) const { return {At(at.value).slope, 0.0}; }
  double Energy(const JointInstant& at) const { return At(at.value).potential; }
  double MarginMoment(const JointInstant& at) const { return Moment(at); }
  const data::TimeFunction* Function() const { return nullptr; }

 private:
  struct Piece {
    double begin;           // coordinate [rad]
    double c0, c1, c2, c3;  // moment by powers of the coordinate less `begin` [N m/rad^k]
    double potential;       // at `begin` [J]
  };
  std::vector<double> knots_;
  double range_ = 0.0;
  std::vector<Piece> pieces_;  // the last is the straight line beyond the end
};

}  // namespace unfurl::sim
