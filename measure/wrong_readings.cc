#include "measure/wrong_readings.h"

#include <algorithm>
#include <cmath>

#include "measure/course_differences.h"
#include "measure/course_levels.h"

namespace unfurl::measure {

namespace {

constexpr std::size_t kMostInARow = 2;   // readings; more are a blow, or a mark that is lost
constexpr std::size_t kNearFlashes = 2;  // by which cameras may show a blow one after another

using CourseRecord = std::vector<CourseReading>;

// The largest difference of a kind over the last readings before `flash` and the first after it,
// with the reading `own` between or without; 0 where there are too few.
double DepartureOf(const CourseRecord& kept, std::size_t flash, const CourseReading* own,
                   const CourseKind& kind) {
  const auto reach = static_cast<std::ptrdiff_t>((kind.points / 2 + 1) * kind.stride);
  const auto next = std::lower_bound(
      kept.begin(), kept.end(), flash,
      [](const CourseReading& one, std::size_t value) { return one.flash < value; });
  const auto from = next - std::min(reach, next - kept.begin());
  const auto to = next + std::min(reach, kept.end() - next);
  CourseRecord near(from, next);
  if (own != nullptr) near.push_back(*own);
  near.insert(near.end(), next, to);
  double most = 0.0;
  for (const Difference& one : DifferencesOf(near, kind)) {
    const bool middle = own == nullptr || near[one.middle].flash == flash;
    if (middle) most = std::max(most, std::abs(one.d));
  }
  return most;
}

// Without those that depart from the others; what was taken out beside one of these comes back.
CourseRecord KeptOf(const CourseRecord& all, const CourseKind& kind, double limit) {
  CourseRecord kept = all;
  LeaveOutWrong(&kept);
  CourseRecord out;
  for (std::size_t i = 0, at = 0; i < all.size(); ++i) {
    const bool there = at < kept.size() && kept[at].flash == all[i].flash;
    if (there) ++at;
    if (there || !(DepartureOf(kept, all[i].flash, &all[i], kind) > limit)) out.push_back(all[i]);
  }
  return out;
}

// Those of `all` that `kept` lacks, no more than two in a row.
std::vector<const CourseReading*> TakenOut(const CourseRecord& all, const CourseRecord& kept) {
  std::vector<const CourseReading*> out, row;
  std::size_t at = 0;
  const auto end_row = [&] {
    if (row.size() <= kMostInARow) out.insert(out.end(), row.begin(), row.end());
    row.clear();
  };
  for (const CourseReading& one : all) {
    if (at < kept.size() && kept[at].flash == one.flash) {
      ++at;
      end_row();
    } else {
      row.push_back(&one);
    }
  }
  end_row();
  return out;
}

// Those that may be wrong, and all that depart.
void OutliersOfCamera(const ReadingCourse& course, const CourseScatter& scatter, std::size_t c,
                      std::vector<CourseOutlier>* found, std::vector<CourseOutlier>* departing) {
  const CourseKind& kind = AllCourseKinds().of[scatter.kind];
  const CourseRecord all = CourseReadings(course, static_cast<Eigen::Index>(c));
  const double limit = kWrongSigmas * std::sqrt(std::max(1.0, scatter.square[c]));
  const CourseRecord kept = KeptOf(all, kind, limit);
  for (std::size_t i = 0, at = 0; i < all.size(); ++i) {
    if (at < kept.size() && kept[at].flash == all[i].flash) {
      ++at;
    } else {
      departing->push_back({all[i].flash, c});
    }
  }
  for (const CourseReading* one : TakenOut(all, kept)) {
    const auto row = course.u_px.row(static_cast<Eigen::Index>(one->flash)).array();
    if ((row == row).count() != 3) continue;
    if (DepartureOf(kept, one->flash, nullptr, kind) < limit) found->push_back({one->flash, c});
  }
}

// A blow is seen by several cameras, one after another.
bool GoTogether(const CourseOutlier& a, const CourseOutlier& b) {
  return a.camera != b.camera && a.flash + kNearFlashes >= b.flash &&
         a.flash <= b.flash + kNearFlashes;
}

}  // namespace

std::vector<CourseOutlier> OutliersOf(const ReadingCourse& course, const CourseScatter& scatter) {
  std::vector<CourseOutlier> out;
  if (!scatter.unknown.empty()) return out;
  std::vector<CourseOutlier> found, departing;
  for (std::size_t c = 0; c < scatter.square.size(); ++c) {
    if (!(scatter.numbers[c] > 0.0)) continue;
    OutliersOfCamera(course, scatter, c, &found, &departing);
  }
  for (const CourseOutlier& one : found) {
    if (std::none_of(departing.begin(), departing.end(),
                     [&](const CourseOutlier& other) { return GoTogether(one, other); })) {
      out.push_back(one);
    }
  }
  std::sort(out.begin(), out.end(),
            [](const CourseOutlier& a, const CourseOutlier& b) { return a.flash < b.flash; });
  return out;
}

std::vector<ReadingCourse> CoursesOf(const HealthEvidence& evidence, std::size_t cameras) {
  std::vector<std::vector<std::size_t>> lines;
  for (std::size_t i = 0; i < evidence.size(); ++i) {
    if (evidence.mark(i) < 0) continue;
    const auto m = static_cast<std::size_t>(evidence.mark(i));
    if (m >= lines.size()) lines.resize(m + 1);
    lines[m].push_back(i);
  }
  std::vector<ReadingCourse> out(lines.size());
  for (std::size_t m = 0; m < lines.size(); ++m) {
    const auto n = static_cast<Eigen::Index>(lines[m].size());
    out[m].u_px.resize(n, static_cast<Eigen::Index>(cameras));
    out[m].s_px.resize(n, static_cast<Eigen::Index>(cameras));
    for (Eigen::Index k = 0; k < n; ++k) {
      const std::size_t i = lines[m][static_cast<std::size_t>(k)];
      out[m].t.push_back(evidence.t(i));
      out[m].line.push_back(evidence.line(i));
      for (std::size_t c = 0; c < cameras; ++c) {
        const auto column = static_cast<Eigen::Index>(c);
        out[m].u_px(k, column) = evidence.At(i, c).u_px;
        out[m].s_px(k, column) = evidence.At(i, c).s_px;
      }
    }
  }
  return out;
}

std::vector<WrongReading> WrongIn(const std::vector<ReadingCourse>& readings,
                                  const std::vector<CourseScatter>& courses) {
  std::vector<WrongReading> out;
  for (std::size_t m = 0; m < readings.size(); ++m) {
    for (const CourseOutlier& one : OutliersOf(readings[m], courses[m])) {
      out.push_back(
          {readings[m].line[one.flash], static_cast<int>(m), static_cast<int>(one.camera)});
    }
  }
  std::sort(out.begin(), out.end(),
            [](const WrongReading& a, const WrongReading& b) { return a.line < b.line; });
  return out;
}

}  // namespace unfurl::measure
