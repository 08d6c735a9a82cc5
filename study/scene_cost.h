#pragma once

#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "data/scene.h"
#include "study/cost_quantities.h"

namespace unfurl::study {

/// Which settings a scene is run with, to see what accuracy costs.
struct SceneCostOptions {
  /// What is judged, of CostQuantities; empty: marks, joints, latch and event times, peak loads.
  std::vector<std::string> quantities;
  /// Of sim::MethodOf.
  std::vector<std::string> methods = {"auto", "projected", "implicit", "partitioned"};
  /// Each in [1e-13, 1e-2]; empty: 1e-2, 1e-3, .. to 1e-6, of beams until the mesh is what is left.
  std::vector<double> tolerances;
  /// Segments, and orders of smooth beams, of every beam; both empty: half of the scene's segments,
  /// as many and twice as many, and orders 1 to 4.
  std::vector<int> segments, orders;
  double duration = 0.0;    ///< 0: the scene's [s]
  int samples = 2000;       ///< that a run is compared on: some twenty a vibration of the marks
  std::size_t workers = 0;  ///< runs at a time; 0: one per core
  double repeats = 0.5;     ///< CPU after which a setting is not run again for its time [s]
  double within = std::numeric_limits<double>::infinity();  ///< CPU of everything, all cores [s]

  /// Throws Error naming the field.
  void Check() const;
};

/// How a scene is run.
struct CostSetting {
  std::string method;
  double tolerance = 0.0;        ///< [-]
  std::string beams;             ///< "8 segments", "smooth, order 2"; empty: the scene has none
  int segments = 0, order = 0;   ///< of every beam alike, else 0
  std::vector<std::string> set;  ///< overrides of the scene that do all of this
  std::string Name() const;      ///< in words
  std::string SetText() const;   ///< "--set beam.b.segments=8 --set solver.rtol=0.001"
};

/// A quantity that settings are judged by.
struct CostLine {
  CostQuantity quantity;
  double scale = 0.0;  ///< range of motion, or magnitude, that errors are parts of [its unit]
  double reference_error = 0.0;  ///< of what runs are compared with; infinite: not known [-]
  /// Whether finer meshes come to an end; else nothing can be said of errors.
  bool settled = false;
};

/// A setting's error in one line.
struct CostError {
  double rms = 0.0;      ///< over the run, the reference's own added; infinite: it never comes [-]
  double largest = 0.0;  ///< in time, likewise [-]
  bool bound = false;    ///< the reference is not known ninefold better: the error is below this
};

/// What a setting costs, and what it is worth.
struct CostPoint {
  CostSetting setting;
  bool usable = false;
  std::string message;            ///< why not
  double seconds = 0.0;           ///< of CPU; of `runs` runs the median [s]
  double scatter = 0.0;           ///< its standard error; 0 of one run [s]
  int runs = 0;                   ///< that were timed
  std::vector<CostError> errors;  ///< by line
  int worst = -1;                 ///< of the settled lines; -1: there is none
  double rms = 0.0;               ///< of that line [-]
  double largest = 0.0;           ///< the largest of any settled line [-]
  bool on_front = false;          ///< no other is both faster and more accurate in its worst line
};

/// What accuracy of a scene costs.
struct SceneCost {
  double duration = 0.0;  ///< that was simulated [s]
  std::vector<CostLine> lines;
  std::vector<std::string> absent;   ///< quantities without a line, and why, in words
  std::vector<std::string> refused;  ///< why some settings have no run, in words
  std::string reference;             ///< what runs are compared with, in words
  bool reference_cut = false;        ///< the budget left out some of its meshes
  std::vector<CostPoint> points;     ///< mesh by mesh, method by method
  std::size_t left_out = 0;          ///< settings for which the budget left no time
  double seconds = 0.0;              ///< of CPU, all runs [s]
  std::string problem;               ///< why there is no reference; empty: there is
  /// Whether a setting gave a result that something can be said of.
  bool Usable() const;
};

/// Runs the scene with other beams, methods and tolerances, and compares every quantity with its
/// limit of ever finer meshes: of segments extrapolated (Richardson), of smooth beams as they go;
/// the better known of the two. Throws Error for bad options and a scene that does not run.
/// `progress`, where given, gets the part done, from 0 to 1, and the setting, from any thread; it
/// may throw. Docs/decisions/180.
SceneCost StudySceneCost(const data::Scene& scene, const SceneCostOptions& options,
                         const std::function<void(double, const std::string&)>& progress = {});

/// The cheapest usable setting whose error in a line (-1: in each settled line) is `error` at most;
/// of several that are as cheap within their scatter the most accurate. nullptr: none.
const CostPoint* Cheapest(const SceneCost& cost, double error, int line = -1);

/// Errors that advice is given for [-].
inline constexpr double kCostTargets[] = {1e-2, 1e-3, 1e-4};

/// In sentences: the cheapest for each of these in every line, what cannot be said; and of each the
/// text that sets it ("--set .."), or none.
struct CostCounsel {
  std::string words, set;
};
std::vector<CostCounsel> CostCounsels(const SceneCost& cost);
/// Each as one line, the words and what sets it.
std::vector<std::string> CostAdvice(const SceneCost& cost);

/// "0.34 %", "2.1e-05 %".
std::string CostPercent(double error);

}  // namespace unfurl::study
