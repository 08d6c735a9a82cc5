// Dimming LEDs, cameras whose light or focus changes: what explains most of a record's light, one
// after another, each judged against the scatter and persistence of what is left.
#include "measure/health_light.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/statistics.h"

namespace unfurl::measure {

namespace {

constexpr int kMostSlices = 64;   // of a record's time: its beginning is refined by flashes
constexpr int kFlashes = 4;       // of a mark in a slice at least: their median is no reflection
constexpr int kFewestSlices = 8;  // fewer show no course in time
constexpr double kSure = 9.0;     // of -2 ln of the likelihood: three sigmas

// A change that begins with slice `begin` and has its size `over` slices later.
struct Course {
  int begin = 1, over = 0;
  Eigen::VectorXd Shape(int slices) const {
    Eigen::VectorXd out = Eigen::VectorXd::Zero(slices);
    for (int k = begin; k < slices; ++k) {
      out(k) = over == 0 ? 1.0 : std::min(1.0, (k - begin + 0.5) / over);
    }
    return out;
  }
};

// All courses: at once, or over 2, 3, 4, 6, 8, .. slices.
std::vector<Course> CoursesOf(int slices) {
  std::vector<Course> out;
  for (int begin = 1; begin + 1 < slices; ++begin) out.push_back({begin, 0});
  for (int over = 2; over < 2 * slices; over *= 2) {  // and half as long again
    for (const int one : {over, over + over / 2}) {
      for (int begin = 0; begin + 1 < slices; ++begin) out.push_back({begin, one});
    }
  }
  return out;
}

struct LightExplanation {
  LightSubject subject;
  Course course;
  double size = 0.0;      // of the logarithm [-]
  double variance = 0.0;  // white [-]
  double gain = 0.0;      // what the loss is less by [-]
};

// The light of all cameras.
class Light {
 public:
  Light(const std::vector<std::vector<LightLook>>& looks, int marks, int slices)
      : marks_(marks), slices_(slices) {
    for (const std::vector<LightLook>& of_camera : looks) {
      sides_.emplace_back(of_camera, marks, slices);
    }
    for (const Course& course : CoursesOf(slices)) {
      courses_.push_back(course);
      shapes_.push_back(course.Shape(slices));
    }
    ListSubjects();
  }

  std::size_t looks() const { return subjects_.size() * courses_.size(); }
  std::size_t subjects() const { return subjects_.size(); }

  // The best course of each subject, the best of all first.
  std::vector<LightExplanation> Explain() const {
    std::vector<LightExplanation> out;
    for (const LightSubject& subject : subjects_) {
      LightExplanation best{.subject = subject};
      for (std::size_t k = 0; k < courses_.size(); ++k) {
        const LightExplanation one = Of(subject, k);
        if (one.gain > best.gain) best = one;
      }
      if (best.gain > 0.0) out.push_back(best);
    }
    std::stable_sort(
        out.begin(), out.end(),
        [](const LightExplanation& a, const LightExplanation& b) { return a.gain > b.gain; });
    return out;
  }

  // A subject's change at the record's end and when it began, over all courses that explain it
  // nearly as well as the best, by their likelihoods.
  struct Average {
    double size = 0.0, variance = 0.0;  // of the logarithm [-]
    int first = 0, last = 0;            // slices
  };
  Average Over(const LightExplanation& best, double wide) const {
    Average out{.first = best.course.begin, .last = best.course.begin};
    double weight = 0.0, sum = 0.0, squares = 0.0;
    for (std::size_t k = 0; k < courses_.size(); ++k) {
      const LightExplanation one = Of(best.subject, k);
      const double worse = (best.gain - one.gain) / wide;
      if (worse > kSure) continue;
      const double w = std::exp(-0.5 * worse), last = shapes_[k](slices_ - 1);
      weight += w;
      sum += w * one.size * last;
      squares += w * last * last * (one.size * one.size + wide * one.variance);
      out.first = std::min(out.first, one.course.begin);
      out.last = std::max(out.last, one.course.begin);
    }
    out.size = sum / weight;
    out.variance = squares / weight - out.size * out.size;
    return out;
  }

  // How much more than white errors what is left scatters, by the subject's cameras [-].
  double Wide(const LightExplanation& best) const {
    double wide = 1.0;
    for (std::size_t c = 0; c < sides_.size(); ++c) {
      if (!Holds(best.subject, c) || !sides_[c].tells()) continue;
      wide = std::max(wide, sides_[c].Persistence(best.subject.mark, Shape(best), best.size));
    }
    return wide;
  }
  double Degrees(const LightSubject& subject) const {
    double sum = 0.0;
    for (std::size_t c = 0; c < sides_.size(); ++c) {
      if (Holds(subject, c) && sides_[c].tells()) {
        sum += static_cast<double>(sides_[c].redundant());
      }
    }
    return sum;
  }
  void Take(const LightExplanation& best) {
    for (std::size_t c = 0; c < sides_.size(); ++c) {
      if (!Holds(best.subject, c) || !sides_[c].tells()) continue;
      sides_[c].Take(best.subject.mark, Shape(best), best.size);
    }
  }

 private:
  static bool Holds(const LightSubject& subject, std::size_t camera) {
    return subject.camera < 0 || subject.camera == static_cast<int>(camera);
  }
  Eigen::VectorXd Shape(const LightExplanation& one) const { return one.course.Shape(slices_); }

  // With one mark its light in one camera is that camera's, and in all cameras the LED's.
  void ListSubjects() {
    const auto cameras = static_cast<int>(sides_.size());
    for (int c = 0; c < cameras; ++c) {
      subjects_.push_back({LightKind::kGain, c, -1});
    }
    for (int m = 0; m < marks_; ++m) subjects_.push_back({LightKind::kLed, -1, m});
    if (marks_ < 2) return;
    subjects_.push_back({LightKind::kAll, -1, -1});
    for (int c = 0; c < cameras; ++c) {
      for (int m = 0; m < marks_; ++m) subjects_.push_back({LightKind::kView, c, m});
    }
  }

  LightExplanation Of(const LightSubject& subject, std::size_t course) const {
    double square = 0.0, product = 0.0;
    for (std::size_t c = 0; c < sides_.size(); ++c) {
      if (!Holds(subject, c) || !sides_[c].tells()) continue;
      const LightSide::Terms terms = sides_[c].TermsOf(subject.mark, shapes_[course]);
      square += terms.square;
      product += terms.product;
    }
    if (!(square > 0.0)) return {.subject = subject};
    return {subject, courses_[course], product / square, 1.0 / square, product * product / square};
  }

  int marks_, slices_;
  std::vector<LightSide> sides_;  // by camera
  std::vector<Course> courses_;
  std::vector<Eigen::VectorXd> shapes_;  // by course
  std::vector<LightSubject> subjects_;
};

void SetTime(const std::vector<std::vector<LightLook>>& looks, int marks,
             const LightExplanation& best, const Light::Average& average, const LightClock& clock,
             LightFault* fault) {
  // What takes few slices may have come at once in the middle of one.
  constexpr int kBrief = 4;  // slices
  const LightMoment moment{.subject = best.subject,
                           .marks = marks,
                           .first = best.course.begin - 1,
                           .last = best.course.begin + best.course.over,
                           .size = best.size};
  if (best.course.over <= kBrief && FindMoment(looks, moment, &fault->earliest, &fault->latest)) {
    fault->until = fault->latest;
    return;
  }
  const bool at_once = best.course.over == 0;
  fault->earliest = clock.Edge(at_once ? average.first - 1 : average.first);
  fault->latest = clock.Edge(at_once ? average.last + 1 : average.last);
  fault->until = at_once
                     ? fault->latest
                     : std::max(fault->latest, clock.Edge(best.course.begin + best.course.over));
}

void FindIn(const std::vector<std::vector<LightLook>>& looks, int marks, const LightClock& clock,
            const HealthOptions& options, std::vector<LightFault>* faults) {
  Light light(looks, marks, clock.slices);
  const double tests = static_cast<double>(light.looks());
  for (std::size_t round = 0; round < light.subjects(); ++round) {
    const std::vector<LightExplanation> all = light.Explain();
    if (all.empty()) return;
    const LightExplanation& best = all.front();
    const double wide = light.Wide(best);
    // The scatter is an estimate of so many numbers, of which what persists counts once.
    const double degrees = std::max(1.0, light.Degrees(best.subject) / wide);
    const double limit = StudentQuantile(1.0 - 0.5 * options.false_alarm / tests, degrees);
    if (!(best.gain > limit * limit * wide)) return;
    const LightExplanation taken = best;
    const Light::Average average = light.Over(taken, wide);
    light.Take(taken);
    const LightKind kind = taken.subject.kind;
    if (kind == LightKind::kView) continue;
    LightFault fault{.subject = taken.subject};
    fault.size = std::expm1(average.size);
    fault.sigma = (1.0 + fault.size) * std::sqrt(average.variance);
    SetTime(looks, marks, taken, average, clock, &fault);
    if (std::abs(fault.size) < options.least_light) continue;
    const double enough = 2.0 * std::log(static_cast<double>(light.subjects()) / options.doubt);
    for (std::size_t k = 1; k < all.size(); ++k) {
      if ((taken.gain - all[k].gain) / wide < enough) fault.rivals.push_back(all[k].subject);
    }
    faults->push_back(std::move(fault));
  }
}

}  // namespace

std::vector<LightFault> FindLightFaults(const HealthEvidence& evidence,
                                        const Triangulator& triangulator,
                                        const HealthOptions& options) {
  std::vector<LightFault> faults;
  int marks = 0;
  std::size_t lit = 0;
  for (std::size_t i = 0; i < evidence.size(); ++i) {
    marks = std::max(marks, evidence.mark(i) + 1);
    lit += evidence.mark(i) >= 0;
  }
  if (marks == 0) return faults;
  const auto flashes = static_cast<int>(lit / static_cast<std::size_t>(marks));
  LightClock clock;
  clock.slices = std::min(kMostSlices, flashes / kFlashes);
  if (clock.slices < kFewestSlices) return faults;
  clock.from = evidence.t(0);
  clock.span = std::max(evidence.t(evidence.size() - 1) - clock.from, 1e-9);
  const auto looks = LooksOf(evidence, triangulator, clock.slices);
  FindIn(looks, marks, clock, options, &faults);
  FindFocusFaults(looks, marks, clock, options, &faults);
  return faults;
}

}  // namespace unfurl::measure
