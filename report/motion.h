#pragma once

#include <string>
#include <vector>

#include "report/page.h"

namespace unfurl::report {

// A curve that moves: the same points in every frame.
struct MovingLine {
  enum class Kind { kBeam, kBody };  // beams are drawn thick, and their bending can be scaled
  std::string name;
  Kind kind = Kind::kBeam;
  std::size_t points = 0;
  std::vector<double> xy;  // x, y of each point, frame after frame [the axes' unit]
};

// A joint: where it is, when it latched, when its stops touched.
struct MovingPin {
  std::string name;
  std::vector<double> xy;                                     // frame after frame [the axes' unit]
  double latched = std::numeric_limits<double>::quiet_NaN();  // [s]; NaN: never
  std::vector<std::pair<double, double>> contacts;            // from, to [s]
};

// A point with stamps of its own: simulated marks are discs, measured ones rings.
struct MovingMark {
  std::string name;
  bool measured = false;
  std::vector<double> t, x, y;  // [s], [the axes' unit]
  int color = 0;                // index into the palette
};

// A moving picture in a plane, with a player beneath it: play and pause, time, speed, next event,
// scale of bending, trails, a still or a film on a click. Its time and that of the page's charts of
// time are one. Shown where scripts run; Paths serve where none do.
struct Motion {
  std::string title;
  std::string note;
  Axis x, y;              // of one unit: drawn at equal scale
  std::vector<double> t;  // of the frames, rising [s]
  std::vector<MovingLine> lines;
  std::vector<MovingPin> pins;
  std::vector<MovingMark> marks;
  std::vector<Marker> events;  // on the frames' clock
  bool loops = false;          // begins again at its end: a period
  bool legend = true;          // false: colours tell nothing, and only the pointer names marks
};

// Indices of at most `most` (2 or more) of `count`, both ends included.
std::vector<std::size_t> EvenlyChosen(std::size_t count, std::size_t most);

// The panel; `id` names its elements. Numbers are kept in 32 bits, thinned so that the panel stays
// below some 1.5 MB. Throws Error for arrays of wrong lengths.
std::string MotionHtml(const Motion& motion, const std::string& id);

}  // namespace unfurl::report
