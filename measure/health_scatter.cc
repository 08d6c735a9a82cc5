// How readings scatter over what is stated: by how those of one mark in one camera follow each
// other in time (reading_course.h), where its motion can be told from scatter; of other marks, by
// what no place explains. Of three flashes of a mark in a row the middle one's readings less the
// line through the others': a smooth way, the calibration's errors along it and what a camera does
// that moved all leave nothing, white noise leaves its own. What a place explains is taken out;
// what is left has covariance sum_c k_c^2 v_c n_c n_c^T, with v_c the stated variance and n_c
// camera c's part in what places cannot explain. The k_c^2 are found by maximum likelihood
// (variance components, by Fisher's scoring), with what is beyond chance of any left out.
#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "base/dense.h"
#include "base/statistics.h"
#include "measure/flash_triples.h"
#include "measure/health.h"
#include "measure/reading_course.h"
#include "measure/scatter_components.h"
#include "measure/wrong_readings.h"

namespace unfurl::measure {

namespace {

constexpr std::size_t kMostTriples = 3000;  // the factor's error is then below 2%
constexpr double kTogetherChance = 0.01;    // that sound readings are taken for a motion of marks
constexpr const char* kShakes = "it shakes between its flashes";

// The chance that a sum is so much larger than its mean, as the chi-square of its mean and
// variance.
double ChanceOfSum(double sum, double mean, double variance) {
  if (!(mean > 0.0) || !(variance > 0.0)) return 1.0;
  const double numbers = 2.0 * mean * mean / variance;
  return ChiSquareTail(sum / mean * numbers, numbers);
}

// The chance that readings which scatter as stated scatter so much, of all together, of any one
// camera or of any one mark.
double ChanceOfScatter(const Components& components, double common, Eigen::Index cameras) {
  const auto cells = static_cast<Eigen::Index>(components.cells()), marks = cells / cameras;
  const Eigen::VectorXd one = Eigen::VectorXd::Ones(cells);
  const Sums sums = components.Collect(common * one, one);
  double least = ChiSquareTail(sums.chi_square, sums.numbers);
  // The covariances' sum is the stated one: tr(S^-1 A_c) = sum over d of tr(S^-1 A_c S^-1 A_d).
  Eigen::VectorXd along = Eigen::VectorXd::Zero(cameras), mean = along, variance = along;
  for (Eigen::Index m = 0; m < marks; ++m) {
    const Eigen::MatrixXd& fisher = sums.fisher[static_cast<std::size_t>(m)];
    const Eigen::VectorXd mine = sums.along.segment(m * cameras, cameras);
    along += mine;
    mean += fisher.rowwise().sum();
    variance += 2.0 * fisher.diagonal();
    least = std::min(least, ChanceOfSum(mine.sum(), fisher.sum(), 2.0 * fisher.sum()));
  }
  for (Eigen::Index c = 0; c < cameras; ++c) {
    least = std::min(least, ChanceOfSum(along(c), mean(c), variance(c)));
  }
  return ChanceOfAny(std::min(least, 1.0), static_cast<double>(cameras + marks + 1));
}

// Of a square with its standard deviation.
Scatter RootOf(double square, double sigma) {
  const double factor = std::sqrt(square);
  return {factor, 0.5 * sigma / factor};
}

// What marks tell by their courses, and by what no place explains where those do not tell.
struct ScatterData {
  std::vector<CellSquare> cells;
  std::vector<Triple> triples;
  double redundant = 0.0, in_time = 0.0;  // numbers
};

// A mark of which what no place explains is clearly less than its course says shakes between its
// flashes, which moves all cameras. Else it shakes by less than that would show.
void CheckByPlaces(const std::vector<Triple>& triples, CourseScatter* course) {
  const std::vector<CellSquare> none(course->square.size());
  Eigen::VectorXd square(static_cast<Eigen::Index>(none.size()));
  double numbers = 0.0;
  for (std::size_t c = 0; c < none.size(); ++c) {
    square(static_cast<Eigen::Index>(c)) = course->numbers[c] > 0.0 ? course->square[c] : 1.0;
    numbers += course->numbers[c];
  }
  const Sums sums = Components(triples, none, none.size()).Collect(square, square);
  if (sums.numbers < kFewestNumbers) return;
  constexpr double kSure = 3.0;  // sigmas
  const double hidden = kSure * std::sqrt(2.0 / sums.numbers + 2.0 / numbers);
  if (sums.chi_square / sums.numbers < 1.0 - hidden) course->unknown = kShakes;
  course->hidden = std::min(course->hidden, hidden);
}

// Marks on one structure shake together: what no course shows by itself all may show.
void CheckTogether(std::vector<CourseScatter>* courses) {
  for (;;) {
    double chi_square = 0.0, pairs = 0.0, most = 0.0;
    CourseScatter* worst = nullptr;
    for (CourseScatter& course : *courses) {
      if (!course.unknown.empty() || !(course.pairs > 0.0)) continue;
      chi_square += course.together;
      pairs += course.pairs;
      if (course.together / course.pairs <= most) continue;
      most = course.together / course.pairs;
      worst = &course;
    }
    if (worst == nullptr || ChiSquareTail(chi_square, pairs) > kTogetherChance) return;
    worst->unknown = kShakes;
  }
}

// Whether what courses show of readings that scatter more than stated cannot be a motion between
// flashes that nothing would show: of all, of some mark or of some camera.
bool NoHiddenMotion(const std::vector<CourseScatter>& courses, std::size_t cameras) {
  double all = 0.0, numbers = 0.0, shown = 0.0;
  std::vector<double> sum(cameras, 0.0), of(cameras, 0.0);
  for (const CourseScatter& course : courses) {
    if (!course.unknown.empty()) continue;
    double mine = 0.0, n = 0.0;
    for (std::size_t c = 0; c < cameras; ++c) {
      if (!(course.numbers[c] > 0.0)) continue;
      mine += course.numbers[c] * course.square[c];
      n += course.numbers[c];
      sum[c] += course.numbers[c] * course.square[c];
      of[c] += course.numbers[c];
    }
    if (mine / n * (1.0 - course.hidden) > 1.0) return true;
    all += mine;
    numbers += n;
    shown += 1.0 / (course.hidden * course.hidden);
  }
  if (!(numbers > 0.0)) return true;
  const double hidden = 1.0 / std::sqrt(shown);
  if (all / numbers * (1.0 - hidden) > 1.0) return true;
  for (std::size_t c = 0; c < cameras; ++c) {
    const double here = hidden * std::sqrt(static_cast<double>(cameras));
    if (of[c] > 0.0 && sum[c] / of[c] * (1.0 - here) > 1.0) return true;
  }
  return false;
}

std::vector<CourseScatter> ScatterOfCourses(const std::vector<ReadingCourse>& courses,
                                            const std::vector<Triple>& triples) {
  std::vector<CourseScatter> out;
  for (const ReadingCourse& course : courses) {
    std::vector<Triple> mine;
    for (const Triple& triple : triples) {
      if (triple.mark != out.size()) continue;
      mine.push_back(triple);
      mine.back().mark = 0;
    }
    out.push_back(ScatterOfCourse(course));
    if (out.back().unknown.empty()) CheckByPlaces(mine, &out.back());
  }
  CheckTogether(&out);
  return out;
}

ScatterData Gather(const std::vector<CourseScatter>& courses, const std::vector<Triple>& triples,
                   std::size_t cameras) {
  ScatterData out;
  out.cells.resize(courses.size() * cameras);
  for (std::size_t m = 0; m < courses.size(); ++m) {
    if (!courses[m].unknown.empty()) continue;
    for (std::size_t c = 0; c < cameras; ++c) {
      out.cells[m * cameras + c] = {courses[m].square[c], courses[m].numbers[c]};
      out.in_time += courses[m].numbers[c];
    }
  }
  for (const Triple& triple : triples) {
    if (courses[triple.mark].unknown.empty()) continue;
    out.redundant += static_cast<double>(triple.y.size());
    out.triples.push_back(triple);
  }
  return out;
}

// Marks whose readings tell nothing, neither in time nor by what places leave over.
void TellUntold(const std::vector<CourseScatter>& courses, const std::vector<Triple>& triples,
                ScatterReport* report) {
  for (std::size_t m = 0; m < courses.size(); ++m) {
    if (courses[m].unknown.empty()) continue;
    const auto left =
        std::count_if(triples.begin(), triples.end(), [&](const Triple& t) { return t.mark == m; });
    if (left > 0 || courses[m].numbers.empty()) continue;
    report->untold.emplace_back(static_cast<int>(m), courses[m].unknown);
  }
}

std::string WhyUnknown(const ScatterReport& report, std::size_t cameras) {
  std::string why = cameras < 4 ? "three cameras leave no reading over"
                                : "too few marks are seen by four cameras at once in three of "
                                  "their flashes in a row";
  if (report.untold.empty()) return why;
  return why + ", and of a mark by itself " + report.untold.front().second;
}

// Whose readings scatter by how much; nothing where it is within chance, or does no harm.
void Tell(const Components& components, Eigen::Index cameras, const HealthOptions& options,
          ScatterReport* out) {
  const double common = components.Common();
  out->all = RootOf(common, common * std::sqrt(2.0 / components.numbers()));
  if (!(ChanceOfScatter(components, common, cameras) < options.scatter_alarm)) return;
  const Components::Found each = components.Each(common, 1.0);
  const double harm = 1.0 + options.scatter_harmless;
  out->wide = common > harm || each.square.maxCoeff() > harm;
  if (!out->wide) return;
  out->owner = each.owner;
  const auto cells = static_cast<Eigen::Index>(components.cells());
  for (Eigen::Index k = 0; k < each.square.size(); ++k) {
    std::vector<Scatter>& to = k < cells             ? out->cells
                               : k < cells + cameras ? out->cameras
                                                     : out->marks;
    to.push_back(RootOf(each.square(k), each.sigma(k)));
  }
}

}  // namespace

ScatterReport FindScatter(const HealthEvidence& evidence, const Triangulator& triangulator,
                          const HealthOptions& options) {
  const std::size_t cameras = triangulator.cameras();
  const auto C = static_cast<Eigen::Index>(cameras);
  std::vector<Triple> triples;
  if (cameras >= 4) {
    for (FlashTriple& one : TriplesOf(evidence, triangulator, kMostTriples)) {
      triples.push_back(std::move(one.differs));
    }
  }
  const std::vector<ReadingCourse> readings = CoursesOf(evidence, cameras);
  std::vector<CourseScatter> courses = ScatterOfCourses(readings, triples);
  for (;;) {
    ScatterReport out;
    out.wrong = WrongIn(readings, courses);
    TellUntold(courses, triples, &out);
    const ScatterData data = Gather(courses, triples, cameras);
    if (data.redundant + data.in_time < kFewestNumbers) {
      out.unknown = WhyUnknown(out, cameras);
      return out;
    }
    Tell(Components(data.triples, data.cells, cameras), C, options, &out);
    if (!out.wide || NoHiddenMotion(courses, cameras)) return out;
    for (CourseScatter& course : courses) {
      if (course.unknown.empty()) course.unknown = "its readings may scatter more, or it shakes";
    }
  }
}

}  // namespace unfurl::measure
