#pragma once

#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "correlate/fit/interval.h"

namespace unfurl::study {

/// Which settings a study is fitted with, to see what the width of its intervals costs.
struct StudyCostOptions {
  /// Of StudyCostKinds; empty: all.
  std::vector<std::string> vary;
  std::size_t workers = 0;      ///< model evaluations at a time; 0: one per core
  bool allow_programs = false;  ///< as FitStudyOptions
  double within = std::numeric_limits<double>::infinity();   ///< no fit begins after so many [s]
  std::function<void(double, const std::string&)> progress;  ///< part done [0, 1]; may throw
  /// Throws Error naming the field.
  void Check() const;
};

/// "rungs", "tolerance", "horizon", "starts", "marks", "profiles".
std::vector<std::string> StudyCostKinds();

/// A way to fit the study.
struct StudySetting {
  std::string kind;              ///< of StudyCostKinds; empty: as the study is
  std::string name;              ///< "8, 16 segments"
  std::vector<std::string> set;  ///< overrides of the study that do it
};

/// What it gave of a parameter.
struct StudyCostValue {
  double value = 0.0;            ///< [unit]
  correlate::Interval interval;  ///< 95%, of all parts [unit]
  /// Half of the interval; infinity: it is open [unit].
  double Half() const;
  double shift =
      0.0;  ///< of the value from that of the study as it is, in half intervals of that [-]
};

/// One fit.
struct StudyCostPoint {
  StudySetting setting;
  bool usable = false;
  std::string message;                 ///< why not
  double seconds = 0.0;                ///< of CPU, all cores together [s]
  bool mesh_tested = false;            ///< a finer model is in the interval of every trial
  bool agrees = true;                  ///< each interval meets that of the study as it is
  bool on_front = false;               ///< none that is as honest is both cheaper and narrower
  std::vector<StudyCostValue> values;  ///< by parameter of the study
};

/// What the intervals of a study cost.
struct StudyCost {
  std::vector<std::string> parameters, units;
  std::vector<StudyCostPoint> points;  ///< the first as the study is
  std::size_t left_out = 0;            ///< settings for which there was no time
  bool Usable() const { return !points.empty() && points[0].usable; }
};

/// Fits the study as it is and with each of the settings that apply to it: other rungs of its
/// ladder, tolerances, shorter records, starts, each mark left out, no profiles. Throws Error for
/// bad input.
StudyCost CostOfStudy(const std::string& path, const std::vector<std::string>& overrides,
                      const StudyCostOptions& options);

/// The cheapest setting whose every interval is at most `factor` times as wide as that of the study
/// as it is, tested by a finer mesh where that one is, and in agreement with it; nullptr: none.
const StudyCostPoint* CheapestWithin(const StudyCost& cost, double factor);

/// Advice in sentences, with the options that do it.
std::vector<std::string> CostAdvice(const StudyCost& cost);

}  // namespace unfurl::study
