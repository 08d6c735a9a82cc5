#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <string>
#include <vector>

namespace unfurl::correlate {

/// Readings in a row that repeat one value because the instrument dropped out: it held its last
/// one, or showed a fixed one such as 0.
struct HeldRun {
  std::size_t first = 0, count = 0;  ///< into the readings
  double from = 0.0, to = 0.0;       ///< stamps of the first and the last [s]
  double value = 0.0;                ///< [unit of the readings]
};

/// Runs that chance does not make, in order. As chance counts how often a reading equals the one
/// before it in all the others (one run so long in a hundred records). And the readings must jump
/// to the run or from it, by more than twice what they do in any step of the six before or behind:
/// what rests, or lies at the end of a range, leaves its value as it moves. Where more than a fifth
/// of the readings would be held there are none: the record is made of plateaus.
std::vector<HeldRun> FindHeldRuns(const std::vector<double>& t, const Eigen::VectorXd& y);

/// Leaves the runs' readings out of vectors of the record's length; an empty one stays empty.
void LeaveOut(const std::vector<HeldRun>& runs, std::vector<double>* values);

/// What they are, in a sentence: "20 readings of acc from .. to .. s, all 0 m/s^2, ..".
std::string HeldWords(const std::vector<HeldRun>& runs, const std::string& name,
                      const std::string& unit);

}  // namespace unfurl::correlate
