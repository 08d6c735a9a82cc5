// What may be tried, and where its points are.
#include <fmt/format.h>

#include <cmath>

#include "base/error.h"
#include "base/refuse_option.h"
#include "calib/survey_cost.h"
#include "calib/wand_guess.h"

namespace unfurl::calib {

double SpreadPlace(int k, int base) {
  double out = 0.0, share = 1.0;
  for (int n = k + 1; n > 0; n /= base) {
    share /= base;
    out += share * (n % base);
  }
  return out;
}

const char* Name(SurveyPlaces places) {
  constexpr const char* kNames[] = {"volume", "levels", "lower"};
  return kNames[static_cast<std::size_t>(places)];
}

SurveyPlaces ParseSurveyPlaces(const std::string& name, const std::string& where) {
  for (const SurveyPlaces one :
       {SurveyPlaces::kVolume, SurveyPlaces::kLevels, SurveyPlaces::kLower}) {
    if (name == Name(one)) return one;
  }
  throw Error(fmt::format("'{}' is no kind of places", name), where,
              "give volume, levels or lower");
}

void SurveyCostOptions::Check() const {
  const RefuseOption refuse("SurveyCostOptions");
  // Fewer readings determine no camera (GuessOptions); more points are a slip of the keyboard.
  constexpr int kFewest = 12, kMost = 10000;
  const int kFewestPoses = WandGuessOptions().fewest_poses;
  const auto within = [&](const char* name, const std::vector<int>& values, int low) {
    for (const int n : values) {
      if (n >= low && n <= kMost) continue;
      refuse(name, fmt::format("{} is not from {} to {}", n, low, kMost), "give whole numbers");
    }
  };
  within("points", points, kFewest);
  within("shots", shots, 1);
  within("poses", poses, kFewestPoses);
  const auto positive = [&](const char* name, double value) {
    if (!(value > 0.0) || !std::isfinite(value)) refuse(name, "is not above 0", "give more");
  };
  positive("point_sigma", point_sigma);
  positive("reading_sigma_px", reading_sigma_px);
  positive("bar_sigma", bar_sigma);
  for (const double time :
       {minutes_per_point, seconds_per_shot, seconds_per_pose, minutes_before, bar, need}) {
    if (!(time >= 0.0) || !std::isfinite(time))
      refuse("times, bar, need", "are not 0 or above", "give numbers");
  }
  if (few < 3) refuse("few", "is below 3", "give points that fix a frame");
  if (!(wild >= 0.0 && wild < 0.5)) refuse("wild", "is not from 0 to 0.5", "give a share");
  if (draws < 0) refuse("draws", "is negative", "give 0 or more");
  if (columns < 1 || layers < 1) refuse("columns, layers", "are less than 1", "give some");
}

data::Survey SurveyOf(const data::Rig& rig, const SurveySetting& setting,
                      const SurveyCostOptions& options) {
  constexpr double kLevels[] = {0.1, 0.5, 0.9};  // of the height
  data::Survey out;
  out.p.resize(3, setting.points);
  out.cov.setZero(6, setting.points);
  const Eigen::Vector3d size = rig.volume_high - rig.volume_low;
  for (int i = 0; i < setting.points; ++i) {
    Eigen::Vector3d at(SpreadPlace(i, 2), SpreadPlace(i, 3), SpreadPlace(i, 5));
    if (setting.places == SurveyPlaces::kLevels) at.z() = kLevels[i % 3];
    if (setting.places == SurveyPlaces::kLower) at.z() *= 0.5;
    out.p.col(i) = rig.volume_low + size.cwiseProduct(at);
    out.id.push_back(fmt::format("P{:03}", i + 1));
  }
  if (options.station.offset + options.station.scale > 0.0) {
    out.station = options.station_at;
    SetAccuracy(options.station, "--station", &out);
  } else {
    const double variance = options.point_sigma * options.point_sigma;
    out.cov.colwise() +=
        (Eigen::Matrix<double, 6, 1>() << variance, 0, 0, variance, 0, variance).finished();
  }
  return out;
}

}  // namespace unfurl::calib
