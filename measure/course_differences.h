#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <span>
#include <vector>

namespace unfurl::measure {

struct CourseKind {
  int points = 4, stride = 1;  // a difference over so many readings, every so many-th
};
constexpr std::array<int, 5> kCoursePoints = {4, 6, 8, 12, 16};
constexpr std::array<int, 5> kCourseStrides = {1, 2, 3, 4, 5};
constexpr std::size_t kCourseKinds = kCoursePoints.size() * kCourseStrides.size();

// Kinds in the order of what they make of a row, and of two of them R = the sum over all shifts of
// their squared correlations, where readings are white and even in time: n differences of both
// give variances with the covariance 2 R / n of what they should be.
struct CourseKinds {
  std::array<CourseKind, kCourseKinds> of;
  Eigen::MatrixXd R = Eigen::MatrixXd::Zero(kCourseKinds, kCourseKinds);
};
const CourseKinds& AllCourseKinds();

// A reading of one camera of one mark; rows are readings without a long gap in time.
struct CourseReading {
  double t = 0.0, u_px = 0.0, s_px = 0.0;
  std::size_t flash = 0, row = 0;
};

// Over readings of which one is `first` and one in the `middle`, over what is stated of it.
struct Difference {
  double d = 0.0;          // [-]
  std::size_t first = 0;   // flash
  std::size_t middle = 0;  // reading
  bool whole = false;      // none is missing between
};

// Of every so many-th flash, whichever of these is the first, those readings that are there: what
// no polynomial explains that goes through all but one of a kind's points.
std::vector<Difference> DifferencesOf(std::span<const CourseReading> readings,
                                      const CourseKind& kind);

// Sigmas beyond which a reading among its neighbours is wrong by itself: of a million sound ones
// one is [-].
constexpr double kWrongSigmas = 5.0;

// Takes out what is wrong by itself: readings that are the largest of their neighbourhood, beyond
// five sigmas of what is usual, by kinds that show little else.
void LeaveOutWrong(std::vector<CourseReading>* readings);

}  // namespace unfurl::measure
