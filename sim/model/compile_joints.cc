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
    if (inner.slot == outer.slot) {
      throw Error(fmt::format("joint '{}' joins a rigid body to itself", joint.name), joint.where,
                  "join two bodies that are not welded together");
    }
    Model::Joint out;
    out.name = joint.name;
    out.kind = joint.kind;
    out.pin = outer;
    Coordinate& c = out.coordinate;
    c.hinge.inner = inner.slot;
    c.hinge.outer = outer.slot;
    c.hinge.sign = joint.sign;
    // The coordinates at the start are known; for angles this also settles whole turns.
    c.hinge.zero =
        SlotAngle(joint.outer) - SlotAngle(joint.inner) - joint.sign * start_.at.theta[j];
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
  model_.constraints = Constraints(model_.slots, element_length_, std::move(rows), element_names_);
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
  if (joint.spring) {
    out->spring = model_.springs.count();
    model_.springs.Add(out->coordinate, joint.spring->stiffness, joint.spring->preload);
  }
  if (joint.damper) {
    out->damper = model_.dampers.count();
    model_.dampers.Add(out->coordinate, joint.damper->damping);
  }
  if (joint.table) {
    out->table = model_.tables.count();
    model_.tables.Add(out->coordinate, joint.table->coordinate, joint.table->moment);
  }
  if (joint.friction) {
    out->friction = model_.frictions.count();
    model_.frictions.Add(out->coordinate, joint.friction->moment, joint.friction->creep_rate);
  }
  if (joint.motor) {
    out->motor = model_.motors.count();
    model_.motors.Add(out->coordinate, joint.motor->moment);
    model_.functions.push_back({joint.motor->moment, 0});
  }
  if (joint.drive)
    model_.functions.push_back({joint.drive->function, joint.drive->by_rate ? 1 : 2});
  if (!joint.latch) return;
  const data::SceneContact& c = scene_.contacts[joint.latch->contact];
  const double theta = start_.at.theta[j];
  out->latch = model_.latches.count();
  model_.latches.Add(out->coordinate.hinge,
                     {joint.latch->theta_a, joint.latch->theta_b, joint.latch->lever, c.K, c.C, c.Q,
                      c.epsilon, c.never_pulls});
  LatchMode mode;
  mode.latched = theta < joint.latch->theta_a;
  mode.upper_contact = mode.latched && theta > joint.latch->theta_a;
  mode.lower_contact = theta < -joint.latch->theta_b;
  model_.initial_modes.push_back(mode);
}

}  // namespace unfurl::sim
