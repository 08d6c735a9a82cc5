#pragma once

#include <string>
#include <vector>

namespace unfurl::correlate {

// What accuracy costs: a model run with several settings (tolerance, method, mesh), each against
// the finest, and which of them nobody should choose.

/// How a model is run.
struct CostSetting {
  std::string method;
  double tolerance = 0.0;    // [-]
  int mesh = 0;              // segments; 0: as the model has it
  std::string Name() const;  // all three, in words
};

// One setting's outcome. Points move: x, y by point and sample, on the same stamps for all
// settings.
struct CostRun {
  CostSetting setting;
  bool usable = false;
  std::string message;                    // why not
  double seconds = 0.0;                   // of computing [s]
  std::vector<std::vector<double>> x, y;  // by point [m]
};

/// What a setting costs, and what it is worth.
struct CostPoint {
  CostSetting setting;
  bool usable = false;
  std::string message;
  double seconds = 0.0;   // [s]
  double rms = 0.0;       // RMS distance to the reference, of the worst point, over its range [-]
  double largest = 0.0;   // the largest distance in time, likewise [-]
  bool on_front = false;  // no other is both faster and nearer
};

/// All settings against one reference.
struct CostStudy {
  CostSetting reference;
  // How far a second finest run, by another method, is from the reference (rms as above): errors
  // below a few of it are not resolved. Negative: there was no second one.
  double floor = -1.0;  // [-]
  CostSetting second;
  std::vector<CostPoint> points;  // in the order given
};

// RMS and largest distance of a run from the reference, of the worst point, over that point's
// range: the diagonal of the box that its path fills. Points that hardly move (less than kStill of
// the largest range) are measured by that largest range. Throws Error for runs on different stamps.
inline constexpr double kStill = 1e-3;
CostPoint CompareCost(const CostRun& run, const CostRun& reference);

// `second`: nullptr for none.
CostStudy StudyCost(const std::vector<CostRun>& runs, const CostRun& reference,
                    const CostRun* second);

// The cheapest usable setting whose rms error is at most `error`; nullptr: none.
const CostPoint* Cheapest(const CostStudy& study, double error);

// Advice in sentences: the cheapest for 1%, 0.1% and 0.01% as far as resolved, what limits the
// rest.
std::vector<std::string> CostAdvice(const CostStudy& study);

}  // namespace unfurl::correlate
