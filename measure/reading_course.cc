#include "measure/reading_course.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/statistics.h"
#include "measure/course_levels.h"

namespace unfurl::measure {

namespace {

constexpr double kFewestCompared =
    6.0;  // independent numbers of a kind that another is held against
constexpr double kTogetherLevel = 0.01;  // chance that sound readings are taken for a mark's motion

// The first kind that no other one undercuts; kCourseKinds: there is none.
std::size_t Lowest(const CourseLevels& levels, std::size_t most) {
  for (std::size_t a = 0; a < kCourseKinds; ++a) {
    if (levels.Cameras(a) < most || !levels.Quiet(a)) continue;
    bool lowest = true;
    for (std::size_t b = 0; b < kCourseKinds && lowest; ++b) {
      if (b != a) lowest = levels.Compare(a, b).most < kCourseApart;
    }
    if (lowest) return a;
  }
  return kCourseKinds;
}

// What moves less than readings scatter shows the same in another kind, too; what a mark does near
// half the rate of its flashes does not.
bool Confirmed(const CourseLevels& levels, std::size_t a) {
  for (std::size_t b = 0; b < kCourseKinds; ++b) {
    if (b == a) continue;
    const CourseLevels::Apart apart = levels.Compare(b, a, kFewestCompared);
    if (std::isfinite(apart.sigma) && apart.Alike()) return true;
  }
  return false;
}

// Which share of what kind `a` shows may be a motion that nothing would show.
double Hidden(const CourseLevels& levels, std::size_t a, double pairs, double told) {
  double hidden = 1.0;
  for (std::size_t b = 0; b < kCourseKinds; ++b) {
    if (AllCourseKinds().of[b].stride == AllCourseKinds().of[a].stride) continue;
    const CourseLevels::Apart apart = levels.Compare(b, a);
    if (apart.Alike()) {
      hidden = std::min(hidden, kCourseApart * apart.sigma);
    }
  }
  if (pairs < 1.0) return hidden;
  // A share h of all cameras' variances is a correlation h of every pair, at some lag.
  const double limit = ChiSquareQuantile(1.0 - kTogetherLevel, pairs) *
                       ChiSquareQuantile(1.0 - kTogetherLevel / kCourseLags, 1.0) /
                       ChiSquareQuantile(1.0 - kTogetherLevel, 1.0);
  return std::min(hidden, std::sqrt(2.0 * limit / (pairs * told)));
}

}  // namespace

CourseScatter ScatterOfCourse(const ReadingCourse& course) {
  const Eigen::Index cameras = course.u_px.cols();
  CourseScatter out;
  out.square.assign(static_cast<std::size_t>(cameras), std::numeric_limits<double>::quiet_NaN());
  out.numbers.assign(static_cast<std::size_t>(cameras), 0.0);
  const CourseLevels levels(course);
  std::size_t most = 0;
  for (std::size_t k = 0; k < kCourseKinds; ++k) most = std::max(most, levels.Cameras(k));
  if (most == 0) {
    out.unknown = "it has too few flashes in a row";
    return out;
  }
  const std::size_t lowest = Lowest(levels, most);
  constexpr const char* kMoves = "it moves too much between its flashes";
  if (lowest == kCourseKinds || !Confirmed(levels, lowest)) {
    out.unknown = kMoves;
    return out;
  }
  double told = 0.0;
  out.together = levels.Together(lowest, &out.pairs, &told);
  if (out.pairs > 0.0 && ChiSquareTail(out.together, out.pairs) < kTogetherLevel) {
    out.unknown = kMoves;
    return out;
  }
  for (Eigen::Index c = 0; c < cameras; ++c) {
    if (!levels.Known(lowest, c)) continue;
    const auto k = static_cast<std::size_t>(c);
    out.square[k] = levels.Square(lowest, c);
    out.numbers[k] = levels.Numbers(lowest, c);
  }
  out.kind = lowest;
  out.hidden = Hidden(levels, lowest, out.pairs, told);
  return out;
}

}  // namespace unfurl::measure
