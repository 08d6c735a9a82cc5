#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <limits>
#include <vector>

#include "measure/course_differences.h"
#include "measure/reading_course.h"

namespace unfurl::measure {

// Independent numbers: a variance is then known to a third.
constexpr double kFewestTold = 16.0;
// Of kinds' own deviations: what is apart by more is another level [-].
constexpr double kCourseApart = 3.0;
// Flashes by which two cameras' readings may go together.
constexpr int kCourseLag = 8;
constexpr double kCourseLags = 2.0 * kCourseLag + 1.0;

// Of camera c, in the order of time; of `every` so many pieces of the course one. After a gap of
// more than one flash another row begins.
std::vector<CourseReading> CourseReadings(const ReadingCourse& course, Eigen::Index c,
                                          std::size_t every = 1);

// How large the differences of every camera are, of every kind, over what is stated.
class CourseLevels {
 public:
  explicit CourseLevels(const ReadingCourse& course);

  // The mean of their squares, as if nothing wild had been left out.
  double Square(std::size_t k, Eigen::Index c) const {
    return square_(static_cast<Eigen::Index>(k), c);
  }
  // Independent numbers.
  double Numbers(std::size_t k, Eigen::Index c) const;
  bool Known(std::size_t k, Eigen::Index c, double fewest = kFewestTold) const {
    return Numbers(k, c) >= fewest;
  }
  std::size_t Cameras(std::size_t k) const;  // that are known
  // What a mark does at times only, and what dies away after it, is wild, or makes the mean larger
  // than the median says. Where that is within what is stated it does no harm.
  bool Quiet(std::size_t k) const;

  // Of two kinds: by how much `a` shows more than `b`, over the deviation of that, in the camera
  // that tells most or in all together; and that deviation in all together, of a share [-].
  struct Apart {
    double most = 0.0, least = 0.0;
    double sigma = std::numeric_limits<double>::infinity();
    bool Alike() const { return most < kCourseApart && least > -kCourseApart; }
  };
  Apart Compare(std::size_t a, std::size_t b, double fewest = kFewestTold) const;

  // How much the cameras' differences go together, at once or one after another: a chi-square of as
  // many numbers as there are pairs where they have nothing in common; `told` is the mean of the
  // independent numbers in each.
  double Together(std::size_t k, double* pairs, double* told) const;

 private:
  std::vector<Difference> Clipped(std::size_t k, Eigen::Index c) const;

  Eigen::Index cameras_;
  Eigen::MatrixXd square_, median_, numbers_, wild_;  // kind x camera
  std::vector<std::vector<CourseReading>> readings_;  // by camera
};

}  // namespace unfurl::measure
