#pragma once

#include "sim/model/aligned.h"
#include "sim/model/rigid_bodies.h"

namespace unfurl::sim {

class Tangent;

// The elastic elements of all beams, [paper, eq. (4) to (13)] as docs/physics-simulator.md has
// them: with dx, dy the relative position of the two stations in the element's axes (at the mean of
// their angles) and dtheta the relative angle,
//   U = (12 EI / l^3) dy^2 / 2 + (EI / l) dtheta^2 / 2 + (EA / l) (dx - l)^2 / 2,
// and the damped forces are those of d + beta d_dot. Element e joins bodies e and e + 1; entries
// that are no element have zero stiffness.
class Bending {
 public:
  struct Element {
    double length = 0.0;  // l [m]
    double EI = 0.0;      // [N m^2]
    double EA = 0.0;      // [N]; 0 where the longitudinal constraint holds
    double beta = 0.0;    // [s]
    bool gradient_form = true;
  };

  Bending() = default;
  explicit Bending(int beam_count);
  void Set(int e, const Element& element);

  int count() const { return count_; }
  int bodies() const { return beam_count_; }                 // elements are numbered below
  double length(int e) const { return length_[e]; }          // l [m]
  double shear_stiffness(int e) const { return shear_[e]; }  // 12 EI / l^3 [N/m]
  double axial_stiffness(int e) const { return axial_stiffness_[e]; }  // EA / l [N/m]
  double damping(int e) const { return beta_[e]; }                     // [s]
  bool damped() const { return damped_; }
  bool axial() const { return axial_; }
  // Of element e; 0: it does not stretch.
  double Strain(const Motion& motion, int e) const;

  // Adds the elements' forces to the bodies'. `scratch` holds ScratchSize() entries. Where
  // `dissipated` is given, it receives the power turned into heat [W].
  void AddLoad(const Motion& motion, double* scratch, Load load, double* dissipated) const;
  int ScratchSize() const { return 5 * (beam_count_ + kBlock); }
  void AddTangent(const Motion& motion, Tangent* tangent) const;

  double Energy(const Motion& motion) const;       // bending [J]
  double AxialEnergy(const Motion& motion) const;  // [J]

 private:
  template <bool kDamped, bool kAxial, bool kPower>
  void Forces(const Motion& motion, double* scratch) const;

  int beam_count_ = 0;
  int count_ = 0;
  bool damped_ = false;
  bool axial_ = false;
  Array length_, beta_, gradient_;        // [m], [s], [-]
  Array shear_, bend_, axial_stiffness_;  // [N/m], [N m], [N/m]
};

}  // namespace unfurl::sim
