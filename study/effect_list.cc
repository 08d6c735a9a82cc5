// Which effects a scene has and could have, and how each is switched.
#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "study/effects.h"

namespace unfurl::study {

namespace {

// Switches of one kind, together or each for itself, in the order of their kinds.
class Switches {
 public:
  explicit Switches(bool each) : each_(each) {}
  // `kind` in words; `part` says of which, where each is by itself.
  void Add(const std::string& kind, const std::string& part, bool there,
           std::vector<std::string> set) {
    const std::string name = each_ && !part.empty() ? kind + " (" + part + ")" : kind;
    const auto found = std::find_if(all_.begin(), all_.end(),
                                    [&](const EffectSwitch& s) { return s.name == name; });
    EffectSwitch& to = found != all_.end() ? *found : all_.emplace_back();
    to.name = name;
    to.there = there;
    to.set.insert(to.set.end(), set.begin(), set.end());
  }
  std::vector<EffectSwitch> Take() { return std::move(all_); }

 private:
  bool each_;
  std::vector<EffectSwitch> all_;
};

// "joint effects" by their keys, in words.
const std::map<std::string, std::string>& JointEffectWords() {
  static const std::map<std::string, std::string> words = {
      {"spring", "springs of the joints"},
      {"damper", "dampers of the joints"},
      {"table", "moment tables of the joints"},
      {"friction", "friction of the joints"},
      {"motor", "motors of the joints"},
      {"quadratic_damper", "quadratic dampers of the joints"},
  };
  return words;
}

void AddJoints(const data::Scene& scene, Switches* out) {
  for (const data::SceneJoint& joint : scene.joints) {
    const std::string table = "joint." + joint.name + ".";
    if (joint.latch) {
      const data::SceneLatch& latch = *joint.latch;
      if (latch.theta_a + latch.theta_b > 0.0) {
        // Both stops where their middle was: the same place, no play.
        const double middle = 0.5 * (latch.theta_a - latch.theta_b);
        out->Add("clearance", joint.name, true,
                 {fmt::format("{}latch.theta_a={:.17g}", table, middle),
                  fmt::format("{}latch.theta_b={:.17g}", table, -middle)});
      }
      out->Add("latches", joint.name, true, {table + "latch="});
    }
    data::VisitJointEffects(joint, [&]<typename E>(const std::optional<E>& effect) {
      if (!effect) return;
      out->Add(JointEffectWords().at(E::kKey), joint.name, true, {table + E::kKey + "="});
    });
  }
}

void AddContacts(const data::Scene& scene, const data::TomlTable& document, Switches* out) {
  for (const data::SceneContact& contact : scene.contacts) {
    const std::string table = "contact." + contact.name + ".";
    if (contact.law == data::SceneContact::Law::kHuntCrossley) {
      if (contact.alpha > 0.0)
        out->Add("losses in contacts", contact.name, true, {table + "alpha=0"});
    } else if (contact.C > 0.0) {
      // Either C itself, or the restitution that it is made of.
      const bool made = document.Table("contact").Table(contact.name).Has("restitution");
      out->Add("losses in contacts", contact.name, true,
               {table + (made ? "restitution=1" : "C=0")});
    }
  }
}

void AddBeams(const data::Scene& scene, Switches* out) {
  constexpr int kStiffest = 1;  // segments of a beam that cannot bend
  constexpr int kMostOrder = 11, kMoreOrders = 2, kOrder = 4;  // of smooth beams, docs/scene.md
  for (const data::SceneBeam& beam : scene.beams) {
    const std::string table = "beam." + beam.name + ".";
    const bool smooth = beam.model == data::BeamModel::kKirchhoff;
    if (beam.damping > 0.0)
      out->Add("damping of the beams", beam.name, true, {table + "damping=0"});
    if (beam.axial_elastic) {
      out->Add("stretching of the beams", beam.name, true, {table + "axial=rigid"});
    } else if (beam.EA > 0.0) {
      out->Add("stretching of the beams", beam.name, false, {table + "axial=elastic"});
    }
    std::vector<std::string> rigid = {table + "model=segments",
                                      fmt::format("{}segments={}", table, kStiffest)};
    if (smooth || beam.segments > kStiffest)
      out->Add("bending of the beams", beam.name, true, rigid);
    if (smooth) {
      if (beam.order < kMostOrder) {
        out->Add(
            "a finer mesh", beam.name, false,
            {fmt::format("{}order={}", table, std::min(kMostOrder, beam.order + kMoreOrders))});
      }
    } else {
      out->Add("a finer mesh", beam.name, false,
               {fmt::format("{}segments={}", table, 2 * beam.segments)});
      if (beam.gradient_form && (beam.axial_elastic || beam.along_chord)) {
        out->Add("smooth beams", beam.name, false,
                 {table + "model=kirchhoff", fmt::format("{}order={}", table, kOrder)});
      }
    }
  }
}

}  // namespace

const char* Name(EffectVerdict verdict) {
  switch (verdict) {
    case EffectVerdict::kUnjudged:
      return "-";
    case EffectVerdict::kNeeded:
      return "needed";
    case EffectVerdict::kNotNeeded:
      return "not needed";
    case EffectVerdict::kCannotTell:
      return "cannot be told";
    case EffectVerdict::kAgainst:
      return "contradicted";
    case EffectVerdict::kFailed:
      break;
  }
  return "does not run";
}

std::vector<EffectSwitch> EffectsOf(const data::Scene& scene, const data::TomlTable& document,
                                    bool each) {
  Switches out(each);
  if (scene.gravity) out.Add("gravity", "", true, {"gravity="});
  if (scene.suspension) out.Add("suspension", "", true, {"suspension="});
  AddJoints(scene, &out);
  AddContacts(scene, document, &out);
  for (const data::SceneLinearSpring& spring : scene.linear_springs) {
    out.Add("springs between points", spring.name, true, {"spring." + spring.name + "="});
  }
  for (const data::SceneForce& force : scene.forces) {
    out.Add("forces", force.name, true, {"force." + force.name + "="});
  }
  AddBeams(scene, &out);
  return out.Take();
}

}  // namespace unfurl::study
