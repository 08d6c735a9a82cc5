#include "correlate/compare/comparison.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>

#include "base/error.h"
#include "base/number.h"
#include "base/text.h"
#include "correlate/align/body_angle.h"
#include "correlate/compare/comparison_measures.h"
#include "data/h5.h"

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
  if (path.size() > 4 && path.substr(path.size() - 4) == ".csv") {
    out.tracks = data::ReadTracksCsv(path);
    return out;
  }
  const std::string schema = data::H5Reader::SchemaOf(path);
  if (schema == data::kRunSchema) {
    out.run = data::ReadRun(path);
  } else if (schema == data::kTracksSchema) {
    out.tracks = data::ReadTracks(path);
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

// Coordinates of each mark in the reference's frame, and angles of pairs that sit on one body.
void FillSignals(const SampledModel& reference, Comparison* c) {
  const Registration& at = c->alignment.at;
  Stamps common;  // the marks flash one after another: pairs need them at once
  common.marks = c->marks;
  common.t.assign(c->marks.size(), c->observations.StampsAt(at.offset).t.front());
  for (const auto& [first, second] : RigidPairs(reference.Evaluate({}, common), c->marks)) {
    BodyAngle angle = MeasureBodyAngle(c->observations, reference, {}, at, first, second);
    if (angle.t.size() < 8) continue;
    c->signals.push_back({"angle of " + first + "-" + second, "rad", std::move(angle.t),
                          std::move(angle.measured), std::move(angle.sigma),
                          std::move(angle.simulated)});
  }
  const auto measured = InModelFrame(c->observations, at);
  const auto sigma = SigmasInModelFrame(c->observations, at);
  for (std::size_t m = 0; m < c->marks.size(); ++m) {
    const MarkMotion& motion = c->alignment.reference.marks[m];
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      ComparedSignal s;
      s.name = c->marks[m] + " " + std::string(1, "xyz"[axis]);
      s.unit = "m";
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

void Judge(Comparison* c) {
  const Alignment& a = c->alignment;
  const MarkError& all = c->errors.back();
  double range = 0.0;  // of the largest motion of any mark
  for (const ComparedSignal& s : c->signals) {
    if (s.unit != "m" || s.measured.empty()) continue;
    const auto [low, high] = std::minmax_element(s.measured.begin(), s.measured.end());
    range = std::max(range, *high - *low);
  }
  const double part = all.rmse / std::max(range, 1e-12);
  const bool within = all.sigmas > 0.0 && all.sigmas < 1.2;
  c->verdict = fmt::format("The two agree to {:.3g} mm RMS, {:.2g}% of the motion{}",
                           1e3 * all.rmse, 100.0 * part,
                           all.sigmas <= 0.0 ? "."
                           : within          ? ": no more than the measurement's own error."
                                    : fmt::format(": {:.{}f} times the measurement's own error.",
                                                  all.sigmas, all.sigmas < 10.0 ? 1 : 0));
  const MarkError* worst = &c->errors.front();
  for (const auto& e : c->errors) {
    if (e.mark != "all" && e.rmse > worst->rmse) worst = &e;
  }
  c->reasons.push_back(
      fmt::format("Farthest apart is {}: {:.3g} mm RMS, {:.3g} mm at most, at {:.3f} s.",
                  worst->mark, 1e3 * worst->rmse, 1e3 * worst->largest, worst->largest_at));
  c->reasons.push_back(fmt::format(
      "Out of the plane the marks stray by {:.3g} mm RMS (mean {:+.3f} mm); the reference is {}.",
      1e3 * all.rmse_across, 1e3 * all.bias_across, c->reference_is_run ? "planar" : "measured"));
  c->reasons.push_back(fmt::format(
      "The record's clock shows {} s when the reference's shows 0: found from {}, then together "
      "with the frame.",
      NumberWithError(a.at.offset, a.Sigma("time offset"), 6), a.signal));
  if (a.drift != 0.0) {
    c->reasons.push_back(fmt::format(
        "The record's clock runs fast by {} parts in a million; that is taken out, about {:.3f} s.",
        NumberWithError(1e6 * a.drift, 1e6 * a.Sigma("clock drift")), a.drift_pivot));
  }
  if (!c->scores.empty() && c->scores.back().rated) {
    const ComparedScore& s = c->scores.back();
    c->reasons.push_back(fmt::format(
        "As histories they are {} by ISO/TS 18571 ({:.3f} of 1, mean of the marks); R squared is "
        "{:.5f}.",
        Name(s.rating.grade), s.rating.overall, s.score.r2));
  }
  std::size_t shared = 0;
  for (const ModePair& p : c->mode_pairs) shared += p.a >= 0 && p.b >= 0 ? 1 : 0;
  if (c->measured_modes.decay.Usable()) {
    c->reasons.push_back(fmt::format(
        "Its free decay holds {} modes, {} of which the reference has too (within 10% and alike in "
        "shape).",
        c->measured_modes.decay.modes.size(), shared));
  } else if (!c->measured_modes.decay.message.empty()) {
    c->reasons.push_back("No modes: " + c->measured_modes.decay.message + ".");
  }
  std::size_t pairs = 0, all_peaks = 0;
  double farthest = 0.0;
  for (const ComparedSpectrum& s : c->spectra) {
    for (const PeakPair& p : s.pairs) {
      if (p.a < 0) continue;
      ++all_peaks;
      if (p.b < 0) continue;
      ++pairs;
      const double f = s.measured_peaks[static_cast<std::size_t>(p.a)].frequency;
      farthest = std::max(
          farthest, std::abs(s.reference_peaks[static_cast<std::size_t>(p.b)].frequency - f) / f);
    }
  }
  if (all_peaks > 0) {
    c->reasons.push_back(fmt::format(
        "Of {} spectral peaks measured after {:.2f} s, {} have a partner in the reference within "
        "two bins, at most {:.1f}% away in frequency.",
        all_peaks, c->spectrum_from, pairs, 100.0 * farthest));
  }
  if (!a.noise.white() && c->observations.has_sigma) {
    c->reasons.push_back(
        "The residuals follow one another in time, so the two differ by more than chance; the "
        "standard errors above are widened for it.");
  }
  if (!a.fit.weak.empty()) {
    c->reasons.push_back("These marks do not determine: " + JoinWords(a.fit.weak) + ".");
  }
  if (!c->left_out.empty()) {
    c->reasons.push_back("Only one of the two has " + JoinWords(c->left_out) + ": left out.");
  }
}

}  // namespace

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
  c->alignment = Align(c->observations, reference, how);
  if (!c->alignment.Usable()) {
    c->verdict = std::string("Not correlated: ") + Name(c->alignment.status) + ".";
    c->reasons.push_back(c->alignment.message + ".");
    return;
  }
  c->observations =
      WithoutDrift(std::move(c->observations), c->alignment.drift, c->alignment.drift_pivot);
  c->errors =
      Errors(c->observations, c->alignment.reference, c->alignment.at.offset, c->alignment.fit);
  FillSignals(reference, c);
  FillScores(c);
  FillSpectra(options, c);
  FillModes(c);
  Judge(c);
}

}  // namespace unfurl::correlate
