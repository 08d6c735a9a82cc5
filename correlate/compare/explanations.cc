#include "correlate/compare/explanations.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "base/length.h"
#include "base/number.h"
#include "correlate/compare/metrics.h"

namespace unfurl::correlate {
namespace {

constexpr std::size_t kMostSamples = 20000;  // of all marks: a second or two of computing
constexpr std::size_t kMostMarks = 6;        // of which every pair is tried
constexpr std::size_t kPairs = 3;            // tried, of marks that lie best when exchanged
// Of what the squared distance has beyond the measurement's own error, the most that is left.
constexpr double kLeft = 0.25;
constexpr double kSome = 0.9;  // likewise, of a first look
// RMS in the marks' sigmas up to which they agree within their error, as in the verdict; without
// sigmas, part of the distance before.
constexpr double kAgree = 1.2, kTenth = 0.1;
// What another may leave over what the best leaves, and the scatter of a mean square in sigmas.
constexpr double kAsMuch = 2.0, kScatter = 0.02;
constexpr int kLengthRounds = 3;  // frame and factor by turns

// Every so many samples of each mark, so that there are not too many.
Observations Thinned(const Observations& all) {
  const std::size_t every = (all.size() + kMostSamples - 1) / kMostSamples;
  if (every <= 1) return all;
  Observations out = all;
  for (MarkSeries& mark : out.marks) {
    const std::size_t n = (mark.size() + every - 1) / every;
    const Eigen::Index k = mark.shared.cols() / static_cast<Eigen::Index>(mark.size());
    for (std::size_t i = 0; i < n; ++i) {
      const auto to = static_cast<Eigen::Index>(i), from = static_cast<Eigen::Index>(i * every);
      mark.t[i] = mark.t[i * every];
      mark.p.col(to) = mark.p.col(from).eval();
      mark.cov.col(to) = mark.cov.col(from).eval();
      if (k > 0) mark.shared.middleCols(to * k, k) = mark.shared.middleCols(from * k, k).eval();
    }
    mark.t.resize(n);
    const auto size = static_cast<Eigen::Index>(n);
    mark.p.conservativeResize(Eigen::NoChange, size);
    mark.cov.conservativeResize(Eigen::NoChange, size);
    mark.shared.conservativeResize(Eigen::NoChange, size * k);
  }
  return out;
}

// How far two records are apart with the best frame and offset.
struct Apart {
  Alignment alignment;
  std::vector<MarkError> errors;  // by mark, then of all
  double rms = 0.0;               // [m]
  double excess = 0.0;            // squared, beyond the measurement's own error [-] or [m^2]
  double sigmas = 0.0;            // 0: none known [-]
};

std::optional<Apart> Measured(const Observations& record, Alignment alignment) {
  Apart out;
  out.alignment = std::move(alignment);
  if (!out.alignment.Usable()) return std::nullopt;
  const Observations driftless =
      WithoutDrift(record, out.alignment.drift, out.alignment.drift_pivot);
  out.errors =
      Errors(driftless, out.alignment.reference, out.alignment.at.offset, out.alignment.fit);
  const MarkError& all = out.errors.back();
  out.rms = all.rmse;
  out.sigmas = record.has_sigma ? all.sigmas : 0.0;
  out.excess =
      record.has_sigma ? std::max(0.0, all.sigmas * all.sigmas - 1.0) : all.rmse * all.rmse;
  return out;
}

std::optional<Apart> Try(const Observations& record, const SampledModel& reference,
                         const AlignOptions& how) {
  return Measured(record, Align(record, reference, how));
}

Observations Scaled(Observations record, double factor) {
  for (MarkSeries& mark : record.marks) {
    mark.p *= factor;
    mark.cov *= factor * factor;
    mark.shared *= factor;
  }
  return record;
}

// Of all lengths of the record over the reference's, with the frame as it is.
double RatioOfLengths(const Observations& record, const Alignment& alignment) {
  const auto measured = InModelFrame(record, alignment.at);
  Eigen::Vector3d mean_measured = Eigen::Vector3d::Zero(), mean_reference = mean_measured;
  double count = 0.0;
  const auto each = [&](const auto& use) {
    for (std::size_t m = 0; m < measured.size(); ++m) {
      const MarkMotion& motion = alignment.reference.marks[m];
      for (Eigen::Index i = 0; i < motion.p.cols(); ++i) {
        if (!motion.known.empty() && !motion.known[static_cast<std::size_t>(i)]) continue;
        use(measured[m].col(i), motion.p.col(i));
      }
    }
  };
  each([&](const auto& a, const auto& b) {
    mean_measured += a;
    mean_reference += b;
    count += 1.0;
  });
  if (!(count > 0.0)) return 1.0;
  mean_measured /= count;
  mean_reference /= count;
  double both = 0.0, square = 0.0;
  each([&](const auto& a, const auto& b) {
    both += (a - mean_measured).dot(b - mean_reference);
    square += (b - mean_reference).squaredNorm();
  });
  return square > 0.0 && both > 0.0 ? both / square : 1.0;
}

class Explaining {
 public:
  Explaining(const Observations& record, const SampledModel& reference,
             const ExplanationOptions& options)
      : record_(Thinned(record)),
        plain_(WithoutDraw(record_)),
        reference_(reference),
        options_(options),
        thinned_(record_.size() < record.size()) {}

  std::vector<Explanation> Run(const Alignment& alignment) {
    if (!alignment.Usable()) {
      if (record_.marks.size() <= kMostMarks) TryNames(AllPairs(), nullptr);
      return Sorted();
    }
    const std::optional<Apart> before = thinned_ || !alignment.far.empty()
                                            ? Try(record_, reference_, options_.align)
                                            : Measured(record_, alignment);
    // No more than the error: there is nothing to explain.
    if (!before || !(before->excess > 0.0) || (before->sigmas > 0.0 && before->sigmas < kAgree)) {
      return {};
    }
    if (record_.shared_rank > 0) {
      const std::optional<Apart> plain = Try(plain_, reference_, options_.align);
      if (plain) plain_excess_ = plain->excess;
    }
    if (options_.clock) TryClock(*before);
    if (options_.lengths) TryLengths(*before);
    TryNames(BestPairs(*before), &*before);
    if (record_.marks.size() >= 3) TryWithout(*before);
    return Sorted();
  }

 private:
  void Add(Explanation::Kind kind, double value, std::vector<std::string> marks, const Apart& left,
           std::string words) {
    found_.push_back({{kind, value, std::move(marks), left.rms, std::move(words)}, left.excess});
  }

  // The best, and those that explain as much.
  std::vector<Explanation> Sorted() {
    std::stable_sort(found_.begin(), found_.end(),
                     [](const Found& a, const Found& b) { return a.excess < b.excess; });
    std::vector<Explanation> out;
    for (Found& one : found_) {
      const double best = found_.front().excess + (record_.has_sigma ? kScatter : 0.0);
      if (one.excess <= kAsMuch * best) out.push_back(std::move(one.explanation));
    }
    return out;
  }

  // Whether a cause is worth its full price. Without the calibration's draw, dozens of unknowns, a
  // look costs a tenth; what would take three quarters away with it takes some away without it.
  bool Promises(const Observations& plain, const AlignOptions& how) const {
    if (record_.shared_rank == 0) return true;
    const std::optional<Apart> after = Try(plain, reference_, how);
    return after && after->excess <= kSome * plain_excess_;
  }

  static bool Explains(const std::optional<Apart>& after, const Apart& before) {
    return after && after->excess <= kLeft * before.excess;
  }

  void TryClock(const Apart& before) {
    AlignOptions how = options_.align;
    how.registration.fit_drift = true;
    if (!Promises(plain_, how)) return;
    const std::optional<Apart> after = Try(record_, reference_, how);
    if (!Explains(after, before)) return;
    const double drift = after->alignment.drift;
    Add(Explanation::Kind::kClock, drift, {}, *after,
        fmt::format(
            "A clock of the record that runs {} by {} parts in a million would leave {} "
            "RMS: say --clock-drift if it may; else the reference moves too {} by as much.",
            drift > 0.0 ? "fast" : "slow",
            NumberWithError(1e6 * std::fabs(drift), 1e6 * after->alignment.Sigma("clock drift")),
            LengthText(after->rms), drift > 0.0 ? "fast" : "slowly"));
  }

  void TryLengths(const Apart& before) {
    double ratio = RatioOfLengths(record_, before.alignment);
    if (!Promises(Scaled(plain_, 1.0 / ratio), options_.align)) return;
    std::optional<Apart> after;
    for (int k = 0; k < kLengthRounds; ++k) {
      const Observations scaled = Scaled(record_, 1.0 / ratio);
      after = Try(scaled, reference_, options_.align);
      if (!after) return;
      if (k + 1 < kLengthRounds) ratio *= RatioOfLengths(scaled, after->alignment);
    }
    if (!Explains(after, before)) return;
    Add(Explanation::Kind::kLengths, ratio, {}, *after,
        fmt::format("Lengths that are all {:.6g} times the reference's would leave {} RMS: look at "
                    "the scale of the rig (bar, survey) and at the lengths in the scene.",
                    ratio, LengthText(after->rms)));
  }

  using Pair = std::pair<std::size_t, std::size_t>;

  std::vector<Pair> AllPairs() const {
    std::vector<Pair> pairs;
    for (std::size_t i = 0; i < record_.marks.size(); ++i) {
      for (std::size_t j = i + 1; j < record_.marks.size(); ++j) pairs.emplace_back(i, j);
    }
    return pairs;
  }

  // Those that lie nearer to one another's place than to their own.
  std::vector<Pair> BestPairs(const Apart& before) const {
    const auto measured = InModelFrame(record_, before.alignment.at);
    const Stamps own = record_.StampsAt(before.alignment.at.clock());
    const std::size_t count = record_.marks.size();
    // Mean squared distance of mark i from where the reference has mark j [m^2].
    std::vector<double> distance(count * count, 0.0);
    for (std::size_t j = 0; j < count; ++j) {
      Stamps there;
      there.marks = {own.marks[j]};
      for (std::size_t i = 0; i < count; ++i) {
        there.t = {own.t[i]};
        const Prediction at = reference_.Evaluate({}, there);
        if (at.status != ModelStatus::kGood) return {};
        double sum = 0.0, n = 0.0;
        for (Eigen::Index k = 0; k < at.marks[0].p.cols(); ++k) {
          if (!at.marks[0].known.empty() && !at.marks[0].known[static_cast<std::size_t>(k)])
            continue;
          sum += (measured[i].col(k) - at.marks[0].p.col(k)).squaredNorm();
          n += 1.0;
        }
        distance[i * count + j] = n > 0.0 ? sum / n : HUGE_VAL;
      }
    }
    std::vector<std::pair<double, Pair>> gains;
    for (const Pair& p : AllPairs()) {
      const double as_named =
          distance[p.first * count + p.first] + distance[p.second * count + p.second];
      const double exchanged =
          distance[p.first * count + p.second] + distance[p.second * count + p.first];
      if (exchanged < as_named) gains.emplace_back(exchanged - as_named, p);
    }
    std::sort(gains.begin(), gains.end());
    std::vector<Pair> pairs;
    for (std::size_t k = 0; k < std::min(kPairs, gains.size()); ++k) {
      pairs.push_back(gains[k].second);
    }
    return pairs;
  }

  // `before` null: the records could not be aligned at all.
  void TryNames(const std::vector<Pair>& pairs, const Apart* before) {
    for (const auto& [i, j] : pairs) {
      Observations other = record_;
      std::swap(other.marks[i].name, other.marks[j].name);
      if (before != nullptr && !Promises(WithoutDraw(other), options_.align)) continue;
      const std::optional<Apart> after = Try(other, reference_, options_.align);
      if (!after || (before != nullptr && !Explains(after, *before))) continue;
      const std::string &a = record_.marks[i].name, &b = record_.marks[j].name;
      Add(Explanation::Kind::kNames, 0.0, {a, b}, *after,
          fmt::format("With the names of {} and {} exchanged {} RMS would be left.", a, b,
                      LengthText(after->rms)));
    }
  }

  // The mark farthest off, by its own distance.
  void TryWithout(const Apart& before) {
    std::size_t worst = 0;
    for (std::size_t m = 1; m < record_.marks.size(); ++m) {
      if (before.errors[m].rmse > before.errors[worst].rmse) worst = m;
    }
    Observations rest = record_;
    rest.marks.erase(rest.marks.begin() + static_cast<std::ptrdiff_t>(worst));
    if (!Promises(WithoutDraw(rest), options_.align)) return;
    const std::optional<Apart> after = Try(rest, reference_, options_.align);
    if (!after) return;
    if (!(record_.has_sigma ? after->sigmas < kAgree : after->rms < kTenth * before.rms)) return;
    const std::string& name = record_.marks[worst].name;
    Add(Explanation::Kind::kMark, 0.0, {name}, *after,
        fmt::format("Without {} the others agree to {} RMS{}: it may sit elsewhere than the "
                    "reference has it, or be another mark.",
                    name, LengthText(after->rms),
                    record_.has_sigma ? ", no more than their own error" : ""));
  }

  const Observations record_, plain_;  // without the draw
  double plain_excess_ = HUGE_VAL;
  const SampledModel& reference_;
  const ExplanationOptions& options_;
  const bool thinned_;
  struct Found {
    Explanation explanation;
    double excess = 0.0;  // that it leaves
  };
  std::vector<Found> found_;
};

}  // namespace

const char* Name(Explanation::Kind kind) {
  switch (kind) {
    case Explanation::Kind::kClock:
      return "clock";
    case Explanation::Kind::kLengths:
      return "lengths";
    case Explanation::Kind::kNames:
      return "names";
    case Explanation::Kind::kMark:
      return "mark";
  }
  return "";
}

std::vector<Explanation> ExplainDifference(const Observations& record,
                                           const SampledModel& reference,
                                           const Alignment& alignment,
                                           const ExplanationOptions& options) {
  if (record.marks.size() < 2) return {};
  return Explaining(record, reference, options).Run(alignment);
}

}  // namespace unfurl::correlate
