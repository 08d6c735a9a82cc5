#include "calib/calibrate_survey.h"

#include <utility>

#include "measure/survey_readings.h"

namespace unfurl::calib {

Calibration Calibrate(data::Survey survey, CalibrateOptions options, const std::string& where,
                      Observations* used) {
  measure::FindSurveyReadings(&survey, options.workers);
  const Observations data = FromSurvey(survey, where);
  options.explain.station = survey.station;
  if (survey.has_lines()) options.explain.pixels = static_cast<double>(survey.format.active);
  Calibration result = Calibrate(data, options, where);
  for (const std::string& note : survey.notes) result.rig.reasons.push_back(note);
  if (used != nullptr) *used = data;
  return result;
}

}  // namespace unfurl::calib
