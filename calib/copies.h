#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "calib/observations.h"

namespace unfurl::calib {

/// What is measured several times, each time with numbers of its own.
struct MeasuredRows {
  std::string kind;  ///< "point", "pose"
  std::string what;  ///< what is alike of two copies: "the place and the readings"
  std::vector<std::string> names;
  std::vector<std::vector<double>> rows;  ///< of each the numbers; copies have the same
  std::size_t fewest = 0;                 ///< numbers of a row that chance does not repeat
};

/// Numbers of a bar's row: end or mark, camera and reading for each of six readings, one more than
/// a bar has unknowns. With fewer, two places of a bar may agree by chance. [-]
inline constexpr std::size_t kFewestOfABar = 3 * 6;

/// Throws Error with `where` where a row is there twice: it would count twice, and narrow every
/// error bar.
void RefuseCopiedRows(const MeasuredRows& measured, const std::string& where);

/// Throws Error with `where` where a camera reads nearly the same of all points, wherever they are:
/// it follows no mark.
void RefuseStillCameras(const Observations& data, const std::string& where);

}  // namespace unfurl::calib
