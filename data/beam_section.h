#pragma once

#include <cmath>

namespace unfurl::data {

/// How the section of a beam changes along it: one size of it (or two) linearly from 1 at the start
/// to `taper` at the end. What is stated of a section is stated of that at the start.
struct BeamSection {
  /// Which size it is: across the plane, in it, or both.
  enum class Of { kWidth, kHeight, kBoth };

  double taper = 1.0;  ///< size at the end over that at the start [-]
  Of of = Of::kBoth;   ///< what changes so

  /// Whether nothing changes along it.
  bool uniform() const { return taper == 1.0; }
  /// At `at`, 0 at the start and 1 at the end; over that at the start [-].
  double Size(double at) const { return 1.0 + (taper - 1.0) * at; }
  double Area(double at) const { return of == Of::kBoth ? Size(at) * Size(at) : Size(at); }
  double Bending(double at) const {
    const double size = Size(at);
    return of == Of::kWidth ? size : of == Of::kHeight ? size * size * size : std::pow(size, 4.0);
  }
  /// int Area from 0 to `at`.
  double Volume(double at) const {
    const double t = taper - 1.0;
    const double linear = at * (1.0 + 0.5 * t * at);
    return of == Of::kBoth ? linear + t * at * at * (0.5 + t * at / 3.0) : linear;
  }
  /// Centre of mass, of the length [-].
  double Centre() const {
    const double t = taper - 1.0;
    const double linear = 0.5 + t / 3.0;
    return (of == Of::kBoth ? linear + t / 3.0 + 0.25 * t * t : linear) / Volume(1.0);
  }
  /// The part of the mass that lies between two places.
  double MassPart(double from, double to) const {
    return (Volume(to) - Volume(from)) / Volume(1.0);
  }
};

}  // namespace unfurl::data
