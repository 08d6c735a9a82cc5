#pragma once

#include <functional>
#include <string>
#include <vector>

#include "correlate/fit/cost.h"
#include "data/scene.h"

namespace unfurl::study {

/// Which settings a scene is run with, to see what accuracy costs.
struct SceneCostOptions {
  /// Of sim::MethodOf. The first makes the finest run, the second checks it.
  std::vector<std::string> methods = {"projected", "partitioned"};
  std::vector<double> tolerances = {1e-3, 1e-4, 1e-5, 1e-6, 1e-7};  ///< each in [1e-13, 1e-2]
  std::vector<int> segments;  ///< of every beam of segments, 1 or more each; empty: the scene's
  double duration = 0.0;      ///< 0: the scene's [s]
  int samples = 2000;         ///< that a run is compared on: some twenty a vibration of the marks
  double repeat_below = 1.0;  ///< runs that take less are timed three times, for their median [s]

  /// Throws Error naming the field.
  void Check() const;
};

/// What accuracy of a scene costs in time.
struct SceneCost {
  correlate::CostStudy study;
  double duration = 0.0;  ///< that was simulated [s]
  /// Whether a setting gave a result at all.
  bool Usable() const;
};

/// Runs the scene with every combination of method, tolerance and mesh, and compares the marks with
/// those of a run that is finer than the finest of them (correlate::StudyCost). Throws Error for
/// bad options, a scene without marks, and one whose finest run fails. `progress`, where given,
/// gets the part done, from 0 to 1, and the setting; it may throw.
SceneCost StudySceneCost(const data::Scene& scene, const SceneCostOptions& options,
                         const std::function<void(double, const std::string&)>& progress = {});

}  // namespace unfurl::study
