#include "sim/kirchhoff/kirchhoff_shapes.h"

#include <Eigen/Dense>
#include <cmath>
#include <vector>

#include "sim/kirchhoff/legendre.h"
#include "sim/kirchhoff/tapered_shapes.h"

namespace unfurl::sim {
namespace {

// int_0^x P_k(2 x' - 1) dx' less its mean over [0, 1], k < n.
std::vector<double> CentredIntegrals(int n, double x) {
  const std::vector<double> p = Legendre(n, 2.0 * x - 1.0);
  std::vector<double> integral(n);
  integral[0] = x - 0.5;
  for (int k = 1; k < n; ++k) integral[k] = (p[k + 1] - p[k - 1]) / (2.0 * (2 * k + 1));
  if (n > 1) integral[1] += 1.0 / 6.0;  // the others have none
  return integral;
}

// Points that integrate accelerations to 1e-4 of the largest with any of these numbers of modes,
// the rod bent by a fifth of a radian, and low frequencies to 1e-7; what is left out of the space
// is more. Energy is kept whatever their number, since it is the same sum.
int PointsFor(int modes) { return 8 + 4 * (modes / 2); }

// Angle and slope of the free beam's modes, k = 0 the first; z = x - 1/2. Symmetric modes have
//   slope cosh(b z) / cosh(b / 2) - cos(b z) / cos(b / 2),   tanh(b / 2) + tan(b / 2) = 0.
double WaveNumber(int k) {
  double b = (k + 1.5) * M_PI;
  const double sign = k % 2 == 0 ? 1.0 : -1.0;
  for (int i = 0; i < 6; ++i) {
    const double t = std::tanh(0.5 * b), c = std::cos(0.5 * b);
    const double value = t + sign * std::tan(0.5 * b);
    b -= value / (0.5 * (1.0 - t * t) + sign * 0.5 / (c * c));
  }
  return b;
}
double ModeSlope(int k, double z) {
  const double b = WaveNumber(k);
  if (k % 2 == 0)
    return std::cosh(b * z) / std::cosh(0.5 * b) - std::cos(b * z) / std::cos(0.5 * b);
  return std::sinh(b * z) / std::sinh(0.5 * b) - std::sin(b * z) / std::sin(0.5 * b);
}
double ModeAngle(int k, double z) {
  const double b = WaveNumber(k);
  if (k % 2 == 0) {
    return (std::sinh(b * z) / std::cosh(0.5 * b) - std::sin(b * z) / std::cos(0.5 * b)) / b;
  }
  return (std::cosh(b * z) / std::sinh(0.5 * b) + std::cos(b * z) / std::sin(0.5 * b)) / b -
         4.0 / (b * b);
}

// A unit moment, or force times length, at the start of a free beam, held by its inertia: the
// slope (curvature) is 1 - 3 x^2 + 2 x^3, or x (1 - x)^2.
double StaticSlope(bool moment, double x) {
  return moment ? 1.0 - 3.0 * x * x + 2.0 * x * x * x : x * (1.0 - x) * (1.0 - x);
}
double StaticAngle(bool moment, double x) {
  const double x2 = x * x;
  return moment ? x - x * x2 + 0.5 * x2 * x2 - 0.35
                : 0.5 * x2 - 2.0 / 3.0 * x * x2 + 0.25 * x2 * x2 - 0.05;
}

}  // namespace

KirchhoffShapes::KirchhoffShapes(int mode_count, Ends which_ends, const data::BeamSection& section,
                                 int strains)
    : modes(mode_count),
      ends(which_ends),
      bends(modes + ends.count()),
      stretches(strains),
      count(bends + stretches),
      points(PointsFor(modes)),
      width(PaddedSize(count + 1)),
      shape(points * width, 0.0),
      kernel(points * points, 0.0),
      stiffness(width, 0.0),
      section_(section) {
  GaussPoints(points, &x, &weight);
  // Arms are polynomials of degree `points`: integrated to rounding.
  Array fine, fine_weight;
  GaussPoints(points + 2, &fine, &fine_weight);
  if (!section.uniform()) {
    tapered_ = std::make_shared<const TaperedShapes>(section, modes);
    centre_.assign(points, 0.0);
    for (std::size_t r = 0; r < fine.size(); ++r) {
      const std::vector<double> integral = CentredIntegrals(points, fine[r]);
      const double part = fine_weight[r] * section.Area(fine[r]) / section.Volume(1.0);
      for (int k = 0; k < points; ++k) centre_[k] += part * integral[k];
    }
  }
  for (std::size_t r = 0; r < fine.size(); ++r) {
    const Array arm = Arm(fine[r]);
    if (tapered_ != nullptr) fine_weight[r] *= section.Area(fine[r]) / section.Volume(1.0);
    for (int a = 0; a < points; ++a) {
      for (int b = 0; b < points; ++b) kernel[a * points + b] += fine_weight[r] * arm[a] * arm[b];
    }
  }
  Diagonalize();
  if (stretches > 0) DiagonalizeStrains();
  for (int q = 0; q < points; ++q) {
    for (int k = 0; k <= count; ++k) shape[q * width + k] = Shape(k, x[q]);
  }
}

// Natural modes in the space of the raw shapes.
void KirchhoffShapes::Diagonalize() {
  constexpr int kFine = 64;  // points; the highest mode has six waves
  Array at, at_weight;
  GaussPoints(kFine, &at, &at_weight);
  Eigen::MatrixXd angles(bends, kFine), slopes(bends, kFine), coarse(bends, points);
  for (int k = 0; k < bends; ++k) {
    for (int r = 0; r < kFine; ++r) {
      angles(k, r) = RawShape(k, at[r]);
      slopes(k, r) = RawSlope(k, at[r]);
    }
    for (int q = 0; q < points; ++q) coarse(k, q) = RawShape(k, x[q]);
  }
  const Eigen::Map<const Eigen::VectorXd> w(at_weight.data(), kFine);
  const Eigen::Map<const Eigen::MatrixXd> K(kernel.data(), points, points);
  Eigen::VectorXd stiff = w;
  for (int r = 0; r < kFine && tapered_ != nullptr; ++r) stiff[r] *= section_.Bending(at[r]);
  const Eigen::MatrixXd S = slopes * stiff.asDiagonal() * slopes.transpose();
  const Eigen::MatrixXd M = coarse * K * coarse.transpose();
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> solver(S, M);
  mix_.assign(bends * bends, 0.0);
  for (int k = 0; k < bends; ++k) {
    const Eigen::VectorXd v = solver.eigenvectors().col(k);
    const double square = (angles.transpose() * v).cwiseAbs2().dot(w);
    for (int j = 0; j < bends; ++j) mix_[k * bends + j] = v[j] / std::sqrt(square);
    stiffness[k + 1] = v.dot(S * v) / square;
  }
}

// The same of the strains; a table of them besides.
void KirchhoffShapes::DiagonalizeStrains() {
  constexpr int kFine = 64;  // points; the highest strain is of degree twelve
  Array at, at_weight;
  GaussPoints(kFine, &at, &at_weight);
  const auto raw = [&](const Array& places) {
    Eigen::MatrixXd out(stretches, places.size());
    for (std::size_t r = 0; r < places.size(); ++r) {
      const std::vector<double> p = Legendre(stretches, 2.0 * places[r] - 1.0);
      for (int j = 0; j < stretches; ++j) out(j, r) = p[j] / section_.Area(places[r]);
    }
    return out;
  };
  const Eigen::MatrixXd fine = raw(at), coarse = raw(x);
  const Eigen::Map<const Eigen::VectorXd> w(at_weight.data(), kFine);
  const Eigen::Map<const Eigen::MatrixXd> K(kernel.data(), points, points);
  Eigen::VectorXd stiff = w;
  for (int r = 0; r < kFine; ++r) stiff[r] *= section_.Area(at[r]);
  const Eigen::MatrixXd S = fine * stiff.asDiagonal() * fine.transpose();
  const Eigen::MatrixXd M = coarse * K * coarse.transpose();
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> solver(S, M);
  strain_mix_.assign(stretches * stretches, 0.0);
  strain.assign(points * width, 0.0);
  for (int j = 0; j < stretches; ++j) {
    const Eigen::VectorXd v = solver.eigenvectors().col(j);
    const double square = (fine.transpose() * v).cwiseAbs2().dot(w);
    for (int i = 0; i < stretches; ++i) strain_mix_[j * stretches + i] = v[i] / std::sqrt(square);
    stiffness[bends + 1 + j] = v.dot(S * v) / square;
    for (int q = 0; q < points; ++q) strain[q * width + bends + 1 + j] = Strain(j, x[q]);
  }
}

// Of raw shape k what TaperedShapes calls it.
int KirchhoffShapes::KindOf(int k) const {
  if (ends.moment_at_start && k-- == 0) return TaperedShapes::kMomentAtStart;
  if (ends.force_at_start && k-- == 0) return TaperedShapes::kForceAtStart;
  if (ends.moment_at_end && k-- == 0) return TaperedShapes::kMomentAtEnd;
  if (ends.force_at_end && k-- == 0) return TaperedShapes::kForceAtEnd;
  return TaperedShapes::kFirstMode + k;
}

double KirchhoffShapes::RawShape(int k, double at) const {
  const int kind = KindOf(k);
  if (tapered_ != nullptr) return tapered_->Angle(kind, at);
  if (kind >= TaperedShapes::kFirstMode)
    return ModeAngle(kind - TaperedShapes::kFirstMode, at - 0.5);
  const bool moment = kind == TaperedShapes::kMomentAtStart || kind == TaperedShapes::kMomentAtEnd;
  if (kind < TaperedShapes::kMomentAtEnd) return StaticAngle(moment, at);
  return -StaticAngle(moment, 1.0 - at);
}

double KirchhoffShapes::RawSlope(int k, double at) const {
  const int kind = KindOf(k);
  if (tapered_ != nullptr) return tapered_->Slope(kind, at);
  if (kind >= TaperedShapes::kFirstMode)
    return ModeSlope(kind - TaperedShapes::kFirstMode, at - 0.5);
  const bool moment = kind == TaperedShapes::kMomentAtStart || kind == TaperedShapes::kMomentAtEnd;
  return StaticSlope(moment, kind < TaperedShapes::kMomentAtEnd ? at : 1.0 - at);
}

double KirchhoffShapes::Shape(int k, double at) const {
  if (k == 0) return 1.0;
  double sum = 0.0;
  for (int j = 0; j < bends && k <= bends; ++j) {
    sum += mix_[(k - 1) * bends + j] * RawShape(j, at);
  }
  return sum;
}

double KirchhoffShapes::Slope(int k, double at) const {
  double sum = 0.0;
  for (int j = 0; j < bends && k > 0 && k <= bends; ++j) {
    sum += mix_[(k - 1) * bends + j] * RawSlope(j, at);
  }
  return sum;
}

double KirchhoffShapes::Strain(int j, double at) const {
  const std::vector<double> p = Legendre(stretches, 2.0 * at - 1.0);
  double sum = 0.0;
  for (int i = 0; i < stretches; ++i) sum += strain_mix_[j * stretches + i] * p[i];
  return sum / section_.Area(at);
}

Array KirchhoffShapes::Arm(double at) const {
  std::vector<double> integral = CentredIntegrals(points, at);
  for (int k = 0; k < points && tapered_ != nullptr; ++k) integral[k] -= centre_[k];
  Array arm(points, 0.0);
  for (int q = 0; q < points; ++q) {
    const std::vector<double> p = Legendre(points, 2.0 * x[q] - 1.0);
    for (int k = 0; k < points; ++k) arm[q] += (2 * k + 1) * weight[q] * p[k] * integral[k];
  }
  return arm;
}

Array KirchhoffShapes::ShapesAt(double at) const {
  Array row(width, 0.0);
  for (int k = 0; k <= count; ++k) row[k] = Shape(k, at);
  return row;
}

}  // namespace unfurl::sim
