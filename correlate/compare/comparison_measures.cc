#include "correlate/compare/comparison_measures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/statistics.h"
#include "correlate/spectra/bridge.h"
#include "correlate/spectra/lomb_scargle.h"

namespace unfurl::correlate {

namespace {

constexpr std::size_t kFewestOfSpectrum = 16;  // samples of a spectrum

// What the scores of all marks are the mean of; a mark's rating too, over its coordinates.
constexpr double SignalScore::*kMeans[] = {
    &SignalScore::sprague_geers_magnitude, &SignalScore::sprague_geers_phase,
    &SignalScore::sprague_geers,           &SignalScore::russell_magnitude,
    &SignalScore::russell_phase,           &SignalScore::russell};
constexpr double ObjectiveRating::*kRatings[] = {
    &ObjectiveRating::corridor, &ObjectiveRating::phase, &ObjectiveRating::magnitude,
    &ObjectiveRating::slope, &ObjectiveRating::overall};
// What is measured by the test's own motion.
constexpr double SignalScore::*kRelative[] = {&SignalScore::nrmse,
                                              &SignalScore::r2,
                                              &SignalScore::sprague_geers_magnitude,
                                              &SignalScore::sprague_geers_phase,
                                              &SignalScore::sprague_geers,
                                              &SignalScore::russell_magnitude,
                                              &SignalScore::russell_phase,
                                              &SignalScore::russell};

std::vector<double> Less(const std::vector<double>& x, double zero) {
  std::vector<double> out(x);
  for (double& v : out) v -= zero;
  return out;
}

// Rated on the longest even stretch, thinned where it is longer than the rating's effort (which
// grows with the square) is worth.
bool Rate(const std::vector<double>& t, const std::vector<double>& test,
          const std::vector<double>& computed, ObjectiveRating* rating, double* step) {
  // Samples. The standard shifts by up to a fifth of the length: of fewer than 50, one sample is
  // over a tenth of that, and the phase score is as coarse.
  constexpr std::size_t kMost = 3000, kLeast = 50;
  const BridgedRecord whole = BridgeGaps(t, {test, computed});
  const auto stretch = LongestEvenStretch(whole.t);
  if (stretch.count < kLeast) return false;
  const std::size_t skip = (stretch.count + kMost - 1) / kMost;
  std::vector<double> a, b;
  for (std::size_t i = stretch.first; i < stretch.first + stretch.count; i += skip) {
    a.push_back(whole.x[0][i]);
    b.push_back(whole.x[1][i]);
  }
  *rating = RateObjectively(a, b);
  *step = stretch.dt * static_cast<double>(skip);
  return true;
}

// The range below which a history is that of something that stands still: noise, or round-off, over
// which no share of motion means anything.
double Stillness(const Comparison& c, const std::vector<const ComparedSignal*>& parts) {
  constexpr double kNoise = 10.0;  // sigmas between the ends of thousands of normal draws
  constexpr double kPart = 1e-6;   // of the largest motion of any mark
  double least = 0.0;
  for (const ComparedSignal* s : parts) least = std::max(least, kNoise * Rms(s->sigma));
  for (const ComparedSignal& s : c.signals) {
    const SignalId& own = parts.front()->id;
    if (s.id.kind != own.kind || s.id.unit != own.unit || s.reference.empty()) continue;
    const auto [low, high] = std::minmax_element(s.reference.begin(), s.reference.end());
    least = std::max(least, kPart * (*high - *low));
  }
  return least;
}

// One mark's coordinates, or one angle, as what moved since the reference's first sample.
ComparedScore Score(const Comparison& c, const std::string& name,
                    const std::vector<const ComparedSignal*>& parts) {
  ComparedScore out;
  out.name = name;
  const SignalId& id = parts.front()->id;
  out.of = id.IsChannel() ? ComparedScore::Of::kChannel
           : id.IsAngle() ? ComparedScore::Of::kAngle
                          : ComparedScore::Of::kMark;
  out.unit = id.unit;
  std::vector<std::vector<double>> test, computed;
  std::vector<SignalPair> pairs;
  double largest = 0.0;
  std::vector<double> range;
  for (const ComparedSignal* s : parts) {
    // An instrument's zero means something as it is.
    const double zero = id.IsChannel() ? 0.0 : s->reference.front();
    test.push_back(Less(c.record_is_test ? s->measured : s->reference, zero));
    computed.push_back(Less(c.record_is_test ? s->reference : s->measured, zero));
    const auto [low, high] = std::minmax_element(test.back().begin(), test.back().end());
    range.push_back(*high - *low);
    largest = std::max(largest, range.back());
  }
  for (std::size_t k = 0; k < parts.size(); ++k) {
    pairs.push_back({parts[k]->t, test[k], computed[k], {}});
    if (id.IsChannel()) pairs.back().sigma = parts[k]->sigma;
  }
  out.score = ScoreSignals(pairs);
  if (id.IsChannel()) out.sigmas = out.score.sigmas;
  // Errors stand in the order of the marks.
  if (out.of == ComparedScore::Of::kMark) out.sigmas = c.errors[parts.front()->id.mark].sigmas;
  if (largest <= Stillness(c, parts)) {
    for (const auto member : kRelative) out.score.*member = std::nan("");
    return out;
  }
  // The rating is of one history: that of a mark is the mean over the coordinates in which it
  // moves.
  constexpr double kMoves = 0.05;  // of the larger coordinate's range
  double count = 0.0;
  for (std::size_t k = 0; k < parts.size(); ++k) {
    ObjectiveRating one;
    if (range[k] < kMoves * largest ||
        !Rate(parts[k]->t, test[k], computed[k], &one, &out.rating_step)) {
      continue;
    }
    count += 1.0;
    for (const auto member : kRatings) out.rating.*member += one.*member;
  }
  out.rated = count > 0.0;
  if (out.rated) {
    for (const auto member : kRatings) out.rating.*member /= count;
    out.rating.grade = GradeOf(out.rating.overall);
  }
  return out;
}

std::vector<Peak> AsPeaks(const std::vector<LombPeak>& from) {
  std::vector<Peak> out;
  out.reserve(from.size());
  for (const LombPeak& p : from) out.push_back({p.frequency, p.amplitude, 0});
  return out;
}

Spectrum AsSpectrum(LombSpectrum from) {
  Spectrum out;
  out.frequency = std::move(from.frequency);
  out.amplitude = std::move(from.amplitude);
  out.resolution = from.resolution;
  out.n = from.n;
  out.convention = std::move(from.convention);
  return out;
}

// Samples `first` to `last` of what was measured and of its reference, or of the same again.
BridgedRecord Bridged(const ComparedSignal& s, std::size_t first, std::size_t last) {
  const auto part = [&](const std::vector<double>& of) {
    return std::span(of).subspan(first, last - first);
  };
  return BridgeGaps(part(s.t),
                    {part(s.measured), part(s.reference.empty() ? s.measured : s.reference)});
}

ComparedSpectrum SpectraOf(const ComparedSignal& s, std::size_t first, std::size_t last,
                           const SpectrumOptions& how) {
  // With less in one piece, least squares at the stamps themselves tell more than a shorter record.
  constexpr double kMostlyWhole = 0.8;
  const std::string unit = s.id.Unit();
  ComparedSpectrum out;
  out.id = s.id;
  out.name = s.name;
  const bool alone = s.reference.empty();
  const BridgedRecord whole = Bridged(s, first, last);
  const std::span<const double> t(whole.t), x(whole.x[0]), y(whole.x[1]);
  const auto stretch = LongestEvenStretch(t);
  const double share = static_cast<double>(stretch.count) / static_cast<double>(t.size());
  if (stretch.count >= kFewestOfSpectrum && share >= kMostlyWhole) {
    out.measured =
        AmplitudeSpectrum(x.subspan(stretch.first, stretch.count), stretch.dt, unit, how);
    out.reference =
        AmplitudeSpectrum(y.subspan(stretch.first, stretch.count), stretch.dt, unit, how);
    out.measured_peaks = FindPeaks(out.measured);
    out.reference_peaks = FindPeaks(out.reference);
    const std::span a(out.measured.value), b(out.reference.value);
    // The first two bins hold what detrending left.
    if (a.size() > 2 && !alone) out.frac = FrequencyResponseAssurance(a.subspan(2), b.subspan(2));
    if (whole.filled > 0) {
      out.note = fmt::format("samples put in where they are missing, {} of {}: what the others say",
                             whole.filled, t.size());
    } else if (!stretch.whole) {
      out.note = fmt::format("{} of {} samples: the longest stretch without a gap", stretch.count,
                             t.size());
    }
  } else {
    const auto sigma = s.sigma.empty() ? std::span<const double>()
                                       : std::span(s.sigma).subspan(first, last - first);
    const bool weighted =
        !sigma.empty() && std::all_of(sigma.begin(), sigma.end(), [](double v) { return v > 0.0; });
    const auto w = weighted ? sigma : std::span<const double>();
    out.measured = AsSpectrum(LombScargle(t, x, w, unit));
    out.reference = AsSpectrum(LombScargle(t, y, w, unit));
    out.measured_peaks = AsPeaks(FindLombPeaks(t, x, w));
    out.reference_peaks = AsPeaks(FindLombPeaks(t, y, w));
    out.note = "with gaps, so by least squares at the stamps themselves (Lomb-Scargle)";
  }
  if (stretch.count >= 2 * kFewestOfSpectrum) {
    out.density = WelchCrossSpectrum(t, x, y, unit, {how.window, how.detrend});
  }
  if (alone) {  // of the two the second was only there to have the first
    out.reference = {};
    out.reference_peaks.clear();
    out.density.yy.clear();
    out.density.xy.clear();
    out.density.coherence.clear();
  }
  out.pairs = PairPeaks(out.measured_peaks, out.reference_peaks, out.measured.resolution);
  return out;
}

// At each frequency that both show: how alike the deformations are in which they vibrate there.
void FillOperatingShapes(Comparison* c) {
  constexpr std::size_t kMost = 6;  // of the largest amplitudes: what a page can show
  for (const ComparedSpectrum& s : c->spectra) {
    if (!s.id.IsCoordinate()) continue;
    for (const PeakPair& p : s.pairs) {
      if (p.a < 0 || p.b < 0) continue;
      const Peak& a = s.measured_peaks[static_cast<std::size_t>(p.a)];
      OperatingShape shape;
      shape.measured_frequency = a.frequency;
      shape.reference_frequency = s.reference_peaks[static_cast<std::size_t>(p.b)].frequency;
      shape.amplitude = a.amplitude;
      bool stronger = true;
      for (OperatingShape& known : c->operating_shapes) {
        if (std::abs(known.measured_frequency - a.frequency) > s.measured.resolution) continue;
        stronger = false;
        if (a.amplitude > known.amplitude) known = shape;
      }
      if (stronger) c->operating_shapes.push_back(shape);
    }
  }
  auto& shapes = c->operating_shapes;
  std::stable_sort(shapes.begin(), shapes.end(),
                   [](const auto& a, const auto& b) { return a.amplitude > b.amplitude; });
  if (shapes.size() > kMost) shapes.resize(kMost);
  for (OperatingShape& shape : shapes) {
    std::vector<std::complex<double>> a, b;
    for (const ComparedSignal& s : c->signals) {
      if (!s.id.InPlane()) continue;
      const auto [first, last] = WithinSpectra(*c, s);
      if (last < first + kFewestOfSpectrum) continue;
      const auto t = std::span(s.t).subspan(first, last - first);
      a.push_back(FourierAmplitude(t, std::span(s.measured).subspan(first, last - first),
                                   shape.measured_frequency, c->spectrum_from));
      b.push_back(FourierAmplitude(t, std::span(s.reference).subspan(first, last - first),
                                   shape.reference_frequency, c->spectrum_from));
    }
    const auto n = static_cast<Eigen::Index>(a.size());
    shape.mac = ModalAssurance(Eigen::Map<const Eigen::VectorXcd>(a.data(), n),
                               Eigen::Map<const Eigen::VectorXcd>(b.data(), n));
  }
}

// Over all marks: squares add up over the samples, the rest is the mean of the marks'.
class TotalScore {
 public:
  void Add(const ComparedScore& s) {
    const auto n = static_cast<double>(s.score.samples);
    squares_ += n * s.score.rmse * s.score.rmse;
    unexplained_ += s.score.r2 < 1.0 ? n * s.score.rmse * s.score.rmse / (1.0 - s.score.r2) : 0.0;
    range2_ = std::max(range2_, s.score.range * s.score.range);
    all_.score.samples += s.score.samples;
    if (s.score.largest > all_.score.largest) {
      all_.score.largest = s.score.largest;
      all_.score.largest_at = s.score.largest_at;
    }
    if (!std::isfinite(s.score.sprague_geers)) return;  // one of the two does not move
    count_ += 1.0;
    all_.rated = s.rated && (all_.rated || count_ == 1.0);
    all_.rating_step = s.rating_step;
    for (const auto member : kMeans) all_.score.*member += s.score.*member;
    for (const auto member : kRatings) all_.rating.*member += s.rating.*member;
  }

  auto samples() const { return all_.score.samples; }

  ComparedScore Get(double sigmas) const {
    ComparedScore all = all_;
    all.of = ComparedScore::Of::kAll;
    all.name = "all";
    for (const auto member : kMeans) all.score.*member /= std::max(count_, 1.0);
    for (const auto member : kRatings) all.rating.*member /= std::max(count_, 1.0);
    all.rating.grade = GradeOf(all.rating.overall);
    all.score.rmse = std::sqrt(squares_ / static_cast<double>(all.score.samples));
    all.score.range = std::sqrt(range2_);
    all.score.nrmse = all.score.range > 0.0 ? all.score.rmse / all.score.range : 0.0;
    all.score.r2 = unexplained_ > 0.0 ? 1.0 - squares_ / unexplained_ : 1.0;
    all.sigmas = sigmas;
    return all;
  }

 private:
  ComparedScore all_;
  double squares_ = 0.0, range2_ = 0.0, unexplained_ = 0.0;
  double count_ = 0.0;  // marks of which both move
};

}  // namespace

std::pair<std::size_t, std::size_t> WithinSpectra(const Comparison& c, const ComparedSignal& s) {
  return {static_cast<std::size_t>(std::lower_bound(s.t.begin(), s.t.end(), c.spectrum_from) -
                                   s.t.begin()),
          static_cast<std::size_t>(std::upper_bound(s.t.begin(), s.t.end(), c.spectrum_to) -
                                   s.t.begin())};
}

void FillScores(Comparison* c) {
  for (const ComparedSignal& s : c->signals) {
    if (s.id.IsChannel() && s.t.size() < 2) continue;
    if (!s.id.IsCoordinate()) c->scores.push_back(Score(*c, s.name, {&s}));
  }
  TotalScore total;
  for (std::size_t m = 0; m < c->marks.size(); ++m) {
    const ComparedSignal *x = FindCoordinate(*c, m, 0), *y = FindCoordinate(*c, m, 1);
    if (x == nullptr || y == nullptr || x->t.size() < 2) continue;
    c->scores.push_back(Score(*c, c->marks[m], {x, y}));
    total.Add(c->scores.back());
  }
  if (total.samples() > 0) c->scores.push_back(total.Get(c->errors.back().sigmas));
}

void UseDensityPeaks(const ComparisonOptions& options, bool record, bool reference, Comparison* c) {
  constexpr double kSegments = 32.0;  // overlapping by half: heights that are known to a quarter
  for (ComparedSpectrum& spectrum : c->spectra) {
    const auto signal = std::find_if(c->signals.begin(), c->signals.end(),
                                     [&](const auto& s) { return s.id == spectrum.id; });
    if (signal == c->signals.end() || spectrum.density.segments == 0) continue;
    const auto [first, last] = WithinSpectra(*c, *signal);
    const bool alone = signal->reference.empty();
    const BridgedRecord whole = Bridged(*signal, first, last);
    const std::span<const double> t(whole.t), x(whole.x[0]), y(whole.x[1]);
    DensityOptions how{options.window, Detrend::kLine};
    how.segment = std::max<std::size_t>(
        kFewestOfSpectrum,
        static_cast<std::size_t>(static_cast<double>(LongestEvenStretch(t).count) /
                                 (0.5 * (kSegments + 1.0))));
    CrossSpectrum density = WelchCrossSpectrum(t, x, y, spectrum.id.Unit(), how);
    if (record) spectrum.measured_peaks = FindDensityPeaks(density.xx, density);
    if (reference && !alone) spectrum.reference_peaks = FindDensityPeaks(density.yy, density);
    spectrum.by_density = true;
    spectrum.pairs =
        PairPeaks(spectrum.measured_peaks, spectrum.reference_peaks, density.resolution);
    if (alone) {
      density.yy.clear();
      density.xy.clear();
      density.coherence.clear();
    }
    spectrum.density = std::move(density);
  }
  c->operating_shapes.clear();
  FillOperatingShapes(c);
}

namespace {

// A span that was asked for and in which nothing was recorded.
void RefuseEmptySpan(const ComparisonOptions& options, const Comparison& c) {
  const double start = c.alignment.overlap_start, end = c.alignment.overlap_end;
  if (!(start <= end)) return;
  const std::string remedy =
      fmt::format("give a time within {:.6g} to {:.6g} s, which {} on its clock", start, end,
                  c.reference.empty() ? "the record spans" : "the record and the reference share");
  if (options.from && *options.from >= end) {
    throw Error(fmt::format("nothing is recorded from {:.6g} s on", *options.from), "--from",
                remedy);
  }
  if (options.to && *options.to <= start) {
    throw Error(fmt::format("nothing is recorded until {:.6g} s", *options.to), "--to", remedy);
  }
}

}  // namespace

void FillSpectra(const ComparisonOptions& options, Comparison* c) {
  // What vibrates freely: after the last latch; without latches, all.
  c->spectrum_from = c->alignment.overlap_start;
  for (const ModelEvent& e : c->latches) {
    c->spectrum_from = std::max(c->spectrum_from, e.t + c->alignment.at.offset);
  }
  RefuseEmptySpan(options, *c);
  c->spectrum_from = options.from.value_or(c->spectrum_from);
  c->spectrum_to = options.to.value_or(c->alignment.overlap_end);
  for (const ComparedSignal& s : c->signals) {
    if (s.id.AcrossPlane()) continue;  // nothing moves there: its residuals tell all
    const auto [first, last] = WithinSpectra(*c, s);
    if (last < first + kFewestOfSpectrum) continue;
    c->spectra.push_back(SpectraOf(s, first, last, {options.window, Detrend::kLine}));
  }
  FillOperatingShapes(c);
}

}  // namespace unfurl::correlate
