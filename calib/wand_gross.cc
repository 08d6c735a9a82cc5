#include "calib/wand_gross.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/length.h"
#include "calib/refine.h"
#include "calib/wand_poses.h"

namespace unfurl::calib {
namespace {

constexpr int kTelling = 4;           // readings of a mark that check each other
constexpr double kTie = 0.9;          // of the largest residual: which of the two is wrong is open
constexpr int kSecond = 2;            // wrong data at a surveyed point: then its place is wrong
constexpr double kBehindFactor = 10;  // of the limit: a mark that is found behind a camera

// Of each reading of the bar, its residual in its own sigmas; 0 where it takes no part or tells
// nothing.
std::vector<double> ResidualSigmas(double sigmas, const WandFit& fit) {
  std::vector<double> out(fit.data.readings.size(), 0.0);
  for (std::size_t k = 0; k < out.size(); ++k) {
    const WandReading& r = fit.data.readings[k];
    if (fit.weighting.use_reading[k] == 0) continue;
    if (!std::isfinite(fit.summary.residual_px[k])) {
      out[k] = kBehindFactor * sigmas;
    } else if (fit.system.redundancy[k] >= kUsefulRedundancy) {
      out[k] = std::abs(fit.summary.residual_px[k]) /
               std::sqrt(fit.weighting.Variance(r.camera, r.s_px) * fit.system.redundancy[k]);
    }
  }
  return out;
}

// In the readings [first, end) of one pose.
bool LeaveOutOfPose(double sigmas, const std::vector<double>& off, std::size_t first,
                    std::size_t end, WandFit* fit) {
  const auto from = static_cast<std::ptrdiff_t>(first), to = static_cast<std::ptrdiff_t>(end);
  const auto worst = std::max_element(off.begin() + from, off.begin() + to);
  if (!(*worst > sigmas)) return false;
  const std::vector<WandReading>& readings = fit->data.readings;
  std::vector<char>& use = fit->weighting.use_reading;
  const int mark = readings[static_cast<std::size_t>(worst - off.begin())].mark;
  int rest = 0;
  for (std::size_t k = first; k < end; ++k) {
    if (readings[k].mark != mark) continue;
    if (off[k] >= kTie * *worst) use[k] = 0;
    rest += use[k];
  }
  // Three planes meet in a point whatever they are: nothing tells which of four was wrong.
  if (rest < kTelling) std::fill(use.begin() + from, use.begin() + to, 0);
  return true;
}

bool LeaveOutOfBar(double sigmas, WandFit* fit) {
  const std::vector<double> off = ResidualSigmas(sigmas, *fit);
  const std::vector<WandReading>& readings = fit->data.readings;
  bool any = false;
  for (std::size_t first = 0, end = 0; first < readings.size(); first = end) {
    while (end < readings.size() && readings[end].pose == readings[first].pose) ++end;
    any = LeaveOutOfPose(sigmas, off, first, end, fit) || any;
  }
  return any;
}

// What of a surveyed point is off, in the readings [first, end) of it.
struct PointFaults {
  int off = 0, out = 0;        // readings that are off now; that were left out before
  std::vector<double> sigmas;  // of each reading, its residual; 0 where it tells nothing
  bool place = false;          // the surveyed place is off
};

PointFaults FaultsOf(double sigmas, const WandFit& fit, int point, std::size_t first,
                     std::size_t end) {
  PointFaults out;
  for (std::size_t k = first; k < end; ++k) {
    const Reading& r = fit.data.points.readings[k];
    const double redundant = fit.system.point_redundancy[k], off = fit.summary.point_residual_px[k];
    double size = 0.0;
    if (fit.weighting.use_point_reading[k] == 0) {
      ++out.out;
    } else if (!std::isfinite(off)) {
      size = kBehindFactor * sigmas;
    } else if (redundant >= kUsefulRedundancy) {
      size = std::abs(off) / std::sqrt(fit.weighting.Variance(r.camera, r.s_px) * redundant);
    }
    out.sigmas.push_back(size);
    out.off += size > sigmas ? 1 : 0;
  }
  const auto at = static_cast<std::size_t>(point);
  const double redundant = fit.system.survey_redundancy[at] / 3.0;
  out.place = fit.weighting.use_survey[at] != 0 && redundant >= kUsefulRedundancy &&
              SurveySquare(fit.data.points, fit.state, point) >
                  std::pow(SurveyLossWidth(sigmas), 2) * redundant;
  return out;
}

// One reading may be wrong; where a second one is off, too, or the place, it is the place: two
// wrong readings at one point are rarer, and a place that outlived its readings, one by one, would
// be off without a word.
bool LeaveOutAtPoint(double sigmas, int point, std::size_t first, std::size_t end, WandFit* fit) {
  const PointFaults faults = FaultsOf(sigmas, *fit, point, first, end);
  if (faults.off == 0 && !faults.place) return false;
  char* const use = fit->weighting.use_point_reading.data() + first;
  const std::size_t n = end - first;
  char& survey = fit->weighting.use_survey[static_cast<std::size_t>(point)];
  if (survey != 0 && (faults.place || faults.off + faults.out >= kSecond)) {
    survey = 0;
    std::fill(use, use + n, 1);
    return true;
  }
  const double worst = *std::max_element(faults.sigmas.begin(), faults.sigmas.end());
  for (std::size_t k = 0; k < n; ++k) {
    if (faults.sigmas[k] >= kTie * worst) use[k] = 0;
  }
  // Without its place, as a mark of a pose.
  if (survey == 0 && std::count(use, use + n, 1) < kTelling) std::fill(use, use + n, 0);
  return true;
}

bool LeaveOutAtPoints(double sigmas, WandFit* fit) {
  const std::vector<Reading>& readings = fit->data.points.readings;
  bool any = false;
  for (std::size_t first = 0, end = 0; first < readings.size(); first = end) {
    while (end < readings.size() && readings[end].point == readings[first].point) ++end;
    any = LeaveOutAtPoint(sigmas, readings[first].point, first, end, fit) || any;
  }
  return any;
}

// Whether surveyed places that take part, each with the readings that find it, fix the frame.
bool PointsFixFrame(const WandFit& fit) {
  std::vector<int> readings(fit.weighting.use_survey.size(), 0), keep;
  for (std::size_t k = 0; k < fit.data.points.readings.size(); ++k) {
    const int point = fit.data.points.readings[k].point;
    readings[static_cast<std::size_t>(point)] += fit.weighting.use_point_reading[k];
  }
  for (std::size_t i = 0; i < readings.size(); ++i) {
    if (fit.weighting.use_survey[i] != 0 && readings[i] >= 3) keep.push_back(static_cast<int>(i));
  }
  return FixFrame(fit.data.points.p(Eigen::all, keep));
}

}  // namespace

bool LeaveOut(double sigmas, WandFit* fit) {
  const bool bar = LeaveOutOfBar(sigmas, fit);
  const bool points = LeaveOutAtPoints(sigmas, fit);
  // Else the frame would be anywhere, and so would all covariances.
  if (points && fit->by_points && !PointsFixFrame(*fit)) fit->weighting.hold_frame = true;
  return bar || points;
}

void CountLost(const WandData& data, const std::vector<int>& poses, WandFit* fit) {
  if (poses.empty()) return;
  std::vector<char> lost(data.poses.size(), 0);
  for (const int k : poses) {
    lost[static_cast<std::size_t>(k)] = 1;
    fit->lost_poses.push_back(data.poses[static_cast<std::size_t>(k)]);
  }
  fit->lost_readings.resize(data.cameras.size(), 0);
  for (const WandReading& r : data.readings) {
    fit->lost_readings[static_cast<std::size_t>(r.camera)] +=
        lost[static_cast<std::size_t>(r.pose)];
  }
}

bool DropLostPoses(WandFit* fit) {
  std::vector<char> taken(fit->data.poses.size(), 0);
  for (std::size_t k = 0; k < fit->data.readings.size(); ++k) {
    if (fit->weighting.use_reading[k] == 0) continue;
    taken[static_cast<std::size_t>(fit->data.readings[k].pose)] = 1;
  }
  std::vector<int> keep, lost;
  for (int k = 0; k < fit->data.pose_count(); ++k) {
    (taken[static_cast<std::size_t>(k)] != 0 ? keep : lost).push_back(k);
  }
  if (lost.empty()) return false;
  CountLost(fit->data, lost, fit);
  *fit = KeepPoses(*fit, keep);
  return true;
}

std::string ContradictionOf(const WandData& data, const Eigen::VectorXd& place) {
  const Eigen::VectorXd stated = data.place.array() - data.place(0);
  Eigen::VectorXd found = place.array() - place(0);
  Eigen::Index far = 0, worst = 0;
  stated.cwiseAbs().maxCoeff(&far);
  found *= stated(far) / found(far);
  (found - stated).cwiseAbs().maxCoeff(&worst);
  const auto name = [&](Eigen::Index m) { return data.marks[static_cast<std::size_t>(m)]; };
  return fmt::format(
      "the stated distances of the bar's marks contradict each other: with mark \"{}\" {} from the "
      "first the readings have mark \"{}\" at {:.5g} mm, and not at {:.5g} mm",
      name(far), LengthText(stated(far)), name(worst), 1e3 * found(worst), 1e3 * stated(worst));
}

}  // namespace unfurl::calib
