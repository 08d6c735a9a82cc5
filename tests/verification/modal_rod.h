#pragma once

#include <Eigen/Dense>
#include <complex>
#include <functional>
#include <vector>

namespace unfurl::reference {

// An inextensible, shear-free rod of any amplitude in the plane, in modes of its tangent's angle:
//   psi(s, t) = base angle + sum_k b_k shape_k(s),   r(s, t) = base + int_0^s exp(i psi) du,
// with shapes cos(k pi s / L) on a pinned base (b_0 is then its free angle) and
// sin((k + 1/2) pi s / L) on a clamped one: the natural conditions psi' = 0 hold at free and pinned
// ends. Integrals by Gauss and Legendre. Cross sections have no rotary inertia. A third formulation
// beside the simulator's segments and its smooth beam. State: b, then their rates.
class ModalRod {
 public:
  using Complex = std::complex<double>;
  struct Base {
    Complex place, acceleration;                                 // [m], [m/s^2]
    double angle = 0.0, rate = 0.0, angular_acceleration = 0.0;  // clamped: of the tangent there
  };

  double length = 1.0, mass = 1.0, EI = 1.0;  // [m], [kg], [N m^2]
  double damping = 0.0;                       // Kelvin-Voigt beta [s]
  double tip_mass = 0.0;                      // a point at the end [kg]
  Complex gravity = 0.0;                      // [m/s^2]
  Complex tip_force = 0.0;                    // fixed in space [N]
  bool clamped = false;
  bool tip_on_x_axis = false;  // the end slides on y = 0
  std::function<Base(double t)> base = [](double) { return Base{}; };

  ModalRod(int shapes, bool is_clamped);
  int shapes() const { return shapes_; }
  void RightSide(double t, const std::vector<double>& y, std::vector<double>& dydt) const;
  // Places at s = 0, L / 2 and L.
  struct Places {
    Complex start, middle, end;
  };
  Places At(double t, const std::vector<double>& y) const;

 private:
  double Shape(int k, double part) const;  // at s = part * length

  static constexpr int kNodes = 31;  // odd: the middle is one
  int shapes_;
  Eigen::VectorXd node_, weight_;  // on [0, 1]
  Eigen::MatrixXd integral_;       // of a function's values at the nodes, from 0 to each node
  Eigen::MatrixXd shape_;          // node by shape
};

}  // namespace unfurl::reference
