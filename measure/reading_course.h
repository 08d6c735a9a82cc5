#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

namespace unfurl::measure {

// Readings of one mark in the order of time, flash by flash: n flashes, c cameras.
struct ReadingCourse {
  std::vector<double> t;          // n, never falling [s]
  std::vector<std::size_t> line;  // n, of the record
  Eigen::MatrixXd u_px, s_px;     // n x c, reading and what is stated of it; NaN: none [px]
};

// By how much the readings of one mark scatter over what is stated, by how they follow one another.
struct CourseScatter {
  std::string unknown;  // why it cannot be told; empty: it is
  // By camera: variance over the stated one, and the independent numbers that tell it (0: none).
  std::vector<double> square, numbers;
  std::size_t kind = 0;  // of differences that tells it (AllCourseKinds)
  // Which share of all of it may be a motion between the flashes that nothing here would show [-].
  double hidden = 1.0;
  // How much cameras' readings go together: a chi-square of `pairs` numbers where they do not.
  double together = 0.0, pairs = 0.0;
};

// Differences over 4 to 16 readings in a row, or of every second to fifth, of unit variance where
// readings scatter as stated: all of them have the readings' own scatter in full, and each has what
// it has of the way. So none can show less than the scatter, and those that the way does not reach
// agree. What a mark does between two readings may hide from one stride, and shows less in another,
// or in several cameras at once; what neither would show is said not to be told.
CourseScatter ScatterOfCourse(const ReadingCourse& course);

}  // namespace unfurl::measure
