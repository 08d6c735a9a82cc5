#include "calib/weak.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "base/dense.h"
#include "calib/covariance.h"
#include "calib/initial_guess.h"
#include "calib/parameters.h"
#include "measure/camera_model.h"
#include "measure/triangulate.h"

namespace unfurl::calib {
namespace {

using Vector = Eigen::Matrix<double, kParameters, 1>;
using Matrix = Eigen::Matrix<double, kParameters, kParameters>;

// What one would notice of a camera's parameters (weak.h): of rotation [rad], of place and of e
// over the distance to the volume, of the image scale over itself, of offset and terms over the
// row.
constexpr double kRotation = 1e-3, kPlace = 3e-3, kCentres = 1.5e-3, kScale = 1e-3, kOffset = 1e-3,
                 kTerm = 5e-4;
constexpr double kPart = 0.15;       // share of a direction's square that is worth a word
constexpr double kHarmless = 0.1;    // of the calibration's variance of points
constexpr double kNearPlane = 0.25;  // least spread over the largest: below, more depth is advised
constexpr double kGap = 0.15;        // of the sensor's row without a reading
constexpr double kReading = 1.4e-5;  // a reading's sigma over the row, where it only weighs
// Surveyed points to each free parameter of a camera: the calibration's part of an error goes with
// the root of parameters over readings.
constexpr int kFewPerParameter = 5;
constexpr int kGrid = 5;  // points along each edge of the volume; 125 in all

// Decimals that show hundredths of a length [m], whether of a hinge or of a wing.
int DecimalsOf(double length) {
  return length > 0.0 ? std::clamp(2 - static_cast<int>(std::floor(std::log10(length))), 0, 9) : 2;
}

// Of the camera with most: its pose and image, and the lens terms, each as far as the data tell it
// and not its prior.
double MostFreeParameters(const data::Rig& rig, const std::vector<CameraPrior>& priors) {
  double most = 0.0;
  for (std::size_t j = 0; j < priors.size(); ++j) {
    const auto variance =
        rig.covariance.diagonal().segment<kParameters>(kParameters * static_cast<Eigen::Index>(j));
    double free = static_cast<double>((variance.head<data::kFirstTerm>().array() > 0.0).count());
    for (int k = 0; k < kTerms; ++k) {
      const double sigma = priors[j].term_sigma_px[static_cast<std::size_t>(k)];
      if (sigma > 0.0) {
        free += std::max(0.0, 1.0 - variance(data::kFirstTerm + k) / (sigma * sigma));
      }
    }
    most = std::max(most, free);
  }
  return most;
}

// What a parameter is called, and its unit.
struct Word {
  std::string text;
  const char* unit;
};

Word WordOf(int parameter, data::LensModel lens) {
  constexpr std::array<std::array<const char*, 2>, data::kFirstTerm> kWords = {
      {{"rotation about the sensor's row", "rad"},
       {"rotation about the lens axis", "rad"},
       {"rotation about the optical axis", "rad"},
       {"place along the sensor's row", "m"},
       {"place along its lens axis", "m"},
       {"distance to the scene", "m"},
       {"image scale f", "px"},
       {"offset u0", "px"},
       {"distance between the two centres e", "m"}}};
  const auto k = static_cast<std::size_t>(parameter);
  if (k < kWords.size()) return {kWords[k][0], kWords[k][1]};
  return {std::string("term ") + data::NamesOf(lens).terms[k - kWords.size()], "px"};
}

// What one would notice of each parameter.
Vector Units(const data::RigCamera& camera, const CameraPrior& prior, double distance) {
  Vector units;
  units << Eigen::Vector3d::Constant(kRotation), Eigen::Vector3d::Constant(kPlace * distance),
      kScale * camera.f_px, kOffset * camera.pixels, kCentres * distance,
      Vector::Ones().tail<kTerms>();
  for (int k = 0; k < kTerms; ++k) {
    const double unit = prior.term_unit_px[static_cast<std::size_t>(k)];
    if (unit > 0.0) units(data::kFirstTerm + k) = kTerm * camera.pixels * unit;
  }
  return units;
}

std::string Advice(int main_part, bool harmless, const data::RigCamera& camera) {
  const std::string name = "\"" + camera.name + "\"";
  if (harmless) return "its effect on reconstructed points is negligible: no action needed";
  switch (main_part) {
    case 5:
    case 6:
      return "survey points nearer to and farther from camera " + name;
    case 0:
    case 2:
    case 4:
    case 8:
      return "survey points at both ends of what camera " + name + " sees along its lens axis";
    default:
      return "survey more points at the edges of what camera " + name + " sees";
  }
}

// Points of a grid over the volume, each with the readings that the rig itself predicts.
struct GridPoint {
  measure::PointSolution solution;
  Eigen::MatrixXd of_cameras;  // dP / dc, 3 x 31 c
};

std::vector<GridPoint> Grid(const data::Rig& rig) {
  const measure::Triangulator triangulator(rig, {.residual_level = 1e-12});
  const std::size_t cameras = rig.cameras.size();
  std::vector<double> u(cameras), s;
  for (const data::RigCamera& camera : rig.cameras) s.push_back(kReading * camera.pixels);
  std::vector<GridPoint> out;
  const Eigen::Vector3d span = rig.volume_high - rig.volume_low;
  for (int i = 0; i < kGrid * kGrid * kGrid; ++i) {
    const int plane = i / (kGrid * kGrid), row = i / kGrid % kGrid;
    const Eigen::Vector3d at(i % kGrid, row, plane);
    const Eigen::Vector3d p =
        rig.volume_low + span.cwiseProduct((at.array() + 0.5).matrix()) / kGrid;
    std::uint32_t use = 0;
    for (std::size_t c = 0; c < cameras; ++c) {
      if (measure::Project(rig.cameras[c], p, &u[c]) && u[c] >= 0.0 &&
          u[c] < rig.cameras[c].pixels) {
        use |= 1U << c;
      }
    }
    GridPoint point;
    point.solution = triangulator.Solve(u, s, p, use);
    if (point.solution.outcome != measure::PointOutcome::kSolved) continue;
    point.of_cameras.setZero(3, kParameters * static_cast<Eigen::Index>(cameras));
    for (std::size_t c = 0; c < cameras; ++c) {
      measure::Projection h;
      if ((point.solution.cameras >> c & 1U) == 0 || !measure::Project(rig.cameras[c], p, &h)) {
        continue;
      }
      const double floor = data::FloorOf(rig, c);
      const double w = 1.0 / (s[c] * s[c] + floor * floor);
      point.of_cameras.middleCols(kParameters * static_cast<Eigen::Index>(c), kParameters) =
          -w * point.solution.cov * h.du_dp.transpose() * h.du_dc;
    }
    out.push_back(std::move(point));
  }
  return out;
}

double ErrorRms(const std::vector<GridPoint>& grid, const Eigen::MatrixXd& covariance) {
  double squares = 0.0;
  for (const GridPoint& point : grid) {
    squares += (point.of_cameras * covariance * point.of_cameras.transpose()).trace();
  }
  return grid.empty() ? 0.0 : std::sqrt(squares / static_cast<double>(grid.size()));
}

std::string NameOf(const Vector& direction, int main_part, data::LensModel lens) {
  std::vector<std::pair<double, int>> parts;
  for (int k = 0; k < kParameters; ++k) {
    const double share = direction(k) * direction(k);
    if (share >= kPart || k == main_part) parts.push_back({-share, k});
  }
  std::sort(parts.begin(), parts.end());
  std::string name;
  for (std::size_t k = 0; k < parts.size(); ++k) {
    if (k > 0) name += k + 1 == parts.size() ? " together with " : ", ";
    name += WordOf(parts[k].second, lens).text;
  }
  return name;
}

}  // namespace

double CalibrationErrorRms(const data::Rig& rig) { return ErrorRms(Grid(rig), rig.covariance); }

std::vector<WeakDirection> FindWeak(const data::Rig& rig, const std::vector<CameraPrior>& priors,
                                    const Eigen::MatrixXd& information) {
  const Eigen::Index all_cameras = kParameters * static_cast<Eigen::Index>(priors.size());
  const Eigen::MatrixXd covariance =
      CameraCovariance(information).topLeftCorner(all_cameras, all_cameras);
  const Eigen::MatrixXd prior_information = PriorInformation(priors);
  const std::vector<GridPoint> grid = Grid(rig);
  const double all = ErrorRms(grid, rig.covariance);
  std::vector<WeakDirection> out;
  for (std::size_t j = 0; j < priors.size(); ++j) {
    const auto first = kParameters * static_cast<Eigen::Index>(j);
    const data::RigCamera& camera = rig.cameras[j];
    // Places in the camera's own directions, everything in units of what one would notice.
    Matrix turn = Matrix::Identity();
    turn.block<3, 3>(3, 3) = camera.R_CW;
    const double distance = (0.5 * (rig.volume_low + rig.volume_high) - camera.p_WC).norm();
    const Vector units = Units(camera, priors[j], distance);
    Eigen::MatrixXd scaled = units.cwiseInverse().asDiagonal() * turn *
                             covariance.block<kParameters, kParameters>(first, first) *
                             turn.transpose() * units.cwiseInverse().asDiagonal();
    for (int k = 0; k < kTerms; ++k) {
      if (!priors[j].Fixed(k)) continue;
      scaled.row(data::kFirstTerm + k).setZero();
      scaled.col(data::kFirstTerm + k).setZero();
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scaled);
    for (int k = kParameters - 1; k >= 0; --k) {
      const double width = std::sqrt(std::max(eigen.eigenvalues()(k), 0.0));
      if (width <= 1.0) break;
      const Vector v = eigen.eigenvectors().col(k);
      WeakDirection weak;
      weak.camera = static_cast<int>(j);
      int main_part = 0;
      v.cwiseAbs().maxCoeff(&main_part);
      weak.name = NameOf(v, main_part, camera.lens);
      weak.unit = WordOf(main_part, camera.lens).unit;
      weak.sigma = width * std::abs(v(main_part)) * units(main_part);
      // What a change by one sigma along it does to points, and what the priors say against it.
      // The rest of the rig follows as it is correlated with it.
      const Vector own = turn.transpose() * units.cwiseProduct(v);
      const Vector dual = turn.transpose() * v.cwiseQuotient(units);
      const Eigen::VectorXd change = covariance.middleCols<kParameters>(first) * dual / width;
      weak.by_prior = std::min(
          1.0, width * width *
                   own.dot(prior_information.block<kParameters, kParameters>(first, first) * own));
      double squares = 0.0;
      for (const GridPoint& point : grid) squares += (point.of_cameras * change).squaredNorm();
      weak.point_rms = grid.empty() ? 0.0 : std::sqrt(squares / static_cast<double>(grid.size()));
      weak.harmless = weak.point_rms * weak.point_rms < kHarmless * all * all;
      weak.advice = Advice(main_part, weak.harmless, camera);
      out.push_back(weak);
    }
  }
  return out;
}

std::vector<std::string> SurveyAdvice(const Observations& data, const Weighting& weighting,
                                      const data::Rig& rig, const std::vector<CameraPrior>& priors,
                                      bool lenses_known) {
  std::vector<std::string> out;
  std::vector<int> used;
  for (int i = 0; i < data.points(); ++i) {
    if (weighting.UsesSurvey(static_cast<std::size_t>(i))) used.push_back(i);
  }
  const Eigen::Matrix3Xd p = data.p(Eigen::all, used);
  const PointSpread spread = SpreadOf(p);
  if (spread.sigma(2) < kNearPlane * spread.sigma(0)) {
    const Eigen::Vector3d centre = p.rowwise().mean();
    const double away = 2.0 * kNearPlane * spread.sigma(0);
    const bool level = std::abs(spread.normal.z()) > 0.9;
    const int decimals = DecimalsOf(spread.sigma(0));
    out.push_back(fmt::format(
        "the points lie within {:.{}f} m (one sigma) of one plane with normal ({:.2f}, {:.2f}, "
        "{:.2f}): measure some {}",
        spread.sigma(2), decimals, spread.normal.x(), spread.normal.y(), spread.normal.z(),
        level ? fmt::format("at z > {:.{}f} m and z < {:.{}f} m", centre.z() + away, decimals,
                            centre.z() - away, decimals)
              : fmt::format("{:.{}f} m and more to either side of it", away, decimals)));
  }
  if (static_cast<double>(used.size()) < kFewPerParameter * MostFreeParameters(rig, priors)) {
    out.push_back(
        fmt::format("{} points calibrate the rig: four times as many would halve the calibration's "
                    "part of the error",
                    used.size()));
  }
  if (lenses_known) return out;  // what the survey does not show of a row another one did
  for (std::size_t j = 0; j < rig.cameras.size(); ++j) {
    const double row = rig.cameras[j].pixels;
    std::vector<double> u = {0.0, row};
    for (std::size_t k = 0; k < data.readings.size(); ++k) {
      if (data.readings[k].camera == static_cast<int>(j) && weighting.Uses(k)) {
        u.push_back(std::clamp(data.readings[k].u_px, 0.0, row));
      }
    }
    std::sort(u.begin(), u.end());
    for (std::size_t k = 1; k < u.size(); ++k) {
      if (u[k] - u[k - 1] < kGap * row) continue;
      out.push_back(fmt::format(
          "camera \"{}\" has no reading from pixel {:.0f} to {:.0f}: points that fall there rest "
          "on extrapolation",
          rig.cameras[j].name, u[k - 1], u[k]));
    }
  }
  return out;
}

}  // namespace unfurl::calib
