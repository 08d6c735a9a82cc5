#include "sim/kirchhoff/tapered_shapes.h"

#include <Eigen/Dense>
#include <array>
#include <cmath>

#include "sim/kirchhoff/legendre.h"

namespace unfurl::sim {
namespace {

// Of the sum beyond the modes asked for: the highest of them is then right to 1e-6 at tapers from a
// fifth on (tests/sim/tapered_test.cc), and what is left is a matter of the basis, not of energy.
constexpr int kMoreTerms = 8;
// Points of an integral: at the smallest taper the stiffness falls within a twentieth of the beam.
constexpr int kTaperedPoints = 64;

// The density over its mean, as a polynomial in the distance from the start.
std::array<double, 3> DensityOf(const data::BeamSection& section) {
  const double t = section.taper - 1.0, volume = section.Volume(1.0);
  const bool both = section.of == data::BeamSection::Of::kBoth;
  return {1.0 / volume, (both ? 2.0 * t : t) / volume, (both ? t * t : 0.0) / volume};
}

// The moment in a free beam that a unit moment at its start (or force: the moment's slope there)
// bends, held by the beam's inertia: M'' = density (a + b x), M and M' zero at the end.
std::vector<double> MomentOf(bool moment, const data::BeamSection& section) {
  const std::array<double, 3> density = DensityOf(section);
  std::array<double, 3> m{};  // its moments
  for (int n = 0; n < 3; ++n) {
    for (int k = 0; k < 3; ++k) m[n] += density[k] / (n + k + 1);
  }
  // a m0 + b m1 = -M'(0), a (m0 - m1) + b (m1 - m2) = -M(0) - M'(0).
  const double rate = moment ? 0.0 : -1.0, value = -1.0;
  const double determinant = m[0] * (m[1] - m[2]) - m[1] * (m[0] - m[1]);
  const double a = (rate * (m[1] - m[2]) - m[1] * value) / determinant;
  const double b = (m[0] * value - (m[0] - m[1]) * rate) / determinant;
  std::vector<double> out = {moment ? 1.0 : 0.0, moment ? 0.0 : 1.0, 0.0, 0.0, 0.0, 0.0};
  for (int k = 0; k < 3; ++k) {
    out[k + 2] += density[k] * a / ((k + 1) * (k + 2));
    out[k + 3] += density[k] * b / ((k + 2) * (k + 3));
  }
  return out;
}

double PolynomialAt(const std::vector<double>& c, double x) {
  double value = 0.0;
  for (std::size_t k = c.size(); k-- > 0;) value = value * x + c[k];
  return value;
}

}  // namespace

TaperedShapes::TaperedShapes(const data::BeamSection& section, int modes) : section_(section) {
  GaussPoints(kTaperedPoints, &x_, &weight_);
  data::BeamSection backwards = section;
  backwards.taper = 1.0 / section.taper;
  for (const data::BeamSection& from : {section, backwards}) {
    for (const bool moment : {true, false}) statics_.push_back(MomentOf(moment, from));
  }
  FindModes(modes);
  for (int k = 0; k < kFirstMode + modes; ++k) means_.push_back(Integral(k, 1.0, true));
}

double TaperedShapes::Moment(int shape, double x) const {
  if (shape < kFirstMode) {
    return PolynomialAt(statics_[shape], shape < kMomentAtEnd ? x : 1.0 - x);
  }
  const std::vector<double>& c = modes_[shape - kFirstMode];
  const std::vector<double> p = Legendre(static_cast<int>(c.size()) - 1, 2.0 * x - 1.0);
  double sum = 0.0;
  for (std::size_t k = 0; k < c.size(); ++k) sum += c[k] * p[k];
  return x * x * (1.0 - x) * (1.0 - x) * sum;
}

double TaperedShapes::Slope(int shape, double x) const {
  return Moment(shape, x) / section_.Bending(x);
}

// Of the slope up to a place; `mean`: that of this over the beam.
double TaperedShapes::Integral(int shape, double to, bool mean) const {
  double sum = 0.0;
  for (int q = 0; q < kTaperedPoints; ++q) {
    const double at = to * x_[q];
    sum += to * weight_[q] * (mean ? 1.0 - at : 1.0) * Slope(shape, at);
  }
  return sum;
}

double TaperedShapes::Angle(int shape, double x) const {
  return Integral(shape, x, false) - means_[shape];
}

void TaperedShapes::FindModes(int modes) {
  const int terms = modes + kMoreTerms, points = kTaperedPoints;
  modes_.assign(terms, {});
  for (int k = 0; k < terms; ++k) {
    modes_[k].assign(terms, 0.0);
    modes_[k][k] = 1.0;
  }
  // Slopes at the points, and deflections: twice integrated.
  Eigen::MatrixXd slope(terms, points), deflection(terms, points);
  Eigen::VectorXd mass(points), stiff(points), arm(points);
  for (int r = 0; r < points; ++r) {
    mass[r] = weight_[r] * section_.Area(x_[r]) / section_.Volume(1.0);
    stiff[r] = weight_[r] * section_.Bending(x_[r]);
    arm[r] = x_[r] - section_.Centre();
    for (int k = 0; k < terms; ++k) {
      slope(k, r) = Slope(kFirstMode + k, x_[r]);
      double sum = 0.0;
      for (int q = 0; q < points; ++q) {
        const double at = x_[r] * x_[q];
        sum += x_[r] * weight_[q] * (x_[r] - at) * Slope(kFirstMode + k, at);
      }
      deflection(k, r) = sum;
    }
  }
  // A free beam's modes neither move its centre nor turn it.
  const double inertia = mass.dot(arm.cwiseAbs2());
  for (int k = 0; k < terms; ++k) {
    const Eigen::VectorXd y = deflection.row(k);
    const double move = mass.dot(y), turn = (mass.cwiseProduct(arm)).dot(y) / inertia;
    deflection.row(k) -= (move * Eigen::VectorXd::Ones(points) + turn * arm).transpose();
  }
  const Eigen::MatrixXd S = slope * stiff.asDiagonal() * slope.transpose();
  const Eigen::MatrixXd M = deflection * mass.asDiagonal() * deflection.transpose();
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> solver(S, M);
  modes_.resize(modes);
  for (int k = 0; k < modes; ++k) {
    for (int j = 0; j < terms; ++j) modes_[k][j] = solver.eigenvectors()(j, k);
  }
}

}  // namespace unfurl::sim
