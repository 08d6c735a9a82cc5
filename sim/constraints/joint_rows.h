#pragma once

#include <string>
#include <vector>

#include "data/time_function.h"
#include "sim/model/rigid_bodies.h"

namespace unfurl::sim {

class Tangent;

// The constraints of joints, of three kinds, with r = r_outer - r_inner between the two points:
//   pin     r = 0, two rows (x, y);                                      [paper, eq. (26) to (29)]
//   along   sign e.r - f(t) = 0, e fixed in the inner body: a slot when e is its normal
//           and f = 0, a drive of the travel when e is the axis;
//   angle   sign (theta_outer - theta_inner - zero) - f(t) = 0: what holds a slider, or a drive.
// Rows are numbered in that order: 2 p, 2 p + 1 for pin p, then the alongs, then the angles.
class JointRows {
 public:
  struct Pin {
    int inner, outer;  // bodies
    double ix, iy;     // the point in the inner body's frame [m]
    double ox, oy;     // in the outer's [m]
    std::string name;  // of the joint
  };
  struct Along {
    int inner, outer;
    double ix, iy, ox, oy;      // [m]
    double ax, ay;              // e in the inner body's frame, of length 1 [-]
    double sign = 1.0;          // [-]
    data::TimeFunction target;  // f [m]
    std::string name;
    bool drive = false;  // f is what a drive says
  };
  struct Angle {
    int inner, outer;
    double zero = 0.0;          // [rad]
    double sign = 1.0;          // [-]
    data::TimeFunction target;  // f [rad]
    std::string name;
    bool drive = false;
  };

  std::vector<Pin> pins;
  std::vector<Along> alongs;
  std::vector<Angle> angles;

  int rows() const { return static_cast<int>(2 * pins.size() + alongs.size() + angles.size()); }
  int first_angle() const { return first_along() + static_cast<int>(alongs.size()); }
  int Inner(int row) const;
  int Outer(int row) const;
  const std::string& NameOf(int row) const;
  bool driven() const;  // a target that changes with time
  bool IsDrive(int row) const;

  // Entries of `geometry`: pins' offsets in the world, 4 each (inner x, y, outer x, y); alongs, 8
  // each: e, inner offset, outer offset, r.
  int GeometrySize() const { return static_cast<int>(4 * pins.size() + 8 * alongs.size()); }
  // Fills the geometry and, where given, the Jacobian: 6 entries a row, x, y, theta of inner, then
  // of outer.
  void FillGeometry(const Motion& motion, double* geometry, double* jacobian) const;
  // gamma - J a for accelerations a; by row.
  void Residual(const Motion& motion, const double* geometry, const double* jacobian,
                const double* ax, const double* ay, const double* alpha, double* b) const;
  // Adds J^T lambda to the bodies'.
  void AddLoad(const double* geometry, const double* jacobian, const double* lambda, double* fx,
               double* fy, double* m) const;
  // The constraints and their rates.
  void Positions(const Motion& motion, const double* geometry, double* phi) const;
  void Velocities(const Motion& motion, const double* geometry, const double* jacobian,
                  double* rate) const;
  // The stiffness that the multipliers give, -d(J^T lambda)/dq.
  void AddTangent(const double* geometry, const double* lambda, Tangent* tangent) const;
  // Power that the drives give, sum of lambda f'(t) [W].
  double DrivePower(double t, const double* lambda) const;

 private:
  int first_along() const { return static_cast<int>(2 * pins.size()); }
};

}  // namespace unfurl::sim
