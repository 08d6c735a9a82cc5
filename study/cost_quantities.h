#pragma once

#include <string>
#include <vector>

#include "data/scene.h"

namespace unfurl::study {

/// What of a scene its runs are judged by.
struct CostQuantity {
  /// What it is in a run.
  enum class Kind {
    kMark,       ///< a place in time: x and y
    kSeries,     ///< a quantity of a run in time
    kNumber,     ///< one number of a run, such as a latch time
    kFrequency,  ///< a natural frequency, which is of the scene and its mesh alone
  };
  std::string name;  ///< "joint1.theta"
  std::string unit;
  Kind kind = Kind::kSeries;
  /// It jumps where something latches, so that runs are compared from event to event.
  bool jumps = false;
  int mode = 0;  ///< of kFrequency, from 1

  /// Columns of a run that it is made from.
  std::vector<std::string> Columns() const;
};

/// The quantities of a scene by name, * and ? standing for letters: a mark; any quantity of a run;
/// numbers of joints (JOINT.latch_time, .latch_rate, .peak_moment, .peak_pin_force, ...);
/// EVENT.time, its first crossing; frequency.K, the K-th that `unfurl modes` gives. None wanted:
/// marks, joints' angles and travels, latch and event times, peak moments and pin forces. Throws
/// Error for a name that fits nothing, and a scene of which nothing would be judged.
std::vector<CostQuantity> CostQuantities(const data::Scene& scene,
                                         const std::vector<std::string>& wanted);

}  // namespace unfurl::study
