#include "calib/far_points.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/dense.h"
#include "base/length.h"
#include "calib/near_frame.h"
#include "measure/camera_model.h"
#include "measure/triangulate.h"

namespace unfurl::calib {
namespace {

constexpr double kFar = 4.0;        // median distances; of points that fill a box none is beyond 2
constexpr double kMostFar = 0.1;    // of the points
constexpr double kRightBelow = 50;  // chi-square of three coordinates: five sigmas of each
constexpr double kOutside = 10.0;   // sizes of the volume of the rest, where a point may be found
constexpr double kOutsideField = 0.02;  // of the row
constexpr double kAlone = 0.01;         // what the others may be off by, of the one that is wrong

}  // namespace

std::vector<int> FarPoints(const Eigen::Matrix3Xd& p) {
  std::vector<int> out;
  if (p.cols() == 0) return out;
  const Eigen::Vector3d middle = MiddleOf(p);
  const double usual = UsualDistance(p, middle);
  for (Eigen::Index i = 0; i < p.cols(); ++i) {
    if (!((p.col(i) - middle).norm() <= kFar * usual)) out.push_back(static_cast<int>(i));
  }
  if (static_cast<double>(out.size()) > kMostFar * static_cast<double>(p.cols())) out.clear();
  return out;
}

Observations Unseen(Observations data, const std::vector<int>& points) {
  const Eigen::Vector3d middle = MiddleOf(data.p);
  for (const int i : points) data.p.col(i) = middle;
  std::erase_if(data.readings, [&](const Reading& r) {
    return std::find(points.begin(), points.end(), r.point) != points.end();
  });
  return data;
}

namespace {

// Whether the cameras that saw a point would see it there, but for what a lens model does outside
// of the field that it was made for.
bool SeenThere(const Observations& data, const FarPoint& far, const data::Rig& rig) {
  int seen = 0;
  for (const Reading& r : data.readings) {
    if (r.point != far.point) continue;
    const data::RigCamera& camera = rig.cameras[static_cast<std::size_t>(r.camera)];
    double u = 0.0;
    if (!measure::Project(camera, data.p.col(far.point), &u)) return false;
    if (std::fabs(u - r.u_px) > kOutsideField * camera.pixels) return false;
    ++seen;
  }
  return seen >= 3;
}

}  // namespace

std::vector<FarPoint> FindFarPoints(const Observations& data, const std::vector<int>& points,
                                    const data::Rig& calibrated) {
  data::Rig rig = calibrated;
  const Eigen::Vector3d more = kOutside * (rig.volume_high - rig.volume_low);
  rig.volume_low -= more;
  rig.volume_high += more;
  const measure::Triangulator triangulator(rig);
  const Eigen::Vector3d middle = MiddleOf(data.p);
  std::vector<FarPoint> out;
  for (const int i : points) {
    std::vector<double> u(rig.cameras.size(), std::numeric_limits<double>::quiet_NaN()), s = u;
    for (const Reading& r : data.readings) {
      if (r.point != i) continue;
      u[static_cast<std::size_t>(r.camera)] = r.u_px;
      s[static_cast<std::size_t>(r.camera)] = r.s_px;
    }
    FarPoint one;
    one.point = i;
    const Eigen::Vector3d surveyed = data.p.col(i);
    for (const Eigen::Vector3d& start : {surveyed, middle}) {
      const measure::PointSolution found = triangulator.Solve(u, s, start);
      if (found.outcome != measure::PointOutcome::kSolved) continue;
      one.found = true;
      one.at = found.p;
      // Outside of what was surveyed a calibration is worth less than it states: what it makes of
      // a thousandth of the way there is not held against the point.
      const double beyond = 1e-3 * (surveyed - middle).norm();
      // What the lens may do out there is in the covariance of the cameras.
      Eigen::Matrix3Xd shared(3, triangulator.shared_rank());
      triangulator.SharedFactor(found, s, shared);
      const Eigen::Matrix3d both = found.cov + data.cov[static_cast<std::size_t>(i)] +
                                   shared * shared.transpose() +
                                   beyond * beyond * Eigen::Matrix3d::Identity();
      const Eigen::Vector3d off = found.p - surveyed;
      one.right = off.dot(both.llt().solve(off)) < kRightBelow;
      if (one.right) break;
    }
    one.right = one.right || SeenThere(data, one, rig);
    out.push_back(one);
  }
  return out;
}

GrossFinding Finding(const Observations& data, const FarPoint& far) {
  GrossFinding out;
  out.points = {far.point};
  const std::string& id = data.ids[static_cast<std::size_t>(far.point)];
  const Eigen::Vector3d surveyed = data.p.col(far.point);
  if (!far.found) {
    out.size = (surveyed - MiddleOf(data.p)).stableNorm();
    out.text = fmt::format(
        "point \"{}\" was surveyed {} from the middle of the others, and its readings meet "
        "nowhere: "
        "left out",
        id, LengthText(out.size));
    return out;
  }
  const Eigen::Vector3d off = surveyed - far.at;
  Eigen::Index axis = 0;
  out.size = off.cwiseAbs().maxCoeff(&axis);
  const Eigen::Vector3d size = off.cwiseAbs();
  const double rest = std::max(size((axis + 1) % 3), size((axis + 2) % 3));
  if (rest < kAlone * out.size) {
    out.kind = GrossKind::kAlongOneAxis;
    out.text = fmt::format("point \"{}\": {} alone is off, by {:+.6g} m (a typing error)", id,
                           "xyz"[axis], off(axis));
  } else {
    out.size = off.norm();
    out.text =
        fmt::format("point \"{}\" is {} from where it was surveyed", id, LengthText(out.size));
  }
  return out;
}

}  // namespace unfurl::calib
