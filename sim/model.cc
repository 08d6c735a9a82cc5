#include "sim/model.h"

#include <algorithm>

namespace unfurl::sim {

std::vector<Model::EffectCount> Model::Effects() const {
  std::vector<EffectCount> effects;
  const auto add = [&](const char* effect, int count) {
    if (count > 0) effects.push_back({effect, count});
  };
  add("bodies", DynamicBodies());
  add("bending elements", bending.count());
  if (bending.axial()) add("axial elasticity", 1);
  if (bending.damped()) add("material damping", 1);
  add("springs", springs.count());
  add("latches", latches.count());
  add("suspension", suspension.count());
  add("gravity", gravity.count());
  add("constraints", constraints.count());
  return effects;
}

int Model::FindMark(const std::string& mark) const {
  const auto found =
      std::find_if(marks.begin(), marks.end(), [&](const Mark& m) { return m.name == mark; });
  return found == marks.end() ? -1 : static_cast<int>(found - marks.begin());
}

int Model::DynamicBodies() const {
  return static_cast<int>(
      std::count_if(slots.mass.begin(), slots.mass.end(), [](double m) { return m > 0.0; }));
}

}  // namespace unfurl::sim
