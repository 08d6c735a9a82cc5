#pragma once

#include <optional>
#include <string>
#include <vector>

#include "data/modes.h"
#include "data/scene.h"
#include "sim/implicit/equilibrium_report.h"

namespace unfurl::sim {

/// Which state the modes of a scene are taken about.
struct ModesOptions {
  /// Where the latches stand.
  enum class State {
    kAuto,     ///< latched where the scene has latches
    kDrawn,    ///< as the scene gives it
    kLatched,  ///< every clearance closed on the side that the load presses
  };
  State state = State::kAuto;
  std::optional<double> at;  ///< instead: what a run has reached then, brought to rest [s], >= 0
  bool find_equilibrium = true;  ///< false: about the state as it is, in equilibrium or not
  int count = 12;                ///< of modes, 1 to 1000
  bool mesh_error = true;        ///< a finer mesh says what this one leaves wrong

  /// Throws Error naming the field.
  void Check() const;
};

/// "auto", "drawn", "latched"; throws Error for another.
ModesOptions::State ModesStateOf(const std::string& name);

/// The natural motions of a scene, and about which state.
struct SceneModes {
  /// How a latch stands in the state that was linearised.
  struct Latch {
    std::string joint;
    double theta = 0.0;                 ///< [rad]
    bool upper = false, lower = false;  ///< the stop that it presses on, if any
  };

  data::ModesRecord record;
  std::string name;               ///< of the scene
  bool latched = false;           ///< every clearance was closed first
  EquilibriumReport equilibrium;  ///< as it was found; empty where none was looked for
  int rigid = 0;                  ///< motions without stiffness, or slower than rigid_below
  double rigid_below = 0.0;       ///< what rounding hides [Hz]; 0: nothing
  double rounding = 0.0;          ///< the largest error of a frequency that it leaves, of itself
  std::vector<Latch> latches;

  /// Whether the state is one of rest, or was to be taken as it is.
  bool usable = false;
};

/// Linearises a scene about a state at rest, M q'' + D q' + K q = J^T mu, J q = 0
/// (docs/physics-simulator.md). Throws Error for bad options, a scene without a latch that is to be
/// latched, and a run that does not reach options.at.
SceneModes FindModes(const data::Scene& scene, const ModesOptions& options = {});

}  // namespace unfurl::sim
