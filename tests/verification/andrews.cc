#include "andrews.h"

#include <Eigen/Dense>
#include <cmath>

namespace unfurl::reference {
namespace {

constexpr double kXa = -0.06934, kYa = -0.00227, kXb = -0.03635, kYb = 0.03273, kXc = 0.014,
                 kYc = 0.072;
constexpr double kM1 = 0.04325, kM2 = 0.00365, kM3 = 0.02373, kM4 = 0.00706, kM5 = 0.07050,
                 kM6 = 0.00706, kM7 = 0.05498;
constexpr double kI1 = 2.194e-6, kI2 = 4.410e-7, kI3 = 5.255e-6, kI4 = 5.667e-7, kI5 = 1.169e-5,
                 kI6 = 5.667e-7, kI7 = 1.912e-5;
constexpr double kD = 0.028, kDa = 0.0115, kE = 0.02, kEa = 0.01421, kZf = 0.02, kZt = 0.04,
                 kFa = 0.01421, kRr = 0.007, kRa = 0.00092, kSs = 0.035, kSa = 0.01874,
                 kSb = 0.01043, kSc = 0.018, kSd = 0.02, kTa = 0.02308, kTb = 0.00916, kU = 0.04,
                 kUa = 0.01228, kUb = 0.00449;
constexpr double kC0 = 4530.0, kL0 = 0.07785, kMoment = 0.033;

using Vector = Eigen::Matrix<double, 7, 1>;

// The six constraints.
Eigen::Matrix<double, 6, 1> Gap(const Vector& q) {
  const double be = q[0], th = q[1], ga = q[2], ph = q[3], de = q[4], om = q[5], ep = q[6];
  const double ex = kRr * std::cos(be) - kD * std::cos(be + th);
  const double ey = kRr * std::sin(be) - kD * std::sin(be + th);
  Eigen::Matrix<double, 6, 1> g;
  g << ex - kSs * std::sin(ga) - kXb, ey + kSs * std::cos(ga) - kYb,
      ex - kE * std::sin(ph + de) - kZt * std::cos(de) - kXa,
      ey + kE * std::cos(ph + de) - kZt * std::sin(de) - kYa,
      ex - kZf * std::cos(om + ep) - kU * std::sin(ep) - kXa,
      ey - kZf * std::sin(om + ep) + kU * std::cos(ep) - kYa;
  return g;
}

Eigen::Matrix<double, 6, 7> Jacobian(const Vector& q) {
  const double be = q[0], th = q[1], ga = q[2], ph = q[3], de = q[4], om = q[5], ep = q[6];
  Eigen::Matrix<double, 6, 7> G = Eigen::Matrix<double, 6, 7>::Zero();
  for (int row = 0; row < 6; row += 2) {
    G(row, 0) = -kRr * std::sin(be) + kD * std::sin(be + th);
    G(row, 1) = kD * std::sin(be + th);
    G(row + 1, 0) = kRr * std::cos(be) - kD * std::cos(be + th);
    G(row + 1, 1) = -kD * std::cos(be + th);
  }
  G(0, 2) = -kSs * std::cos(ga), G(1, 2) = -kSs * std::sin(ga);
  G(2, 3) = -kE * std::cos(ph + de), G(3, 3) = -kE * std::sin(ph + de);
  G(2, 4) = G(2, 3) + kZt * std::sin(de), G(3, 4) = G(3, 3) - kZt * std::cos(de);
  G(4, 5) = kZf * std::sin(om + ep), G(5, 5) = -kZf * std::cos(om + ep);
  G(4, 6) = G(4, 5) - kU * std::cos(ep), G(5, 6) = G(5, 5) - kU * std::sin(ep);
  return G;
}

}  // namespace

std::vector<double> Andrews::Start() {
  return {-0.0617138900142764496358948458001,
          0.0,
          0.455279819163070380255912382449,
          0.222668390165885884674473185609,
          0.487364979543842550225598953530,
          -0.222668390165885884674473185609,
          1.23054744454982119249735015568,
          0.0,
          0.0,
          0.0,
          0.0,
          0.0,
          0.0,
          0.0};
}

void Andrews::RightSide(const std::vector<double>& y, std::vector<double>& dydt) {
  const Vector q = Eigen::Map<const Vector>(y.data()), v = Eigen::Map<const Vector>(y.data() + 7);
  const double co_th = std::cos(q[1]), si_th = std::sin(q[1]);
  const double si_ga = std::sin(q[2]), co_ga = std::cos(q[2]);
  const double si_ph = std::sin(q[3]), co_ph = std::cos(q[3]);
  const double si_om = std::sin(q[5]), co_om = std::cos(q[5]);
  const double be = v[0], th = v[1], ph = v[3], de = v[4], om = v[5], ep = v[6];  // rates
  Eigen::Matrix<double, 7, 7> M = Eigen::Matrix<double, 7, 7>::Zero();
  const double e = kE - kEa, f = kZf - kFa;
  M(0, 0) = kM1 * kRa * kRa + kM2 * (kRr * kRr - 2 * kDa * kRr * co_th + kDa * kDa) + kI1 + kI2;
  M(1, 0) = M(0, 1) = kM2 * (kDa * kDa - kDa * kRr * co_th) + kI2;
  M(1, 1) = kM2 * kDa * kDa + kI2;
  M(2, 2) = kM3 * (kSa * kSa + kSb * kSb) + kI3;
  M(3, 3) = kM4 * e * e + kI4;
  M(4, 3) = M(3, 4) = kM4 * (e * e + kZt * e * si_ph) + kI4;
  M(4, 4) =
      kM4 * (kZt * kZt + 2 * kZt * e * si_ph + e * e) + kM5 * (kTa * kTa + kTb * kTb) + kI4 + kI5;
  M(5, 5) = kM6 * f * f + kI6;
  M(6, 5) = M(5, 6) = kM6 * (f * f - kU * f * si_om) + kI6;
  M(6, 6) =
      kM6 * (f * f - 2 * kU * f * si_om + kU * kU) + kM7 * (kUa * kUa + kUb * kUb) + kI6 + kI7;
  const double xd = kSd * co_ga + kSc * si_ga + kXb, yd = kSd * si_ga - kSc * co_ga + kYb;
  const double length = std::hypot(xd - kXc, yd - kYc);
  const double pull = -kC0 * (length - kL0) / length;
  const double fx = pull * (xd - kXc), fy = pull * (yd - kYc);
  Vector Q;
  Q << kMoment - kM2 * kDa * kRr * th * (th + 2 * be) * si_th, kM2 * kDa * kRr * be * be * si_th,
      fx * (kSc * co_ga - kSd * si_ga) + fy * (kSd * co_ga + kSc * si_ga),
      kM4 * kZt * e * de * de * co_ph, -kM4 * kZt * e * ph * (ph + 2 * de) * co_ph,
      -kM6 * kU * f * ep * ep * co_om, kM6 * kU * f * om * (om + 2 * ep) * co_om;
  // gamma = -d2(gap)/ds2 along v: the gap is a sum of sines and cosines of one or two angles, whose
  // second derivative is minus the term times the square of the angle's rate.
  const double be_th = be + th, ph_de = ph + de, om_ep = om + ep;
  const double ex = -kRr * std::cos(q[0]) * be * be + kD * std::cos(q[0] + q[1]) * be_th * be_th;
  const double ey = -kRr * std::sin(q[0]) * be * be + kD * std::sin(q[0] + q[1]) * be_th * be_th;
  Eigen::Matrix<double, 6, 1> second;
  second << ex + kSs * si_ga * v[2] * v[2], ey - kSs * co_ga * v[2] * v[2],
      ex + kE * std::sin(q[3] + q[4]) * ph_de * ph_de + kZt * std::cos(q[4]) * de * de,
      ey - kE * std::cos(q[3] + q[4]) * ph_de * ph_de + kZt * std::sin(q[4]) * de * de,
      ex + kZf * std::cos(q[5] + q[6]) * om_ep * om_ep + kU * std::sin(q[6]) * ep * ep,
      ey + kZf * std::sin(q[5] + q[6]) * om_ep * om_ep - kU * std::cos(q[6]) * ep * ep;
  // Baumgarte's terms keep the six constraints; they vanish on the exact solution.
  constexpr double kReturn = 1e3;  // [1/s]
  const Eigen::Matrix<double, 6, 7> G = Jacobian(q);
  Eigen::Matrix<double, 13, 13> K = Eigen::Matrix<double, 13, 13>::Zero();
  K.topLeftCorner<7, 7>() = M;
  K.topRightCorner<7, 6>() = G.transpose();
  K.bottomLeftCorner<6, 7>() = G;
  Eigen::Matrix<double, 13, 1> right;
  right << Q, -second - 2 * kReturn * (G * v) - kReturn * kReturn * Gap(q);
  const Eigen::Matrix<double, 13, 1> solution = K.partialPivLu().solve(right);
  dydt.resize(14);
  for (int k = 0; k < 7; ++k) dydt[k] = v[k], dydt[7 + k] = solution[k];
}

}  // namespace unfurl::reference
