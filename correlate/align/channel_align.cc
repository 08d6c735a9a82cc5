#include "correlate/align/channel_align.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/dense.h"
#include "base/fixed_number.h"
#include "base/text.h"
#include "correlate/align/refine.h"
#include "correlate/residual/row_layout.h"

namespace unfurl::correlate {

namespace {

// Of the channels, at one offset.
struct OffsetFit {
  double explained = 0.0;  // of the readings' variance, see Explained() [-]
  double covered = 0.0;    // the same of those that the model has something for [-]
  RegistrationFit registration;
  Prediction prediction;
};

class ChannelAligner {
 public:
  ChannelAligner(const Observations& record, const SampledModel& model, const AlignOptions& options)
      : record_(record),
        model_(model),
        options_(options.registration),
        layout_(record),
        // As time, of the shorter of the two.
        min_overlap_(options.search.min_overlap *
                     std::min(1.0, (model.Span().second - model.Span().first) /
                                       (record.End() - record.Start()))) {
    options_.with_others = true;
    held_ = options_;
    held_.fit_offset = held_.fit_drift = false;
    for (const RowSeries& s : layout_.series) readings_ += static_cast<double>(s.size());
    for (const auto& kind : record.others) {
      if (kind->series().empty()) continue;
      readings_of_.push_back(ReadingsOf(*kind));
      Eigen::VectorXd& y = readings_of_.back();
      // Those put aside show the mean: they count for nothing.
      const double known = std::max(1.0, static_cast<double>((y.array() != 0.0).count()));
      const double mean = y.sum() / known;
      const RowSeries series = kind->series().front();
      for (std::size_t i = 0; series.aside != nullptr && i < series.size(); ++i) {
        if ((*series.aside)[i]) y(static_cast<Eigen::Index>(i)) = mean;
      }
      squares_ += (y.array() - y.mean()).square().sum();
    }
  }

  double readings() const { return readings_; }

  // The offset is held; gains and biases are at their best.
  double ExplainedAt(double offset) const {
    Observations at = record_;
    at.placement.offset = Prior::Known(offset);
    at.placement.drift = Prior::Known(StartingDrift());
    const Prediction prediction = model_.Evaluate({}, at.StampsAt(Clock(offset, StartingDrift())));
    return Explained(
        FitRegistration(at, prediction, Clock(offset, StartingDrift()), StartAt(offset), held_));
  }

  // From there by least squares, the model asked again until the clock stays.
  OffsetFit Refine(double offset, bool* settled) const {
    constexpr int kMaxRounds = 30;     // as of marks: two or three do
    constexpr double kSettled = 1e-3;  // standard errors
    OffsetFit out;
    Registration start = StartAt(offset);
    *settled = false;
    for (int round = 0; round < kMaxRounds && !*settled; ++round) {
      const Clock reference = start.clock();
      out.prediction = model_.Evaluate({}, record_.StampsAt(reference));
      out.registration = FitRegistration(record_, out.prediction, reference, start, options_);
      const bool moves = WithPlacement(options_, record_).fit_offset;
      const double sigma = moves ? out.registration.sigma(0) : 0.0;
      start = out.registration.at;
      *settled = std::abs(start.offset - reference.offset) <= kSettled * sigma || !moves;
    }

    out.explained = Explained(out.registration, &out.covered);
    return out;
  }

  // Lags between which no signal changes by much: an eighth of the shortest period that they show,
  // by how often they cross their means. As many as ten million readings allow.
  double Step(double low, double high) const {
    constexpr double kPerPeriod = 8.0;  // a sine is then off by a fifth of its amplitude at most
    // Readings looked at in all: a second or two; lags that find a peak however many readings.
    constexpr double kReadings = 1e7, kFewest = 200.0, kMost = 4000.0;
    double step = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < layout_.series.size(); ++k) {
      const std::vector<double>& t = *layout_.series[k].t;
      const Eigen::VectorXd& y = readings_of_[k];
      const double span = t.back() - t.front(), mean = y.mean();
      double crossings = 1.0;
      for (Eigen::Index i = 1; i < y.size(); ++i) {
        crossings += (y(i - 1) < mean) != (y(i) < mean) ? 1.0 : 0.0;
      }
      step = std::min(step, 2.0 * span / crossings / kPerPeriod);
    }
    const double most = std::clamp(kReadings / readings_, kFewest, kMost);
    return std::max(step, (high - low) / most);
  }

 private:
  double StartingDrift() const {
    return record_.placement.drift.Told() ? record_.placement.drift.mean : 0.0;
  }

  Registration StartAt(double offset) const {
    Registration start;
    start.offset = offset;
    start.drift = StartingDrift();
    start.own = StartOfOwn(record_);
    return start;
  }

  // What a model of nothing leaves: the readings, in their sigmas.
  Eigen::VectorXd ReadingsOf(const ResidualKind& kind) const {
    ResidualKind::Rows rows;
    const auto unknowns = static_cast<Eigen::Index>(kind.unknowns().size());
    rows.residual.resize(kind.rows());
    rows.by_time.resize(kind.rows());
    rows.by_unknown.resize(kind.rows(), unknowns);
    Stamps stamps;
    const Clock clock(record_.Start());
    kind.Ask(clock, record_.Pivot(), &stamps);
    Prediction nothing;
    for (const QuantityStamps& q : stamps.quantities) {
      nothing.quantities.push_back(
          {q.key, Eigen::VectorXd::Zero(static_cast<Eigen::Index>(q.t.size()))});
    }
    kind.Evaluate(kind.NumbersOf(nothing), ClocksOf(record_, clock, clock),
                  Eigen::VectorXd::Zero(unknowns), &rows);
    Eigen::Index n = 0;
    for (const RowSeries& s : kind.series()) n += static_cast<Eigen::Index>(s.size());
    return rows.residual.head(n);
  }

  // Share of the readings' variance. What the model has nothing for is not explained, or an offset
  // at which they overlap little would fit best; but while a structure is held nothing changes, and
  // there it is the mean that stands for the model.
  double Explained(const RegistrationFit& fit, double* covered = nullptr) const {
    double squares = 0.0, overlap = 0.0, within = 0.0, motion = 0.0;
    for (std::size_t k = 0; k < layout_.series.size(); ++k) {
      const RowSeries& s = layout_.series[k];
      const auto n = static_cast<Eigen::Index>(s.size());
      const auto left = fit.residual.segment(s.first, n);
      squares += left.squaredNorm();
      const Eigen::VectorXd& y = readings_of_[k];
      Eigen::Index first = 0, end = n;
      while (first < end && left(first) == 0.0) ++first;
      while (end > first && left(end - 1) == 0.0) --end;
      overlap += static_cast<double>(end - first);
      within += left.segment(first, end - first).squaredNorm();
      motion += (y.segment(first, end - first).array() - y.mean()).square().sum();
      const bool held = model_.samples().held_before;
      const double mean = held && first > 0 ? y.head(first).mean() : y.mean();
      squares += (y.head(first).array() - mean).square().sum();
      squares += (y.tail(n - end).array() - y.mean()).square().sum();
    }
    if (covered != nullptr) *covered = motion > 0.0 ? 1.0 - within / motion : 0.0;
    if (overlap < min_overlap_ * readings_) return -std::numeric_limits<double>::infinity();
    return 1.0 - squares / squares_;
  }

  const Observations& record_;
  const SampledModel& model_;
  RegistrationOptions options_, held_;
  const RowLayout layout_;
  const double min_overlap_;  // of the readings [-]
  double readings_ = 0.0;
  std::vector<Eigen::VectorXd> readings_of_;  // by series, in their sigmas [-]
  double squares_ = 0.0;                      // of them about their means [-]
};

// Offsets to refine: the highest of those tried, each above its neighbours; what is known itself.
std::vector<double> Candidates(const ChannelAligner& aligner, const Observations& record,
                               const SampledModel& model, const AlignOptions& options) {
  const Prior& known = record.placement.offset;
  if (!options.at.empty()) return options.at;
  if (known.kind == Foreknowledge::kKnown) return {known.mean};
  // All overlaps of which at least `min_overlap` of the shorter remains.
  const auto [from, to] = model.Span();
  const double length = record.End() - record.Start();
  const double overlap = options.search.min_overlap * std::min(length, to - from);
  double low = std::max(options.search.low, record.Start() - to + overlap);
  double high = std::min(options.search.high, record.End() - from - overlap);
  std::vector<double> out;
  if (known.kind == Foreknowledge::kNormal) {
    constexpr double kWithin = 4.0;  // standard deviations: one in 16 000 lies beyond
    low = std::max(low, known.mean - kWithin * known.sigma);
    high = std::min(high, known.mean + kWithin * known.sigma);
    out.push_back(known.mean);
  }
  if (!(low < high)) return out;
  const double step = aligner.Step(low, high);
  const auto count = static_cast<std::size_t>(std::ceil((high - low) / step)) + 1;
  std::vector<double> explained(count);
  for (std::size_t i = 0; i < count; ++i) {
    explained[i] = aligner.ExplainedAt(low + static_cast<double>(i) * step);
  }
  std::vector<std::size_t> peaks;
  for (std::size_t i = 0; i < count; ++i) {
    const bool above = (i == 0 || explained[i] >= explained[i - 1]) &&
                       (i + 1 == count || explained[i] > explained[i + 1]);
    if (above) peaks.push_back(i);
  }
  std::stable_sort(peaks.begin(), peaks.end(),
                   [&](std::size_t a, std::size_t b) { return explained[a] > explained[b]; });
  const auto wanted = static_cast<std::size_t>(std::max(1, options.search.candidates));
  for (std::size_t i = 0; i < std::min(wanted, peaks.size()); ++i) {
    out.push_back(low + static_cast<double>(peaks[i]) * step);
  }
  return out;
}

void FillChannelCovariance(const Observations& record, Alignment* out) {
  const Eigen::MatrixXd& J = out->fit.jacobian;
  out->noise = EstimateResidualNoise(record, out->fit.residual, 1.0);
  if (J.cols() == 0) return;
  const Eigen::MatrixXd inverse =
      (J.transpose() * J).ldlt().solve(Eigen::MatrixXd::Identity(J.cols(), J.cols()));
  out->covariance = inverse * std::max(1.0, out->chi2_per_dof);
  out->white_sigma = inverse.diagonal().cwiseMax(0.0).cwiseSqrt();
}

}  // namespace

Alignment AlignChannels(const Observations& record, const SampledModel& model,
                        const AlignOptions& options) {
  Alignment out;
  out.signal = "channels";
  const ChannelAligner aligner(record, model, options);
  const std::size_t fewest = FewestAligned(record, options.registration);
  if (aligner.readings() < static_cast<double>(fewest)) {
    out.message =
        fmt::format("the channels have {} readings; {} are the fewest{}", aligner.readings(),
                    fewest, fewest > 1 ? " where the clock is to be found" : "");
    return out;
  }
  const std::vector<double> candidates = Candidates(aligner, record, model, options);
  OffsetFit best;
  bool settled = false, found = false;
  for (double offset : candidates) {
    bool here = false;
    OffsetFit fit = aligner.Refine(offset, &here);
    if (fit.registration.data_rows < static_cast<Eigen::Index>(fewest)) continue;
    if (options.search.IsKnown(fit.registration.at.offset)) continue;
    if (found && !(fit.explained > best.explained)) continue;
    best = std::move(fit);
    settled = here;
    found = true;
  }
  if (!found) {
    out.message = "no time offset leaves enough in common between the channels and the model";
    return out;
  }
  out.fit = std::move(best.registration);
  out.reference = std::move(best.prediction);
  out.at = out.fit.at;
  out.drift = out.at.drift;
  out.drift_pivot = record.Pivot();
  const double explained = options.part ? best.covered : best.explained;
  out.correlation = std::sqrt(std::max(explained, 0.0));
  out.r2 = explained;
  const double dof =
      std::max(1.0, static_cast<double>(out.fit.data_rows - out.fit.jacobian.cols()));
  out.chi2_per_dof = out.fit.SumOfSquares() / dof;
  RegistrationOptions all = WithPlacement(options.registration, record);
  all.with_others = true;
  out.unknowns = NuisanceNames(all, record);
  FillChannelCovariance(record, &out);
  out.overlap_start = record.Start();
  out.overlap_end = record.End();
  // One history: any two swings look somewhat alike. A known clock leaves nothing to be misled by.
  const bool placed = record.placement.offset.Told();
  if (!placed && explained < options.min_r2_of_one) {
    out.status = AlignStatus::kNothingShared;
    out.message = fmt::format(
        "the channels and the model share nothing: with the best time offset ({} s) the model "
        "explains {:.0f}% of what the channels show ({:.0f}% is asked)",
        FixedNumber(out.at.offset), 100.0 * std::max(0.0, explained),
        100.0 * options.min_r2_of_one);
    return out;
  }
  out.status = settled ? AlignStatus::kGood : AlignStatus::kNotConverged;
  out.message = settled ? fmt::format("aligned on {} readings; the model explains {:.3f}% of them",
                                      out.fit.data_rows, 100.0 * explained)
                        : "the time offset did not settle";
  if (!out.fit.weak.empty()) {
    out.message += "; not determined by these channels: " + JoinWords(out.fit.weak);
  }
  return out;
}

std::vector<double> ChannelOffsetsAlike(const Observations& record, const SampledModel& model,
                                        const AlignOptions& options) {
  return Candidates(ChannelAligner(record, model, options), record, model, options);
}

}  // namespace unfurl::correlate
