#pragma once

#include <array>
#include <cstddef>
#include <tuple>
#include <type_traits>
#include <utility>

#include "sim/effects/damper.h"
#include "sim/effects/effect.h"
#include "sim/effects/forces.h"
#include "sim/effects/friction.h"
#include "sim/effects/gravity.h"
#include "sim/effects/joint_effect.h"
#include "sim/effects/latches.h"
#include "sim/effects/linear_springs.h"
#include "sim/effects/moment_table.h"
#include "sim/effects/motor.h"
#include "sim/effects/quadratic_damper.h"
#include "sim/effects/spring.h"
#include "sim/effects/suspension.h"

namespace unfurl::sim {

// The moments on joints' coordinates: for every record of data::SceneJointEffects its law. One
// without a law does not compile.
using JointEffects =
    std::tuple<JointEffect<Spring>, JointEffect<Damper>, JointEffect<MomentTable>,
               JointEffect<Friction>, JointEffect<Motor>, JointEffect<QuadraticDamper>>;
inline constexpr std::size_t kJointEffects = std::tuple_size_v<JointEffects>;

// Everything that adds loads to bodies, but for the beams' own elasticity and the constraints. What
// is not in the scene is empty, and never called.
struct ModelEffects {
  JointEffects joint_effects;
  LinearSprings linear_springs;
  Forces forces;
  Latches latches;
  Suspension suspension;
  Gravity gravity;

  // All as one tuple of references, in the order in which their loads are summed.
  auto All() const {
    const auto& [joint, a, b, c, d, e] = *this;  // every member, or the compiler objects
    return std::tuple_cat(std::apply([](const auto&... each) { return std::tie(each...); }, joint),
                          std::tie(a, b, c, d, e));
  }
};

// Calls visit(effect) for all of them; the compiler unrolls it.
template <typename Visit>
void ForEachEffect(const ModelEffects& effects, Visit&& visit) {
  std::apply([&](const Effect auto&... each) { (visit(each), ...); }, effects.All());
}
// Likewise for the effects of joints, visit(effect, index into Model::Joint::effects).
template <typename Effects, typename Visit>
void ForEachJointEffect(Effects& joint_effects, Visit&& visit) {
  std::size_t index = 0;
  std::apply([&](auto&... each) { (visit(each, index++), ...); }, joint_effects);
}

// The place in JointEffects of the law that a scene's record calls for.
template <typename Record, std::size_t kIndex = 0>
constexpr std::size_t JointEffectIndex() {
  static_assert(kIndex < kJointEffects, "the record has no law in JointEffects (effects.h)");
  if constexpr (std::is_same_v<typename std::tuple_element_t<kIndex, JointEffects>::Record,
                               Record>) {
    return kIndex;
  } else {
    return JointEffectIndex<Record, kIndex + 1>();
  }
}

inline constexpr std::size_t kEffects =
    std::tuple_size_v<decltype(std::declval<const ModelEffects&>().All())>;

// The place of an effect in that order.
template <typename E, std::size_t kIndex = 0>
constexpr std::size_t EffectIndex() {
  using All = decltype(std::declval<const ModelEffects&>().All());
  if constexpr (std::is_same_v<std::remove_cvref_t<std::tuple_element_t<kIndex, All>>, E>) {
    return kIndex;
  } else {
    return EffectIndex<E, kIndex + 1>();
  }
}

// What they are called, in the same order.
template <typename... E>
constexpr std::array<EffectText, sizeof...(E)> TextsOf(const std::tuple<E...>*) {
  return {std::remove_cvref_t<E>::kText...};
}
inline constexpr std::array<EffectText, kEffects> kEffectTexts =
    TextsOf(static_cast<const decltype(std::declval<const ModelEffects&>().All())*>(nullptr));

}  // namespace unfurl::sim
