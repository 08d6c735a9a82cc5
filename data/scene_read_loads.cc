// What acts between bodies and from outside, what is watched, and how to solve.
#include <fmt/format.h>

#include "base/text.h"
#include "data/scene_reader.h"

namespace unfurl::data {
namespace {

std::array<double, 2> Pair(const std::vector<double>& v) { return {v[0], v[1]}; }

void RefuseIdleKeysOfForce(const TomlTable& table) {
  if (table.Has("torque")) {
    RefuseKeys(table, {"point"}, "a torque is the same at every point of a body");
    RefuseKeys(table, {"frame"}, "a torque is the same in every frame of the plane");
  }
  if (table.Has("per_length")) {
    RefuseKeys(table, {"point", "at"}, "per_length acts along the whole beam");
  }
}

}  // namespace

void SceneReader::ReadLinearSprings() {
  for (const auto& [name, table] : root_.NamedTables("spring")) {
    Register(table, name, Thing::kSpring);
    SceneLinearSpring spring;
    spring.name = name;
    spring.a = ReadEnd(table, "a", "a_point", "a_at");
    spring.b = ReadEnd(table, "b", "b_point", "b_at");
    spring.stiffness = table.NumberOr("stiffness", 0.0, kNonNegative);
    spring.damping = table.NumberOr("damping", 0.0, kNonNegative);
    if (spring.stiffness == 0.0 && spring.damping == 0.0) {
      table.Fail("", "the spring has neither stiffness nor damping", "give one of them, or both");
    }
    if (spring.stiffness == 0.0) {
      RefuseKeys(table, {"free_length"}, "without a stiffness nothing asks for the length");
    }
    if (table.Has("free_length")) spring.free_length = table.Number("free_length", kNonNegative);
    spring.where = table.Where();
    if (spring.a.kind == spring.b.kind && spring.a.index == spring.b.index &&
        spring.a.kind != SceneEnd::Kind::kAlongBeam) {
      table.Fail("b", "both ends of the spring hold the same body", "name two");
    }
    scene_.linear_springs.push_back(std::move(spring));
  }
}

void SceneReader::ReadForces() {
  for (const auto& [name, table] : root_.NamedTables("force")) {
    CheckName(table, name);
    SceneForce force;
    force.name = name;
    force.where = table.Where();
    const bool by_force = table.Has("force"), by_torque = table.Has("torque"),
               by_length = table.Has("per_length");
    if (by_force + by_torque + by_length != 1) {
      table.Fail("", "a force says exactly one of force, torque and per_length",
                 by_force + by_torque + by_length == 0 ? "add one" : "keep one");
    }
    RefuseIdleKeysOfForce(table);
    if (by_length) {
      force.kind = SceneForce::Kind::kPerLength;
      const std::string on = table.String("on");
      const auto beam = beams_.find(on);
      if (beam == beams_.end()) {
        std::vector<std::string> known;
        for (const auto& [n, i] : beams_) known.push_back(n);
        const std::string nearest = NearestName(on, known);
        table.Fail("on", "there is no beam \"" + on + "\"",
                   nearest.empty() ? "per_length acts along a whole beam: name one"
                                   : "did you mean \"" + nearest + "\"?");
      }
      force.on.kind = SceneEnd::Kind::kAlongBeam;
      force.on.index = beam->second;
    } else {
      force.on = ReadEnd(table, "on", "point", "at");
      if (force.on.kind == SceneEnd::Kind::kGround) {
        table.Fail("on", "a force on the ground moves nothing", "name a body or a beam's end");
      }
    }
    if (by_torque) {
      force.kind = SceneForce::Kind::kTorque;
      force.torque = ReadFunction(table, "torque", 0);
    } else {
      const TomlTable items = table.Items(by_length ? "per_length" : "force", 2);
      force.force = {ReadFunction(items, "0", 0), ReadFunction(items, "1", 0)};
      force.follows = table.ChoiceOr("frame", "world", {"world", "body"}) == "body";
    }
    scene_.forces.push_back(std::move(force));
  }
}

void SceneReader::ReadMarks() {
  for (const auto& [name, table] : root_.NamedTables("mark")) {
    Register(table, name, Thing::kMark);
    scene_.marks.push_back({name, ReadEnd(table, "on", "point", "at"), table.Where()});
  }
}

void SceneReader::ReadSensors() {
  using Kind = SceneSensor::Kind;
  for (const auto& [name, table] : root_.NamedTables("sensor")) {
    Register(table, name, Thing::kSensor);
    SceneSensor sensor;
    sensor.name = name;
    sensor.where = table.Where();
    const std::string kind =
        table.Choice("kind", {"accelerometer", "gyroscope", "curvature", "strain_gauge"});
    sensor.kind = kind == "accelerometer" ? Kind::kAccelerometer
                  : kind == "gyroscope"   ? Kind::kGyroscope
                  : kind == "curvature"   ? Kind::kCurvature
                                          : Kind::kStrainGauge;
    sensor.on = ReadEnd(table, "on", "point", "at");
    if (sensor.on.kind == SceneEnd::Kind::kGround) {
      table.Fail("on", "a sensor on the ground reads nothing", "name a body or a beam");
    }
    const bool bends = sensor.kind == Kind::kCurvature || sensor.kind == Kind::kStrainGauge;
    if (bends && sensor.on.kind == SceneEnd::Kind::kBody) {
      table.Fail("on", "a rigid body does not bend", "name a beam, and its place as `at`");
    }
    if (sensor.kind != Kind::kAccelerometer) {
      RefuseKeys(table, {"axis", "gravity"}, "only an accelerometer asks for it");
    }
    if (sensor.kind != Kind::kStrainGauge) {
      RefuseKeys(table, {"height"}, "only a strain gauge asks for it");
    }
    if (sensor.kind == Kind::kGyroscope) {
      RefuseKeys(table, {"point"}, "a body turns alike at every point");
    }
    if (sensor.kind == Kind::kAccelerometer) {
      sensor.axis = table.NumberOr("axis", 0.0);
      sensor.feels_gravity = table.BoolOr("gravity", true);
    }
    if (sensor.kind == Kind::kStrainGauge) sensor.height = table.Number("height");
    scene_.sensors.push_back(std::move(sensor));
  }
}

bool SceneReader::Unwatched(Thing thing) {
  return thing == Thing::kBeam || thing == Thing::kSpring || thing == Thing::kSensor;
}

void SceneReader::ReadWatches() {
  for (const auto& [name, table] : root_.NamedTables("event")) {
    CheckName(table, name);
    SceneWatch watch;
    watch.name = name;
    watch.quantity = table.String("when");
    CheckQuantity(table, watch.quantity);
    watch.level = table.NumberOr("level", 0.0);
    const std::string direction =
        table.ChoiceOr("direction", "both", {"rising", "falling", "both"});
    watch.direction = direction == "rising"    ? SceneWatch::Direction::kRising
                      : direction == "falling" ? SceneWatch::Direction::kFalling
                                               : SceneWatch::Direction::kBoth;
    watch.stop = table.BoolOr("stop", false);
    watch.where = table.Where();
    scene_.watches.push_back(std::move(watch));
  }
}

void SceneReader::FailUnwatchable(const TomlTable& table, const std::string& name,
                                  const std::string& column) const {
  std::vector<std::string> known;
  for (const auto& [n, t] : things_) {
    if (!Unwatched(t)) known.push_back(n);
  }
  const std::string nearest = NearestName(name, known);
  table.Fail("when", "there is no joint, body or mark \"" + name + "\"",
             nearest.empty() ? "write it as NAME.theta, NAME.x"
                             : "did you mean \"" + nearest + "." + column + "\"?");
}

std::vector<std::string> SceneReader::WatchedColumns(const std::string& name, Thing kind) const {
  if (kind == Thing::kBody) return {"x", "y", "theta", "vx", "vy", "omega"};
  if (kind != Thing::kJoint) return {"x", "y", "vx", "vy"};
  SceneJoint::Kind joint_kind = SceneJoint::Kind::kRevolute;
  for (const SceneJoint& joint : scene_.joints) {
    if (joint.name == name) joint_kind = joint.kind;
  }
  std::vector<std::string> columns;
  if (joint_kind != SceneJoint::Kind::kSlider) columns = {"theta", "theta_rate"};
  if (joint_kind != SceneJoint::Kind::kRevolute) {
    columns.insert(columns.end(), {"travel", "travel_rate"});
  }
  return columns;
}

void SceneReader::CheckQuantity(const TomlTable& table, const std::string& quantity) const {
  const std::size_t dot = quantity.find('.');
  const std::string name = quantity.substr(0, dot);
  const std::string column = dot == std::string::npos ? "" : quantity.substr(dot + 1);
  const auto found = things_.find(name);
  if (found == things_.end() || Unwatched(found->second)) {
    FailUnwatchable(table, name, column);
  }
  const std::vector<std::string> columns = WatchedColumns(name, found->second);
  for (const std::string& known : columns) {
    if (column == known) return;
  }
  table.Fail("when", "\"" + name + "\" has no \"" + column + "\" to be watched",
             "use " + JoinWords(columns));
}

void SceneReader::ReadFields() {
  if (const auto gravity = root_.TableOrNone("gravity")) {
    scene_.gravity = SceneGravity{Pair(gravity->Numbers("acceleration", 2))};
  }
  if (const auto suspension = root_.TableOrNone("suspension")) {
    scene_.suspension = SceneSuspension{suspension->Number("length", kPositive),
                                        suspension->NumberOr("gravity", 9.81, kPositive)};
  }
}

void SceneReader::ReadSolver() {
  const auto solver = root_.TableOrNone("solver");
  if (!solver) return;
  if (solver->Has("method")) {
    scene_.solver.method =
        solver->Choice("method", {"auto", "projected", "partitioned", "implicit"});
  }
  if (solver->Has("rtol")) scene_.solver.rtol = solver->Number("rtol", TomlRange{1e-13, 1e-2});
  if (solver->Has("rate")) {
    scene_.solver.rate = solver->Number("rate", TomlRange{0.0, 1e7, true, false});
  }
}

}  // namespace unfurl::data
