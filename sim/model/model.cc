#include "sim/model/model.h"

#include <algorithm>
#include <cmath>

namespace unfurl::sim {
namespace {

// Of the time scale: what changes by its own size within it is before a pole. Functions that a
// person means change a million times more slowly.
constexpr double kInstant = 1e-9;

}  // namespace

std::vector<Model::EffectCount> Model::Effects() const {
  std::vector<EffectCount> effects;
  const auto add = [&](const char* effect, int count) {
    if (count > 0) effects.push_back({effect, count});
  };
  add("bodies", DynamicBodies());
  add("bending elements", bending.count());
  if (bending.axial() || kirchhoff.stretches()) add("axial elasticity", 1);
  add("smooth beams", kirchhoff.count());
  if (bending.damped() || kirchhoff.damped()) add("material damping", 1);
  ForEachEffect(*this, [&](const auto& effect) { add(effect.kText.name, effect.count()); });
  add("constraints", constraints.count());
  return effects;
}

std::string Model::FaultyFunctions(double t) const {
  const double instant = kInstant * time_scale;  // [s]
  std::string names;
  for (const Function& f : functions) {
    const data::TimeValue v = f.function.At(t);
    const bool runs_away = std::fabs(v.rate) * instant > std::fabs(v.value) && v.value != 0.0;
    if (f.function.IsFinite(t, f.derivatives) && !runs_away) continue;
    names += (names.empty() ? "" : ", ") + f.function.Describe();
  }
  return names;
}

int Model::FindMark(const std::string& mark) const {
  const auto found =
      std::find_if(marks.begin(), marks.end(), [&](const Mark& m) { return m.name == mark; });
  return found == marks.end() ? -1 : static_cast<int>(found - marks.begin());
}

int Model::DynamicBodies() const {
  return static_cast<int>(std::count_if(rigid_bodies.mass.begin(), rigid_bodies.mass.end(),
                                        [](double m) { return m > 0.0; }));
}

}  // namespace unfurl::sim
