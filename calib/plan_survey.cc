#include "calib/plan_survey.h"

#include <fmt/format.h>

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <numbers>
#include <string_view>
#include <utility>

#include "base/error.h"
#include "base/length.h"
#include "base/text.h"
#include "data/survey_points.h"

namespace unfurl::calib {

namespace {

// A number with one of the units, the longest first where one ends another.
template <std::size_t N>
bool ParseWithUnit(std::string_view text,
                   const std::array<std::pair<std::string_view, double>, N>& units, double* value) {
  text = Trim(text);
  for (const auto& [name, size] : units) {
    if (!text.ends_with(name)) continue;
    text.remove_suffix(name.size());
    if (!ParseDouble(Trim(text), value) || !std::isfinite(*value) || *value < 0.0) return false;
    *value *= size;
    return true;
  }
  return false;
}

constexpr std::array<std::pair<std::string_view, double>, 4> kScales = {
    {{"um/m", 1e-6}, {"mm/m", 1e-3}, {"mm/km", 1e-6}, {"ppm", 1e-6}}};
constexpr std::array<std::pair<std::string_view, double>, 7> kAngles = {
    {{"urad", 1e-6},
     {"mrad", 1e-3},
     {"rad", 1.0},
     {"arcsec", std::numbers::pi / 648e3},
     {"mgon", std::numbers::pi / 200e3},
     {"gon", std::numbers::pi / 200.0},
     {"deg", std::numbers::pi / 180.0}}};

}  // namespace

StationAccuracy ParseStationAccuracy(const std::string& text, const std::string& where) {
  const auto refuse = [&](const std::string& part) {
    throw Error(fmt::format("'{}' is no accuracy of a station", part), where,
                "give distance and angles, as \"1mm+0.1mm/m, 0.1mrad\" or \"1.5mm+2ppm, 1arcsec\"");
  };
  StationAccuracy out;
  const std::vector<std::string> parts = Split(text, ',');
  if (parts.size() != 2) refuse(text);
  const std::vector<std::string> distance = Split(parts[0], '+');
  const bool unit = !distance[0].empty() && Trim(distance[0]).ends_with('m');
  if (distance.size() > 2 || !unit || !ParseLength(distance[0], &out.offset) || out.offset < 0.0) {
    refuse(parts[0]);
  }
  if (distance.size() == 2 && !ParseWithUnit(distance[1], kScales, &out.scale)) refuse(parts[0]);
  if (!ParseWithUnit(parts[1], kAngles, &out.angle)) refuse(parts[1]);
  if (!(out.offset + out.scale > 0.0 && out.angle > 0.0)) refuse(text);
  return out;
}

void SetAccuracy(const StationAccuracy& accuracy, const std::string& where, data::Survey* survey) {
  if (!survey->station.allFinite()) {
    throw Error("the station's accuracy without its place", where,
                "add a comment '# station: E, N, H' to the points, or give --station-at");
  }
  for (Eigen::Index i = 0; i < survey->p.cols(); ++i) {
    if (survey->cov.col(i).any()) continue;
    const Eigen::Vector3d way = survey->p.col(i) - survey->station;
    const double d = way.norm();
    if (!(d > 0.0)) {
      throw Error(fmt::format("point \"{}\" lies where the station stands",
                              survey->id[static_cast<std::size_t>(i)]),
                  where, "correct the station's place");
    }
    // Across the sight both directions have the same error, but for sin v of the horizontal one,
    // which the reading of the circle is divided by when it is aimed.
    const double across = d * accuracy.angle, along = accuracy.offset + accuracy.scale * d;
    const Eigen::Matrix3d sight = way * way.transpose() / (d * d);
    const Eigen::Matrix3d C =
        across * across * (Eigen::Matrix3d::Identity() - sight) + along * along * sight;
    survey->cov.col(i) << C(0, 0), C(0, 1), C(0, 2), C(1, 1), C(1, 2), C(2, 2);
  }
}

data::Survey PlannedSurvey(data::Survey points, const PlannedStation& station,
                           const std::string& where) {
  if (station.at.allFinite()) points.station = station.at;
  if (!station.accuracy.empty()) {
    const StationAccuracy accuracy = ParseStationAccuracy(station.accuracy, station.where);
    points.cov.setZero();
    SetAccuracy(accuracy, where, &points);
  }
  for (Eigen::Index i = 0; i < points.cov.cols(); ++i) {
    if (points.cov.col(i).any()) continue;
    if (!(station.sigma > 0.0)) {
      throw Error("states no uncertainty of its points", where,
                  "add columns 'sx [m]', 'sy [m]' and 'sz [m]', or give " + station.where);
    }
    const double variance = station.sigma * station.sigma;
    points.cov.col(i) << variance, 0.0, 0.0, variance, 0.0, variance;
  }
  return points;
}

}  // namespace unfurl::calib
