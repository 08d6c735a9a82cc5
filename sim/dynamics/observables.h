#pragma once

#include <string>
#include <vector>

#include "data/run.h"
#include "sim/dynamics/centre_line.h"
#include "sim/dynamics/dynamics.h"
#include "sim/dynamics/sensors.h"
#include "sim/effects/joint_forces.h"
#include "sim/effects/torque_margin.h"
#include "sim/model/model.h"

namespace unfurl::sim {

struct PointMotion {
  double x, y, vx, vy;  // [m], [m/s]
};
PointMotion MotionOf(const Model& model, const MovingPoint& point, const double* state);
// The same, with the sines and cosines that the motion holds.
PointMotion MotionOf(const Model& model, const MovingPoint& point, const Motion& motion);

// Moment of contact on the angle of one latch's joint [N m].
double LatchMoment(const Model& model, int latch, const double* state, const LatchMode& mode);

// "beam 'beam1', segment 3", "body 'hub'".
std::string NameOfRigidBody(const Model& model, int body);

// The sampled quantities of a run, in the order of its columns: marks, joints, bodies, beams,
// energies, momentum, centre of mass, drift of the constraints; and the beams' shapes.
class Observables {
 public:
  // `wanted`: names to keep, with * for any letters and ? for one; empty: all. Throws Error for one
  // that fits nothing.
  explicit Observables(const Model& model, const std::vector<std::string>& wanted = {});

  const std::vector<data::Quantity>& quantities() const { return quantities_; }
  std::vector<std::string> marks() const;  // those whose x and y are both kept
  // One row; the energies' residual is against the first call. `state` gets its stations filled.
  const std::vector<double>& Row(double t, double* state, const std::vector<LatchMode>& modes);
  const Balance& balance() const { return balance_; }  // of the last row
  double energy_at_start() const { return start_; }
  double residual() const { return balance_.Conserved() - start_; }

  const TorqueMargins& margins() const { return margins_; }  // over all that was seen so far
  // Between rows; see Observer::OnWay.
  void WatchMargins(const Motion& motion, const std::vector<LatchMode>& modes) {
    margins_.Watch(motion, modes);
  }

  std::vector<data::BeamShape> shapes() const;
  // x, y of every point of shapes(), one after another [m].
  const std::vector<double>& ShapeRow(double t, double* state);

 private:
  // What a column is computed from.
  struct Frame {
    const Observables& self;
    const Motion& motion;
    const std::vector<LatchMode>& modes;
    const Model::Joint& Joint(int k) const { return self.model_.joints[k]; }
    JointForces::Force Force(int joint) const {
      return self.forces_.Of(joint, motion, self.dynamics_.JointMultipliers());
    }
  };
  using Value = double (*)(const Frame& frame, int index);
  struct Column {
    Value value;
    int index;
  };

  // Of a body's shape.
  struct Outline {
    std::string name;
    std::vector<MovingPoint> points;
  };

  void MakeOutlines();
  void Declare();
  void DeclareJoints();
  void DeclareBodies();
  void DeclareLinearSprings();
  void DeclareSensors();
  void DeclareTotals();
  void Add(const std::string& name, const char* units, const std::string& what, Value value,
           int index = 0);
  void Keep(const std::vector<std::string>& wanted);

  const Model& model_;
  Dynamics dynamics_;
  Balance balance_;
  TorqueMargins margins_;
  JointForces forces_;
  Sensors sensors_;
  double start_ = 0.0;  // energy [J]
  bool started_ = false;
  bool wants_forces_ = false;                // some column needs the multipliers
  bool wants_sensors_ = false;               // likewise what sensors read
  std::vector<CentreLine> lines_;            // by beam
  std::vector<std::vector<double>> places_;  // by beam, of its length [-]
  std::vector<Outline> outlines_;            // by rigid body
  std::vector<data::Quantity> quantities_;
  std::vector<Column> columns_;
  std::vector<double> row_, shape_row_, rates_;  // [units of the columns]
};

}  // namespace unfurl::sim
