#include "report/plane_unit.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/length.h"

namespace unfurl::report {

namespace {

double Farthest(const std::vector<double>& values) {
  double most = 0.0;
  for (const double v : values) {
    if (std::isfinite(v)) most = std::max(most, std::fabs(v));
  }
  return most;
}

void Multiply(std::vector<double>* values, double factor) {
  for (double& v : *values) v *= factor;
}

}  // namespace

double SetShortUnit(double extent, Axis* x, Axis* y) {
  constexpr double kSmall = 0.1;  // [m]: two decimals still tell its ticks apart
  if (x->unit != "m" || y->unit != "m" || !(extent > 0.0) || extent >= kSmall) return 1.0;
  const LengthUnit unit = UnitFor(extent);
  x->unit = y->unit = unit.name;
  return unit.per_metre;
}

Motion InShortUnit(Motion motion) {
  double extent = 0.0;
  for (const MovingLine& line : motion.lines) extent = std::max(extent, Farthest(line.xy));
  for (const MovingPin& pin : motion.pins) extent = std::max(extent, Farthest(pin.xy));
  for (const MovingMark& mark : motion.marks) {
    extent = std::max({extent, Farthest(mark.x), Farthest(mark.y)});
  }
  const double factor = SetShortUnit(extent, &motion.x, &motion.y);
  if (factor == 1.0) return motion;
  for (MovingLine& line : motion.lines) Multiply(&line.xy, factor);
  for (MovingPin& pin : motion.pins) Multiply(&pin.xy, factor);
  for (MovingMark& mark : motion.marks) {
    Multiply(&mark.x, factor);
    Multiply(&mark.y, factor);
  }
  return motion;
}

Paths InShortUnit(Paths paths) {
  double extent = 0.0;
  for (const Path& path : paths.paths) {
    extent = std::max({extent, Farthest(path.x), Farthest(path.y)});
  }
  const double factor = SetShortUnit(extent, &paths.x, &paths.y);
  if (factor == 1.0) return paths;
  for (Path& path : paths.paths) {
    Multiply(&path.x, factor);
    Multiply(&path.y, factor);
  }
  return paths;
}

}  // namespace unfurl::report
