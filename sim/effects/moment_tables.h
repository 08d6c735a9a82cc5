#pragma once

#include <vector>

#include "sim/model/coordinate.h"

namespace unfurl::sim {

class Tangent;

// Moments on joints' coordinates given by points, as measured on a tape spring: the monotone cubic
// through them (Fritsch and Butland, SIAM J. Sci. Stat. Comput. 5, 1984), which has no bulge that
// the points have not, and a straight line on beyond each end. The moment depends on the coordinate
// alone, so it has a potential, V = -integral of it, zero at the first point.
class MomentTables {
 public:
  // At least two points, the coordinates rising.
  void Add(const Coordinate& coordinate, const std::vector<double>& points,
           const std::vector<double>& moments);
  int count() const { return static_cast<int>(coordinates_.size()); }
  const Coordinate& coordinate(int k) const { return coordinates_[k]; }

  void AddLoad(const Motion& motion, Load load) const;
  void AddTangent(const Motion& motion, Tangent* tangent) const;
  double Moment(int k, const Motion& motion) const;  // on the coordinate [N m]
  double Energy(const Motion& motion) const;         // [J]

  struct Value {
    double moment;     // [N m]
    double slope;      // d(moment)/d(coordinate) [N m/rad]
    double potential;  // [J]
  };
  Value At(int k, double coordinate) const;

 private:
  // Of all tables one after another; table k has the points first_[k] to first_[k + 1] - 1, and a
  // piece begins at each but the last.
  struct Piece {
    double begin;           // [rad]
    double c0, c1, c2, c3;  // moment by powers of the coordinate less `begin`
    double potential;       // at `begin` [J]
  };
  std::vector<Coordinate> coordinates_;
  std::vector<int> first_{0};
  std::vector<Piece> pieces_;  // the last of a table is its straight line beyond the end
};

}  // namespace unfurl::sim
