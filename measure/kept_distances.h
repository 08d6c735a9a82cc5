#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "measure/triangulate.h"

namespace unfurl::measure {

class HealthEvidence;
struct HealthOptions;

/// Two marks on one rigid body: a bar that is in the picture all the time.
struct KeptDistance {
  std::string a, b;     ///< names of the marks
  double length = 0.0;  ///< 0: not known, only that it stays the same [m]
  double sigma = 0.0;   ///< standard deviation of `length` [m]
};

/// What such distances say of the cameras; with three of them nothing else does.
struct DistanceReport {
  /// Of one distance.
  struct One {
    std::size_t samples = 0;
    double length = 0.0, sigma = 0.0;      ///< as found, the calibration's part included [m]
    double scatter = 0.0, expected = 0.0;  ///< RMS about its mean, and by the error bars [m]
  };
  /// What would explain distances that are not kept.
  struct Cause {
    std::vector<int> cameras;         ///< one; two that are exchanged
    int lag = 0;                      ///< lines that it is late by
    double px = 0.0, sigma_px = 0.0;  ///< of a shift [px]
  };
  std::string unknown;        ///< why nothing can be told; empty: it was looked at
  bool kept = true;           ///< by all that the readings and the calibration may be off
  std::vector<One> each;      ///< in the order in which they were named
  std::vector<Cause> causes;  ///< where they are not kept; may be none
  /// By camera, the shift that nine times in ten would have shown [px].
  std::vector<double> shows_px;
};

/// Whether distances are kept: each, how it varies, and a shift of each camera, tested against all
/// that readings, floors and the calibration may be off by. `marks` names those of the evidence,
/// none of which may be missing in `distances`.
DistanceReport JudgeDistances(const HealthEvidence& evidence, const Triangulator& triangulator,
                              std::span<const KeptDistance> distances,
                              std::span<const std::string> marks, const HealthOptions& options);

/// "the distance of a and b keeps to 320.02 +- 0.04 mm: ..."; empty: nobody asked.
std::string Describe(const DistanceReport& report, std::span<const KeptDistance> distances,
                     std::span<const std::string> cameras);

/// Throws Error, for `record`, where a distance names what is none of its marks.
void RequireMarks(std::span<const KeptDistance> distances, std::span<const std::string> marks,
                  const std::string& record);

/// "a,b", or "a,b=0.32m+-0.1mm". Throws Error, with `where`, for anything else.
KeptDistance ParseKeptDistance(const std::string& text, const std::string& where);

}  // namespace unfurl::measure
