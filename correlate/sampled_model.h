#pragma once

#include <string>
#include <utility>
#include <vector>

#include "correlate/model.h"
#include "correlate/observations.h"
#include "data/run.h"

namespace unfurl::correlate {

// A record as a model without parameters: what a run or a track says at any stamp.
//
// A run is interpolated by cubic Hermite polynomials through its positions and velocities. Tracks
// are interpolated by the cubic through the four nearest samples, and their covariance goes along.
// Nothing is invented: a stamp outside the record, or in a gap of more than `max_gap` median steps,
// is answered "not known". The one exception is a run before its start, when the marks are held.
//
// Quantities, of which no rate is known, by the cubic through the four nearest samples; NaN where
// it has none. Before the start of a run that is held: KnownWhileHeld.
class SampledModel : public Model {
 public:
  static constexpr double kMaxGap = 2.5;  // a single missing sample is bridged, two are not

  explicit SampledModel(const data::Run& run, const std::vector<std::string>& marks = {},
                        const std::vector<std::string>& quantities = {});
  explicit SampledModel(Observations tracks);
  // What another model says, sampled evenly; `held_before` as for a run.
  SampledModel(const Model& model, std::span<const double> theta,
               const std::vector<std::string>& marks, double low, double high, double step);
  // The same from its answer at EvenStamps, quantities too.
  SampledModel(const Stamps& stamps, Prediction prediction);

  const Observations& samples() const { return samples_; }  // that it interpolates
  /// First and last stamp of marks and quantities [s].
  std::pair<double, double> Span() const;
  bool good() const { return good_; }  // false: the sampled model's evaluation failed
  const std::string& message() const { return message_; }            // why
  const std::vector<ModelEvent>& events() const { return events_; }  // of a model or a run

  Prediction Evaluate(std::span<const double> theta, const Stamps& stamps) const override;

 private:
  Observations samples_;
  std::vector<Eigen::Matrix3Xd> velocity_;  // per mark, 3 x n [m/s]; empty: none known
  std::vector<double> median_step_;         // per mark [s]
  bool good_ = true;
  std::string message_;
  std::vector<ModelEvent> events_;
  // A quantity in time; NaN: not known there.
  struct QuantitySeries {
    std::string name;
    std::vector<double> t;   // [s]
    Eigen::VectorXd values;  // [unit of the quantity]
    bool held = true;        // the first value stands for what was before
  };
  std::vector<QuantitySeries> quantities_;
  void FindSteps();
  Eigen::VectorXd QuantityAt(const std::string& name, const std::vector<double>& t) const;
};

// The cubic through the four samples nearest to `t` (fewer where there are fewer): indices
// first .. first + count - 1 with weights for the value and for its derivative [1/s].
struct LocalCubic {
  std::size_t first = 0;
  int count = 0;
  double value[4] = {};  // [-]
  double slope[4] = {};  // [1/s]
};
LocalCubic CubicAt(std::span<const double> stamps, double t);

// A quantity in time at other stamps, by CubicAt; NaN outside of its own, except that before them
// the first value stands where it is `held`.
Eigen::VectorXd ValuesAt(std::span<const double> stamps, std::span<const double> values, bool held,
                         std::span<const double> wanted);

// From `low` on, past `high` by less than a step, the same for all marks.
Stamps EvenStamps(const std::vector<std::string>& marks, double low, double high, double step);

double MedianStep(std::span<const double> stamps);  // 0 for fewer than two

}  // namespace unfurl::correlate
