// Joints, what acts on their coordinates, and the contacts of their latches.
#include <fmt/format.h>

#include <functional>
#include <limits>

#include "base/text.h"
#include "data/scene_reader.h"

namespace unfurl::data {
namespace {

using SceneReadJointsKind = SceneJoint::Kind;

// Names of the keys for the coordinate that effects act on.
bool ActsOnTravel(const SceneJoint& joint) { return joint.kind != SceneReadJointsKind::kRevolute; }

// A joint effect's table, and what its keys are called for the joint's coordinate.
struct EffectTable {
  const TomlTable& table;
  const char* coordinate;  // "theta", "travel"
  const char* moment;      // "moment", "force"
  // SceneReader::ReadFunction, for one without derivatives.
  const std::function<TimeFunction(const TomlTable&, const char*)>& function;
};

void ReadRecord(const EffectTable& in, SceneSpring* spring) {
  spring->stiffness = in.table.Number("stiffness", kPositive);
  if (in.table.Has("free")) {
    if (in.table.Has("preload")) {
      in.table.Fail("preload", "free and preload are both given", "keep one");
    }
    spring->preload = -in.table.Number("free");
  } else {
    spring->preload = in.table.NumberOr("preload", 0.0);
  }
}

void ReadRecord(const EffectTable& in, SceneDamper* damper) {
  damper->damping = in.table.Number("damping", kPositive);
}

void ReadRecord(const EffectTable& in, SceneQuadraticDamper* damper) {
  damper->damping = in.table.Number("damping", kPositive);
}

void ReadRecord(const EffectTable& in, SceneMomentTable* points) {
  points->coordinate = in.table.Numbers(in.coordinate, -1);
  points->moment = in.table.Numbers(in.moment, -1);
  if (points->coordinate.size() < 2) {
    in.table.Fail(in.coordinate, "the table has less than two points", "give two or more");
  }
  if (points->coordinate.size() != points->moment.size()) {
    in.table.Fail(
        in.moment,
        fmt::format("{} values for {} points", points->moment.size(), points->coordinate.size()),
        "give one for each point");
  }
  for (std::size_t k = 1; k < points->coordinate.size(); ++k) {
    if (points->coordinate[k] > points->coordinate[k - 1]) continue;
    in.table.Fail(in.coordinate,
                  fmt::format("the points do not rise: {} follows {}", points->coordinate[k],
                              points->coordinate[k - 1]),
                  "put them in order, each once");
  }
}

void ReadRecord(const EffectTable& in, SceneFriction* friction) {
  friction->moment = in.table.Number(in.moment, kPositive);
  friction->creep_rate = in.table.Number("creep_rate", kPositive);
}

void ReadRecord(const EffectTable& in, SceneMotor* motor) {
  motor->moment = in.function(in.table, in.moment);
}

double ReadHertzStiffness(const TomlTable& table) {
  if (table.Has("K")) {
    RefuseKeys(table, {"radius_i", "radius_j", "modulus_i", "modulus_j", "poisson_i", "poisson_j"},
               "K is given, which this would make");
    return table.Number("K", kPositive);
  }
  constexpr TomlRange kPoisson{-1.0, 0.5, true, false};
  const double infinity = std::numeric_limits<double>::infinity();
  const double radius_i = table.Number("radius_i", kPositive);
  const double radius_j = table.Has("radius_j") ? table.Number("radius_j", kPositive) : infinity;
  return HertzStiffness(radius_i, radius_j, table.Number("modulus_i", kPositive),
                        table.Number("poisson_i", kPoisson), table.Number("modulus_j", kPositive),
                        table.Number("poisson_j", kPoisson));
}

void ReadRampedDamping(const TomlTable& table, SceneContact* c) {
  if (table.Has("C")) {
    RefuseKeys(table, {"mass", "linear_stiffness", "restitution"},
               "C is given, which this would make");
    c->C = table.Number("C", kNonNegative);
  } else {
    c->C =
        ContactDamping(table.Number("mass", kPositive), table.Number("linear_stiffness", kPositive),
                       table.Number("restitution", TomlRange{0.0, 1.0, true, false}));
  }
  c->Q = table.Number("Q", kNonNegative);
  c->epsilon = table.Number("epsilon", kPositive);
}

}  // namespace

void SceneReader::ReadContacts() {
  for (const auto& [name, table] : root_.NamedTables("contact")) {
    CheckName(table, name);
    SceneContact c;
    c.name = name;
    c.K = ReadHertzStiffness(table);
    const std::string law = table.ChoiceOr("law", "ramped", {"ramped", "hunt_crossley"});
    if (law == "hunt_crossley") {
      c.law = SceneContact::Law::kHuntCrossley;
      RefuseKeys(table, {"C", "mass", "linear_stiffness", "restitution", "Q", "epsilon"},
                 "a contact of the law \"hunt_crossley\" is damped by alpha alone");
      c.alpha = table.Number("alpha", kNonNegative);
    } else {
      RefuseKeys(table, {"alpha"}, "alpha belongs to the law \"hunt_crossley\"");
      ReadRampedDamping(table, &c);
    }
    c.never_pulls = table.ChoiceOr("pull", "never", {"never", "printed"}) == "never";
    c.where = table.Where();
    contacts_[name] = static_cast<int>(scene_.contacts.size());
    scene_.contacts.push_back(c);
  }
}

void SceneReader::ReadJoints() {
  for (const auto& [name, table] : root_.NamedTables("joint")) {
    Register(table, name, Thing::kJoint);
    SceneJoint joint;
    joint.name = name;
    joint.where = table.Where();
    const std::string type =
        table.ChoiceOr("type", "revolute", {"revolute", "slider", "pin_in_slot"});
    joint.kind = type == "revolute" ? SceneReadJointsKind::kRevolute
                 : type == "slider" ? SceneReadJointsKind::kSlider
                                    : SceneReadJointsKind::kPinInSlot;
    joint.inner = ReadEnd(table, "inner", "inner_point");
    joint.outer = ReadEnd(table, "outer", "outer_point");
    joint.sign = table.IntegerOr("sign", 1, -1, 1);
    if (joint.sign == 0.0) table.Fail("sign", "the sign is 0", "use 1 or -1");
    joint.zero_angle = table.NumberOr("zero_angle", 0.0);
    ReadStart(table, &joint);
    ReadJointEffects(table, &joint);
    scene_.joints.push_back(std::move(joint));
  }
}

void SceneReader::ReadStart(const TomlTable& table, SceneJoint* joint) {
  if (joint->kind != SceneReadJointsKind::kSlider) {
    joint->theta = table.NumberOr("theta", 0.0);
    joint->theta_rate = table.NumberOr("theta_rate", 0.0);
    joint->hang_theta = table.NumberOr("hang_theta", 0.0);
  } else {
    RefuseKeys(table, {"theta", "theta_rate", "hang_theta"}, "a slider does not turn");
  }
  if (joint->kind != SceneReadJointsKind::kRevolute) {
    joint->axis = table.NumberOr("axis", 0.0);
    joint->travel = table.NumberOr("travel", 0.0);
    joint->travel_rate = table.NumberOr("travel_rate", 0.0);
    joint->hang_travel = table.NumberOr("hang_travel", 0.0);
  } else {
    RefuseKeys(table, {"axis", "travel", "travel_rate", "hang_travel"},
               "a revolute joint has no travel");
  }
}

void SceneReader::ReadJointEffects(const TomlTable& table, SceneJoint* joint) {
  const std::function<TimeFunction(const TomlTable&, const char*)> function =
      [this](const TomlTable& owner, const char* key) { return ReadFunction(owner, key, 0); };
  const bool travel = ActsOnTravel(*joint);
  VisitJointEffects(*joint, [&]<typename Record>(std::optional<Record>& record) {
    const auto effect = table.TableOrNone(Record::kKey);
    if (!effect) return;
    record.emplace();
    record->where = effect->Where();
    ReadRecord({*effect, travel ? "travel" : "theta", travel ? "force" : "moment", function},
               &*record);
  });
  if (const auto drive = table.TableOrNone("drive")) ReadDrive(*drive, table, joint);
  if (joint->drive && joint->motor) {
    table.Fail("motor", "the joint is driven, so a motor changes nothing", "keep one of the two");
  }
  if (const auto latch = table.TableOrNone("latch")) {
    if (joint->kind != SceneReadJointsKind::kRevolute) {
      table.Fail("latch", "only a revolute joint can have a latch", "remove it");
    }
    ReadLatch(*latch, joint);
  }
}

// A driven coordinate starts where its drive says.
void SceneReader::ReadDrive(const TomlTable& table, const TomlTable& owner, SceneJoint* joint) {
  SceneDrive drive;
  drive.where = table.Where();
  drive.by_rate = table.Has("rate");
  const bool by_position = table.Has("position");
  if (drive.by_rate && by_position) {
    table.Fail("rate", "position and rate are both given, and may conflict", "keep one");
  }
  if (!drive.by_rate && !by_position) {
    table.Fail("", "the drive says neither position nor rate", "give one of them");
  }
  drive.function =
      drive.by_rate ? ReadFunction(table, "rate", 1) : ReadFunction(table, "position", 2);
  const bool travel = ActsOnTravel(*joint);
  const TimeValue start = drive.function.At(0.0);
  const auto settle = [&](const char* key, double given, double driven) {
    if (owner.Has(key) && given != driven) {
      owner.Fail(key, fmt::format("{} at the start, where the drive says {}", given, driven),
                 "remove the key: a driven joint starts as its drive says");
    }
    return driven;
  };
  double& value = travel ? joint->travel : joint->theta;
  double& rate = travel ? joint->travel_rate : joint->theta_rate;
  const char* rate_key = travel ? "travel_rate" : "theta_rate";
  if (by_position) {
    value = settle(travel ? "travel" : "theta", value, start.value);
    rate = settle(rate_key, rate, start.rate);
  } else {
    rate = settle(rate_key, rate, start.value);
  }
  joint->drive = std::move(drive);
}

void SceneReader::ReadLatch(const TomlTable& table, SceneJoint* joint) {
  SceneLatch latch;
  latch.theta_a = table.Number("theta_a");
  latch.theta_b = table.Number("theta_b");
  if (latch.theta_a + latch.theta_b < 0.0) {
    table.Fail("theta_b", "theta_a + theta_b is negative: the upper stop lies below the lower",
               "make theta_a + theta_b zero or more");
  }
  latch.lever = table.Number("lever", kPositive);
  const std::string contact = table.String("contact");
  const auto found = contacts_.find(contact);
  if (found == contacts_.end()) {
    std::vector<std::string> known;
    for (const auto& [n, i] : contacts_) known.push_back(n);
    const std::string nearest = NearestName(contact, known);
    table.Fail(
        "contact", "there is no contact \"" + contact + "\"",
        nearest.empty() ? "add a [contact." + contact + "]" : "did you mean \"" + nearest + "\"?");
  }
  latch.contact = found->second;
  latch.where = table.Where();
  joint->latch = latch;
}

}  // namespace unfurl::data
