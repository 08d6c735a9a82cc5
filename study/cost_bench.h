#pragma once

#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "study/cost_meshes.h"
#include "study/cost_values.h"

namespace unfurl::study {

/// One way to run a scene, and what came of it.
struct CostOutcome {
  bool usable = false;
  std::string message;   ///< why not
  bool refused = false;  ///< the method does not take such a scene
  bool stopped = false;  ///< at its limit of time, or at the end of the budget
  double seconds = 0.0;  ///< of the thread's CPU; of several runs the median [s]
  double scatter = 0.0;  ///< standard error of that; 0: of one run [s]
  int runs = 0;
  std::vector<CostValues> values;  ///< by quantity
  CostEvents events;
};

/// Runs a scene with other beams, methods and tolerances. Threads may use it side by side.
class CostBench {
 public:
  /// `end`: CPU seconds of the process (CpuSeconds) after which nothing goes on [s].
  CostBench(const data::Scene& scene, std::vector<CostQuantity> quantities, double duration,
            int samples, double end);

  /// How long a run may take, and how often it is made.
  struct Effort {
    double limit = 0.0;    ///< CPU of one run [s]
    double repeats = 0.0;  ///< CPU of all its runs, beyond which none begins; 0: one run [s]
  };
  /// One that fails is not usable. Throws Interrupted.
  CostOutcome Run(const CostMesh& mesh, const std::string& method, double rtol,
                  const Effort& effort) const;

  const std::vector<CostQuantity>& quantities() const { return quantities_; }
  /// Values as they are compared: those that jump at the other events' times, others as they are.
  CostValues OnClock(const CostOutcome& outcome, std::size_t quantity,
                     const CostEvents& clock) const;
  double duration() const { return duration_; }
  bool Over() const;  ///< the budget has ended
  /// Why a mesh has no natural frequencies that were asked for; empty: all have.
  std::string FrequencyProblem() const;

 private:
  void Once(const CostMesh& mesh, const std::string& method, double rtol, double limit,
            CostOutcome* out) const;
  CostValues Frequency(const CostMesh& mesh, int mode) const;

  const data::Scene& scene_;
  std::vector<CostQuantity> quantities_;
  std::vector<std::string> columns_;
  double duration_;  // [s]
  int samples_;
  double end_;  // [s]
  int modes_ = 0;
  mutable std::mutex mutex_;
  mutable std::map<std::string, std::vector<double>> frequencies_;  // by mesh [Hz]
  mutable std::string frequency_problem_;
};

}  // namespace unfurl::study
