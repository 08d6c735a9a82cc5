#pragma once

#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "correlate/model.h"
#include "data/run.h"
#include "sim/methods/simulate.h"
#include "sim/model/model.h"
#include "study/step_samples.h"

namespace unfurl::study {

/// What one run of a scene is asked for: the same request is the same motion, to the last bit.
struct MotionRequest {
  std::vector<double> theta;  // [units of the parameters]
  std::vector<std::string> marks, quantities;
  double step = 0.0;      // least distance of two samples of a quantity [s]
  double duration = 0.0;  // 0: one that is short [s]

  bool operator==(const MotionRequest&) const = default;

  /// For `stamps`. Durations go in steps of about a hundredth, so that stamps that a clock moves by
  /// little are answered by the motion that there is.
  static MotionRequest For(std::span<const double> theta, const correlate::Stamps& stamps);
};

/// How a scene moved, to be asked at any stamps: sampled as its steps go, so that what lies between
/// two samples adds a small part to what a step leaves.
class SceneMotion {
 public:
  /// Simulates. A run that fails is a motion with a message.
  SceneMotion(const sim::Model& model, const MotionRequest& wanted, double rtol);

  /// Of the marks and quantities of the request.
  correlate::Prediction At(const correlate::Stamps& stamps) const;
  std::size_t bytes() const;                                              // that the samples take
  const std::vector<std::string>& warnings() const { return warnings_; }  // of scene and run

 private:
  class Collector;

  correlate::MarkMotion MarkAt(std::size_t mark, const std::vector<double>& stamps) const;
  Eigen::VectorXd QuantityAt(const correlate::QuantityStamps& asked) const;
  bool StartsAtRest() const;

  std::string failure_;
  std::vector<std::string> warnings_;
  std::optional<MarkSamples> marks_;
  std::optional<QuantitySamples> quantities_;
  double first_rate_ = 0.0, highest_rate_ = 0.0;  // of turning, without marks [rad/s]
  bool held_ = true;                              // stood still before the start
  std::vector<correlate::ModelEvent> events_;
};

/// The last motions of a scene. Safe to use from several threads.
class MotionStore {
 public:
  /// The 24 last of a deployment of 5 s with four marks: a point comes back after the differences
  /// about it.
  static constexpr std::size_t kMostBytes = 32'000'000;

  explicit MotionStore(std::size_t most_bytes = kMostBytes) : most_bytes_(most_bytes) {}
  /// That of an equal request, or the one that `make` makes.
  std::shared_ptr<const SceneMotion> Get(
      const MotionRequest& wanted, const std::function<std::shared_ptr<const SceneMotion>()>& make);

  /// Of the kept motion nearest to `theta`, each parameter by its size; none: none is kept.
  std::optional<std::vector<std::string>> WarningsNear(std::span<const double> theta) const;

 private:
  struct Kept {
    MotionRequest request;
    std::shared_ptr<const SceneMotion> motion;
  };
  std::size_t most_bytes_;
  mutable std::mutex mutex_;
  std::deque<Kept> kept_;  // the latest last
  std::size_t bytes_ = 0;
};

}  // namespace unfurl::study
