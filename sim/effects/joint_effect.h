#pragma once

#include <cmath>
#include <concepts>
#include <cstddef>
#include <vector>

#include "data/time_function.h"
#include "sim/effects/effect.h"
#include "sim/implicit/tangent.h"
#include "sim/model/coordinate.h"

namespace unfurl::sim {

// A joint's coordinate at one instant: theta of a revolute joint, else the travel. Units are given
// for the angle; for the travel read m for rad and N for N m.
struct JointInstant {
  double value;  // [rad]
  double rate;   // [rad/s]
  double t;      // [s]
};

// Derivatives of a moment on the coordinate.
struct MomentSlopes {
  double by_value;  // [N m/rad]
  double by_rate;   // [N m s/rad]
};

// The law of one joint effect: a moment on the coordinate, as a function of the coordinate, its
// rate and the time. It is made from its scene record and states
//   kText, kPower   its names, and where its power goes; it either stores energy or has power
//   kKey, kOf       of the column JOINT.KEY_moment, and "of the damper" in its description
//   Moment          on the coordinate [N m]
//   Slopes          derivatives of Moment
//   Energy          potential, -d/d(value) of which is the moment [J]; 0 where kPower is not kNone
//   MarginMoment    the moment that counts in the torque margin [N m], positive where it resists
//                   the closing of a latch (docs/physics-simulator.md)
//   Function        its function of time, to name it where it fails; null where it has none
template <typename L>
concept JointLaw = std::constructible_from<L, const typename L::Record&> &&
    requires(const L& law, const JointInstant& at) {
  { L::kText.name } -> std::convertible_to<const char*>;
  { L::kPower } -> std::convertible_to<PowerKind>;
  { L::kKey } -> std::convertible_to<const char*>;
  { L::kOf } -> std::convertible_to<const char*>;
  { law.Moment(at) } -> std::same_as<double>;
  { law.Slopes(at) } -> std::same_as<MomentSlopes>;
  { law.Energy(at) } -> std::same_as<double>;
  { law.MarginMoment(at) } -> std::same_as<double>;
  { law.Function() } -> std::same_as<const data::TimeFunction*>;
};

// All joints' effects of one law.
template <JointLaw Law>
class JointEffect {
 public:
  using Record = typename Law::Record;
  static constexpr EffectText kText = Law::kText;
  static constexpr PowerKind kPower = Law::kPower;
  static constexpr const char* kKey = Law::kKey;
  static constexpr const char* kOf = Law::kOf;
  static_assert((kPower == PowerKind::kNone) == (kText.energy != nullptr),
                "a law stores energy or has power; one that does both is two effects");

  void Add(const Coordinate& coordinate, const Record& record) {
    coordinates_.push_back(coordinate);
    laws_.emplace_back(record);
  }
  int count() const { return static_cast<int>(laws_.size()); }
  const Coordinate& coordinate(int k) const { return coordinates_[Index(k)]; }
  const Law& law(int k) const { return laws_[Index(k)]; }

  double Moment(int k, const Motion& motion) const { return law(k).Moment(At(k, motion)); }
  double MarginMoment(int k, const Motion& motion) const {
    return law(k).MarginMoment(At(k, motion));
  }

  bool HasPower() const { return kPower != PowerKind::kNone && count() > 0; }
  void AddLoad(const Motion& motion, Load load, double* power) const {
    for (int k = 0; k < count(); ++k) {
      const JointInstant at = At(k, motion);
      const double moment = law(k).Moment(at);
      if constexpr (kPower == PowerKind::kWork) {
        if (power != nullptr) *power += moment * at.rate;
      } else if constexpr (kPower != PowerKind::kNone) {
        if (power != nullptr) *power -= moment * at.rate;
      }
      coordinate(k).Apply(motion, moment, load);
    }
  }
  void AddTangent(const Motion& motion, Tangent* tangent) const {
    for (int k = 0; k < count(); ++k) {
      const JointInstant at = At(k, motion);
      const MomentSlopes slopes = law(k).Slopes(at);
      tangent->AddCoordinate(motion, coordinate(k), -slopes.by_value, -slopes.by_rate,
                             law(k).Moment(at));
    }
  }
  double Energy(const Motion& motion) const {
    double sum = 0.0;
    for (int k = 0; k < count(); ++k) sum += law(k).Energy(At(k, motion));
    return sum;
  }
  double EnergyScale(const Motion& motion) const {
    double sum = 0.0;
    for (int k = 0; k < count(); ++k) sum += std::fabs(law(k).Energy(At(k, motion)));
    return sum;
  }

 private:
  static std::size_t Index(int k) { return static_cast<std::size_t>(k); }
  JointInstant At(int k, const Motion& motion) const {
    const Coordinate::State state = coordinate(k).At(motion);
    return {state.value, state.rate, motion.t};
  }

  std::vector<Coordinate> coordinates_;
  std::vector<Law> laws_;
};

}  // namespace unfurl::sim
