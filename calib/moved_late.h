#pragma once

#include <cstddef>
#include <vector>

#include "calib/observations.h"
#include "calib/refine.h"
#include "calib/trends.h"

namespace unfurl::calib {

// Of `all` things in a row `marked` are so anywhere: the chance that of the last `last` as many as
// `least` or more are [hypergeometric distribution].
double ChanceOfLast(std::size_t all, std::size_t marked, std::size_t last, std::size_t least);

// Of things in the order of measuring, some of which were left out: those of the last that are
// least likely to hold so many of them, if they lay anywhere. Most of them were left out, and two
// at least: of one nobody can say what came after it.
struct LastOnes {
  double chance = 1.0;       // [-]
  std::size_t last = 0;      // how many they are
  std::size_t left_out = 0;  // and of them left out
};
LastOnes LeastLikelyLast(const std::vector<char>& left_out);

// Cameras of whose last readings, in the order of measuring, most were left out as gross: such a
// camera moved before the survey ended, and the rig has it as it stood before, as most of its
// readings do. Found is what is less probable than `level` for all cameras and all beginnings
// together, if those that were left out lay anywhere; two readings at least. One that moved and was
// put back, or moved early, does no harm and is not found.
std::vector<Trend> FindMovedLate(const Observations& data, const RefinedBundle& bundle,
                                 double level);

}  // namespace unfurl::calib
