#pragma once

#include <functional>
#include <string>
#include <vector>

#include "data/scene.h"
#include "data/toml.h"

namespace unfurl::study {

/// One effect of a scene, and how it is switched.
struct EffectSwitch {
  std::string name;              ///< "clearance", "damping of the beams"
  bool there = true;             ///< it is in the scene and gets switched off; else on
  std::vector<std::string> set;  ///< overrides of the scene that do it, "key=value" or "key="
};

/// What a scene simulates and could do without (gravity, suspension, clearance, latches, losses in
/// contacts, each kind of joint effect, springs, forces, damping, stretching and bending of beams),
/// and what it lacks and could have (a finer mesh, the other beam model, stretching where EA is
/// known). Of one kind together, or each part for itself.
/// `document`: what the scene was read from.
std::vector<EffectSwitch> EffectsOf(const data::Scene& scene, const data::TomlTable& document,
                                    bool each = false);

/// What is said of an effect.
enum class EffectVerdict {
  kUnjudged,    ///< without a sigma there is nothing to judge by
  kNeeded,      ///< of one that is there: it has to stay; of one that is not: it is missed
  kNotNeeded,   ///< nobody could see the difference
  kCannotTell,  ///< the run's own error, or what the trial leaves open, hides it
  kAgainst,     ///< of a trial: the data speak against it
  kFailed,      ///< the scene does not run that way
};
const char* Name(EffectVerdict verdict);  // in words

/// How scenes are compared.
struct SceneEffectsOptions {
  double sigma = 0.0;     ///< of a mark's coordinate in the trial that is meant; 0: no verdicts [m]
  double part = 0.3;      ///< of it, which all that is left out together may move any mark by, RMS
  double rtol = 0.0;      ///< 0: the scene's, else 1e-6 [-]
  double duration = 0.0;  ///< 0: the scene's [s]
  bool each = false;      ///< each part for itself
  std::function<void(double, const std::string&)> progress;  ///< part done [0, 1]; may throw

  /// Throws Error naming the field.
  void Check() const;
};

/// What an effect does to the motion at the parameters as they stand.
struct EffectChange {
  EffectSwitch effect;
  EffectVerdict verdict = EffectVerdict::kUnjudged;
  std::string message;   ///< of one that failed
  std::string mark;      ///< that moves most
  double rms = 0.0;      ///< by how much over the run, without the effect or with it [m]
  double largest = 0.0;  ///< at its largest [m]
  std::vector<std::string> latches;  ///< in words: those that come at another time, or not at all
  double seconds = 0.0;              ///< of CPU, without it or with it [s]
};

/// What a scene's effects count for.
struct SceneEffects {
  double duration = 0.0;  ///< that was simulated [s]
  double rtol = 0.0;      ///< [-]
  double seconds = 0.0;   ///< of CPU, of the scene as it is [s]
  double floor = 0.0;     ///< what a tolerance ten times tighter moves the worst mark by, RMS [m]
  std::vector<EffectChange> effects;  ///< as EffectsOf
  std::vector<std::string> left_out;  ///< names: of the reduced scene
  std::vector<std::string> set;       ///< its overrides
  double reduced_rms = 0.0;           ///< what it moves the worst mark by, RMS [m]
  double reduced_seconds = 0.0;       ///< of CPU [s]
};

/// Runs the scene as it is and with each effect switched, at fixed parameters, and compares the
/// marks. With a sigma, leaves out as many effects as move no mark by more than a part of it
/// together: tried one upon the other, the smallest first. Throws Error for a scene without marks,
/// one that does not run, bad options.
SceneEffects WeighEffects(const std::string& scene, const std::vector<std::string>& overrides,
                          const SceneEffectsOptions& options);

/// The scene with these overrides as a file's text.
std::string ReducedScene(const std::string& scene, const std::vector<std::string>& overrides,
                         const std::vector<std::string>& more);

}  // namespace unfurl::study
