#include "sim/kirchhoff/kirchhoff.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <complex>
#include <random>
#include <vector>

namespace unfurl::sim::kirchhoff_test {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using Attachment = KirchhoffRod::Attachment;
using Ends = KirchhoffShapes::Ends;

// Rows of attachments held at rest: 3 b + 0, 1, 2 for x, y, theta of attachment b.
using Held = std::vector<int>;

constexpr Ends kFree{};
constexpr Ends kPins{true, false, true, false};  // as the fields of Ends: what acts at each end
constexpr Ends kClampAndFree{true, true, false, false};
constexpr Ends kClampAndLoad{true, true, true, false};
constexpr Ends kAll{true, true, true, true};

KirchhoffRod Rod(int modes, Ends ends, std::vector<Attachment> attachments = {{0.0}, {1.0}},
                 double damping = 0.0) {
  return KirchhoffRod({1.0, 1.0, 10.0, damping, modes, ends}, std::move(attachments), {});
}

// Accelerations of the rod's coordinates with some rows of its attachments held.
VectorXd Accelerations(const KirchhoffRod& rod, const VectorXd& q, const VectorXd& v,
                       const Held& held = {}, const VectorXd& load = {}) {
  KirchhoffRod::Work work = rod.MakeWork();
  const int rows = 3 * static_cast<int>(rod.attachments().size());
  VectorXd attached = load.size() > 0 ? load : VectorXd::Zero(rows);
  VectorXd free(rows), total = VectorXd::Zero(rows), out(rod.coordinates());
  Eigen::Matrix<double, -1, -1, Eigen::RowMajor> C(rows, rows);
  const double none[2] = {0.0, 0.0};
  rod.Update(q.data(), v.data(), &work);
  rod.Solve(none, attached.data(), &work, free.data(), C.data(), nullptr);
  if (!held.empty()) {
    const MatrixXd S = C(held, held);
    const VectorXd lambda = S.ldlt().solve(-free(held).eval());
    total(held) = lambda;
  }
  rod.Accelerate(total.data(), &work, out.data());
  return out;
}

// Natural frequencies of the straight rod in units of sqrt(EI / (m L^3)), lowest first, without
// rigid motions.
std::vector<double> Frequencies(int modes, Ends ends, const Held& held) {
  const KirchhoffRod rod = Rod(modes, ends);
  const int n = rod.coordinates();
  // Along y and in the angles; x is of second order.
  std::vector<int> moving{1};
  for (int k = 2; k < n; ++k) moving.push_back(k);
  MatrixXd A(n - 1, n - 1);
  const VectorXd rest = VectorXd::Zero(n);
  constexpr double kStep = 1e-5;  // the cubic terms of a rotation stay below 1e-10
  for (int c = 0; c < n - 1; ++c) {
    VectorXd plus = rest, minus = rest;
    plus[moving[c]] += kStep;
    minus[moving[c]] -= kStep;
    A.col(c) = ((Accelerations(rod, plus, rest, held) - Accelerations(rod, minus, rest, held)) /
                (2.0 * kStep))(moving);
  }
  std::vector<double> found;
  constexpr double kRigid = 1.0;  // the lowest elastic mode here has 3.5^2 * 10
  for (const std::complex<double>& value : A.eigenvalues()) {
    if (-value.real() > kRigid) found.push_back(std::sqrt(-value.real() / 10.0));
  }
  std::sort(found.begin(), found.end());
  return found;
}

constexpr double kFreeFree[3] = {22.373285448, 61.672822868, 120.903391640};
constexpr double kCantilever[3] = {3.516015269, 22.034491565, 61.697214413};
constexpr double kPinned[3] = {9.869604401, 39.478417604, 88.826439610};
constexpr double kPinnedAndFree[3] = {15.418205717, 49.964862032, 104.247696459};
// Differencing, the printed digits, and the rod's few points (2e-7 for three modes).
constexpr double kDifferenceError = 3e-7;

TEST(KirchhoffFrequencies, FreeModesAreTheShapesThemselves) {
  const std::vector<double> found = Frequencies(3, kFree, {});
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(found[k] / kFreeFree[k], 1.0, kDifferenceError) << k;
}

// Held in other ways the modes come from the space. What is left falls with the number of free
// modes faster than its 3.5th power (clamped; the fifth and more otherwise), where segments have
// the second.
void ExpectHighOrder(Ends ends, const Held& held, const double* exact) {
  constexpr int kFew = 2, kMany = 4;
  const std::vector<double> few = Frequencies(kFew, ends, held);
  const std::vector<double> many = Frequencies(kMany, ends, held);
  for (int k = 0; k < 2; ++k) {
    const double e1 = few[k] / exact[k] - 1.0, e2 = many[k] / exact[k] - 1.0;
    EXPECT_GT(e1, -kDifferenceError);  // Rayleigh and Ritz: from above
    EXPECT_GT(e2, -kDifferenceError);
    EXPECT_LT(e2, e1 * std::pow(double(kFew) / kMany, 3.5) + kDifferenceError) << "mode " << k;
  }
  EXPECT_LT(few[0] / exact[0] - 1.0, 1e-5);
  EXPECT_LT(many[2] / exact[2] - 1.0, 1e-4);
}
TEST(KirchhoffFrequencies, Pinned) { ExpectHighOrder(kPins, {0, 1, 4}, kPinned); }
TEST(KirchhoffFrequencies, PinnedAndFree) {
  ExpectHighOrder({true, false, false, false}, {0, 1}, kPinnedAndFree);
}
TEST(KirchhoffFrequencies, Cantilever) { ExpectHighOrder(kClampAndFree, {0, 1, 2}, kCantilever); }
TEST(KirchhoffFrequencies, ClampedAtBothEnds) {  // has the frequencies of the free one
  ExpectHighOrder(kAll, {0, 1, 2, 4, 5}, kFreeFree);
}

// The equations against a second formulation: Lagrange's, with the energies summed over many places
// along the line and everything differentiated numerically.
class SecondFormulation {
 public:
  explicit SecondFormulation(const KirchhoffRod& rod) : rod_(rod) {
    for (const double x : fine_.x) places_.push_back(rod.PlaceAt(x));
    for (const Attachment& a : rod.attachments()) attached_.push_back(rod.PlaceAt(a.at));
  }
  VectorXd Accelerations(const VectorXd& q, const VectorXd& v, const VectorXd& load,
                         double string) const {
    const int n = rod_.coordinates();
    // d/dt(M v) - dT/dq = Q
    VectorXd rhs(n);
    constexpr double h = 1e-4;
    for (int j = 0; j < n; ++j) {
      const VectorXd e = VectorXd::Unit(n, j) * h;
      const auto gradient = [&](auto f) {
        return (8.0 * (f(e) - f(-e)) - (f(2 * e) - f(-2 * e))) / (12.0 * h);
      };
      rhs[j] = gradient(
          [&](const VectorXd& d) { return Kinetic(q + d, v) - Potential(q + d, load, string); });
    }
    const auto momentum = [&](const VectorXd& at) {
      VectorXd p(n);
      for (int k = 0; k < n; ++k) {
        const VectorXd b = VectorXd::Unit(n, k);
        p[k] = Kinetic(at, v + b) - Kinetic(at, v) - Kinetic(at, b);
      }
      return p;
    };
    rhs -= (8.0 * (momentum(q + h * v) - momentum(q - h * v)) -
            (momentum(q + 2 * h * v) - momentum(q - 2 * h * v))) /
           (12.0 * h);
    MatrixXd mass(n, n);
    for (int j = 0; j < n; ++j) {
      for (int k = 0; k < n; ++k) {
        const VectorXd a = VectorXd::Unit(n, j), b = VectorXd::Unit(n, k);
        mass(j, k) = Kinetic(q, a + b) - Kinetic(q, a) - Kinetic(q, b);
      }
    }
    return mass.ldlt().solve(rhs);
  }
  double Kinetic(const VectorXd& q, const VectorXd& v) const {
    double sum = 0.0;
    for (std::size_t i = 0; i < places_.size(); ++i) {
      const KirchhoffRod::Frame f = rod_.At(places_[i], q.data(), v.data());
      sum += 0.5 * rod_.properties().mass * fine_.weight[i] * (f.vx * f.vx + f.vy * f.vy);
    }
    for (std::size_t b = 0; b < attached_.size(); ++b) {
      const Attachment& a = rod_.attachments()[b];
      const KirchhoffRod::Frame f = Body(b, q, v);
      sum += 0.5 * a.mass * (f.vx * f.vx + f.vy * f.vy) + 0.5 * a.inertia * f.omega * f.omega;
    }
    return sum;
  }

 private:
  KirchhoffRod::Frame Body(std::size_t b, const VectorXd& q, const VectorXd& v) const {
    const Attachment& a = rod_.attachments()[b];
    KirchhoffRod::Frame f = rod_.At(attached_[b], q.data(), v.data());
    const double c = std::cos(f.theta), s = std::sin(f.theta);
    const double ox = c * a.px - s * a.py, oy = s * a.px + c * a.py;
    f.x += ox;
    f.y += oy;
    f.vx -= f.omega * oy;
    f.vy += f.omega * ox;
    return f;
  }
  double Potential(const VectorXd& q, const VectorXd& load, double string) const {
    const VectorXd v = VectorXd::Zero(q.size());
    const KirchhoffRod::Properties& p = rod_.properties();
    double sum = 0.0;
    for (std::size_t i = 0; i < places_.size(); ++i) {
      const double x = fine_.x[i], curvature = rod_.Curvature(x, q.data());
      sum += 0.5 * p.EI * curvature * curvature * p.length * fine_.weight[i];
      const double strain = rod_.Strain(x, q.data());
      sum += 0.5 * p.EA * strain * strain * p.length * fine_.weight[i];
      // Strings hold every point, less what they do to the centre; straight along x at angle 0.
      const KirchhoffRod::Frame f = rod_.At(places_[i], q.data(), v.data());
      const double dx = f.x - q[0] - (x - 0.5) * p.length, dy = f.y - q[1];
      sum += 0.5 * string * p.mass * fine_.weight[i] * (dx * dx + dy * dy);
    }
    for (std::size_t b = 0; b < attached_.size(); ++b) {
      const KirchhoffRod::Frame f = Body(b, q, v);
      sum -= load[3 * b] * f.x + load[3 * b + 1] * f.y + load[3 * b + 2] * f.theta;
    }
    return sum;
  }
  const KirchhoffRod& rod_;
  const KirchhoffShapes fine_{KirchhoffShapes::kMostModes, {}};  // for its points: 32 of Gauss's
  std::vector<KirchhoffRod::Place> places_, attached_;
};

TEST(Kirchhoff, EquationsMatchASecondFormulation) {
  constexpr double kString = 1.4;
  // The rod's own 12 points against 32, and the differences.
  constexpr double kTolerance = 1e-5;
  std::mt19937 random(5);
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  for (const auto& [ends, EA] :
       {std::pair{kFree, 0.0}, std::pair{kPins, 0.0}, std::pair{kClampAndFree, 0.0},
        std::pair{kAll, 0.0}, std::pair{kFree, 70.0}, std::pair{kAll, 700.0}}) {
    const KirchhoffRod rod(
        {1.3, 0.7, 4.0, 0.0, 2, ends, {}, EA},
        {{0.0, 0.1, 0.02, 0.3, 0.4, 0.01}, {0.4}, {1.0, -0.05, 0.0, 0.0, 0.2, 0.003}},
        {kString, 0.0});
    VectorXd q(rod.coordinates()), v(rod.coordinates()), load(9);
    for (double& x : q) x = any(random);
    for (double& x : v) x = 3.0 * any(random);
    for (double& x : load) x = 5.0 * any(random);
    q.tail(rod.amplitudes()) *= 0.2;
    const VectorXd found = Accelerations(rod, q, v, {}, load);
    const VectorXd expected = SecondFormulation(rod).Accelerations(q, v, load, kString);
    EXPECT_LT((found - expected).cwiseAbs().maxCoeff(),
              kTolerance * expected.cwiseAbs().maxCoeff());
  }
}

// A moment on both ends bends the rod into an arc of a circle, theta = M L x / EI: cubic slopes are
// in the space when all four may act.
TEST(Kirchhoff, EndMomentsBendItIntoACircle) {
  const KirchhoffRod rod = Rod(2, kAll);
  for (const double turn : {0.5, 2.0}) {
    VectorXd q = VectorXd::Zero(rod.coordinates()), load = VectorXd::Zero(6);
    // The amplitudes of theta = turn (x - 1/2), from as many places.
    const int p = rod.amplitudes();
    MatrixXd N(p, p);
    VectorXd theta(p);
    for (int i = 0; i < p; ++i) {
      const double x = (i + 0.5) / p;
      for (int k = 0; k < p; ++k) N(i, k) = rod.shapes().Shape(k + 1, x);
      theta[i] = turn * (x - 0.5);
    }
    q.tail(p) = N.partialPivLu().solve(theta);
    load[2] = -10.0 * turn;
    load[5] = 10.0 * turn;
    const VectorXd a = Accelerations(rod, q, VectorXd::Zero(q.size()), {}, load);
    // Nothing moves: beside the angular acceleration that the same moment gives one end alone.
    const VectorXd one = Accelerations(rod, q, VectorXd::Zero(q.size()), {}, load.cwiseMax(0.0));
    EXPECT_LT(a.cwiseAbs().maxCoeff(), 1e-9 * one.cwiseAbs().maxCoeff());
    const KirchhoffRod::Frame start = rod.At(rod.PlaceAt(0.0), q.data(), q.data());
    const KirchhoffRod::Frame end = rod.At(rod.PlaceAt(1.0), q.data(), q.data());
    EXPECT_NEAR(std::hypot(end.x - start.x, end.y - start.y), std::sin(0.5 * turn) / (0.5 * turn),
                1e-11);
  }
}

// Cantilever with a dead load P across its tip, P L^2 / EI = 1, 2, 5 (Mattiasson, Int. J. Numer.
// Meth. Engng 17, 1981, by elliptic integrals): tip down, tip inwards (over L), slope.
TEST(Kirchhoff, ElasticaUnderEndLoad) {
  struct Case {
    double load, down, inwards, slope;
  };
  constexpr double kTolerance = 2e-5;  // five printed digits, and six modes
  const KirchhoffRod rod = Rod(6, kClampAndLoad);
  const int n = rod.coordinates();
  const Held clamp{0, 1, 2};
  VectorXd q = VectorXd::Zero(n);
  q[0] = 0.5;
  for (const Case& c : {Case{1.0, 0.30172, 0.05643, 0.46135},
                        {2.0, 0.49346, 0.16064, 0.78175},
                        {5.0, 0.71379, 0.38763, 1.21537}}) {
    VectorXd load = VectorXd::Zero(6);
    load[4] = c.load * 10.0;
    // At rest, held, and not accelerating: Gauss and Newton.
    const auto residual = [&](const VectorXd& at) {
      const VectorXd zero = VectorXd::Zero(n);
      const KirchhoffRod::Frame f = rod.At(rod.PlaceAt(0.0), at.data(), zero.data());
      VectorXd r(n + 3);
      r << Accelerations(rod, at, zero, clamp, load) * 1e-3, f.x, f.y, f.theta;
      return r;
    };
    for (int iteration = 0; iteration < 12; ++iteration) {
      MatrixXd J(n + 3, n);
      for (int k = 0; k < n; ++k) {
        const VectorXd e = VectorXd::Unit(n, k) * 1e-6;
        J.col(k) = (residual(q + e) - residual(q - e)) / 2e-6;
      }
      q -= J.colPivHouseholderQr().solve(residual(q));
    }
    const KirchhoffRod::Frame tip = rod.At(rod.PlaceAt(1.0), q.data(), q.data());
    EXPECT_NEAR(tip.y, c.down, kTolerance) << c.load;
    EXPECT_NEAR(1.0 - tip.x, c.inwards, kTolerance) << c.load;
    EXPECT_NEAR(tip.theta, c.slope, kTolerance) << c.load;
  }
}

// Free flight of a bent, turning rod with a body at one end: nothing is lost. The classical
// Runge-Kutta method's own loss falls at least with the fourth power of the step, which tells it
// from an error of the equations.
TEST(Kirchhoff, FreeFlightKeepsEnergyAndMomentum) {
  const KirchhoffRod rod = Rod(2, kClampAndFree, {{0.0, 0.05, 0.0, 0.0, 0.3, 0.002}});
  const int n = rod.coordinates();
  const auto energy = [&](const VectorXd& q, const VectorXd& v, double* momentum) {
    KirchhoffRod::Work work = rod.MakeWork();
    rod.Update(q.data(), v.data(), &work);
    const KirchhoffRod::Frame& f = work.frame[0];
    const Attachment& b = rod.attachments()[0];
    *momentum = q[0] * v[1] - q[1] * v[0] + rod.AngularMomentum(&work) +
                b.mass * (f.x * f.vy - f.y * f.vx) + b.inertia * f.omega;
    return 0.5 * (v[0] * v[0] + v[1] * v[1]) + rod.KineticAboutCentre(&work) + rod.Bending(work) +
           0.5 * b.mass * (f.vx * f.vx + f.vy * f.vy) + 0.5 * b.inertia * f.omega * f.omega;
  };
  double lost[2], turned[2];
  for (int k = 0; k < 2; ++k) {
    VectorXd q = VectorXd::Zero(n), v = VectorXd::Zero(n);
    q[3] = 0.4;
    q[4] = -0.1;
    v[1] = 1.0;
    v[2] = 3.0;
    double start_momentum, end_momentum;
    const double start = energy(q, v, &start_momentum);
    const int steps = 2000 << k;
    const double h = 0.4 / steps;
    for (int i = 0; i < steps; ++i) {
      const VectorXd a1 = Accelerations(rod, q, v), v2 = v + 0.5 * h * a1;
      const VectorXd a2 = Accelerations(rod, q + 0.5 * h * v, v2), v3 = v + 0.5 * h * a2;
      const VectorXd a3 = Accelerations(rod, q + 0.5 * h * v2, v3), v4 = v + h * a3;
      const VectorXd a4 = Accelerations(rod, q + h * v3, v4);
      q += h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4);
      v += h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4);
    }
    lost[k] = std::fabs(energy(q, v, &end_momentum) - start) / start;
    turned[k] = std::fabs(end_momentum - start_momentum) / std::fabs(start_momentum);
  }
  EXPECT_LT(lost[1], lost[0] / 12.0);
  EXPECT_LT(lost[1], 1e-6);
  EXPECT_LT(turned[1], 1e-7);
}

TEST(Kirchhoff, DampingTakesWhatItReports) {
  const KirchhoffRod rod = Rod(2, kPins, {{0.0}, {1.0}}, 2e-3);
  KirchhoffRod::Work work = rod.MakeWork();
  const int n = rod.coordinates();
  VectorXd q = VectorXd::Zero(n), v = VectorXd::Zero(n);
  q[3] = 0.2;
  v[3] = 1.0;
  v[4] = -2.0;
  const double none[2] = {0.0, 0.0};
  const VectorXd attached = VectorXd::Zero(6);
  VectorXd free(6), C(36), a(n);
  double lost = 0.0;
  rod.Update(q.data(), v.data(), &work);
  rod.Solve(none, attached.data(), &work, free.data(), C.data(), &lost);
  rod.Accelerate(attached.data(), &work, a.data());
  // d(T + V)/dt by a difference along the motion.
  const auto energy = [&](double t) {
    const VectorXd qt = q + t * v + 0.5 * t * t * a, vt = v + t * a;
    rod.Update(qt.data(), vt.data(), &work);
    return 0.5 * (vt[0] * vt[0] + vt[1] * vt[1]) + rod.KineticAboutCentre(&work) +
           rod.Bending(work);
  };
  constexpr double h = 1e-6;
  const double rate = (energy(h) - energy(-h)) / (2.0 * h);
  EXPECT_GT(lost, 0.0);
  EXPECT_NEAR(rate, -lost, 1e-6 * lost);
}

}  // namespace
}  // namespace unfurl::sim::kirchhoff_test
