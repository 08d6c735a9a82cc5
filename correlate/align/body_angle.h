#pragma once

#include <string>
#include <utility>
#include <vector>

#include "correlate/align/registration.h"
#include "correlate/sampled_model.h"

namespace unfurl::correlate {

// Pairs of marks that sit on one body: their distance in the model stays constant within 1e-4 of
// itself and, where the model is a measurement, its noise. Each mark is named in one pair at most.
std::vector<std::pair<std::string, std::string>> RigidPairs(const Prediction& prediction,
                                                            const std::vector<std::string>& marks);

// The angle in the model's plane of the line from one mark to another, at the first one's stamps.
// The second flashed at other times: the record is interpolated to the first's stamps, and where it
// has a gap there the sample is left out.
struct BodyAngle {
  std::string first, second;
  std::vector<double> t;          // on the record's clock [s]
  std::vector<double> measured;   // [rad], unwrapped; starts within half a turn of the model's
  std::vector<double> sigma;      // of the samples' own errors [rad]
  std::vector<double> simulated;  // the model's, at the same times [rad]
};

// `model` is asked for both marks at the same instants.
BodyAngle MeasureBodyAngle(const Observations& observations, const Model& model,
                           std::span<const double> theta, const Registration& at,
                           const std::string& first, const std::string& second);

}  // namespace unfurl::correlate
