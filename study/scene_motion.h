#pragma once

#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "correlate/model.h"
#include "data/run.h"
#include "sim/methods/simulate.h"
#include "sim/model/model.h"

namespace unfurl::study {

/// What one run of a scene is asked for: the same request is the same motion, to the last bit.
struct MotionRequest {
  std::vector<double> theta;  // [units of the parameters]
  std::vector<std::string> marks, quantities;
  double rate = 0.0;      // samples per second [1/s]
  double duration = 0.0;  // [s]

  bool operator==(const MotionRequest&) const = default;

  /// For `stamps`. Durations go in steps of about a hundredth, so that stamps that a clock moves by
  /// little are answered by the motion that there is.
  static MotionRequest For(std::span<const double> theta, const correlate::Stamps& stamps);
};

/// How a scene moved, sampled evenly, to be asked at any stamps.
class SceneMotion {
 public:
  /// Simulates. A run that fails is a motion with a message.
  SceneMotion(const sim::Model& model, const MotionRequest& wanted, double rtol);

  /// Of the marks and quantities of the request.
  correlate::Prediction At(const correlate::Stamps& stamps) const;
  std::size_t bytes() const;  // that the samples take

 private:
  class Collector;
  struct Sample {
    double x, y, vx, vy;  // [m], [m/s]
  };

  correlate::MarkMotion MarkAt(std::size_t mark, const std::vector<double>& stamps) const;
  Eigen::VectorXd QuantityAt(const correlate::QuantityStamps& asked) const;
  bool StartsAtRest() const;

  std::string failure_;
  std::vector<double> t_;                     // [s]
  std::vector<std::vector<Sample>> samples_;  // by mark
  std::vector<data::Quantity> quantities_;
  std::vector<std::vector<double>> columns_;      // by quantity [their units]
  double first_rate_ = 0.0, highest_rate_ = 0.0;  // of turning, without marks [rad/s]
  bool held_ = true;                              // stood still before the start
  std::vector<correlate::ModelEvent> events_;
};

/// The last motions of a scene. Safe to use from several threads.
class MotionStore {
 public:
  /// That of an equal request, or the one that `make` makes.
  std::shared_ptr<const SceneMotion> Get(
      const MotionRequest& wanted, const std::function<std::shared_ptr<const SceneMotion>()>& make);

 private:
  struct Kept {
    MotionRequest request;
    std::shared_ptr<const SceneMotion> motion;
  };
  std::mutex mutex_;
  std::deque<Kept> kept_;  // the latest last
  std::size_t bytes_ = 0;
};

}  // namespace unfurl::study
