// The flying spaghetti of data/sets/flying_spaghetti. Source: Simo and Vu-Quoc 1986, part II (L 10
// m, rho A 1 kg/m, EI 500 N m^2, rotary inertia 10 kg m, from (6, 0) to (0, 8) m, 8 N and 80 N m at
// the foot until 2.5 s). Quantities: momentum and centre of mass, in closed form; both ends,
// against a free inextensible rod in modes of its angle, with rotary inertia, Fehlberg 7(8).
// Tolerances: named below. Not checked: their shear stiffness, which no beam here has; their
// figures, which have no numbers.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <complex>

#include "reference.h"
#include "runs.h"

namespace unfurl::sim::flying_spaghetti_test {
namespace {

using Complex = std::complex<double>;

constexpr double kLength = 10.0, kDensity = 1.0, kRotary = 10.0, kEI = 500.0;
constexpr double kForce = 8.0, kTorque = 80.0, kOff = 2.5, kEnd = 6.0;
constexpr int kSamples = 120;

// psi(s) = sum_k b_k cos(k pi s / L); places by the centre of mass, whose own motion is F / m.
// State: b, then their rates.
class FreeRod {
 public:
  explicit FreeRod(int shapes) : n_(shapes), shape_(2 * kCells + 1, shapes) {
    for (int i = 0; i <= 2 * kCells; ++i) {
      for (int k = 0; k < n_; ++k) shape_(i, k) = std::cos(k * M_PI * i / (2.0 * kCells));
    }
  }

  void RightSide(double t, const std::vector<double>& y, std::vector<double>& rate) const {
    const Line line = At(y);
    const bool on = t < kOff;
    Eigen::MatrixXd M = Eigen::MatrixXd::Zero(n_, n_);
    Eigen::VectorXd Q = Eigen::VectorXd::Zero(n_);
    const Eigen::MatrixXcd weighted = line.weight.asDiagonal() * line.J;
    M += kDensity * (line.J.adjoint() * weighted).real();
    Q -= kDensity * (weighted.adjoint() * line.bend).real();
    for (int k = 0; k < n_; ++k) {
      const double wave = k * M_PI / kLength;
      M(k, k) += kRotary * kLength * (k == 0 ? 1.0 : 0.5);
      Q[k] -= kEI * wave * wave * 0.5 * kLength * y[static_cast<std::size_t>(k)];
      if (on) Q[k] += kTorque + kForce * std::real(line.J(0, k));
    }
    const Eigen::VectorXd a = M.llt().solve(Q);
    rate.resize(y.size());
    for (int k = 0; k < n_; ++k) {
      rate[static_cast<std::size_t>(k)] = y[static_cast<std::size_t>(n_ + k)];
      rate[static_cast<std::size_t>(n_ + k)] = a[k];
    }
  }

  // Foot and head at t.
  std::pair<Complex, Complex> Ends(double t, const std::vector<double>& y) const {
    const double v = kForce / (kDensity * kLength);
    const double moved = t < kOff ? 0.5 * v * t * t : v * kOff * (t - 0.5 * kOff);
    const Complex centre(3.0 + moved, 4.0);
    const Line line = At(y);
    return {centre + line.place[0], centre + line.place[kCells]};
  }

  std::vector<double> Start() const {
    std::vector<double> y(static_cast<std::size_t>(2 * n_), 0.0);
    y[0] = std::atan2(8.0, -6.0);
    return y;
  }

 private:
  static constexpr int kCells = 120;  // Simpson's rule: some 1e-6 of these shapes
  // At the nodes, less the mean over the mass: places, d(place)/db_k, the acceleration at b'' = 0.
  struct Line {
    Eigen::VectorXcd place, bend;
    Eigen::MatrixXcd J;
    Eigen::VectorXd weight;
  };
  static double Weight(int j) {
    return (j == 0 || j == kCells ? 1.0 : j % 2 == 1 ? 4.0 : 2.0) / 3.0;
  }

  // Integrals from the foot: Simpson's rule over each cell with its middle.
  Line At(const std::vector<double>& y) const {
    Line line;
    line.place = line.bend = Eigen::VectorXcd::Zero(kCells + 1);
    line.J = Eigen::MatrixXcd::Zero(kCells + 1, n_);
    line.weight.resize(kCells + 1);
    const double ds = kLength / kCells;
    Eigen::VectorXcd before(n_ + 2), now(n_ + 2);
    Rates(y, 0, &before);
    for (int j = 0; j < kCells; ++j) {
      Eigen::VectorXcd middle(n_ + 2);
      Rates(y, 2 * j + 1, &middle);
      Rates(y, 2 * j + 2, &now);
      const Eigen::VectorXcd cell = ds / 6.0 * (before + 4.0 * middle + now);
      line.place[j + 1] = line.place[j] + cell[n_];
      line.bend[j + 1] = line.bend[j] + cell[n_ + 1];
      line.J.row(j + 1) = line.J.row(j) + cell.head(n_).transpose();
      before = now;
    }
    for (int j = 0; j <= kCells; ++j) line.weight[j] = ds * Weight(j);
    const Complex place = (line.weight.transpose() * line.place)(0) / kLength;
    const Complex bend = (line.weight.transpose() * line.bend)(0) / kLength;
    const Eigen::RowVectorXcd J = line.weight.transpose() * line.J / kLength;
    line.place.array() -= place;
    line.bend.array() -= bend;
    line.J.rowwise() -= J;
    return line;
  }

  // Along s, half a cell apart: of d(place)/db_k, of the place, of the acceleration.
  void Rates(const std::vector<double>& y, int half, Eigen::VectorXcd* out) const {
    const Eigen::Map<const Eigen::VectorXd> b(y.data(), n_), rate(y.data() + n_, n_);
    const auto shape = shape_.row(half);
    const double spin = shape * rate;
    const Complex tangent = std::polar(1.0, static_cast<double>(shape * b));
    out->head(n_) = (Complex(0.0, 1.0) * tangent) * shape.transpose();
    (*out)[n_] = tangent;
    (*out)[n_ + 1] = -spin * spin * tangent;
  }

  int n_;
  Eigen::MatrixXd shape_;  // half cell by shape
};

Recorder RunOf(const std::vector<std::string>& overrides) {
  SimulateOptions options;
  options.duration = kEnd;
  options.rate = kSamples / kEnd;
  options.rtol = 1e-6;
  return Record(Compile(ReadSet("flying_spaghetti/scene.toml", overrides)), options);
}

// Impulse 20 N s; centre of mass from (3, 4) by F / m, straight on.
TEST(FlyingSpaghetti, CentreOfMassGoesAsTheForceHasItWhateverBends) {
  const Recorder run = RunOf({});
  const auto px = run["momentum.x"], py = run["momentum.y"], x = run["centre.x"],
             y = run["centre.y"];
  double worst = 0.0, momentum = 0.0;
  for (std::size_t k = 0; k < run.t.size(); ++k) {
    const double on = std::min(run.t[k], kOff), after = run.t[k] - on;
    const double v = kForce / (kLength * kDensity) * on;
    worst =
        std::max({worst, std::fabs(x[k] - 3.0 - 0.5 * v * on - v * after), std::fabs(y[k] - 4.0)});
    momentum = std::max({momentum, std::fabs(px[k] - kForce * on), std::fabs(py[k])});
  }
  // Ten tolerances of the step, of a length of 10 m.
  ExpectWithin("flying spaghetti, centre of mass [m]", worst, 1e-4);
  ExpectWithin("flying spaghetti, momentum of 20 [kg m/s]", momentum, 1e-4);
}

// Stretching is left out on both sides. Beams and the lumps of rotary inertia are of second order:
// with ten beams 65 mm, with twenty (`make 20 500`) 19 mm, while the foot goes 9 m.
TEST(FlyingSpaghetti, EndsAgreeWithAFreeRod) {
  // The torque bends the foot, where the modes do not; 16 shapes differ by 0.3 mm.
  const FreeRod rod(12);
  reference::Integrator integrator;
  integrator.tolerance = 1e-6;
  integrator.guards = {[](double t, const auto&) { return kOff - t; }};
  const auto times = reference::EvenTimes(kEnd, kSamples);
  const auto states = integrator.Run(
      [&](double t, const auto& y, auto& rate) { rod.RightSide(t, y, rate); }, rod.Start(), times);
  std::vector<std::string> rigid;
  for (int b = 1; b <= 10; ++b) rigid.push_back("beam.b" + std::to_string(b) + ".axial=\"rigid\"");
  const Recorder run = RunOf(rigid);
  const auto fx = run["foot.x"], fy = run["foot.y"], hx = run["head.x"], hy = run["head.y"];
  double worst = 0.0, range = 0.0;
  for (std::size_t k = 0; k < times.size(); ++k) {
    const auto [foot, head] = rod.Ends(times[k], states[k]);
    worst = std::max(
        {worst, std::abs(foot - Complex(fx[k], fy[k])), std::abs(head - Complex(hx[k], hy[k]))});
    range = std::max(range, std::abs(foot - Complex(6.0, 0.0)));
  }
  EXPECT_GT(range, 0.5 * kLength);
  ExpectWithin("flying spaghetti, both ends against a free rod [m]", worst, 0.1);
}

}  // namespace
}  // namespace unfurl::sim::flying_spaghetti_test
