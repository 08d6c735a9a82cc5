#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace unfurl::measure {

/// What may change the light of spots, or their width.
enum class LightKind : std::int32_t {
  kLed = 0,    // one mark in all cameras
  kGain = 1,   // all marks in one camera
  kFocus = 2,  // the width of one camera's spots
  kAll = 3,    // all marks in all cameras
  kView = 4,   // one mark in one camera: something stands between. Not called a fault
};
const char* Name(LightKind kind);  ///< one word

/// Whose light, or width: camera and mark, -1 where it is of all.
struct LightSubject {
  LightKind kind = LightKind::kLed;
  int camera = -1, mark = -1;
  /// Of the same kind, camera and mark.
  bool operator==(const LightSubject&) const = default;
};

/// A change of light or focus within a record; how it began with is what it is told against.
struct LightFault {
  LightSubject subject;
  std::vector<LightSubject> rivals;     ///< that explain it nearly as well; empty: it is certain
  double earliest = 0.0, latest = 0.0;  ///< it began between these [s]
  double until = 0.0;  ///< when it has its size [s]; as `latest` where it came at once
  double size = 0.0;   ///< of brightness or width, relative: -0.3 is 30% less [-]
  double sigma = 0.0;  ///< its standard deviation [-]
  /// Nothing else explains it as well.
  bool certain() const { return rivals.empty(); }
};

/// "the LED of mark tip is dimmer by 30.2 +- 0.5% since 3.210 +- 0.002 s".
std::string Describe(const LightFault& fault, std::span<const std::string> cameras,
                     std::span<const std::string> marks);

}  // namespace unfurl::measure
