#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "calib/plan.h"
#include "calib/plan_survey.h"
#include "data/rig.h"

namespace unfurl::calib {

/// Where points of a survey are.
enum class SurveyPlaces {
  kVolume,  ///< spread over the whole volume
  kLevels,  ///< at three heights, as on a tripod
  kLower,   ///< in the lower half of the heights
};
const char* Name(SurveyPlaces places);  ///< "volume", "levels" or "lower"
/// Throws Error at `where` for another word.
SurveyPlaces ParseSurveyPlaces(const std::string& name, const std::string& where);

/// What is tried, and what it takes to measure. Every time is the surveyor's, not the program's.
struct SurveyCostOptions {
  std::vector<int> points = {25, 50, 100, 200, 400};
  std::vector<SurveyPlaces> places = {SurveyPlaces::kVolume, SurveyPlaces::kLevels,
                                      SurveyPlaces::kLower};
  std::vector<int> shots = {1, 16};          ///< readings of each point, averaged
  std::vector<int> poses = {100, 200, 400};  ///< of a bar waved by hand; empty: no bar
  int few = 8;                               ///< surveyed points that give the bar its frame
  double bar = 0.0, bar_sigma = 1e-4;  ///< its length; 0: a third of the volume's longest side [m]
  /// Of a point: the LED is moved, aimed at and measured [min].
  double minutes_per_point = 1.5;
  double seconds_per_shot = 0.1;  ///< a line with the LED and one without, as somebody asks for it
  double seconds_per_pose = 6.0;  ///< the bar is moved, and held still for its flashes [s]
  double minutes_before = 30.0;   ///< the station is set up [min]
  double point_sigma = 3e-4;  ///< of a surveyed point, per axis; the station's own where given [m]
  StationAccuracy station;    ///< all 0: point_sigma holds
  Eigen::Vector3d station_at = Eigen::Vector3d::Zero();  ///< where it stands [m]
  double reading_sigma_px = 0.03;  ///< of one reading, of the survey and of the trial [px]
  double wild = 0.01;  ///< share of readings that are wrong, against which estimators are tried [-]
  int draws = 3;       ///< surveys for each estimator
  int columns = 8, layers = 3;  ///< cells of the volume that errors are taken in
  double need = 0.0;            ///< error of a found point that is aimed at [m]; 0: NeedOf's
  std::uint64_t seed = 1;
  std::size_t workers = 0;  ///< 0: all cores. Changes no result
  std::function<void(double)> progress;
  /// Throws Error that names a value which makes no sense.
  void Check() const;
};

/// One way to calibrate.
struct SurveySetting {
  int points = 0;  ///< surveyed
  SurveyPlaces places = SurveyPlaces::kVolume;
  int shots = 1;
  int poses = 0;           ///< of the bar; 0: none
  std::string lens;        ///< terms of the lens; empty: all
  std::string estimator;   ///< "robust" or "ordinary", with wild readings; empty: none are there
  double calibration = 0;  ///< RMS error of found points by the calibration alone [m]
  double bias = 0;         ///< of that, what is not in the covariance [m]
  double error = 0;        ///< with the reading's own part [m]
  double hours = 0;        ///< of surveying
  double cpu_seconds = 0;  ///< of computing
  bool on_front = false;   ///< nothing is both quicker to survey and better
  std::string problem;     ///< why there are no numbers; empty: there are
};

/// What was tried, and what to do.
struct SurveyCost {
  std::vector<SurveySetting> settings;  ///< points, bar, lens, estimators, in this order
  double need = 0.0;                    ///< [m]
  double floor_px = 0.0;                ///< the rig's own model error, in all predictions [px]
  double readings = 0.0;                ///< the trial's readings' part of any error, RMS [m]
  int advised = -1;                     ///< the quickest that reaches `need`; -1: none does
  std::vector<std::string> advice;      ///< sentences and commands
};

/// How well a rig's cameras would be calibrated by other surveys, and by a bar, over the rig's
/// volume: each predicted by a calibration without noise, whose covariance is that of one with
/// noise. `name` is the rig's, for the advice.
SurveyCost StudySurveyCost(const data::Rig& rig, const std::string& name,
                           const SurveyCostOptions& options);

/// The places of a setting, with the covariances that they will have; for one who measures them.
data::Survey SurveyOf(const data::Rig& rig, const SurveySetting& setting,
                      const SurveyCostOptions& options);

/// The k-th place, from 0 to 1, of the Halton sequence in a base: spread evenly however many.
double SpreadPlace(int k, int base);

}  // namespace unfurl::calib
