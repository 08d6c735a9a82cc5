#include "correlate/compare/comparison.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>

#include "base/error.h"
#include "base/fixed_number.h"
#include "base/length.h"
#include "base/text.h"
#include "correlate/align/body_angle.h"
#include "correlate/compare/clock_words.h"
#include "correlate/compare/comparison_measures.h"
#include "data/formats.h"

namespace unfurl::correlate {

namespace {

struct Loaded {
  std::optional<data::Run> run;
  std::optional<data::Tracks> tracks;

  ComparedRecord AsRecord(const std::string& path) const {
    return run ? ComparedRecord(*run, path) : ComparedRecord(*tracks, path);
  }
};

Loaded Load(const std::string& path) {
  Loaded out;
  const std::string schema = data::KindOf(path);
  if (schema == data::kRunSchema) {
    out.run = data::ReadRun(path);
  } else if (schema == data::kTracksSchema) {
    out.tracks = data::ReadTracksAny(path);
  } else {
    throw Error("a file of schema " + schema + " cannot be correlated", path,
                "give runs (of `simulate`) or tracks (of `reconstruct`)");
  }
  return out;
}

void ChooseMarks(const ComparedRecord& a, const ComparedRecord& b,
                 const std::vector<std::string>& wanted, Comparison* c) {
  auto has = [](const std::vector<std::string>& list, const std::string& name) {
    return std::find(list.begin(), list.end(), name) != list.end();
  };
  for (const std::string& name : wanted) {
    for (const ComparedRecord* one : {&a, &b}) {
      if (!has(one->marks(), name)) {
        throw Error("there is no mark '" + name + "'", one->name,
                    "it has " + JoinWords(one->marks()));
      }
    }
  }
  for (const std::string& name : a.marks()) {
    if (!wanted.empty() && !has(wanted, name)) continue;
    (has(b.marks(), name) ? c->marks : c->left_out).push_back(name);
  }
  if (wanted.empty()) {
    for (const std::string& name : b.marks()) {
      if (!has(a.marks(), name)) c->left_out.push_back(name);
    }
  }
  if (c->marks.empty()) {
    throw Error("no mark has the same name in both", c->record + " and " + c->reference,
                "the first has " + JoinWords(a.marks()) + ", the second " + JoinWords(b.marks()));
  }
}

std::size_t IndexOf(const std::vector<std::string>& marks, const std::string& name) {
  return static_cast<std::size_t>(std::find(marks.begin(), marks.end(), name) - marks.begin());
}

// Coordinates of each mark in the reference's frame, and angles of pairs that sit on one body.
void FillSignals(const SampledModel& reference, Comparison* c) {
  const Registration& at = c->alignment.at;
  Stamps common;  // the marks flash one after another: pairs need them at once
  common.marks = c->marks;
  common.t.assign(c->marks.size(), c->observations.StampsAt(at.offset).t.front());
  for (const auto& [first, second] : RigidPairs(reference.Evaluate({}, common), c->marks)) {
    BodyAngle angle = MeasureBodyAngle(c->observations, reference, {}, at, first, second);
    if (angle.t.size() < 8) continue;
    SignalId id;
    id.kind = SignalId::Kind::kAngle;
    id.mark = IndexOf(c->marks, first);
    id.second = IndexOf(c->marks, second);
    c->signals.push_back({id, fmt::format("angle of {}-{}", first, second), std::move(angle.t),
                          std::move(angle.measured), std::move(angle.sigma),
                          std::move(angle.simulated)});
  }
  const auto measured = InModelFrame(c->observations, at);
  const auto sigma = SigmasInModelFrame(c->observations, at);
  for (std::size_t m = 0; m < c->marks.size(); ++m) {
    const MarkMotion& motion = c->alignment.reference.marks[m];
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      ComparedSignal s;
      s.id.mark = m;
      s.id.axis = static_cast<int>(axis);
      s.name = c->marks[m] + " " + std::string(1, "xyz"[axis]);
      for (Eigen::Index i = 0; i < motion.p.cols(); ++i) {
        const auto k = static_cast<std::size_t>(i);
        if (!motion.known.empty() && !motion.known[k]) continue;
        s.t.push_back(c->observations.marks[m].t[k]);
        s.measured.push_back(measured[m](axis, i));
        s.sigma.push_back(c->observations.has_sigma ? sigma[m](axis, i) : 0.0);
        s.reference.push_back(motion.p(axis, i));
      }
      c->signals.push_back(std::move(s));
    }
  }
}

// The largest range of any coordinate of any mark [m].
double LargestMotion(const Comparison& c) {
  double range = 0.0;
  for (const ComparedSignal& s : c.signals) {
    if (!s.id.IsCoordinate() || s.measured.empty()) continue;
    const auto [low, high] = std::minmax_element(s.measured.begin(), s.measured.end());
    range = std::max(range, *high - *low);
  }
  return range;
}

std::string VerdictOf(const Comparison& c) {
  const MarkError& all = c.errors.back();
  const double part = all.rmse / std::max(LargestMotion(c), std::numeric_limits<double>::min());
  std::string words = fmt::format("The two agree to {} RMS, {:.2g}% of the motion",
                                  LengthText(all.rmse), 100.0 * part);
  if (all.sigmas <= 0.0) return words + ".";
  // Above the scatter of a mean square of a few hundred samples, and of covariances that are known
  // to a tenth.
  constexpr double kNoMore = 1.2;
  if (all.sigmas < kNoMore) return words + ": no more than the measurement's own error.";
  return words + fmt::format(": {:.{}f} times the measurement's own error.", all.sigmas,
                             all.sigmas < 10.0 ? 1 : 0);
}

void AddErrorReasons(Comparison* c) {
  const MarkError& all = c->errors.back();
  const MarkError* worst = &c->errors.front();
  for (std::size_t m = 0; m < c->marks.size(); ++m) {  // not the row of all marks
    if (c->errors[m].rmse > worst->rmse) worst = &c->errors[m];
  }
  c->reasons.push_back(fmt::format("Farthest apart is {}: {} RMS, {} at most, at {} s.",
                                   worst->mark, LengthText(worst->rmse), LengthText(worst->largest),
                                   FixedNumber(worst->largest_at, 3)));
  c->reasons.push_back(
      fmt::format("Out of the plane the marks stray by {} RMS (mean {}); the reference is {}.",
                  LengthText(all.rmse_across), MeanText(all.bias_across, all.rmse_across),
                  c->reference_is_run ? "planar" : "measured"));
}

void AddClockReasons(Comparison* c) {
  const Alignment& a = c->alignment;
  if (!a.far.empty()) {
    c->reasons.push_back(
        fmt::format("Frame and clock were found without {}; all errors and signals are with them.",
                    Words(c->observations, a.far)));
  }
  for (std::string& words : ClockWords(*c, a.signal, ", then together with the frame")) {
    c->reasons.push_back(std::move(words));
  }
  for (std::string& words : ContradictionsOf(c->observations, a)) {
    c->reasons.push_back(std::move(words));
  }
  const FramePrior& known = c->observations.placement.frame;
  if (!known.Told()) return;
  c->reasons.push_back(known.kind == Foreknowledge::kKnown
                           ? std::string("Its frame was known, and not sought.")
                           : fmt::format("Its frame was known to {:.3g} mm and {:.3g} mrad.",
                                         1e3 * known.sigma_shift, 1e3 * known.sigma_rotation));
}

// What limits the comparison.
void AddReservations(Comparison* c) {
  const Alignment& a = c->alignment;
  if (!a.noise.white() && c->observations.has_sigma) {
    c->reasons.push_back(
        "The residuals are correlated in time, so the two differ by more than chance; the "
        "standard errors above are widened for it.");
  }
  if (!a.fit.weak.empty()) {
    c->reasons.push_back("These marks do not determine: " + JoinWords(a.fit.weak) + ".");
  }
  if (!c->left_out.empty()) {
    c->reasons.push_back("Only one of the two has " + JoinWords(c->left_out) + ": left out.");
  }
}

void JudgeMarks(Comparison* c) {
  c->verdict = VerdictOf(*c);
  AddErrorReasons(c);
  for (const Explanation& one : c->explanations) c->reasons.push_back(one.words);
  AddClockReasons(c);
  if (!c->scores.empty() && c->scores.back().rated) {
    const ComparedScore& s = c->scores.back();
    c->reasons.push_back(fmt::format(
        "As histories they are {} by ISO/TS 18571 ({:.3f} of 1, mean of the marks); R squared is "
        "{:.5f}.",
        Name(s.rating.grade), s.rating.overall, s.score.r2));
  }
  AddModeReasons(c);
  AddPeakReasons(c);
  AddReservations(c);
}

}  // namespace

const ComparedSignal* FindCoordinate(const Comparison& c, std::size_t mark, int axis) {
  for (const ComparedSignal& s : c.signals) {
    if (s.id.IsCoordinate() && s.id.mark == mark && s.id.axis == axis) return &s;
  }
  return nullptr;
}

const std::vector<std::string>& ComparedRecord::marks() const {
  return run != nullptr ? run->marks : tracks->marks;
}

Comparison Compare(const std::string& record, const std::string& reference,
                   const ComparisonOptions& options) {
  const Loaded a = Load(record), b = Load(reference);
  return Compare(a.AsRecord(record), b.AsRecord(reference), options);
}

Comparison Compare(const ComparedRecord& a, const ComparedRecord& b,
                   const ComparisonOptions& options) {
  Comparison c;
  c.record = a.name;
  c.reference = b.name;
  ChooseMarks(a, b, options.marks, &c);
  c.record_is_run = a.run != nullptr;
  c.reference_is_run = b.run != nullptr;
  c.record_is_test = !c.record_is_run && c.reference_is_run;
  c.observations = a.run ? FromRun(*a.run, c.marks) : FromTracks(*a.tracks, c.marks);
  const SampledModel model =
      b.run ? SampledModel(*b.run, c.marks) : SampledModel(FromTracks(*b.tracks, c.marks));
  if (b.run) {
    for (const data::RunEvent& e : b.run->events) {
      if (e.kind == "latch") c.latches.push_back({e.t, e.kind, e.where});
    }
  }
  CompareWith(model, options, &c);
  return c;
}

void CompareWith(const SampledModel& reference, const ComparisonOptions& options, Comparison* c) {
  AlignOptions how;
  how.registration.fit_drift = options.clock_drift;
  Placement& known = c->observations.placement;
  const Placement& said = options.placement;
  if (said.offset.kind != Foreknowledge::kUnsaid) known.offset = said.offset;
  if (said.drift.kind != Foreknowledge::kUnsaid) known.drift = said.drift;
  if (said.frame.kind != Foreknowledge::kUnsaid) known.frame = said.frame;
  c->alignment = Align(c->observations, reference, how);
  ExplanationOptions ask;
  ask.align = how;
  ask.clock = !how.registration.fit_drift && !c->record_is_run &&
              known.drift.kind == Foreknowledge::kUnsaid;
  ask.lengths = !(c->record_is_run && c->reference_is_run);
  c->explanations = ExplainDifference(c->observations, reference, c->alignment, ask);
  if (!c->alignment.Usable()) {
    c->verdict = std::string("Not correlated: ") + Name(c->alignment.status) + ".";
    c->reasons.push_back(c->alignment.message + ".");
    for (const Explanation& one : c->explanations) c->reasons.push_back(one.words);
    return;
  }
  c->observations =
      WithoutDrift(std::move(c->observations), c->alignment.drift, c->alignment.drift_pivot);
  c->errors =
      Errors(c->observations, c->alignment.reference, c->alignment.at.offset, c->alignment.fit);
  FillSignals(reference, c);
  FillScores(c);
  FillSpectra(options, c);
  FillModes(options, c);
  JudgeMarks(c);
}

}  // namespace unfurl::correlate
