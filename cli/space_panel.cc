#include "cli/space_panel.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "measure/camera_model.h"

namespace unfurl::cli {

namespace {

using report::Place;

// Steepest ray that is drawn, X / Z or Y / Z: 63 degrees from the axis, beyond any lens of a line
// camera [-].
constexpr double kSteepest = 2.0;

Eigen::Vector3d Vector(const Place& at) { return {at[0], at[1], at[2]}; }

// The point of slopes x, y at a depth, as seen in the camera, in W [m].
Eigen::Vector3d Along(const data::RigCamera& camera, double x, double y, double depth) {
  return camera.p_WC + camera.R_CW.transpose() * Eigen::Vector3d(x, y, 1.0) * depth;
}

// The slope x at which a reading leaves the row, outwards from the axis in direction `sign`.
double EndOfRow(const data::RigCamera& camera, double y, double depth, double sign) {
  const auto on_row = [&](double x) {
    double u = 0.0;
    return measure::Project(camera, Along(camera, x, y, depth), &u) && u >= 0.0 &&
           u <= camera.pixels - 1.0;
  };
  constexpr double kStep = 0.01;  // far below any field's width [-]
  double inside = 0.0;
  while (inside < kSteepest && on_row(sign * (inside + kStep))) inside += kStep;
  double outside = inside + kStep;
  for (int k = 0; k < 20; ++k) {  // 1e-8: far below what is seen
    const double middle = 0.5 * (inside + outside);
    (on_row(sign * middle) ? inside : outside) = middle;
  }
  return sign * inside;
}

std::vector<Place> FieldOf(const data::RigCamera& camera, const Place& low, const Place& high) {
  const auto in_camera = [&](const Eigen::Vector3d& p) -> Eigen::Vector3d {
    return camera.R_CW * (p - camera.p_WC);
  };
  const double depth = in_camera(0.5 * (Vector(low) + Vector(high))).z();
  if (!(depth > 0.0)) return {};
  double least = kSteepest, most = -kSteepest;
  for (unsigned k = 0; k < 8; ++k) {
    const Eigen::Vector3d corner((k & 1U) != 0 ? high[0] : low[0], (k & 2U) != 0 ? high[1] : low[1],
                                 (k & 4U) != 0 ? high[2] : low[2]);
    // At the middle's depth: the field shall cover the volume there, not what is nearer.
    const double y = in_camera(corner).y() / depth;
    least = std::clamp(y, -kSteepest, least);
    most = std::clamp(y, most, kSteepest);
  }
  if (!(least < most)) return {};
  return {PlaceOf(Along(camera, EndOfRow(camera, least, depth, -1.0), least, depth)),
          PlaceOf(Along(camera, EndOfRow(camera, least, depth, 1.0), least, depth)),
          PlaceOf(Along(camera, EndOfRow(camera, most, depth, 1.0), most, depth)),
          PlaceOf(Along(camera, EndOfRow(camera, most, depth, -1.0), most, depth))};
}

// At most `most` of `count`, evenly, each in the middle of its stretch.
std::vector<int> Middles(int count, int most) {
  const int kept = std::min(count, most);
  std::vector<int> out;
  out.reserve(static_cast<std::size_t>(kept));
  for (int k = 0; k < kept; ++k) out.push_back((2 * k + 1) * count / (2 * kept));
  return out;
}

}  // namespace

Place PlaceOf(const Eigen::Vector3d& p) { return {p.x(), p.y(), p.z()}; }

report::Space SpaceOf(const data::Rig& rig, const std::string& title, const std::string& note) {
  report::Space space;
  space.title = title;
  space.note = note;
  Eigen::Vector3d low = rig.volume_low, high = rig.volume_high;
  const double diagonal = (high - low).norm();
  // A survey in one plane has no height of its own.
  const Eigen::Vector3d air = Eigen::Vector3d::Constant(0.01 * (diagonal > 0.0 ? diagonal : 1.0));
  low -= air;
  high += air;
  space.low = PlaceOf(low);
  space.high = PlaceOf(high);
  for (const data::RigCamera& camera : rig.cameras) {
    constexpr double kSheet = 0.12;  // of the volume's diagonal: seen, and not in the way
    space.eyes.push_back({camera.name, PlaceOf(camera.p_WC), FieldOf(camera, space.low, space.high),
                          PlaceOf(kSheet * diagonal * camera.R_CW.row(1).transpose())});
  }
  return space;
}

report::SpaceEllipsoid EllipsoidOf(const Eigen::Vector3d& at, const Eigen::Matrix3d& covariance,
                                   double value) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(covariance);
  report::SpaceEllipsoid out;
  out.at = PlaceOf(at);
  out.value = value;
  for (Eigen::Index k = 0; k < 3; ++k) {
    out.axes[static_cast<std::size_t>(k)] =
        PlaceOf(std::sqrt(std::max(eigen.eigenvalues()(k), 0.0)) * eigen.eigenvectors().col(k));
  }
  return out;
}

report::SpaceEllipsoids EllipsoidsOf(const calib::UncertaintyMap& map, const std::string& name,
                                     double high_mm) {
  constexpr int kColumns = 6, kLayers = 4;  // 144 in all: more hide one another
  report::SpaceEllipsoids out;
  out.name = name;
  out.value = {"error of a found point, 3-D, one sigma", "mm"};
  out.range.high = std::isfinite(high_mm) ? high_mm : 1e3 * map.Quantile(0.98);
  for (const int layer : Middles(map.layers, kLayers)) {
    for (const int row : Middles(map.columns, kColumns)) {
      for (const int column : Middles(map.columns, kColumns)) {
        const auto cell =
            static_cast<std::size_t>((layer * map.columns + row) * map.columns + column);
        if (!std::isfinite(map.sigma[cell])) continue;
        out.ellipsoids.push_back(
            EllipsoidOf(map.Middle(cell), map.covariance[cell], 1e3 * map.sigma[cell]));
      }
    }
  }
  return out;
}

void ReadingsCloud::Add(std::size_t point, int camera, double residual_px, double expected_px,
                        bool refused) {
  Sums& of = points_[point];
  const std::uint32_t bit = 1U << static_cast<unsigned>(camera);
  (refused ? of.refused : of.seen) |= bit;
  if (refused || !(expected_px > 0.0)) return;
  of.squared += residual_px * residual_px / (expected_px * expected_px);
  ++of.count;
}

report::SpaceCloud ReadingsCloud::Cloud(const std::vector<std::string>& ids,
                                        const Eigen::Matrix3Xd& p,
                                        const report::Axis& value) const {
  report::SpaceCloud cloud;
  cloud.name = "residuals of the readings";
  cloud.value = value;
  cloud.range.low = 0.0;
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const Eigen::Vector3d at = p.col(static_cast<Eigen::Index>(i));
    if (!at.allFinite()) continue;
    const Sums& of = points_[i];
    cloud.points.push_back({PlaceOf(at),
                            of.count > 0 ? std::sqrt(of.squared / of.count) : std::nan(""), ids[i],
                            of.seen, of.refused});
  }
  KeepWorst(&cloud);
  return cloud;
}

void KeepWorst(report::SpaceCloud* cloud) {
  if (cloud->points.size() <= report::kMostSpacePoints) return;
  std::vector<std::size_t> order(cloud->points.size());
  std::iota(order.begin(), order.end(), 0U);
  const auto worse = [&](std::size_t a, std::size_t b) {
    const double x = cloud->points[a].value, y = cloud->points[b].value;
    return std::isfinite(x) && (!std::isfinite(y) || x > y);
  };
  std::stable_sort(order.begin(), order.end(), worse);
  order.resize(report::kMostSpacePoints);
  std::sort(order.begin(), order.end());
  std::vector<report::SpacePoint> kept;
  kept.reserve(order.size());
  for (const std::size_t i : order) kept.push_back(std::move(cloud->points[i]));
  cloud->points = std::move(kept);
  cloud->name += ", the worst " + std::to_string(order.size());
}

}  // namespace unfurl::cli
