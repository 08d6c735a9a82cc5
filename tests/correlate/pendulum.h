#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "base/random.h"
#include "correlate/fit/fit.h"
#include "study/scene_model.h"
#include "tests/correlate/two_link.h"
#include "tests/source_dir.h"

namespace unfurl::correlate {

// The single latching pendulum of data/sets/bouncing_latch through the real simulator: a spring
// swings an arm in, it locks, and bounces between its stops. Unknown: clearance, restitution of the
// contact law, damping of the hinge, stiffness of the spring.
struct Pendulum {
  static constexpr double kDuration = 1.2;  // of a trial, some thirty impacts [s]
  static std::vector<std::string> Marks() { return {"mid", "tip"}; }

  // At 1e-6 the simulator's own scatter after thirty impacts is half a sigma of the marks, and the
  // cost a rough ground full of hollows; at 1e-8 it is a thousandth, and the ground smooth.
  static constexpr double kTolerance = 1e-8;

  static study::SceneModelOptions Binding(double rtol = kTolerance) {
    study::SceneModelOptions options;
    options.scene = std::string(UNFURL_SOURCE_DIR) + "/data/sets/bouncing_latch/scene.toml";
    options.set = {"mark.mid.on=arm", "mark.mid.point=[0.0, 0.0]"};
    options.keys = {{"joint.hinge.latch.theta_a", "joint.hinge.latch.theta_b"},
                    {"contact.lock.restitution"},
                    {"joint.hinge.damper.damping"},
                    {"joint.hinge.spring.stiffness"}};
    options.rtol = rtol;
    return options;
  }

  static std::vector<Parameter> Parameters() {
    auto named = [](const char* name, const char* unit, double start, double low, double high,
                    bool log) {
      Parameter p;
      p.name = name, p.unit = unit, p.start = start, p.low = low, p.high = high, p.log = log;
      return p;
    };
    return {named("clearance", "rad", 0.006, 0.002, 0.02, true),
            named("restitution", "1", 0.7, 0.3, 0.98, false),
            named("damping", "N m s/rad", 3e-3, 1e-3, 1e-2, true),
            named("stiffness", "N m/rad", 0.22, 0.15, 0.35, true)};
  }

  // A planted truth well within the bounds.
  static std::vector<double> Truth(Rng& rng) {
    return {0.006 * std::exp(rng.Uniform(-0.7, 0.7)), rng.Uniform(0.45, 0.92),
            3e-3 * std::exp(rng.Uniform(-0.7, 0.7)), 0.225 * std::exp(rng.Uniform(-0.25, 0.25))};
  }

  static Trial Recording(double sigma = 2e-4) {
    Trial trial = TiltedTrial();
    trial.duration = kDuration;
    trial.step = 0.005;
    trial.sigma = sigma;
    return trial;
  }

  // The budget of evaluations that docs/physics-correlation.md states.
  static FitOptions Options() {
    FitOptions options;
    options.stages_by_impacts = true;
    options.search.screened = 48;
    options.search.starts = 4;
    return options;
  }
};

}  // namespace unfurl::correlate
