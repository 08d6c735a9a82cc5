#pragma once

#include <vector>

#include "calib/observations.h"

namespace unfurl::calib {

// How much each datum counts: errors beyond the stated ones, and what is left out as gross.
struct Weighting {
  // Model-error floor by camera, added in quadrature to each reading's sigma [px].
  std::vector<double> floor_px;
  double survey_factor = 1.0;     // on the survey's stated sigmas [-]
  std::vector<char> use_reading;  // as many as readings, 0: left out; empty: all take part
  std::vector<char> use_survey;   // as many as points, likewise

  // Whether a reading takes part.
  bool Uses(std::size_t reading) const { return use_reading.empty() || use_reading[reading] != 0; }
  // Whether a surveyed point takes part.
  bool UsesSurvey(std::size_t point) const { return use_survey.empty() || use_survey[point] != 0; }
  // Of a reading, its camera's floor included [px^2].
  double Variance(const Reading& r) const {
    const double floor = floor_px[static_cast<std::size_t>(r.camera)];
    return r.s_px * r.s_px + floor * floor;
  }
  // By what the survey's inverse covariance of a point is multiplied.
  double SurveyInformationScale(std::size_t point) const {
    const double scale = 1.0 / (survey_factor * survey_factor);
    return UsesSurvey(point) ? scale : kLeftOut * scale;
  }
  // A survey that is left out still counts this much, so that a point which fewer than three
  // readings fix stays somewhere: a sigma of 10,000 times the stated.
  static constexpr double kLeftOut = 1e-8;
};

Weighting EqualWeighting(const Observations& data, double floor_px);
// The weighting of SelectPoints(all, keep).
Weighting SelectPoints(const Weighting& weighting, const Observations& all,
                       const std::vector<int>& keep);

}  // namespace unfurl::calib
