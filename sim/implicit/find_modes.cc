#include "sim/implicit/find_modes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "sim/dynamics/observables.h"
#include "sim/implicit/equilibrium.h"
#include "sim/implicit/modes.h"
#include "sim/methods/simulate.h"

namespace unfurl::sim {
namespace {

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

struct NamedPoint {
  std::string name;
  MovingPoint point;
};

// Where shapes are given: bodies, segments of beams, marks.
std::vector<NamedPoint> PointsOf(const Model& model) {
  std::vector<NamedPoint> points;
  for (const Model::Body& body : model.bodies) points.push_back({body.name, body.centre});
  for (const Model::Beam& beam : model.beams) {
    for (int k = 0; k < beam.segments; ++k) {
      points.push_back({fmt::format("{}/{}", beam.name, k + 1), {beam.first + k, 0.0, 0.0}});
    }
  }
  for (const Model::Mark& mark : model.marks) points.push_back({mark.name, mark.point});
  return points;
}

// Displacement of a point to first order: dr = dr_body + dtheta (-o_y, o_x), o its offset.
data::ModesRecord::Pose Displacement(const Model& model, const MovingPoint& p,
                                     const std::vector<double>& y,
                                     const std::vector<double>& shape) {
  const int n = model.rigid_bodies.count;
  const auto of = [&](int body, double px, double py) -> data::ModesRecord::Pose {
    const double theta = y[model.index.theta(body)], c = std::cos(theta), s = std::sin(theta);
    const double turn = shape[2 * n + body];
    return {shape[body] - turn * (s * px + c * py), shape[n + body] + turn * (c * px - s * py),
            turn};
  };
  data::ModesRecord::Pose d = of(p.body, p.px, p.py);
  if (p.other_body >= 0) {  // where two segments meet: their mean
    const data::ModesRecord::Pose other = of(p.other_body, p.other_px, 0.0);
    for (std::size_t k = 0; k < 3; ++k) d[k] = 0.5 * (d[k] + other[k]);
  }
  return d;
}

data::ModesRecord RecordOf(const Model& model, std::vector<double> y, const ModesReport& report) {
  data::ModesRecord record;
  const std::vector<NamedPoint> points = PointsOf(model);
  for (const NamedPoint& at : points) {
    const PointMotion p = MotionOf(model, at.point, y.data());
    record.places.push_back(at.name);
    record.rest.push_back({p.x, p.y, y[model.index.theta(at.point.body)]});
  }
  for (const NaturalMode& mode : report.modes) {
    record.modes.push_back({mode.frequency, mode.damping, mode.growth, {}});
    for (const NamedPoint& at : points) {
      record.modes.back().shape.push_back(Displacement(model, at.point, y, mode.shape));
    }
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

SceneModes FindModes(const data::Scene& given, const ModesOptions& options) {
  options.Check();
  data::Scene scene = given;
  const bool latches = std::any_of(scene.joints.begin(), scene.joints.end(),
                                   [](const data::SceneJoint& j) { return j.latch.has_value(); });
  if (options.state == ModesOptions::State::kLatched && !latches) {
    throw Error("the scene has no latch", "option state", "use drawn");
  }
  SceneModes result;
  result.name = scene.name;
  result.latched = !options.at && options.state != ModesOptions::State::kDrawn && latches;
  if (result.latched) {
    for (data::SceneJoint& joint : scene.joints) {
      if (joint.latch) joint.theta = -joint.latch->theta_b;
    }
  }
  const Model model = Compile(scene);
  if (model.kirchhoff.count() > 0) {
    throw Error("the modes of smooth beams are not known", scene.path,
                "use model = \"segments\" for the beams");
  }
  Dynamics dynamics(model);
  std::vector<double> y = model.initial_state;
  if (options.at && *options.at > 0.0) RunTo(*options.at, model, scene.path, &dynamics, &y);
  if (options.find_equilibrium) {
    result.equilibrium = result.latched ? FindLatchedEquilibrium(&dynamics, y.data())
                                        : FindEquilibrium(&dynamics, y.data());
  }
  result.usable = !options.find_equilibrium || result.equilibrium.found;
  const ModesReport report = FindModes(&dynamics, y.data(), options.count);
  result.rigid = report.rigid;
  result.latches = LatchesOf(dynamics, &y);
  result.record = RecordOf(model, y, report);
  return result;
}

}  // namespace unfurl::sim
