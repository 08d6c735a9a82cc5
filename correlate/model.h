#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

namespace unfurl::correlate {

/// A quantity of the model that somebody wants, at stamps of its own.
struct QuantityStamps {
  std::string key;        ///< who asks; one of a kind within a record
  std::string quantity;   ///< "hinge.theta", as the columns of a run are named
  std::vector<double> t;  ///< n, ascending, on the model's own clock [s]
  /// What lies later is welcome, and may be unknown [s].
  double needed = std::numeric_limits<double>::infinity();
};

// What is wanted of a model: for each mark the times at which its position is needed. The stamps
// may be uneven and differ between marks (LEDs that flash one after another). And quantities of its
// run.
struct Stamps {
  std::vector<std::string> marks;      // m names
  std::vector<std::vector<double>> t;  // m lists, ascending, on the model's own clock [s]
  std::vector<QuantityStamps> quantities;

  // The latest of all; 0: there is none [s].
  double Last() const;
};

// Where the model's own clock says that the marks stand still before it starts (a structure held
// until its release), stamps before the start are answered with the first position and zero
// velocity; see docs/physics-correlation.md.
struct MarkMotion {
  Eigen::Matrix3Xd p;  // 3 x n, in the model's frame M; a planar model has z = 0 [m]
  Eigen::Matrix3Xd v;  // 3 x n [m/s]
  // n; 0: the model has no answer at that stamp, and p, v are 0 there. Empty: all are known.
  std::vector<std::uint8_t> known;
  // Error covariance of p where the model is itself a measurement: xx, xy, xz, yy, yz, zz by n
  // [m^2]; empty: none.
  Eigen::Matrix<double, 6, Eigen::Dynamic> cov;
};

/// What the model says of one QuantityStamps.
struct QuantityValues {
  std::string key;         ///< who asked
  Eigen::VectorXd values;  ///< n; NaN: the model has none at that stamp [unit of the quantity]
};

/// What happened in a model, and when.
struct ModelEvent {
  double t = 0.0;  // [s]
  std::string kind;
  std::string where;
};

/// Whether a model could be evaluated.
enum class ModelStatus : std::int32_t {
  kGood = 0,
  kFailed = 1,  // the model could not be evaluated here; the message says why
};

/// What a model gives for one set of parameters.
struct Prediction {
  ModelStatus status = ModelStatus::kGood;
  std::string message;                     // of a failure
  std::vector<MarkMotion> marks;           // m, in the order of the stamps
  std::vector<QuantityValues> quantities;  // in the order of the stamps
  double noise = 0.0;              // the model's own numerical scatter in p: how much of it changes
                                   // erratically when a parameter is moved a little [m]
  double seconds = 0.0;            // what the evaluation cost
  std::vector<ModelEvent> events;  // if it has them
  bool held_before = true;         // the marks stand still before the model's start, at t < 0
};

/// Whether a quantity of this unit is known of a structure that is held before its release: places
/// are what they are at the start, and rates are 0. Of what holds it nothing is known, so not of
/// forces, moments and accelerations.
bool KnownWhileHeld(const std::string& unit);

// A function from parameters to tracks: a simulator, an interpolated record, an external program.
class Model {
 public:
  virtual ~Model() = default;

  // `theta` in the order the study lists its parameters, in their own units. A failure is a status,
  // never an exception; misuse (an unknown mark) throws Error. Safe to call from several threads,
  // and the answer depends on the arguments alone.
  virtual Prediction Evaluate(std::span<const double> theta, const Stamps& stamps) const = 0;
};

}  // namespace unfurl::correlate
