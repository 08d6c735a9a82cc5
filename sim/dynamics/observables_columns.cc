// The columns of a run: what each is called, its unit, and where its value comes from.
#include <cmath>

#include "sim/dynamics/observables.h"

namespace unfurl::sim {
namespace {

double MeanOver(const Model::Beam& beam, const double* values) {
  double sum = 0.0;
  for (int k = beam.first; k < beam.first + beam.segments; ++k) sum += values[k];
  return sum / beam.segments;
}

// Of the beam's mass: segments of a tapered one differ. A smooth one is one body.
double CentreOver(const Model::Beam& beam, const double* values) {
  double sum = 0.0, mass = 0.0;
  for (std::size_t k = 0; k < beam.mass.size(); ++k) {
    sum += beam.mass[k] * values[static_cast<std::size_t>(beam.first) + k];
    mass += beam.mass[k];
  }
  return mass > 0.0 ? sum / mass : values[beam.first];
}

}  // namespace

void Observables::Declare() {
  for (int k = 0; k < static_cast<int>(model_.marks.size()); ++k) {
    const std::string& name = model_.marks[k].name;
    Add(
        name + ".x", "m", "position of the mark",
        [](const Frame& f, int i) {
          return MotionOf(f.self.model_, f.self.model_.marks[i].point, f.motion).x;
        },
        k);
    Add(
        name + ".y", "m", "position of the mark",
        [](const Frame& f, int i) {
          return MotionOf(f.self.model_, f.self.model_.marks[i].point, f.motion).y;
        },
        k);
    Add(
        name + ".vx", "m/s", "velocity of the mark",
        [](const Frame& f, int i) {
          return MotionOf(f.self.model_, f.self.model_.marks[i].point, f.motion).vx;
        },
        k);
    Add(
        name + ".vy", "m/s", "velocity of the mark",
        [](const Frame& f, int i) {
          return MotionOf(f.self.model_, f.self.model_.marks[i].point, f.motion).vy;
        },
        k);
  }
  DeclareJoints();
  DeclareBodies();
  DeclareLinearSprings();
  DeclareSensors();
  DeclareTotals();
}

void Observables::DeclareSensors() {
  using Kind = data::SceneSensor::Kind;
  for (int k = 0; k < static_cast<int>(model_.sensors.size()); ++k) {
    const Model::Sensor& sensor = model_.sensors[k];
    const char* unit = "1";
    const char* what = "strain, positive in tension";
    if (sensor.kind == Kind::kAccelerometer) {
      unit = "m/s^2";
      what = sensor.feels_gravity ? "specific force along its axis" : "acceleration along its axis";
    } else if (sensor.kind == Kind::kGyroscope) {
      unit = "rad/s";
      what = "rate of turning";
    } else if (sensor.kind == Kind::kCurvature) {
      unit = "1/m";
      what = "curvature of the beam, positive to its left";
    }
    Add(
        sensor.name + ".reading", unit, what,
        [](const Frame& f, int i) { return f.self.sensors_.readings()[i]; }, k);
  }
}

void Observables::DeclareJoints() {
  for (int k = 0; k < static_cast<int>(model_.joints.size()); ++k) {
    const Model::Joint& joint = model_.joints[k];
    const bool travel = joint.coordinate.travel;
    const char* unit = travel ? "N" : "N m";
    const std::string kind = travel ? "_force" : "_moment";
    const std::string on = travel ? " on the travel" : " on the angle";
    if (joint.kind != data::SceneJoint::Kind::kSlider) {
      Add(
          joint.name + ".theta", "rad", "angle of the joint",
          [](const Frame& f, int i) { return f.Joint(i).coordinate.hinge.Theta(f.motion); }, k);
      Add(
          joint.name + ".theta_rate", "rad/s", "rate of the joint's angle",
          [](const Frame& f, int i) { return f.Joint(i).coordinate.hinge.Rate(f.motion); }, k);
    }
    if (travel) {
      Add(
          joint.name + ".travel", "m", "travel along the joint's axis",
          [](const Frame& f, int i) { return f.Joint(i).coordinate.Value(f.motion); }, k);
      Add(
          joint.name + ".travel_rate", "m/s", "its rate",
          [](const Frame& f, int i) { return f.Joint(i).coordinate.Rate(f.motion); }, k);
    }
    if (joint.latch >= 0) {
      Add(
          joint.name + ".contact_moment", "N m", "moment of the latch's contact on the angle",
          [](const Frame& f, int i) {
            return f.self.model_.latches.Moment(i, f.motion, f.modes[i]);
          },
          joint.latch);
    }
    ForEachJointEffect(model_.joint_effects, [&]<typename E>(const E&, std::size_t index) {
      if (joint.effects[index] < 0) return;
      Add(
          joint.name + "." + E::kKey + kind, unit, E::kOf + on,
          [](const Frame& f, int i) {
            return std::get<E>(f.self.model_.joint_effects).Moment(i, f.motion);
          },
          joint.effects[index]);
    });
    if (forces_.driven(k)) {
      Add(
          joint.name + ".drive" + kind, unit, "that the drive needs" + on,
          [](const Frame& f, int i) { return f.Force(i).drive; }, k);
    }
    if (forces_.held(k)) {
      Add(
          joint.name + ".hold_moment", "N m",
          "that keeps the slider from turning, on its outer side",
          [](const Frame& f, int i) { return f.Force(i).hold; }, k);
    }
    Add(
        joint.name + ".x", "m", "position of the pin",
        [](const Frame& f, int i) { return MotionOf(f.self.model_, f.Joint(i).pin, f.motion).x; },
        k);
    Add(
        joint.name + ".y", "m", "position of the pin",
        [](const Frame& f, int i) { return MotionOf(f.self.model_, f.Joint(i).pin, f.motion).y; },
        k);
    Add(
        joint.name + ".pin_force_x", "N", "force of the inner side on the outer at the pin",
        [](const Frame& f, int i) { return f.Force(i).fx; }, k);
    Add(
        joint.name + ".pin_force_y", "N", "force of the inner side on the outer at the pin",
        [](const Frame& f, int i) { return f.Force(i).fy; }, k);
    Add(
        joint.name + ".pin_force", "N", "its magnitude",
        [](const Frame& f, int i) {
          const JointForces::Force force = f.Force(i);
          return std::hypot(force.fx, force.fy);
        },
        k);
  }
}

void Observables::DeclareBodies() {
  for (int k = 0; k < static_cast<int>(model_.bodies.size()); ++k) {
    const std::string& name = model_.bodies[k].name;
    Add(
        name + ".x", "m", "position of the centre of mass",
        [](const Frame& f, int i) {
          return MotionOf(f.self.model_, f.self.model_.bodies[i].centre, f.motion).x;
        },
        k);
    Add(
        name + ".y", "m", "position of the centre of mass",
        [](const Frame& f, int i) {
          return MotionOf(f.self.model_, f.self.model_.bodies[i].centre, f.motion).y;
        },
        k);
    Add(
        name + ".theta", "rad", "angle of the body",
        [](const Frame& f, int i) {
          const Model::Body& body = f.self.model_.bodies[i];
          return f.motion.theta[body.centre.body] + body.angle;
        },
        k);
    Add(
        name + ".vx", "m/s", "velocity of the centre of mass",
        [](const Frame& f, int i) {
          return MotionOf(f.self.model_, f.self.model_.bodies[i].centre, f.motion).vx;
        },
        k);
    Add(
        name + ".vy", "m/s", "velocity of the centre of mass",
        [](const Frame& f, int i) {
          return MotionOf(f.self.model_, f.self.model_.bodies[i].centre, f.motion).vy;
        },
        k);
    Add(
        name + ".omega", "rad/s", "angular velocity of the body",
        [](const Frame& f, int i) { return f.motion.omega[f.self.model_.bodies[i].centre.body]; },
        k);
  }
  for (int k = 0; k < static_cast<int>(model_.beams.size()); ++k) {
    const std::string& name = model_.beams[k].name;
    const std::string of = "the beam's centre of mass";
    Add(
        name + ".x", "m", "position of " + of,
        [](const Frame& f, int i) { return CentreOver(f.self.model_.beams[i], f.motion.x); }, k);
    Add(
        name + ".y", "m", "position of " + of,
        [](const Frame& f, int i) { return CentreOver(f.self.model_.beams[i], f.motion.y); }, k);
    Add(
        name + ".theta", "rad", "mean angle of the beam",
        [](const Frame& f, int i) { return MeanOver(f.self.model_.beams[i], f.motion.theta); }, k);
    Add(
        name + ".vx", "m/s", "velocity of " + of,
        [](const Frame& f, int i) { return CentreOver(f.self.model_.beams[i], f.motion.vx); }, k);
    Add(
        name + ".vy", "m/s", "velocity of " + of,
        [](const Frame& f, int i) { return CentreOver(f.self.model_.beams[i], f.motion.vy); }, k);
    Add(
        name + ".omega", "rad/s", "mean angular velocity of the beam",
        [](const Frame& f, int i) { return MeanOver(f.self.model_.beams[i], f.motion.omega); }, k);
    Add(
        name + ".mid_deflection", "m", "of the middle from the chord, positive to its left",
        [](const Frame& f, int i) { return f.self.lines_[i].MidDeflection(f.motion); }, k);
    Add(
        name + ".tip_deflection", "m",
        "of the end from the tangent at the start, positive to its left",
        [](const Frame& f, int i) { return f.self.lines_[i].TipDeflection(f.motion); }, k);
    if (model_.beams[k].EA == 0.0) continue;
    Add(
        name + ".axial_force", "N", "EA times the strain in the middle, tension positive",
        [](const Frame& f, int i) {
          const Model::Beam& beam = f.self.model_.beams[i];
          const double middle = 0.5 * beam.segments * beam.segment_length;
          return beam.EA * f.self.lines_[i].Strain(f.motion, middle);
        },
        k);
  }
}

void Observables::DeclareLinearSprings() {
  for (int k = 0; k < model_.linear_springs.count(); ++k) {
    const std::string& name = model_.linear_spring_names[k];
    Add(
        name + ".length", "m", "distance of the spring's ends",
        [](const Frame& f, int i) { return f.self.model_.linear_springs.At(i, f.motion).length; },
        k);
    Add(
        name + ".tension", "N", "of spring and damper",
        [](const Frame& f, int i) { return f.self.model_.linear_springs.At(i, f.motion).tension; },
        k);
  }
}

void Observables::DeclareTotals() {
  Add("energy.kinetic", "J", "kinetic energy",
      [](const Frame& f, int) { return f.self.balance_.kinetic; });
  if (model_.bending.count() + model_.kirchhoff.count() > 0) {
    Add("energy.bending", "J", "energy of bending",
        [](const Frame& f, int) { return f.self.balance_.bending; });
  }
  if (model_.bending.axial() || model_.kirchhoff.stretches()) {
    Add("energy.axial", "J", "energy of stretching",
        [](const Frame& f, int) { return f.self.balance_.axial; });
  }
  bool dissipates = false;
  bool works = model_.constraints.driven();
  int index = 0;
  ForEachEffect(model_, [&](const auto& effect) {
    const EffectText& text = effect.kText;
    if (effect.count() > 0 && text.energy != nullptr) {
      Add(
          std::string("energy.") + text.energy, "J", text.energy_what,
          [](const Frame& f, int i) { return f.self.balance_.effects[i]; }, index);
    }
    dissipates = dissipates || (effect.kPower == PowerKind::kDissipated && effect.HasPower());
    works = works || (effect.kPower == PowerKind::kWork && effect.HasPower());
    ++index;
  });
  if (model_.latches.count() > 0) {
    Add("energy.dissipated_contact", "J", "lost in contacts since the start",
        [](const Frame& f, int) { return f.self.balance_.dissipated_contact; });
  }
  if (model_.bending.damped() || model_.kirchhoff.damped()) {
    Add("energy.dissipated_beams", "J", "lost in the beams' material since the start",
        [](const Frame& f, int) { return f.self.balance_.dissipated_beams; });
  }
  if (dissipates) {
    Add("energy.dissipated_dampers", "J", "lost in dampers and friction since the start",
        [](const Frame& f, int) { return f.self.balance_.dissipated_dampers; });
  }
  if (works) {
    Add("energy.work", "J", "work of drives, motors and applied forces since the start",
        [](const Frame& f, int) { return f.self.balance_.work; });
  }
  Add("energy.total", "J", "all stored energy",
      [](const Frame& f, int) { return f.self.balance_.Stored(); });
  Add("energy.residual", "J",
      "stored and dissipated energy less work done and the energy at the start",
      [](const Frame& f, int) { return f.self.residual(); });
  Add("momentum.x", "kg m/s", "linear momentum",
      [](const Frame& f, int) { return f.self.balance_.momentum_x; });
  Add("momentum.y", "kg m/s", "linear momentum",
      [](const Frame& f, int) { return f.self.balance_.momentum_y; });
  Add("momentum.angular", "kg m^2/s", "angular momentum about the origin",
      [](const Frame& f, int) { return f.self.balance_.angular_momentum; });
  Add("centre.x", "m", "centre of all mass",
      [](const Frame& f, int) { return f.self.balance_.centre_x; });
  Add("centre.y", "m", "centre of all mass",
      [](const Frame& f, int) { return f.self.balance_.centre_y; });
  Add("constraint.position", "m", "largest violation of a constraint",
      [](const Frame& f, int) { return f.self.balance_.position_drift; });
  Add("constraint.velocity", "m/s", "largest rate of a constraint",
      [](const Frame& f, int) { return f.self.balance_.velocity_drift; });
}

}  // namespace unfurl::sim
