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
};

/// "from 2.795 s on mark1 goes on where mark2 was, and mark2 where mark1 was"; empty: none did.
std::string Describe(std::span<const ExchangedMark> exchanged, std::span<const std::string> marks);

// Watches the courses of marks for names that change over. A mark that jumps is no evidence, a kick
// or a gap is enough; but two that jump at one time, each onto the course of another, are.
class ExchangeWatch {
 public:
  explicit ExchangeWatch(std::size_t marks) : courses_(marks) {}

  // A place of a mark, in the order of its samples; `sigma` its standard deviation [m].
  void Add(double t, int mark, const Eigen::Vector3d& p, double sigma);
  const std::vector<ExchangedMark>& found() const { return found_; }

 private:
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
  static Miss MissOf(const Place& a, const Place& b, const Place& c, const Place& d);
  static bool Continues(const Jump& jump, const Jump& other);
  void Match();

  std::vector<Course> courses_;
  std::vector<Jump> jumps_;  // that may still find their partner
  std::vector<ExchangedMark> found_;
};

}  // namespace unfurl::measure
