#include "study/cost_quantities.h"

#include <fmt/format.h>
#include <fnmatch.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <set>

#include "base/error.h"
#include "base/text.h"
#include "sim/methods/simulate.h"
#include "sim/record/run_recorder.h"

namespace unfurl::study {
namespace {

using Kind = CostQuantity::Kind;

constexpr char kFrequencyPrefix[] = "frequency.";
constexpr int kMostFrequencies = 1000;  // that sim::ModesOptions takes

bool Jumps(const std::string& unit) {
  constexpr std::array kUnits = {"m/s", "rad/s", "m/s^2", "N", "N m"};
  return std::find(kUnits.begin(), kUnits.end(), unit) != kUnits.end();
}

bool EndsWithOneOf(const std::string& name, std::initializer_list<const char*> ends) {
  return std::any_of(ends.begin(), ends.end(), [&](const char* e) { return name.ends_with(e); });
}

// Everything that has a name of its own, in the order of the scene.
std::vector<CostQuantity> AllQuantities(const data::Scene& scene) {
  const auto model = sim::CompileModel(scene);
  const sim::RunRecorder recorder(*model, {}, 0.0, 1.0, false);
  const data::RunLayout layout = recorder.Layout({}, false);
  std::vector<CostQuantity> all;
  for (const data::SceneMark& mark : scene.marks) {
    all.push_back({mark.name, "m", Kind::kMark});
  }
  for (const data::Quantity& q : layout.quantities) {
    all.push_back({q.name, q.units, Kind::kSeries, Jumps(q.units)});
  }
  std::set<std::string> joints;
  for (const data::SceneJoint& joint : scene.joints) joints.insert(joint.name);
  for (const data::Quantity& q : layout.summary) {
    if (!joints.contains(q.name.substr(0, q.name.find('.')))) continue;
    all.push_back({q.name, q.units, Kind::kNumber});
  }
  for (const data::SceneWatch& watch : scene.watches) {
    all.push_back({watch.name + ".time", "s", Kind::kNumber});
  }
  return all;
}

bool IsDefault(const CostQuantity& q, const data::Scene& scene) {
  if (q.kind == Kind::kMark) return true;
  const std::string owner = q.name.substr(0, q.name.find('.'));
  const auto owns = [&](const auto& thing) { return thing.name == owner; };
  const bool of_joint = std::any_of(scene.joints.begin(), scene.joints.end(), owns);
  if (q.kind == Kind::kSeries) return of_joint && EndsWithOneOf(q.name, {".theta", ".travel"});
  return !of_joint || EndsWithOneOf(q.name, {".latch_time", ".peak_moment", ".peak_pin_force"});
}

// "frequency.3".
bool AsFrequency(const std::string& name, CostQuantity* out) {
  if (!name.starts_with(kFrequencyPrefix)) return false;
  const char* first = name.data() + sizeof kFrequencyPrefix - 1;
  const char* last = name.data() + name.size();
  int mode = 0;
  const auto [end, fault] = std::from_chars(first, last, mode);
  if (fault != std::errc() || end != last || mode < 1 || mode > kMostFrequencies) return false;
  *out = {name, "Hz", Kind::kFrequency, false, mode};
  return true;
}

}  // namespace

std::vector<std::string> CostQuantity::Columns() const {
  if (kind == Kind::kMark) return {name + ".x", name + ".y"};
  if (kind == Kind::kSeries) return {name};
  return {};
}

std::vector<CostQuantity> CostQuantities(const data::Scene& scene,
                                         const std::vector<std::string>& wanted) {
  const std::vector<CostQuantity> all = AllQuantities(scene);
  std::vector<CostQuantity> out;
  if (wanted.empty()) {
    std::copy_if(all.begin(), all.end(), std::back_inserter(out),
                 [&](const CostQuantity& q) { return IsDefault(q, scene); });
    if (!out.empty()) return out;
    throw Error("the scene has neither marks nor joints to compare", scene.path,
                "give it a [mark.NAME], or name what counts with --quantity");
  }
  const auto add = [&](const CostQuantity& q) {
    const auto same = [&](const CostQuantity& other) { return other.name == q.name; };
    if (std::none_of(out.begin(), out.end(), same)) out.push_back(q);
  };
  for (const std::string& name : wanted) {
    CostQuantity frequency;
    bool found = AsFrequency(name, &frequency);
    if (found) add(frequency);
    for (const CostQuantity& q : all) {
      if (fnmatch(name.c_str(), q.name.c_str(), FNM_NOESCAPE) != 0) continue;
      found = true;
      add(q);
    }
    if (found) continue;
    std::vector<std::string> names;
    names.reserve(all.size());
    for (const CostQuantity& q : all) names.push_back(q.name);
    const std::string nearest = NearestName(name, names);
    throw Error(fmt::format("the scene has no quantity '{}'", name), "option quantity",
                nearest.empty()
                    ? "name a mark, quantities of a run such as 'joint1.*', EVENT.time or "
                      "frequency.1"
                    : "did you mean '" + nearest + "'?");
  }
  return out;
}

}  // namespace unfurl::study
