// Joints, what acts on their coordinates, and the contacts of their latches.
#include <fmt/format.h>

#include <limits>

#include "base/text.h"
#include "data/scene_reader.h"

namespace unfurl::data {
namespace {

using Kind = SceneJoint::Kind;

// Names of the keys for the coordinate that effects act on.
bool ActsOnTravel(const SceneJoint& joint) { return joint.kind != Kind::kRevolute; }
const char* MomentKey(const SceneJoint& joint) { return ActsOnTravel(joint) ? "force" : "moment"; }

void RefuseKeys(const TomlTable& table, std::initializer_list<const char*> keys,
                const std::string& why) {
  for (const char* key : keys) {
    if (table.Has(key)) table.Fail(key, why, "remove the key");
  }
}

}  // namespace

void SceneReader::ReadContacts() {
  for (const auto& [name, table] : root_.NamedTables("contact")) {
    CheckName(table, name);
    SceneContact c;
    c.name = name;
    if (table.Has("K")) {
      c.K = table.Number("K", kPositive);
    } else {
      constexpr TomlRange kPoisson{-1.0, 0.5, true, false};
      const double infinity = std::numeric_limits<double>::infinity();
      const double radius_i = table.Number("radius_i", kPositive);
      const double radius_j =
          table.Has("radius_j") ? table.Number("radius_j", kPositive) : infinity;
      c.K =
          HertzStiffness(radius_i, radius_j, table.Number("modulus_i", kPositive),
                         table.Number("poisson_i", kPoisson), table.Number("modulus_j", kPositive),
                         table.Number("poisson_j", kPoisson));
    }
    if (table.Has("C")) {
      c.C = table.Number("C", kNonNegative);
    } else {
      c.C = ContactDamping(table.Number("mass", kPositive),
                           table.Number("linear_stiffness", kPositive),
                           table.Number("restitution", TomlRange{0.0, 1.0, true, false}));
    }
    c.Q = table.Number("Q", kNonNegative);
    c.epsilon = table.Number("epsilon", kPositive);
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
    joint.kind = type == "revolute" ? Kind::kRevolute
                 : type == "slider" ? Kind::kSlider
                                    : Kind::kPinInSlot;
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
  if (joint->kind != Kind::kSlider) {
    joint->theta = table.NumberOr("theta", 0.0);
    joint->theta_rate = table.NumberOr("theta_rate", 0.0);
    joint->hang_theta = table.NumberOr("hang_theta", 0.0);
  } else {
    RefuseKeys(table, {"theta", "theta_rate", "hang_theta"}, "a slider does not turn");
  }
  if (joint->kind != Kind::kRevolute) {
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
  if (const auto spring = table.TableOrNone("spring")) ReadSpring(*spring, joint);
  if (const auto damper = table.TableOrNone("damper")) {
    joint->damper = SceneDamper{damper->Number("damping", kPositive), damper->Where()};
  }
  if (const auto points = table.TableOrNone("table")) ReadMomentTable(*points, joint);
  if (const auto friction = table.TableOrNone("friction")) ReadFriction(*friction, joint);
  if (const auto drive = table.TableOrNone("drive")) ReadDrive(*drive, table, joint);
  if (const auto motor = table.TableOrNone("motor")) {
    if (joint->drive) {
      table.Fail("motor", "the joint is driven, so a motor changes nothing", "keep one of the two");
    }
    ReadMotor(*motor, joint);
  }
  if (const auto latch = table.TableOrNone("latch")) {
    if (joint->kind != Kind::kRevolute) {
      table.Fail("latch", "only a revolute joint can have a latch", "remove it");
    }
    ReadLatch(*latch, joint);
  }
}

void SceneReader::ReadSpring(const TomlTable& table, SceneJoint* joint) {
  SceneSpring spring;
  spring.stiffness = table.Number("stiffness", kPositive);
  if (table.Has("free")) {
    if (table.Has("preload")) table.Fail("preload", "free and preload are both given", "keep one");
    spring.preload = -table.Number("free");
  } else {
    spring.preload = table.NumberOr("preload", 0.0);
  }
  spring.where = table.Where();
  joint->spring = spring;
}

void SceneReader::ReadMomentTable(const TomlTable& table, SceneJoint* joint) {
  SceneMomentTable points;
  const char* coordinate = ActsOnTravel(*joint) ? "travel" : "theta";
  const char* moment = MomentKey(*joint);
  points.coordinate = table.Numbers(coordinate, -1);
  points.moment = table.Numbers(moment, -1);
  if (points.coordinate.size() < 2) {
    table.Fail(coordinate, "the table has less than two points", "give two or more");
  }
  if (points.coordinate.size() != points.moment.size()) {
    table.Fail(
        moment,
        fmt::format("{} values for {} points", points.moment.size(), points.coordinate.size()),
        "give one for each point");
  }
  for (std::size_t k = 1; k < points.coordinate.size(); ++k) {
    if (points.coordinate[k] > points.coordinate[k - 1]) continue;
    table.Fail(coordinate,
               fmt::format("the points do not rise: {} follows {}", points.coordinate[k],
                           points.coordinate[k - 1]),
               "put them in order, each once");
  }
  points.where = table.Where();
  joint->table = std::move(points);
}

void SceneReader::ReadFriction(const TomlTable& table, SceneJoint* joint) {
  joint->friction = SceneFriction{table.Number(MomentKey(*joint), kPositive),
                                  table.Number("creep_rate", kPositive), table.Where()};
}

// A driven coordinate starts where its drive says.
void SceneReader::ReadDrive(const TomlTable& table, const TomlTable& owner, SceneJoint* joint) {
  SceneDrive drive;
  drive.where = table.Where();
  drive.by_rate = table.Has("rate");
  const bool by_position = table.Has("position");
  if (drive.by_rate && by_position) {
    table.Fail("rate", "position and rate are both given, and may fight", "keep one");
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

void SceneReader::ReadMotor(const TomlTable& table, SceneJoint* joint) {
  joint->motor = SceneMotor{ReadFunction(table, MomentKey(*joint), 0), table.Where()};
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
