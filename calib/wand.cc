#include "calib/wand.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/dense.h"
#include "base/error.h"
#include "base/progress.h"
#include "base/refuse_option.h"
#include "base/statistics.h"
#include "calib/covariance.h"
#include "calib/moved_late.h"
#include "calib/wand_shape.h"
#include "calib/wand_verdict.h"

namespace unfurl::calib {
namespace {

void Refuse(const WandData& data, const WandOptions& options, const std::string& where) {
  if (data.camera_count() < 3) {
    throw Error(fmt::format("holds readings of {} cameras", data.camera_count()), where,
                "three cameras or more are needed to find a point");
  }
  const int fewest = options.fit.start.fewest_poses;
  if (data.pose_count() < fewest) {
    throw Error(fmt::format("holds {} poses of the bar", data.pose_count()), where,
                fmt::format("wave it through at least {}, better some hundred", fewest));
  }
  const int points = data.points.points();
  if (points == 0) return;
  const PointSpread spread = SpreadOf(data.points.p);
  const bool line = points < 3 || spread.sigma(1) < options.fit.guess.flatness * spread.sigma(0);
  if (!line) return;
  throw Error(points < 3 ? fmt::format("{} surveyed points do not fix a frame", points)
                         : "the surveyed points lie on one line and do not fix a frame",
              where,
              "survey three or more that are not on one line, or leave --points out: the bar alone "
              "gives all distances");
}

// Cameras with floors, covariance and the box of the bar's places.
data::Rig RigOf(const WandFit& fit, const FramedWand& framed) {
  data::Rig rig;
  rig.cameras = fit.state.cameras;
  for (std::size_t j = 0; j < rig.cameras.size(); ++j) {
    rig.cameras[j].floor_px = fit.weighting.floor_px[j];
    rig.model_floor_px = std::max(rig.model_floor_px, fit.weighting.floor_px[j]);
  }
  rig.covariance = framed.covariance;
  ClearFixed(fit.priors, &rig.covariance);
  rig.volume_low.setConstant(std::numeric_limits<double>::infinity());
  rig.volume_high = -rig.volume_low;
  // Two readings and the length put a mark at either of two places.
  const int marks = fit.data.mark_count();
  std::vector<int> read(static_cast<std::size_t>(fit.data.pose_count() * marks), 0);
  for (std::size_t k = 0; k < fit.data.readings.size(); ++k) {
    const WandReading& r = fit.data.readings[k];
    if (fit.weighting.use_reading[k] != 0)
      ++read[static_cast<std::size_t>(r.pose * marks + r.mark)];
  }
  for (int k = 0; k < fit.data.pose_count(); ++k) {
    for (int m = 0; m < marks; ++m) {
      if (read[static_cast<std::size_t>(k * marks + m)] < 3) continue;
      const Eigen::Vector3d p = fit.state.Mark(k, m, 0.0);
      rig.volume_low = rig.volume_low.cwiseMin(p);
      rig.volume_high = rig.volume_high.cwiseMax(p);
    }
  }
  return rig;
}

void ReportCameras(const WandFit& fit, WandReport* report) {
  for (std::size_t j = 0; j < fit.data.cameras.size(); ++j) {
    WandCameraReport camera;
    camera.name = fit.data.cameras[j];
    camera.floor_px = fit.weighting.floor_px[j];
    camera.low_px = std::numeric_limits<double>::infinity();
    camera.high_px = -camera.low_px;
    double squares = 0.0;
    for (std::size_t k = 0; k < fit.data.readings.size(); ++k) {
      const WandReading& r = fit.data.readings[k];
      if (r.camera != static_cast<int>(j)) continue;
      ++camera.readings;
      if (fit.weighting.use_reading[k] == 0) {
        ++camera.gross;
        continue;
      }
      squares += fit.summary.residual_px[k] * fit.summary.residual_px[k];
      camera.low_px = std::min(camera.low_px, r.u_px);
      camera.high_px = std::max(camera.high_px, r.u_px);
      report->chi_square += fit.summary.residual_px[k] * fit.summary.residual_px[k] /
                            fit.weighting.Variance(r.camera, r.s_px);
      report->degrees_of_freedom += fit.system.redundancy[k];
    }
    if (j < fit.lost_readings.size()) {
      camera.readings += fit.lost_readings[j];
      camera.gross += fit.lost_readings[j];
    }
    camera.residual_rms_px = std::sqrt(squares / std::max(1, camera.readings - camera.gross));
    report->gross_readings += camera.gross;
    report->cameras.push_back(camera);
  }
}

void ReportBar(const WandFit& fit, WandReport* report) {
  const Eigen::Index cameras = fit.CameraNumbers();
  report->marks = fit.data.marks;
  report->place = fit.state.place.array() - fit.state.place(0);
  report->place_sigma.setZero(report->place.size());
  for (Eigen::Index m = 1; m < report->place.size(); ++m) {
    report->place_sigma(m) = std::sqrt(fit.system.covariance(cameras + m - 1, cameras + m - 1));
  }
  report->poses = fit.data.pose_count();
  report->dropped = fit.dropped;
  report->lost_poses = fit.lost_poses;
  report->rivals = fit.rivals;
  for (int i = 0; i < fit.data.points.points(); ++i) {
    if (fit.weighting.use_survey[static_cast<std::size_t>(i)] != 0) continue;
    report->gross_points.push_back(fit.data.points.ids[static_cast<std::size_t>(i)]);
  }
  const std::vector<char>& use = fit.weighting.use_point_reading;
  report->point_readings = static_cast<int>(use.size());
  report->gross_point_readings = static_cast<int>(std::count(use.begin(), use.end(), 0));
}

// Of all wand calibrations without a late move so many are suspected of one, as TrendOptions [-].
constexpr double kLateLevel = 0.01;

// A camera that moved before the bar was put away: most poses are from before, and those since are
// left out, as a whole where four readings of a mark do not tell which one is wrong.
void ReportLate(const WandData& data, const WandFit& fit, WandReport* report) {
  std::vector<std::string> marked = fit.lost_poses;
  for (std::size_t k = 0; k < fit.data.readings.size(); ++k) {
    if (fit.weighting.use_reading[k] != 0) continue;
    marked.push_back(fit.data.poses[static_cast<std::size_t>(fit.data.readings[k].pose)]);
  }
  std::sort(marked.begin(), marked.end());
  std::vector<char> left_out;
  left_out.reserve(data.poses.size());
  for (const std::string& pose : data.poses) {
    left_out.push_back(std::binary_search(marked.begin(), marked.end(), pose) ? 1 : 0);
  }
  const auto tests = static_cast<double>(std::count(left_out.begin(), left_out.end(), char{1}));
  const LastOnes late = LeastLikelyLast(left_out);
  if (!(late.chance < ChanceOfEach(kLateLevel, tests))) return;
  report->late = static_cast<int>(late.last);
  report->late_left_out = static_cast<int>(late.left_out);
  report->late_from = data.poses[data.poses.size() - late.last];
}

}  // namespace

void WandOptions::Check() const {
  const RefuseOption refuse("WandOptions");
  fit.Check();
  verdict.Check();
  if (folds < 2) refuse("folds", "is less than 2", "give the parts that are held out in turn");
  if (!frame.cameras.empty() && frame.cameras.size() != 3) {
    refuse("frame.cameras", "does not name three", "name three cameras, or none");
  }
  if (frame.plumb.empty() != frame.origin.empty()) {
    refuse("frame.plumb", "comes without frame.origin, or that without it", "name both poses");
  }
}

WandCalibration CalibrateWand(const WandData& data, const WandOptions& options,
                              const std::string& where) {
  options.Check();
  Refuse(data, options, where);
  const auto done = [&](double share) {
    ThrowIfInterrupted();
    if (options.progress) options.progress(share);
  };
  WandCalibration out;
  out.fit = FitWand(data, options.fit, where);
  done(0.5);
  const FramedWand framed = SetFrame(options.frame, where, &out.fit);
  out.rig = RigOf(out.fit, framed);
  WandReport& report = out.report;
  report.converged = out.fit.summary.converged;
  report.frame = framed.words;
  report.handed = framed.handed;
  ReportCameras(out.fit, &report);
  ReportBar(out.fit, &report);
  ReportLate(data, out.fit, &report);
  // Where they were is known in the survey's frame.
  report.lenses = CompareLenses(options.fit.lenses, out.rig, framed.by_points);
  report.against_before = CompareScale(options.fit.lenses, out.rig);
  const std::vector<WandGridPoint> grid = WandGrid(out.fit);
  report.shapes = ShapesOf(out.fit, framed.covariance, grid);
  report.distance_sigma = DistanceSigma(framed.covariance, grid);
  MotionOf(out.fit, &report);
  done(0.6);
  WandLengths lengths = HeldOutLengths(out.fit, options.fit.bundle, options.folds, options.workers);
  report.lengths = std::move(lengths.found);
  report.lengths_unsolved = lengths.unsolved;
  JudgeWand(out.fit, PointSigmas(framed.covariance, grid), report, options.verdict, &out.rig);
  done(1.0);
  return out;
}

}  // namespace unfurl::calib
