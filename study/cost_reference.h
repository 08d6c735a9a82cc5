#pragma once

#include <functional>
#include <string>
#include <vector>

#include "study/cost_bench.h"
#include "study/cost_limit.h"

namespace unfurl::study {

/// What runs of a scene are compared with: each quantity's limit on ever finer meshes, at a tight
/// tolerance.
class CostReference {
 public:
  /// `rtol`: of every run that it makes [-].
  CostReference(const CostBench& bench, const data::Scene& scene, const CostMeshes& meshes,
                double rtol);

  /// Makes the runs, which may take `share` of CPU in all [s]. Throws Error where none is usable
  /// though there was time.
  void Make(std::size_t workers, double share,
            const std::function<void(double, const std::string&)>& progress);
  /// One finer mesh of the model where it costs least, if it takes `allowance` at most [s].
  bool Extend(double allowance, const std::function<void(double, const std::string&)>& progress);

  /// By quantity of the bench.
  const std::vector<CostLimit>& limits() const { return limits_; }
  /// The run that it made on this mesh; nullptr: none.
  const CostOutcome* RunOn(const CostMesh& mesh) const;
  double rtol() const { return rtol_; }
  const CostEvents& clock() const { return clock_; }
  double seconds() const { return seconds_; }  ///< of CPU, of all its runs [s]
  /// "segments 4 to 16 and smooth, order 4 to 8, at rtol 1e-08".
  std::string Words() const;
  /// Whether some of its meshes were left out for lack of time.
  bool ShortOfTime() const;
  /// Why there is none, for lack of time; empty: there is.
  std::string problem() const;

 private:
  struct Ladder {
    std::vector<CostMesh> meshes;
    std::vector<CostOutcome> rungs;
    double power = 0.0;  // with which errors fall with the mesh's size
    bool regular = false;
    std::vector<CostDistance> time;  // error of time stepping, by quantity
    bool ended = false;              // no finer mesh is to be had
    bool stopped = false;            // at the end of its share of time
    double needs = 0.0;              // of that share, to the next rung, foretold; 0: not known [-]
    std::string message;
    double seconds = 0.0;  // of CPU, of all its runs [s]
    double NextCost() const;
    double FirstCost() const { return rungs.empty() ? 0.0 : rungs.front().seconds; }
    std::vector<double> Sizes() const;
  };
  void Climb(Ladder* ladder, double share);
  void CheckTime(Ladder* ladder, double left) const;
  void FindLimits();
  CostLimit LimitOn(const Ladder& ladder, std::size_t quantity) const;

  const CostBench& bench_;
  const data::Scene& scene_;
  double rtol_;
  std::vector<Ladder> ladders_;
  std::vector<CostLimit> limits_;
  CostEvents clock_;
  double seconds_ = 0.0;
  bool rigid_ = false;
};

}  // namespace unfurl::study
