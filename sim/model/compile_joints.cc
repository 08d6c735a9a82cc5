// Joints: their constraints, and what acts on their coordinates.
#include <fmt/format.h>

#include <cmath>

#include "base/error.h"
#include "sim/model/compiler.h"

namespace unfurl::sim {

void Compiler::FillJoints() {
  JointRows rows;
  for (std::size_t j = 0; j < scene_.joints.size(); ++j) {
    const data::SceneJoint& joint = scene_.joints[j];
    double inner_angle = 0.0, outer_angle = 0.0;
    const MovingPoint inner = PointOf(joint.inner, &inner_angle);
    const MovingPoint outer = PointOf(joint.outer, &outer_angle);
    if (inner.body == outer.body) {
      throw Error(fmt::format("joint '{}' joins a rigid body to itself", joint.name), joint.where,
                  "join two bodies that are not welded together");
    }
    Model::Joint out;
    out.name = joint.name;
    out.kind = joint.kind;
    out.pin = outer;
    Coordinate& c = out.coordinate;
    c.hinge.inner = inner.body;
    c.hinge.outer = outer.body;
    c.hinge.sign = joint.sign;
    // The coordinates at the start are known; for angles this also settles whole turns.
    c.hinge.zero =
        BodyAngle(joint.outer) - BodyAngle(joint.inner) - joint.sign * start_.at.theta[j];
    c.travel = joint.kind != data::SceneJoint::Kind::kRevolute;
    c.ix = inner.px;
    c.iy = inner.py;
    c.ox = outer.px;
    c.oy = outer.py;
    c.ax = std::cos(inner_angle + joint.axis);
    c.ay = std::sin(inner_angle + joint.axis);
    AddRows(j, out, &rows);
    AddEffects(j, &out);
    model_.joints.push_back(out);
  }
  AddWeldRows(&rows);
  model_.constraints =
      Constraints(model_.rigid_bodies, longitudinal_, std::move(rows), element_names_);
}

void Compiler::AddRows(std::size_t j, const Model::Joint& out, JointRows* rows) {
  const data::SceneJoint& joint = scene_.joints[j];
  const Coordinate& c = out.coordinate;
  const auto along = [&](double ax, double ay, double sign, const data::TimeFunction& target,
                         bool drive) {
    rows->alongs.push_back({c.hinge.inner, c.hinge.outer, c.ix, c.iy, c.ox, c.oy, ax, ay, sign,
                            target, joint.name, drive});
  };
  const auto angle = [&](const data::TimeFunction& target, bool drive) {
    rows->angles.push_back(
        {c.hinge.inner, c.hinge.outer, c.hinge.zero, c.hinge.sign, target, joint.name, drive});
  };
  if (!c.travel) {
    rows->pins.push_back({c.hinge.inner, c.hinge.outer, c.ix, c.iy, c.ox, c.oy, joint.name});
    if (joint.drive) angle(TargetOf(joint), true);
    return;
  }
  along(-c.ay, c.ax, 1.0, data::TimeFunction(), false);
  if (joint.kind == data::SceneJoint::Kind::kSlider) angle(data::TimeFunction(), false);
  if (joint.drive) along(c.ax, c.ay, c.hinge.sign, TargetOf(joint), true);
}

void Compiler::AddEffects(std::size_t j, Model::Joint* out) {
  const data::SceneJoint& joint = scene_.joints[j];
  data::VisitJointEffects(joint, [&]<typename Record>(const std::optional<Record>& record) {
    if (!record) return;
    constexpr std::size_t kIndex = JointEffectIndex<Record>();
    auto& effect = std::get<kIndex>(model_.joint_effects);
    const int k = out->effects[kIndex] = effect.count();
    effect.Add(out->coordinate, *record);
    if (const data::TimeFunction* f = effect.law(k).Function()) model_.functions.push_back({*f, 0});
  });
  if (joint.drive) {
    model_.functions.push_back({joint.drive->function, joint.drive->by_rate ? 1 : 2});
  }
  if (!joint.latch) return;
  const double theta = start_.at.theta[j];
  out->latch = model_.latches.count();
  model_.latches.Add(out->coordinate.hinge, *joint.latch, scene_.contacts[joint.latch->contact]);
  // Open above the upper stop; in contact only below the lower one.
  LatchMode mode;
  mode.latched = theta < joint.latch->theta_a;
  mode.lower_contact = model_.latches.At(out->latch, false, theta, 0.0).depth > 0.0;
  model_.initial_modes.push_back(mode);
}

}  // namespace unfurl::sim
