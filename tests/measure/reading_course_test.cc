// Scatter of readings by how they follow one another, against what was drawn.
#include "measure/reading_course.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include "base/random.h"
#include "measure/course_differences.h"

namespace unfurl::measure::reading_course_test {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr double kSigma = 0.05;  // stated [px]
constexpr double kStep = 5e-3;   // between flashes [s]

using Way = std::function<double(double t)>;

// Three cameras that see `way` in their own share, and scatter by `factor`.
ReadingCourse Draw(int flashes, double factor, const Way& way, Rng* rng) {
  ReadingCourse out;
  out.u_px.resize(flashes, 3);
  out.s_px = Eigen::MatrixXd::Constant(flashes, 3, kSigma);
  for (int i = 0; i < flashes; ++i) {
    const double t = kStep * i;
    out.t.push_back(t);
    for (int c = 0; c < 3; ++c) {
      out.u_px(i, c) = (1.0 - 0.7 * c) * way(t) + factor * kSigma * rng->Normal();
    }
  }
  return out;
}

double Swing(double t) { return 300.0 * std::sin(2.0 * t) + 5.0 * std::sin(100.0 * t); }

// A difference of unit variance of white noise, whatever the times are.
TEST(CourseDifferences, HaveTheReadingsOwnScatterAndNothingOfAPolynomial) {
  Rng rng(1);
  std::vector<CourseReading> readings;
  double t = 0.0;
  for (std::size_t i = 0; i < 20000; ++i) {
    t += rng.Uniform(0.7, 1.3);
    readings.push_back({t, kSigma * rng.Normal(), kSigma, i, 0});
  }
  for (const CourseKind& kind : AllCourseKinds().of) {
    double sum = 0.0;
    const std::vector<Difference> all = DifferencesOf(readings, kind);
    for (const Difference& one : all) sum += one.d * one.d;
    // R independent numbers to a difference: the mean is within four of its deviations.
    const double n = static_cast<double>(all.size()) / 10.0;
    EXPECT_NEAR(sum / static_cast<double>(all.size()), 1.0, 4.0 * std::sqrt(2.0 / n));
  }
  for (CourseReading& one : readings) one.u_px = 1.0 + 0.5 * one.t - 1e-4 * one.t * one.t;
  for (const Difference& one : DifferencesOf(readings, {4, 2})) EXPECT_LT(std::abs(one.d), 1e-6);
}

TEST(ReadingCourse, TellsTheScatterOfASmoothWay) {
  Rng rng(2);
  for (const double factor : {0.5, 1.0, 3.0}) {
    const CourseScatter found = ScatterOfCourse(Draw(400, factor, Swing, &rng));
    ASSERT_THAT(found.unknown, IsEmpty());
    for (std::size_t c = 0; c < 3; ++c) {
      const double variance = factor * factor;
      EXPECT_NEAR(found.square[c], variance, 4.0 * variance * std::sqrt(2.0 / found.numbers[c]));
      EXPECT_GT(found.numbers[c], 40.0);
    }
    EXPECT_LT(found.hidden, 0.5);
  }
}

// Ten of 400 readings of one camera are off by ten sigmas: they are no scatter.
TEST(ReadingCourse, LeavesOutWhatIsWrongByItself) {
  Rng rng(3);
  ReadingCourse course = Draw(400, 1.0, Swing, &rng);
  for (int i = 7; i < 400; i += 40) course.u_px(i, 1) += 10.0 * kSigma;
  const CourseScatter found = ScatterOfCourse(course);
  ASSERT_THAT(found.unknown, IsEmpty());
  EXPECT_NEAR(found.square[1], 1.0, 4.0 * std::sqrt(2.0 / found.numbers[1]));
}

// What all cameras see is the mark's motion, however rough: white from flash to flash, by itself,
// or one camera's a flash later.
TEST(ReadingCourse, MotionThatLooksLikeNoiseGoesTogetherInTheCameras) {
  Rng rng(4), jumps(5);
  ReadingCourse course = Draw(400, 1.0, Swing, &rng);
  double last = 0.0;
  for (int i = 0; i < 400; ++i) {
    const double jump = 3.0 * kSigma * jumps.Normal();
    course.u_px.row(i) += Eigen::RowVector3d(jump, 0.8 * jump, last);
    last = jump;
  }
  EXPECT_THAT(ScatterOfCourse(course).unknown, HasSubstr("moves too much"));
}

TEST(ReadingCourse, MotionNearHalfTheRateOfFlashesIsNoScatter) {
  Rng rng(6);
  const auto shakes = [](double t) { return Swing(t) + 0.5 * std::sin(0.97 * M_PI * t / kStep); };
  const CourseScatter found = ScatterOfCourse(Draw(400, 1.0, shakes, &rng));
  if (!found.unknown.empty()) return;
  for (std::size_t c = 0; c < 3; ++c) EXPECT_LT(found.square[c], 1.6);
}

TEST(ReadingCourse, FewFlashesTellNothing) {
  Rng rng(7);
  EXPECT_THAT(ScatterOfCourse(Draw(12, 1.0, Swing, &rng)).unknown, HasSubstr("too few"));
  ReadingCourse none = Draw(200, 1.0, Swing, &rng);
  none.u_px.setConstant(std::numeric_limits<double>::quiet_NaN());
  EXPECT_THAT(ScatterOfCourse(none).unknown, HasSubstr("too few"));
}

}  // namespace
}  // namespace unfurl::measure::reading_course_test
