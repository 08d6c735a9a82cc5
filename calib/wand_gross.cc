#include "calib/wand_gross.h"

#include <algorithm>
#include <cmath>

#include "calib/refine.h"
#include "calib/wand_poses.h"

namespace unfurl::calib {
namespace {

constexpr int kTelling = 4;           // readings of a mark that check each other
constexpr double kTie = 0.9;          // of the largest residual: which of the two is wrong is open
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

bool LeaveOutPointReadings(double sigmas, WandFit* fit) {
  bool any = false;
  for (std::size_t k = 0; k < fit->data.points.readings.size(); ++k) {
    const Reading& r = fit->data.points.readings[k];
    const double redundant = fit->system.point_redundancy[k];
    if (fit->weighting.use_point_reading[k] == 0 || redundant < kUsefulRedundancy) continue;
    const double variance = fit->weighting.Variance(r.camera, r.s_px) * redundant;
    if (std::abs(fit->summary.point_residual_px[k]) <= sigmas * std::sqrt(variance)) continue;
    fit->weighting.use_point_reading[k] = 0;
    any = true;
  }
  return any;
}

bool LeaveOutPlaces(double sigmas, WandFit* fit) {
  const double limit = std::pow(SurveyLossWidth(sigmas), 2);
  bool any = false;
  for (int i = 0; i < fit->data.points.points(); ++i) {
    const auto point = static_cast<std::size_t>(i);
    const double redundant = fit->system.survey_redundancy[point] / 3.0;
    if (fit->weighting.use_survey[point] == 0 || redundant < kUsefulRedundancy) continue;
    if (SurveySquare(fit->data.points, fit->state, i) <= limit * redundant) continue;
    fit->weighting.use_survey[point] = 0;
    any = true;
  }
  return any;
}

}  // namespace

bool LeaveOut(double sigmas, WandFit* fit) {
  const bool bar = LeaveOutOfBar(sigmas, fit);
  const bool readings = LeaveOutPointReadings(sigmas, fit);
  const bool places = LeaveOutPlaces(sigmas, fit);
  return bar || readings || places;
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

}  // namespace unfurl::calib
