#include "calib/calibrate_survey.h"

#include <utility>

#include "calib/near_frame.h"
#include "measure/survey_readings.h"

namespace unfurl::calib {

Calibration Calibrate(data::Survey survey, CalibrateOptions options, const std::string& where,
                      Observations* used) {
  measure::FindSurveyReadings(&survey, options.workers);
  const Observations data = FromSurvey(survey, where);
  if (!options.explain.station.allFinite()) options.explain.station = survey.station;
  Calibration result = Calibrate(data, options, where);
  for (const std::string& note : survey.notes) result.rig.reasons.push_back(note);
  if (used != nullptr) {
    *used = data;
    // Drawn where they are, or where the others are.
    for (const FarPoint& far : result.report.far) {
      used->p.col(far.point) = far.found ? far.at : MiddleOf(data.p);
    }
  }
  return result;
}

}  // namespace unfurl::calib
