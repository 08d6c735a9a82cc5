#include "measure/course_levels.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "base/statistics.h"

namespace unfurl::measure {

namespace {

// Of a mark's usual time between flashes: after a longer gap another row begins.
constexpr double kCourseGap = 1.5;
// Chance that sound differences are left out as wild, which is corrected for [-].
constexpr double kWildShare = 1e-3;
constexpr double kMostWild = 0.1;       // of differences, as HealthOptions::scatter_harmless [-]
constexpr double kLeastLevel = 1e-12;   // of readings that do not scatter at all [-]
constexpr double kLeastChance = 1e-12;  // of what is certain: a quantile wants some [-]
// Of the quotient of both variances of n independent normal numbers, by their mean square and by
// their median one m with the density f there, over 1/n: 1 / (2 f m)^2 - 2.
constexpr double kMedianVariance = 3.46;
constexpr std::size_t kMostFlashes = 4096;  // that are looked at: a factor is then known to 2%
constexpr std::size_t kPieceFlashes = 256;  // of a longer record, in a row

struct Level {
  double square = 0.0;  // mean of what is not wild, as if nothing had been left out [-]
  double median = 0.0;  // the same by their median, as of normal ones [-]
  double wild = 0.0;    // share that was left out [-]
};

Level LevelOf(std::span<const Difference> all) {
  static const double limit = ChiSquareQuantile(1.0 - kWildShare, 1.0);
  static const double kept = (1.0 - ChiSquareTail(limit, 3.0)) / (1.0 - kWildShare);
  std::vector<double> squares;
  squares.reserve(all.size());
  for (const Difference& one : all) squares.push_back(one.d * one.d);
  const double median = std::max(Median(squares) / ChiSquareQuantile(0.5, 1.0), kLeastLevel);
  Level out{median, median};
  constexpr int kRounds = 40;  // at most; they settle in some five
  for (int round = 0; round < kRounds; ++round) {
    double sum = 0.0, n = 0.0;
    for (const double one : squares) {
      if (one >= limit * out.square) continue;
      sum += one;
      n += 1.0;
    }
    const double was = out.square;
    out.square = std::max(sum / (n * kept), kLeastLevel);
    out.wild = 1.0 - n / static_cast<double>(squares.size());
    if (std::abs(out.square - was) < 1e-4 * was) break;
  }
  return out;
}

double R(std::size_t a, std::size_t b) {
  return AllCourseKinds().R(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b));
}

// Of differences of the same flashes, or of one camera's so many flashes later, with how many
// independent ones these are. None is left out, as what strikes a mark is wild in every camera;
// a reading that is wrong by itself goes with no other camera's.
std::pair<double, double> Correlation(std::span<const Difference> a, std::span<const Difference> b,
                                      int lag) {
  double sum = 0.0, aa = 0.0, bb = 0.0, n = 0.0;
  for (std::size_t i = 0, j = 0; i < a.size() && j < b.size();) {
    const auto at = static_cast<std::ptrdiff_t>(a[i].first) + lag;
    const auto other = static_cast<std::ptrdiff_t>(b[j].first);
    if (at != other) {
      at < other ? ++i : ++j;
      continue;
    }
    if (a[i].whole && b[j].whole) {
      sum += a[i].d * b[j].d;
      aa += a[i].d * a[i].d;
      bb += b[j].d * b[j].d;
      n += 1.0;
    }
    ++i, ++j;
  }
  if (!(aa > 0.0) || !(bb > 0.0)) return {0.0, 0.0};
  return {sum / std::sqrt(aa * bb), n};
}

}  // namespace

std::vector<CourseReading> CourseReadings(const ReadingCourse& course, Eigen::Index c,
                                          std::size_t every) {
  std::vector<double> gaps;
  for (std::size_t i = 1; i < course.t.size(); ++i) {
    if (course.t[i] > course.t[i - 1]) gaps.push_back(course.t[i] - course.t[i - 1]);
  }
  const double longest = gaps.empty() ? 0.0 : kCourseGap * Median(gaps);
  std::vector<CourseReading> out;
  std::size_t row = 0;
  double last = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < course.t.size(); ++i) {
    if (every > 1 && i / kPieceFlashes % every != 0) continue;
    const auto at = static_cast<Eigen::Index>(i);
    const double t = course.t[i];
    if (!(t > last)) continue;
    if (t - last > longest) ++row;
    last = t;
    if (std::isnan(course.u_px(at, c)) || !(course.s_px(at, c) > 0.0)) continue;
    out.push_back({t, course.u_px(at, c), course.s_px(at, c), i, row});
  }
  return out;
}

CourseLevels::CourseLevels(const ReadingCourse& course) : cameras_(course.u_px.cols()) {
  const std::size_t every = (course.t.size() + kMostFlashes - 1) / kMostFlashes;
  square_ = median_ = numbers_ = wild_ = Eigen::MatrixXd::Zero(kCourseKinds, cameras_);
  for (Eigen::Index c = 0; c < cameras_; ++c) {
    std::vector<CourseReading> readings = CourseReadings(course, c, every);
    readings_.push_back(readings);
    LeaveOutWrong(&readings);
    for (std::size_t k = 0; k < kCourseKinds; ++k) {
      const std::vector<Difference> mine = DifferencesOf(readings, AllCourseKinds().of[k]);
      if (mine.empty()) continue;
      numbers_(static_cast<Eigen::Index>(k), c) = static_cast<double>(mine.size());
      const Level level = LevelOf(mine);
      square_(static_cast<Eigen::Index>(k), c) = level.square;
      median_(static_cast<Eigen::Index>(k), c) = level.median;
      wild_(static_cast<Eigen::Index>(k), c) = level.wild;
    }
  }
}

double CourseLevels::Numbers(std::size_t k, Eigen::Index c) const {
  return numbers_(static_cast<Eigen::Index>(k), c) / R(k, k);
}

std::size_t CourseLevels::Cameras(std::size_t k) const {
  std::size_t n = 0;
  for (Eigen::Index c = 0; c < cameras_; ++c) n += Known(k, c);
  return n;
}

bool CourseLevels::Quiet(std::size_t k) const {
  const auto row = static_cast<Eigen::Index>(k);
  for (Eigen::Index c = 0; c < cameras_; ++c) {
    if (!(wild_(row, c) < kMostWild)) return false;
    if (!Known(k, c) || square_(row, c) < 1.0) continue;
    const double over = square_(row, c) / median_(row, c) - 1.0;
    if (over > kCourseApart * std::sqrt(kMedianVariance / Numbers(k, c))) return false;
  }
  return true;
}

CourseLevels::Apart CourseLevels::Compare(std::size_t a, std::size_t b, double fewest) const {
  Apart out;
  double sum = 0.0, weight = 0.0;
  for (Eigen::Index c = 0; c < cameras_; ++c) {
    if (!Known(a, c, fewest) || !Known(b, c, fewest)) continue;
    const double n = std::min(numbers_(static_cast<Eigen::Index>(a), c),
                              numbers_(static_cast<Eigen::Index>(b), c));
    const double variance = 2.0 * (R(a, a) + R(b, b) - 2.0 * R(a, b)) / n;
    const double share = Square(a, c) / Square(b, c) - 1.0;
    const double z = share / std::sqrt(variance);
    out.most = std::max(out.most, z);
    out.least = std::min(out.least, z);
    sum += share / variance;
    weight += 1.0 / variance;
  }
  if (!(weight > 0.0)) return out;
  out.sigma = 1.0 / std::sqrt(weight);
  out.most = std::max(out.most, sum / weight / out.sigma);
  out.least = std::min(out.least, sum / weight / out.sigma);
  return out;
}

double CourseLevels::Together(std::size_t k, double* pairs, double* told) const {
  double chi_square = 0.0;
  *pairs = *told = 0.0;
  std::vector<std::vector<Difference>> all;
  for (Eigen::Index c = 0; c < cameras_; ++c) {
    all.push_back(Known(k, c) ? Clipped(k, c) : std::vector<Difference>());
  }
  for (std::size_t c = 0; c < all.size(); ++c) {
    for (std::size_t d = 0; d < c; ++d) {
      double most = 0.0, told_here = 0.0;
      for (int lag = -kCourseLag; lag <= kCourseLag; ++lag) {
        const auto [correlation, count] = Correlation(all[c], all[d], lag);
        const double n = count / R(k, k);
        if (n < kFewestTold) continue;
        most = std::max(most, n * correlation * correlation);
        told_here = std::max(told_here, n);
      }
      if (!(told_here > 0.0)) continue;
      // The largest of several, as one number of the same chance.
      const double chance = ChanceOfAny(ChiSquareTail(most, 1.0), kCourseLags);
      chi_square += ChiSquareQuantile(1.0 - std::max(chance, kLeastChance), 1.0);
      *pairs += 1.0;
      *told += told_here;
    }
  }
  if (*pairs > 0.0) *told /= *pairs;
  return chi_square;
}

// Of every reading, and none beyond what is wild: it would outweigh all others.
std::vector<Difference> CourseLevels::Clipped(std::size_t k, Eigen::Index c) const {
  const double most = std::sqrt(ChiSquareQuantile(1.0 - kWildShare, 1.0) * Square(k, c));
  std::vector<Difference> out =
      DifferencesOf(readings_[static_cast<std::size_t>(c)], AllCourseKinds().of[k]);
  for (Difference& one : out) one.d = std::clamp(one.d, -most, most);
  return out;
}

}  // namespace unfurl::measure
