#include "calib/initial_guess.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/statistics.h"
#include "calib/direct_transform.h"

namespace unfurl::calib {
namespace {

constexpr double kLeastCondition = 1e-4;  // of the direct transform: below, another fits as well
constexpr double kLeastInFront = 0.6;     // share of a camera's points that must lie before it
constexpr double kLargestScale = 0.05;    // robust residual over the readings' own spread

void RefuseFlat(const Eigen::Matrix3Xd& p, double flatness, const std::string& what,
                const std::string& where) {
  const PointSpread spread = SpreadOf(p);
  if (spread.sigma(0) <= 0.0 || spread.sigma(1) < flatness * spread.sigma(0)) {
    throw Error(fmt::format("{} are collinear: {:.3g} mm across their line, {:.3g} mm along it",
                            what, 1e3 * spread.sigma(1), 1e3 * spread.sigma(0)),
                where, "survey points that fill the volume");
  }
  if (spread.sigma(2) < flatness * spread.sigma(0)) {
    throw Error(
        fmt::format("{} are coplanar: {:.3g} mm out of the plane with normal ({:.2f}, {:.2f}, "
                    "{:.2f}), {:.3g} mm along it",
                    what, 1e3 * spread.sigma(2), spread.normal(0), spread.normal(1),
                    spread.normal(2), 1e3 * spread.sigma(0)),
        where, "survey some points well off that plane");
  }
}

// Exponents of x and y in the terms of data::kCameraTerms.
constexpr int kPowers[10][2] = {{3, 0}, {1, 2}, {5, 0}, {3, 2}, {1, 4},
                                {2, 0}, {1, 1}, {0, 2}, {2, 1}, {0, 3}};

CameraPrior MakePrior(const data::RigCamera& camera, const Eigen::Matrix3Xd& p,
                      const GuessOptions& options) {
  const Eigen::Vector3d centre = p.rowwise().mean();
  CameraPrior prior;
  prior.e_mean = options.e_mean;
  prior.e_sigma = options.e_sigma;
  prior.axis = camera.R_CW.row(1);
  prior.along = prior.axis.dot(centre);
  prior.along_sigma = options.along_sigma_share * (centre - camera.p_WC).norm();

  const Eigen::Matrix3Xd p_C = camera.R_CW * (p.colwise() - camera.p_WC);
  std::vector<double> xs, ys;
  for (Eigen::Index i = 0; i < p_C.cols(); ++i) {
    if (p_C(2, i) <= 0.0) continue;
    xs.push_back(std::abs(p_C(0, i) / p_C(2, i)));
    ys.push_back(std::abs(p_C(1, i) / p_C(2, i)));
  }
  // The edge by a quantile: gross errors of the survey reach further.
  const double x = Quantile(xs, 0.95), y = Quantile(ys, 0.95);
  for (std::size_t k = 0; k < prior.term_sigma_px.size(); ++k) {
    const int order = kPowers[k][0] + kPowers[k][1];
    const bool even = kPowers[k][0] % 2 == 0 || kPowers[k][1] % 2 == 1;
    const double at_edge = even         ? options.even_sigma_px
                           : order == 3 ? options.cubic_sigma_px
                                        : options.quintic_sigma_px;
    prior.term_unit_px[k] = 1.0 / (std::pow(x, kPowers[k][0]) * std::pow(y, kPowers[k][1]));
    prior.term_sigma_px[k] = at_edge * prior.term_unit_px[k];
  }
  return prior;
}

CameraGuess GuessCamera(const Observations& data, int index, const GuessOptions& options,
                        const std::string& where) {
  const std::string& name = data.cameras[static_cast<std::size_t>(index)];
  const Observations own = SelectCamera(data, index);
  const auto n = static_cast<int>(own.readings.size());
  if (n < options.fewest_points) {
    throw Error(fmt::format("camera \"{}\" sees {} of the points", name, n), where,
                fmt::format("survey at least {} that it sees", options.fewest_points));
  }
  Eigen::Matrix3Xd p(3, n);
  Eigen::VectorXd u(n);
  for (int k = 0; k < n; ++k) {
    p.col(k) = own.p.col(own.readings[static_cast<std::size_t>(k)].point);
    u(k) = own.readings[static_cast<std::size_t>(k)].u_px;
  }
  RefuseFlat(p, options.flatness, fmt::format("the points that camera \"{}\" sees", name), where);

  const RobustDirectFit direct = FitDirectRobust(
      p, u, Rng(options.seed).Stream("direct transform", static_cast<std::uint64_t>(index)));
  CameraGuess guess;
  guess.readings = n;
  guess.camera = CameraFromDirect(direct.fit.transform, p.rowwise().mean());
  guess.camera.name = name;
  guess.camera.e = options.e_mean;
  const Eigen::RowVectorXd depth = guess.camera.R_CW.row(2) * (p.colwise() - guess.camera.p_WC);
  const std::vector<double> readings(u.data(), u.data() + n);
  const bool in_front = static_cast<double>((depth.array() > 0.0).count()) >= kLeastInFront * n;
  if (direct.fit.condition < kLeastCondition || !in_front ||
      !(direct.sigma_px < kLargestScale * (Quantile(readings, 0.95) - Quantile(readings, 0.05)))) {
    throw Error(fmt::format("the readings of camera \"{}\" do not fit any camera at the surveyed "
                            "points (they miss by {:.3g} px)",
                            name, direct.sigma_px),
                where, "check that readings and points belong together and fill the volume");
  }
  guess.prior = MakePrior(guess.camera, p, options);

  // Lens error is in the first scale and, once the terms are fitted, not in the second.
  guess.sigma_px = std::max(direct.sigma_px, 1e-6);
  BundleOptions resection;
  resection.fix_points = true;
  for (int pass = 0; pass < 3; ++pass) {
    BundleState state{{guess.camera}, own.p};
    const BundleSummary summary =
        SolveBundle(own, {guess.prior}, EqualWeighting(own, guess.sigma_px), resection, &state);
    guess.camera = state.cameras[0];
    guess.sigma_px = std::max(RobustSigma(summary.residual_px), 1e-9);
  }
  return guess;
}

}  // namespace

PointSpread SpreadOf(const Eigen::Matrix3Xd& p) {
  const Eigen::Matrix3Xd centred = p.colwise() - p.rowwise().mean();
  const Eigen::Matrix3d moments =
      centred * centred.transpose() / std::max<double>(1.0, static_cast<double>(p.cols()));
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(moments);
  return {eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().reverse(), eigen.eigenvectors().col(0)};
}

std::vector<CameraGuess> GuessCameras(const Observations& data, const GuessOptions& options,
                                      const std::string& where) {
  if (data.points() < options.fewest_points) {
    throw Error(fmt::format("the survey has {} points", data.points()), where,
                fmt::format("survey at least {}", options.fewest_points));
  }
  RefuseFlat(data.p, options.flatness, "the survey's points", where);
  std::vector<CameraGuess> out;
  for (int j = 0; j < data.camera_count(); ++j) {
    out.push_back(GuessCamera(data, j, options, where));
  }
  return out;
}

}  // namespace unfurl::calib
