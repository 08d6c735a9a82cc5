#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "measure/spot.h"

namespace unfurl::measure {

// Whether a line that is named dark shows the light of a mark: its LED stays lit, or flashes there.
// Such a line is no background. A lamp of the room stays where it is, and is one. Of one camera.
class DarkLight {
 public:
  explicit DarkLight(std::size_t marks) : last_(marks) {}

  /// The brightest spot of a line in which that mark alone should be lit, and whether it is the
  /// only one; null: there was none.
  void Lit(int mark, const Spot* spot, bool only);
  /// Whose light a spot of a dark line is: as bright and narrow, it stands where that mark was, as
  /// far as that moves from flash to flash; -1: nobody's. Of several it is the one whose line
  /// showed nothing else, as an LED that stays lit is seen in the lines of all.
  int MarkOf(const Spot& spot) const;

 private:
  struct Last {
    int flashes = 0;    // seen in a row, two at most
    bool only = false;  // in the last one it was the only light
    double u_px = 0.0, before_px = 0.0, width_px = 0.0, flux = 0.0;
  };
  std::vector<Last> last_;
};

/// Dark lines that show the light of marks in most cameras.
struct LitDark {
  std::size_t lines = 0;
  double from = 0.0, until = 0.0;  ///< the first and the last of them [s]
  std::vector<std::size_t> votes;  ///< by mark: cameras and lines that say it is its light

  /// A dark line, by what its cameras say whose light it shows (-1: nobody's); whether most see
  /// any.
  bool Add(double t, std::span<const int> marks);
  /// The one that most say it is.
  int mark() const;
};

}  // namespace unfurl::measure
