#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

namespace unfurl::measure {

/// From a moment on one mark goes on where another one was: the slots name them wrongly.
struct ExchangedMark {
  int mark = -1, was = -1;         ///< goes on under the name `mark` what was `was`
  double after = 0.0, from = 0.0;  ///< the last sample of `mark` before, and the first of it [s]
  bool both = false;               ///< `was` is still there: its LED is lit in the slot of `mark`
  double within = 0.0;             ///< `both`: no further apart than this [m]
};

/// "mark1 goes on from 2.8 s where mark2 was at 2.795 s and mark2 goes on ..", "mark1 is from 2.8 s
/// on where mark2 is"; empty: none did.
std::string Describe(std::span<const ExchangedMark> exchanged, std::span<const std::string> marks);

// Watches the courses of marks for names that change over. A mark that jumps is no evidence, a kick
// or a gap is enough; but two that jump at one time, each onto the course of another, are. So is
// one that is where another is at the same time, flash after flash: two LEDs cannot be.
class ExchangeWatch {
 public:
  explicit ExchangeWatch(std::size_t marks)
      : courses_(marks), recent_(marks), together_(marks * marks) {}

  // A place of a mark, in the order of its samples; `sigma` its standard deviation [m].
  void Add(double t, int mark, const Eigen::Vector3d& p, double sigma);
  const std::vector<ExchangedMark>& found() const { return found_; }

 private:
  static constexpr std::size_t kKept = 64;  // jumps, and exchanges, that are kept
  struct Place {
    double t = 0.0, sigma = 0.0;
    Eigen::Vector3d p = Eigen::Vector3d::Zero();
  };
  struct Course {
    std::array<Place, 3> last;  // the newest behind
    std::size_t count = 0;
  };
  struct Jump {  // two places before and two after
    int mark = -1;
    std::array<Place, 4> at;
    bool told = false;
  };
  // By how much two pieces of a course miss each other [m], and what noise makes of that.
  struct Miss {
    double distance = 0.0, sigma = 0.0;
  };
  // The newest places of a mark, in a ring.
  struct Recent {
    std::array<Place, 8> place;
    std::size_t count = 0;
  };
  // Places of a mark that are another's, from its last jump on, or from its first place.
  struct Together {
    bool jumped = false, begun = false, apart = false;
    double after = 0.0, from = 0.0;  // [s]
    double reach = 0.0;              // of the jump, or how far both went since [m]
    std::size_t count = 0;
    double variance = 0.0;                            // sum over these places [m^2]
    Eigen::Vector3d first = Eigen::Vector3d::Zero();  // [m]
    Eigen::Vector3d sum = Eigen::Vector3d::Zero(), slack = Eigen::Vector3d::Zero();  // [m]
  };
  void Jumped(const Jump& jump, double reach);
  void Compare(int mark, const Place& here);
  void Judge(int mark, int other, const Place& place, const std::array<const Place*, 4>& course);
  void Tell(const Together& pair, int mark, int other, double within);
  static Miss MissOf(const Place& a, const Place& b, const Place& c, const Place& d);
  static bool Continues(const Jump& jump, const Jump& other);
  void Match();

  std::vector<Course> courses_;
  std::vector<Jump> jumps_;  // that may still find their partner
  std::vector<Recent> recent_;
  std::vector<Together> together_;  // of mark m and other k at m marks + k
  std::vector<ExchangedMark> found_;
};

}  // namespace unfurl::measure
