#pragma once

#include <span>
#include <string>

namespace unfurl::report {

// A curve in characters, for a terminal that shows UTF-8.
struct TerminalPlot {
  std::string title;    // above it, with the unit: "hinge.theta [deg]"
  std::string x_title;  // below, at its right end: "t [s]"
  int columns = 72;     // characters, with the axis
  int rows = 8;         // of characters, without title and axis
  bool joined = true;   // points joined by straight lines
};

// Two by four points a character (braille patterns). x and y: n each; what is not finite is a gap.
// Ends with a new line; says so where nothing is finite. Throws Error where n differ.
std::string TerminalText(const TerminalPlot& plot, std::span<const double> x,
                         std::span<const double> y);

}  // namespace unfurl::report
