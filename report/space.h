#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "report/page.h"

namespace unfurl::report {

using Place = std::array<double, 3>;  // in a right-handed frame, z up [the space's unit]

// Something that looks at the rest from a place of its own.
struct SpaceEye {
  std::string name;
  Place at{};
  // Corners of the far end of what it sees, in order around; empty: not drawn.
  std::vector<Place> field;
  // Half the width, at the point, of the sheet that one reading stands for; zero: it is a ray.
  Place across{};
};

struct SpacePoint {
  Place at{};
  double value = std::numeric_limits<double>::quiet_NaN();  // NaN: grey [the cloud's unit]
  std::string label;
  std::uint32_t seen = 0, refused = 0;  // bit e: eye e sees it; it did, and was not believed
};

// Ends of a scale of colours; NaN: the least and the largest value.
struct ColorRange {
  double low = std::numeric_limits<double>::quiet_NaN();
  double high = std::numeric_limits<double>::quiet_NaN();
};

// Points coloured by a value of their own.
struct SpaceCloud {
  std::string name;
  Axis value;
  ColorRange range;
  std::vector<SpacePoint> points;
};

struct SpaceEllipsoid {
  Place at{};
  std::array<Place, 3> axes{};  // semi-axes of one sigma, at right angles
  double value = 0.0;           // its colour [the set's unit]
};

struct SpaceEllipsoids {
  std::string name;
  Axis value;
  ColorRange range;
  std::vector<SpaceEllipsoid> ellipsoids;
};

struct SpaceLine {
  std::string name;
  std::vector<Place> points;  // NaN interrupts it
  int color = 0;              // index into the palette
};

// A view in space that is turned with mouse, touch or keys: one cloud and one set of ellipsoids at
// a time, and from a chosen point the rays of the eyes that see it. Where nothing turns (print, no
// WebGL, no scripts), a still picture of the same stands there.
struct Space {
  std::string title;
  std::string note;
  std::string unit = "m";
  Place low{}, high{};  // a box that is drawn; low below high
  std::vector<SpaceEye> eyes;
  std::vector<SpaceCloud> clouds;           // the first is shown at first
  std::vector<SpaceEllipsoids> ellipsoids;  // likewise
  std::vector<SpaceLine> lines;
};

// Most points of a cloud that the view holds: more would hide one another. The caller chooses
// which.
inline constexpr std::size_t kMostSpacePoints = 3000;

// How many times its size an ellipsoid is drawn: 1, 2 or 5 times a power of ten, such that the
// typical one spans a good part of its distance to the next; 1 where there are none.
double Magnification(const Space& space);

// Both throw Error for a box without extent, a field of fewer than three corners, more points or
// eyes than the view takes, and places that are not finite.
std::string SpaceHtml(const Space& space, const std::string& id);  // the panel
std::string SpaceSvg(const Space& space);                          // the still in it

}  // namespace unfurl::report
