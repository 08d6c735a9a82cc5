#include "sim/implicit/find_modes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "sim/dynamics/observables.h"
#include "sim/implicit/equilibrium.h"
#include "sim/implicit/modes.h"
#include "sim/methods/simulate.h"
#include "sim/record/certificate.h"

namespace unfurl::sim {
namespace {

constexpr double kNotDisplaced = 1e-9;  // in metres to a turn of a radian: rounding
constexpr int kMostCount = 1000;  // shapes of some thousand places each: what a page can still hold

// The state at the end of a run.
class LastState : public Observer {
 public:
  explicit LastState(std::vector<double>* y) : y_(y) {}
  void OnSample(double, double* state, const std::vector<LatchMode>& modes) override {
    std::copy_n(state, y_->size(), y_->begin());
    modes_ = modes;
  }
  const std::vector<LatchMode>& modes() const { return modes_; }

 private:
  std::vector<double>* y_;
  std::vector<LatchMode> modes_;
};

// Of a smooth beam's line, as many equal parts as shapes are given for: its shapes are far longer.
constexpr int kPartsOfSmooth = 16;

struct NamedPoint {
  std::string name;
  MovingPoint point;
  int beam = -1;              // of the smooth ones; -1: `point` says where
  KirchhoffRod::Place place;  // along it
};

// Where shapes are given: bodies, segments or parts of beams, marks.
std::vector<NamedPoint> PointsOf(const Model& model) {
  std::vector<NamedPoint> points;
  for (const Model::Body& body : model.bodies) points.push_back({body.name, body.centre});
  for (const Model::Beam& beam : model.beams) {
    const int parts = beam.smooth >= 0 ? kPartsOfSmooth : beam.segments;
    for (int k = 0; k < parts; ++k) {
      points.push_back({fmt::format("{}/{}", beam.name, k + 1),
                        {beam.first + (beam.smooth >= 0 ? 0 : k), 0.0, 0.0},
                        beam.smooth,
                        {}});
      if (beam.smooth < 0) continue;
      points.back().place = model.kirchhoff.beam(beam.smooth).rod.PlaceAt((k + 0.5) / parts);
    }
  }
  for (const Model::Mark& mark : model.marks) points.push_back({mark.name, mark.point});
  return points;
}

struct PoseAndRate {
  data::ModesRecord::Pose pose, rate;
};

// Of a point at a state that dynamics.Update has filled.
PoseAndRate MotionAt(const Model& model, const NamedPoint& at, const std::vector<double>& y) {
  const MovingPoint& p = at.point;
  const int n = model.rigid_bodies.count;
  if (at.beam >= 0 || p.watched >= 0) {
    const KirchhoffRod::Frame f = [&] {
      if (p.watched >= 0) return model.kirchhoff.MotionAt(p.watched, y.data(), n);
      const Motion motion{0.0,
                          y.data(),
                          y.data() + n,
                          y.data() + 2 * n,
                          y.data() + 3 * n,
                          y.data() + 4 * n,
                          y.data() + 5 * n,
                          nullptr,
                          nullptr};
      return model.kirchhoff.FrameAt(at.beam, at.place, motion);
    }();
    return {{f.x, f.y, f.theta}, {f.vx, f.vy, f.omega}};
  }
  const PointMotion m = MotionOf(model, p, y.data());
  const auto turn = [&](const double* of) {
    const double rest = p.other_body >= 0 ? p.other_share * (of[p.other_body] - of[p.body]) : 0.0;
    return of[p.body] + rest;
  };
  return {{m.x, m.y, turn(y.data() + 2 * n)}, {m.vx, m.vy, turn(y.data() + 5 * n)}};
}

// Scales shapes so that of all places the largest displacement is 1 m, or the largest turn 1 rad
// where nothing is displaced.
void Scale(std::vector<data::ModesRecord::Pose>* shape) {
  double largest = 0.0, turned = 0.0, by = 0.0, by_turn = 0.0;
  for (const data::ModesRecord::Pose& d : *shape) {
    for (int k = 0; k < 2; ++k) {
      if (std::fabs(d[k]) <= largest) continue;
      largest = std::fabs(d[k]);
      by = d[k];
    }
    if (std::fabs(d[2]) <= turned) continue;
    turned = std::fabs(d[2]);
    by_turn = d[2];
  }
  const double scale = largest > kNotDisplaced * turned ? by : by_turn;
  if (scale == 0.0) return;
  for (data::ModesRecord::Pose& d : *shape) {
    for (double& value : d) value /= scale;
  }
}

// Displacements to first order are rates of a motion whose rates are the mode's shape.
data::ModesRecord RecordOf(Dynamics* dynamics, std::vector<double> y, const ModesReport& report) {
  const Model& model = dynamics->model();
  data::ModesRecord record;
  const std::vector<NamedPoint> points = PointsOf(model);
  dynamics->Update(0.0, y.data());
  for (const NamedPoint& at : points) {
    record.places.push_back(at.name);
    record.rest.push_back(MotionAt(model, at, y).pose);
  }
  for (const NaturalMode& mode : report.modes) {
    record.modes.push_back({mode.frequency, mode.damping, mode.growth, {}});
    std::copy(mode.shape.begin(), mode.shape.end(), y.begin() + model.index.vx(0));
    dynamics->Update(0.0, y.data());
    std::vector<data::ModesRecord::Pose>& shape = record.modes.back().shape;
    for (const NamedPoint& at : points) shape.push_back(MotionAt(model, at, y).rate);
    if (model.kirchhoff.count() > 0) Scale(&shape);
  }
  return record;
}

// Runs the model to time t and brings it to rest where it is.
void RunTo(double t, const Model& model, const std::string& path, Dynamics* dynamics,
           std::vector<double>* y) {
  SimulateOptions options;
  options.duration = t;
  options.rate = 1.0 / t;  // a sample at the end
  LastState last(y);
  const SimulateReport report = Simulate(model, options, &last);
  if (!report.Usable()) {
    throw Error(fmt::format("the run to {} s failed: {}", t, report.message), path,
                "take an earlier time");
  }
  dynamics->modes() = last.modes();
  std::fill_n(y->begin() + model.index.vx(0), 3 * model.rigid_bodies.count, 0.0);
}

std::vector<SceneModes::Latch> LatchesOf(const Dynamics& dynamics, std::vector<double>* y) {
  const Model& model = dynamics.model();
  const Motion motion = dynamics.MotionAt(0.0, y->data());
  std::vector<SceneModes::Latch> latches;
  for (const Model::Joint& joint : model.joints) {
    if (joint.latch < 0) continue;
    const LatchMode& mode = dynamics.modes()[static_cast<std::size_t>(joint.latch)];
    latches.push_back({joint.name, joint.coordinate.hinge.Theta(motion), mode.upper_contact != 0,
                       mode.lower_contact != 0});
  }
  return latches;
}

}  // namespace

ModesOptions::State ModesStateOf(const std::string& name) {
  if (name == "auto") return ModesOptions::State::kAuto;
  if (name == "drawn") return ModesOptions::State::kDrawn;
  if (name == "latched") return ModesOptions::State::kLatched;
  throw Error(fmt::format("there is no state \"{}\"", name), "option state",
              "use drawn or latched");
}

void ModesOptions::Check() const {
  if (count < 1 || count > kMostCount) {
    throw Error(fmt::format("{} modes are not a number of modes", count), "option count",
                fmt::format("use 1 to {}", kMostCount));
  }
  if (at && (!(*at >= 0.0) || !std::isfinite(*at))) {
    throw Error(fmt::format("{} s is not a time of a run", *at), "option at", "use 0 s or more");
  }
}

namespace {

SceneModes ModesOn(const data::Scene& scene, bool latched, const ModesOptions& options) {
  SceneModes result;
  result.name = scene.name;
  result.latched = latched;
  const Model model = Compile(scene);
  Dynamics dynamics(model);
  std::vector<double> y = model.initial_state;
  if (options.at && *options.at > 0.0) RunTo(*options.at, model, scene.path, &dynamics, &y);
  const double t = options.at.value_or(0.0);
  dynamics.HoldAt(t);
  if (model.forces.AnyFollows(t)) {
    throw Error("a force in the axes of its body has no potential: the modes would be others",
                scene.path, "use frame = \"world\", or leave it out");
  }
  if (options.find_equilibrium) {
    result.equilibrium = latched ? FindLatchedEquilibrium(&dynamics, y.data())
                                 : FindEquilibrium(&dynamics, y.data());
  }
  result.usable = !options.find_equilibrium || result.equilibrium.found;
  const ModesReport report = FindModes(&dynamics, y.data(), options.count);
  result.rigid = report.rigid;
  result.rigid_below = report.rigid_below;
  result.rounding = report.rounding;
  result.latches = LatchesOf(dynamics, &y);
  result.record = RecordOf(&dynamics, y, report);
  return result;
}

// Of each mode, from the one of its number on a finer mesh: Richardson's, and as much more as a
// certificate takes. Unknown where the finer mesh is at no state like it.
void FindMeshErrors(const data::Scene& scene, const ModesOptions& options, SceneModes* modes) {
  double factor = 0.0;
  std::string words;
  const data::Scene finer = CompanionMesh(scene, true, &factor, &words);
  if (words.empty()) {  // nothing bends
    for (data::ModesRecord::Mode& mode : modes->record.modes) mode.error = 0.0;
    return;
  }
  const SceneModes other = ModesOn(finer, modes->latched, options);
  if (!other.usable || other.rigid != modes->rigid) return;
  const std::size_t both = std::min(modes->record.modes.size(), other.record.modes.size());
  for (std::size_t k = 0; k < both; ++k) {
    data::ModesRecord::Mode& mode = modes->record.modes[k];
    const data::ModesRecord::Mode& than = other.record.modes[k];
    if ((mode.growth > 0.0) != (than.growth > 0.0)) return;
    const double off =
        mode.growth > 0.0 ? mode.growth - than.growth : mode.frequency - than.frequency;
    mode.error = kCaution * factor * std::fabs(off);
  }
}

}  // namespace

SceneModes FindModes(const data::Scene& given, const ModesOptions& options) {
  options.Check();
  data::Scene scene = given;
  const bool latches = std::any_of(scene.joints.begin(), scene.joints.end(),
                                   [](const data::SceneJoint& j) { return j.latch.has_value(); });
  if (options.state == ModesOptions::State::kLatched && !latches) {
    throw Error("the scene has no latch", "option state", "use drawn");
  }
  const bool latched = !options.at && options.state != ModesOptions::State::kDrawn && latches;
  if (latched) {
    for (data::SceneJoint& joint : scene.joints) {
      if (joint.latch) joint.theta = -joint.latch->theta_b;
    }
  }
  SceneModes result = ModesOn(scene, latched, options);
  if (options.mesh_error && result.usable) FindMeshErrors(scene, options, &result);
  return result;
}

}  // namespace unfurl::sim
