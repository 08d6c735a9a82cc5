#pragma once

#include <complex>
#include <functional>
#include <vector>

namespace unfurl::reference {

// Trees of rigid bodies in minimal coordinates, a formulation that shares nothing with the
// simulator's: the coordinates are absolute angles phi_k (and, where the tree floats, the place of
// its base, Z = X + i Y); a centre of mass is r_b = Z + sum_k arm_bk exp(i phi_k) with constant
// complex arms, and Lagrange's equations follow by complex arithmetic. No constraints, no
// multipliers. State: [X, Y,] phi, then their rates.
class AngleTree {
 public:
  using Complex = std::complex<double>;
  struct Body {
    double mass = 0.0;         // [kg]
    double inertia = 0.0;      // about the centre of mass [kg m^2]
    int angle = 0;             // which phi turns it
    std::vector<Complex> arm;  // by angle, from the base to the centre of mass [m]
  };
  struct Forces {
    std::vector<Complex> on_body;  // at each centre of mass [N]
    std::vector<double> on_angle;  // generalized moment on each phi [N m]
  };

  AngleTree(int angles, bool floats) : angles_(angles), floats_(floats) {}
  std::vector<Body> bodies;
  // Fills forces, which come zeroed and sized, at the given state.
  std::function<void(double t, const std::vector<double>& y, Forces& forces)> load;

  int coordinates() const { return angles_ + first(); }
  int first() const { return floats_ ? 2 : 0; }  // index of phi_0
  double phi(const std::vector<double>& y, int k) const { return y[first() + k]; }
  double rate(const std::vector<double>& y, int k) const { return y[coordinates() + first() + k]; }
  Complex PointOf(const std::vector<double>& y, const std::vector<Complex>& arm) const;
  void RightSide(double t, const std::vector<double>& y, std::vector<double>& dydt) const;
  double Kinetic(const std::vector<double>& y) const;  // [J]

 private:
  int angles_;
  bool floats_;
};

}  // namespace unfurl::reference
