#include "sim/observables.h"

#include <fmt/format.h>

#include <cmath>

namespace unfurl::sim {

PointMotion MotionOf(const Model& model, const MovingPoint& p, const double* state) {
  const StateIndex& i = model.index;
  if (p.watched >= 0) {
    const KirchhoffRod::Frame f = model.kirchhoff.MotionAt(p.watched, state, i.n);
    return {f.x, f.y, f.vx, f.vy};
  }
  if (p.other_slot >= 0) {
    const PointMotion a = MotionOf(model, {p.slot, p.px, p.py}, state);
    const PointMotion b = MotionOf(model, {p.other_slot, p.other_px, 0.0}, state);
    return {0.5 * (a.x + b.x), 0.5 * (a.y + b.y), 0.5 * (a.vx + b.vx), 0.5 * (a.vy + b.vy)};
  }
  const double c = std::cos(state[i.theta(p.slot)]), s = std::sin(state[i.theta(p.slot)]);
  const double ox = c * p.px - s * p.py, oy = s * p.px + c * p.py;
  const double w = state[i.omega(p.slot)];
  return {state[i.x(p.slot)] + ox, state[i.y(p.slot)] + oy, state[i.vx(p.slot)] - w * oy,
          state[i.vy(p.slot)] + w * ox};
}

double LatchMoment(const Model& model, int latch, const double* state, const LatchMode& mode) {
  const int n = model.index.n;
  const Motion motion{0.0,           state,         state + n, state + 2 * n, state + 3 * n,
                      state + 4 * n, state + 5 * n, nullptr,   nullptr};
  return model.latches.Moment(latch, motion, mode);
}

std::string NameOfSlot(const Model& model, int slot) {
  for (const Model::Beam& beam : model.beams) {
    if (slot == beam.first && beam.smooth >= 0) return fmt::format("beam '{}'", beam.name);
    if (slot >= beam.first && slot < beam.first + beam.segments) {
      return fmt::format("beam '{}', segment {}", beam.name, slot - beam.first + 1);
    }
  }
  for (int b = 0; b < model.kirchhoff.count(); ++b) {
    const KirchhoffBeams::Beam& beam = model.kirchhoff.beam(b);
    const int k = slot - beam.first_amplitude();
    if (k >= 0 && k < beam.amplitude_slots()) {
      return fmt::format("beam '{}', amplitudes from {}", beam.name, 3 * k + 1);
    }
  }
  for (const Model::Body& body : model.bodies) {
    if (body.centre.slot == slot) return fmt::format("body '{}'", body.name);
  }
  return fmt::format("slot {}", slot);
}

Observables::Observables(const Model& model) : model_(model), dynamics_(model) { Declare(); }

void Observables::Declare() {
  const auto add = [&](const std::string& name, const char* units, const std::string& what) {
    quantities_.push_back({name, units, what});
  };
  for (const Model::Mark& mark : model_.marks) {
    add(mark.name + ".x", "m", "position of the mark");
    add(mark.name + ".y", "m", "position of the mark");
    add(mark.name + ".vx", "m/s", "velocity of the mark");
    add(mark.name + ".vy", "m/s", "velocity of the mark");
  }
  for (const Model::Joint& joint : model_.joints) {
    add(joint.name + ".theta", "rad", "angle of the joint");
    add(joint.name + ".theta_rate", "rad/s", "rate of the joint's angle");
    if (joint.latch >= 0) {
      add(joint.name + ".contact_moment", "N m", "moment of the latch's contact on the angle");
    }
    if (joint.spring >= 0) {
      add(joint.name + ".spring_moment", "N m", "moment of the spring on the angle");
    }
    const bool travel = joint.coordinate.travel;
    const auto add_moment = [&](int effect, const std::string& of) {
      if (effect < 0) return;
      add(joint.name + "." + of + (travel ? "_force" : "_moment"), travel ? "N" : "N m",
          "of the " + of + " on the joint's coordinate");
    };
    add_moment(joint.damper, "damper");
    add_moment(joint.table, "table");
    add_moment(joint.friction, "friction");
    add_moment(joint.motor, "motor");
    add(joint.name + ".x", "m", "position of the pin");
    add(joint.name + ".y", "m", "position of the pin");
  }
  const auto add_body = [&](const std::string& name, const std::string& of) {
    add(name + ".x", "m", "position of " + of);
    add(name + ".y", "m", "position of " + of);
    add(name + ".theta", "rad", "angle of " + name);
    add(name + ".vx", "m/s", "velocity of " + of);
    add(name + ".vy", "m/s", "velocity of " + of);
    add(name + ".omega", "rad/s", "angular velocity of " + name);
  };
  for (const Model::Body& body : model_.bodies) add_body(body.name, "the centre of mass");
  for (const Model::Beam& beam : model_.beams) {
    add_body(beam.name, "the beam's centre of mass (angle: mean of its segments)");
  }
  for (const std::string& name : model_.linear_spring_names) {
    add(name + ".length", "m", "distance of the spring's ends");
    add(name + ".tension", "N", "of spring and damper");
  }
  add("energy.kinetic", "J", "kinetic energy");
  if (model_.bending.count() + model_.kirchhoff.count() > 0) {
    add("energy.bending", "J", "energy of bending");
  }
  if (model_.bending.axial()) add("energy.axial", "J", "energy of stretching");
  if (model_.springs.count() > 0) add("energy.spring", "J", "energy of the torsion springs");
  if (model_.tables.count() > 0) add("energy.table", "J", "potential of the moment tables");
  if (model_.linear_springs.count() > 0) {
    add("energy.linear_spring", "J", "energy of the linear springs");
  }
  if (model_.suspension.count() > 0) add("energy.suspension", "J", "energy of the suspension");
  if (!model_.gravity.empty()) add("energy.gravity", "J", "energy in the field of gravity");
  if (model_.latches.count() > 0) {
    add("energy.contact", "J", "energy stored in the latches' contacts");
    add("energy.dissipated_contact", "J", "lost in contacts since the start");
  }
  if (model_.bending.damped() || model_.kirchhoff.damped()) {
    add("energy.dissipated_beams", "J", "lost in the beams' material since the start");
  }
  if (model_.dampers.count() + model_.frictions.count() > 0 || model_.linear_springs.damped()) {
    add("energy.dissipated_dampers", "J", "lost in dampers and friction since the start");
  }
  if (model_.constraints.driven() || model_.motors.count() + model_.forces.count() > 0) {
    add("energy.work", "J", "work of drives, motors and applied forces since the start");
  }
  add("energy.total", "J", "all stored energy");
  add("energy.residual", "J",
      "stored and dissipated energy less work done and the energy at the start");
  add("momentum.x", "kg m/s", "linear momentum");
  add("momentum.y", "kg m/s", "linear momentum");
  add("momentum.angular", "kg m^2/s", "angular momentum about the origin");
  add("centre.x", "m", "centre of all mass");
  add("centre.y", "m", "centre of all mass");
  add("constraint.position", "m", "largest violation of a constraint");
  add("constraint.velocity", "m/s", "largest rate of a constraint");
  row_.reserve(quantities_.size());
}

const std::vector<double>& Observables::Row(double t, double* state,
                                            const std::vector<LatchMode>& modes) {
  dynamics_.modes() = modes;
  balance_ = dynamics_.BalanceAt(t, state);
  const Motion m = dynamics_.Update(t, state);
  if (!started_) {
    start_ = balance_.Conserved();
    started_ = true;
  }
  row_.clear();
  const auto put = [&](double v) { row_.push_back(v); };
  for (const Model::Mark& mark : model_.marks) {
    const PointMotion p = MotionOf(model_, mark.point, state);
    put(p.x), put(p.y), put(p.vx), put(p.vy);
  }
  for (const Model::Joint& joint : model_.joints) {
    put(joint.coordinate.hinge.Theta(m));
    put(joint.coordinate.hinge.Rate(m));
    if (joint.latch >= 0) put(model_.latches.Moment(joint.latch, m, modes[joint.latch]));
    if (joint.spring >= 0) put(model_.springs.Moment(joint.spring, m));
    if (joint.damper >= 0) put(model_.dampers.Moment(joint.damper, m));
    if (joint.table >= 0) put(model_.tables.Moment(joint.table, m));
    if (joint.friction >= 0) put(model_.frictions.Moment(joint.friction, m));
    if (joint.motor >= 0) put(model_.motors.Moment(joint.motor, m));
    const PointMotion p = MotionOf(model_, joint.pin, state);
    put(p.x), put(p.y);
  }
  for (const Model::Body& body : model_.bodies) {
    const PointMotion p = MotionOf(model_, body.centre, state);
    put(p.x), put(p.y), put(m.theta[body.centre.slot] + body.angle);
    put(p.vx), put(p.vy), put(m.omega[body.centre.slot]);
  }
  for (const Model::Beam& beam : model_.beams) {
    double sum[6] = {};
    for (int k = beam.first; k < beam.first + beam.segments; ++k) {
      const double values[6] = {m.x[k], m.y[k], m.theta[k], m.vx[k], m.vy[k], m.omega[k]};
      for (int c = 0; c < 6; ++c) sum[c] += values[c];
    }
    for (const double s : sum) put(s / beam.segments);
  }
  for (int k = 0; k < model_.linear_springs.count(); ++k) {
    const LinearSprings::State s = model_.linear_springs.At(k, m);
    put(s.length), put(s.tension);
  }
  const Balance& b = balance_;
  put(b.kinetic);
  if (model_.bending.count() + model_.kirchhoff.count() > 0) put(b.bending);
  if (model_.bending.axial()) put(b.axial);
  if (model_.springs.count() > 0) put(b.spring);
  if (model_.tables.count() > 0) put(b.table);
  if (model_.linear_springs.count() > 0) put(b.linear_spring);
  if (model_.suspension.count() > 0) put(b.suspension);
  if (!model_.gravity.empty()) put(b.gravity);
  if (model_.latches.count() > 0) put(b.contact), put(b.dissipated_contact);
  if (model_.bending.damped() || model_.kirchhoff.damped()) put(b.dissipated_beams);
  if (model_.dampers.count() + model_.frictions.count() > 0 || model_.linear_springs.damped()) {
    put(b.dissipated_dampers);
  }
  if (model_.constraints.driven() || model_.motors.count() + model_.forces.count() > 0) {
    put(b.work);
  }
  put(b.Stored());
  put(b.Conserved() - start_);
  put(b.momentum_x), put(b.momentum_y), put(b.angular_momentum);
  put(b.centre_x), put(b.centre_y);
  put(b.position_drift), put(b.velocity_drift);
  return row_;
}

}  // namespace unfurl::sim
