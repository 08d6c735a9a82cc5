#pragma once

#include <concepts>

#include "sim/model/rigid_bodies.h"

namespace unfurl::sim {

class Tangent;

// Where the power of an effect goes that has no energy of its own.
enum class PowerKind {
  kNone,        // all that it does comes from its energy
  kContact,     // lost in contacts
  kDissipated,  // lost in dampers and by friction
  kWork,        // done by motors and forces from outside
};

// What an effect is called in a run and in reports.
struct EffectText {
  const char* name;         // "dampers", in lists of effects and of computing time
  const char* energy;       // of the column energy.NAME; null where it stores none
  const char* energy_what;  // what that is, in words; null likewise
};

// Something that adds loads to the bodies of a model. ForEachEffect (effects.h) walks all of them:
// for the equations of motion, their tangent, the balance of energy, columns and reports. Every
// member is required, so an effect that lacks one does not compile.
template <typename E>
concept Effect = requires(const E& effect, const Motion& motion, Load load, double* power,
                          Tangent* tangent) {
  { E::kText.name } -> std::convertible_to<const char*>;
  { E::kPower } -> std::convertible_to<PowerKind>;
  // How many the scene called for; none: the effect is never called.
  { effect.count() } -> std::convertible_to<int>;
  // Whether its power can be other than zero.
  { effect.HasPower() } -> std::same_as<bool>;
  // Adds its forces [N] and moments [N m]; and to `power`, unless null, what it loses or does [W].
  // With -dE/dt this is the power of the load: sum load . v = -dE/dt - loss + work.
  effect.AddLoad(motion, load, power);
  // Adds K = -dQ/dq and D = -dQ/dv of that load.
  effect.AddTangent(motion, tangent);
  // Stored at the motion's positions [J].
  { effect.Energy(motion) } -> std::same_as<double>;
  // Its energy without what depends on where the zero was put, for tolerances [J].
  { effect.EnergyScale(motion) } -> std::same_as<double>;
};

}  // namespace unfurl::sim
