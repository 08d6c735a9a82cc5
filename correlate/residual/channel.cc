#include "correlate/residual/channel.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/statistics.h"
#include "correlate/sampled_model.h"

namespace unfurl::correlate {

namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// Margin of the grid beside the readings: offsets move by less from one solution to the next.
constexpr double kMarginReadings = 16.0;  // median steps
constexpr double kMarginSpan = 0.01;      // of the record's length
constexpr double kMarginPrior = 4.0;      // sigmas of the delay: one in 16 000 lies beyond
constexpr double kMarginFree = 0.1;       // of the record's length, of a delay without a prior
// A fit keeps 200 answers of a model: 8 MB each.
constexpr double kMostPoints = 1e6;

bool IsFitted(const Prior& prior) {
  return prior.kind == Foreknowledge::kFree || prior.kind == Foreknowledge::kNormal;
}

// A kink between two points of the grid, as a change of rate leaves it, is off by an eighth of the
// second difference there; of the readings' own over the square of their points. So many keep that
// within kPart of the sigma.
int PointsFor(const ChannelRecord& r) {
  constexpr double kPart = 0.1;    // of a sigma: no estimate shows it
  constexpr double kShare = 0.99;  // of the readings: impacts are few, and finer grids cost runs
  constexpr int kFewest = 4, kMost = 16;  // the cubic's own; what a filter's detail costs in runs
  std::vector<double> bends;
  for (Eigen::Index i = 2; i < r.y.size(); ++i) {
    bends.push_back(std::abs(r.y(i) - 2.0 * r.y(i - 1) + r.y(i - 2)) / r.sigma(i));
  }
  const double wanted = std::sqrt(Quantile(bends, kShare) / 8.0 / kPart);
  return static_cast<int>(std::clamp(std::ceil(wanted), 1.0 * kFewest, 1.0 * kMost));
}

// Where a reading says no more than that the motion was at a value or beyond it, that value, times
// the side (1: the upper end of the range, -1: the lower); infinite: it says what it reads. Whether
// a reading near the end was cut off is chance, and what was not would be too low on average: near
// the end is told by its neighbours, whose noise is their own, and all readings there say the same.
double BoundOf(const ChannelRecord& r, Eigen::Index i, double side) {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  constexpr double kFar = 10.0;   // sigmas: no sound reading beside the end lies so far from it
  constexpr double kNear = 4.0;   // sigmas: one reading in 30 000 from below here is cut off
  constexpr double kSlack = 1.0;  // sigmas, twice what the median of six is off by
  constexpr Eigen::Index kBeside = 3;  // to either side
  const double end = side > 0.0 ? r.highest : -r.lowest, sigma = r.sigma(i), y = side * r.y(i);
  if (!std::isfinite(end) || y < end - kFar * sigma) return kNone;
  std::vector<double> beside;
  for (Eigen::Index k = i - kBeside; k <= i + kBeside; ++k) {
    if (k != i && k >= 0 && k < r.y.size()) beside.push_back(side * r.y(k));
  }
  if (Median(beside) >= end - kNear * sigma) return end - (kNear + kSlack) * sigma;
  return y >= end ? end : kNone;
}

double ValueOf(const Prior& prior, double unsaid) { return prior.Told() ? prior.mean : unsaid; }

void CheckReadings(const ChannelRecord& r, const std::string& where) {
  constexpr std::size_t kFewest = 4;  // of a cubic
  if (r.t.size() < kFewest) {
    throw Error(fmt::format("channel '{}' has {} readings", r.name, r.t.size()), where,
                fmt::format("{} are the fewest; widen the window", kFewest));
  }
  for (std::size_t i = 0; i < r.t.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    if (!std::isfinite(r.t[i]) || !std::isfinite(r.y(k))) {
      throw Error(fmt::format("reading {} of '{}' is not finite", i + 1, r.name), where,
                  "leave readings that failed out of the file");
    }
    if (i > 0 && !(r.t[i] > r.t[i - 1])) {
      throw Error(fmt::format("the stamps of '{}' do not ascend at {} s", r.name, r.t[i]), where,
                  "write the readings in order of time, one per stamp");
    }
    if (r.sigma.size() > 0 && !(r.sigma(k) > 0.0 && std::isfinite(r.sigma(k)))) {
      throw Error(fmt::format("the sigma of '{}' at {} s is not positive", r.name, r.t[i]), where,
                  "give each reading its standard deviation, or none to any");
    }
  }
}

}  // namespace

Channel::Channel(ChannelRecord record, const std::string& where) : record_(std::move(record)) {
  CheckReadings(record_, where);
  if (record_.resolution == 0.0) record_.resolution = ResolutionOf(record_.y);
  if (std::isnan(record_.lowest) || std::isnan(record_.highest)) {
    const Range found = RangeOf(record_.y);
    if (std::isnan(record_.lowest)) record_.lowest = found.low;
    if (std::isnan(record_.highest)) record_.highest = found.high;
  }
  clipped_ =
      ((record_.y.array() <= record_.lowest) || (record_.y.array() >= record_.highest)).count();
  record_.filter.Check();
  const auto n = static_cast<Eigen::Index>(record_.t.size());
  has_sigma_ = record_.sigma.size() > 0;
  if (!has_sigma_) {
    const double noise = NoiseOf(record_.y);
    if (!(noise > 0.0)) {
      throw Error(fmt::format("the readings of '{}' never change", record_.name), where,
                  "leave the channel out, or look at its file");
    }
    record_.sigma = Eigen::VectorXd::Constant(n, noise);
  }
  const double span = record_.t.back() - record_.t.front(), median = MedianStep(record_.t);
  if (std::isnan(record_.pivot)) record_.pivot = 0.5 * (record_.t.front() + record_.t.back());
  if (record_.points_per_step == 0) record_.points_per_step = PointsFor(record_);
  margin_ = std::max(kMarginReadings * median, kMarginSpan * span);
  if (record_.delay.kind == Foreknowledge::kNormal) margin_ += kMarginPrior * record_.delay.sigma;
  if (record_.delay.kind == Foreknowledge::kFree) margin_ += kMarginFree * span;
  const double length = span + 2.0 * margin_;
  step_ = std::max(median / record_.points_per_step, length / kMostPoints);
  if (step_ > median) {
    // Even readings are not in bursts: there are too many.
    constexpr double kEven = 0.5;  // of the span, that readings a median step apart cover
    if (static_cast<double>(n) * median > kEven * span) {
      throw Error(fmt::format("'{}' has {} readings; {:.0f} are the most", record_.name, n,
                              kMostPoints * span / length),
                  where, "thin the record, or give a window of it");
    }
    throw Error(fmt::format("the readings of '{}' lie in bursts, {:.3g} s apart in {:.3g} s",
                            record_.name, median, span),
                where, "give a window for each part of the record that is to count");
  }
  count_ = static_cast<Eigen::Index>(std::ceil(length / step_)) + 1;
  placed_ = record_.t;
  const Values known = ValuesOf({});
  // Without round-off where nothing is said of the rate: what a window begins with is in it.
  for (double& t : placed_) t = known.drift == 0.0 ? t - known.delay : RecordTime(t, known);
  auto fit = [&](const char* name, std::string unit, const Prior& prior, double Values::*value) {
    if (!IsFitted(prior)) return;
    fitted_.push_back({name, std::move(unit), prior, value});
    if (prior.kind == Foreknowledge::kNormal) ++prior_rows_;
  };
  fit("gain", "1", record_.gain, &Values::gain);
  fit("bias", record_.unit, record_.bias, &Values::bias);
  fit("delay", "s", record_.delay, &Values::delay);
  fit("clock drift", "1", record_.drift, &Values::drift);
}

Eigen::Index Channel::rows() const { return record_.y.size() + prior_rows_; }

double Channel::TimeOf(Eigen::Index row) const {
  return row < record_.y.size() ? placed_[static_cast<std::size_t>(row)] : kNan;
}

std::vector<RowSeries> Channel::series() const {
  return {{record_.name, &placed_, 0, 1, has_sigma_, record_.resolution / record_.sigma.mean(),
           aside_.empty() ? nullptr : &aside_}};
}

std::vector<ResidualKind::Unknown> Channel::unknowns() const {
  const Values start = ValuesOf({});
  std::vector<Unknown> out;
  for (const Fitted& f : fitted_) {
    out.push_back({fmt::format("{} of {}", f.name, record_.name), f.unit, start.*f.value});
  }
  return out;
}

Channel::Values Channel::ValuesOf(const Eigen::VectorXd& unknowns) const {
  Values out;
  out.gain = ValueOf(record_.gain, 1.0);
  out.bias = ValueOf(record_.bias, 0.0);
  out.delay = ValueOf(record_.delay, 0.0);
  out.drift = ValueOf(record_.drift, 0.0);
  for (std::size_t j = 0; j < fitted_.size() && unknowns.size() > 0; ++j) {
    out.*fitted_[j].value = unknowns(static_cast<Eigen::Index>(j));
  }
  return out;
}

double Channel::RecordTime(double t, const Values& at) const {
  return record_.pivot + (t - record_.pivot) / (1.0 + at.drift) - at.delay;
}

double Channel::OwnTime(double t) const {
  const Values at = ValuesOf({});
  if (at.drift == 0.0) return t + at.delay;
  return record_.pivot + (t + at.delay - record_.pivot) * (1.0 + at.drift);
}

double Channel::GridStart(const Clock& clock, double pivot) const {
  return clock.ModelTime(RecordTime(record_.t.front(), ValuesOf({})), pivot) - margin_;
}

std::vector<double> Channel::GridFrom(double start) const {
  std::vector<double> t(static_cast<std::size_t>(count_));
  for (std::size_t i = 0; i < t.size(); ++i) t[i] = start + static_cast<double>(i) * step_;
  return t;
}

void Channel::Ask(const Clock& clock, double pivot, Stamps* stamps) const {
  std::vector<double> t = GridFrom(GridStart(clock, pivot));
  const double needed = t.back() - margin_;
  stamps->quantities.push_back({record_.name, record_.quantity, std::move(t), needed});
}

void Channel::AskOver(double low, double high, Stamps* stamps) const {
  const double step = std::max(step_, (high - low) / kMostPoints);
  std::vector<double> t;
  for (std::size_t i = 0; low + static_cast<double>(i) * step < high + step; ++i) {
    t.push_back(low + static_cast<double>(i) * step);
  }
  stamps->quantities.push_back({record_.name, record_.quantity, std::move(t)});
}

Eigen::VectorXd Channel::NumbersOf(const Prediction& prediction) const {
  for (const QuantityValues& q : prediction.quantities) {
    if (q.key == record_.name) return q.values;
  }
  return Eigen::VectorXd::Constant(count_, kNan);
}

void Channel::Add(const Eigen::VectorXd& more, Prediction* prediction) const {
  for (QuantityValues& q : prediction->quantities) {
    if (q.key == record_.name) q.values += more;
  }
}

Channel::Place Channel::PlaceAt(double time, double start) const {
  Place out;
  const double x = (time - start) / step_;
  if (!(x >= 0.0) || x > static_cast<double>(count_ - 1)) return out;
  const Eigen::Index first =
      std::clamp<Eigen::Index>(static_cast<Eigen::Index>(x) - 1, 0, count_ - 4);
  const double u = x - static_cast<double>(first);  // in [0, 3]; the points lie at 0, 1, 2, 3
  const double a = u, b = u - 1.0, c = u - 2.0, d = u - 3.0;
  out.first = first;
  out.value[0] = -b * c * d / 6.0;
  out.value[1] = a * c * d / 2.0;
  out.value[2] = -a * b * d / 2.0;
  out.value[3] = a * b * c / 6.0;
  out.slope[0] = -(c * d + b * d + b * c) / (6.0 * step_);
  out.slope[1] = (c * d + a * d + a * c) / (2.0 * step_);
  out.slope[2] = -(b * d + a * d + a * b) / (2.0 * step_);
  out.slope[3] = (b * c + a * c + a * b) / (6.0 * step_);
  return out;
}

Channel::Shown Channel::Show(const Eigen::VectorXd& numbers) const {
  Shown out;
  out.end = numbers.size();
  while (out.first < out.end && !std::isfinite(numbers(out.first))) ++out.first;
  while (out.end > out.first && !std::isfinite(numbers(out.end - 1))) --out.end;
  out.values = Eigen::VectorXd::Zero(numbers.size());
  if (out.end > out.first) {
    out.values.segment(out.first, out.end - out.first) =
        record_.filter.Apply(numbers.segment(out.first, out.end - out.first), step_);
  }
  // A model that starts in motion says nothing of what the filter still remembers.
  if (out.first > 0) {
    out.first += static_cast<Eigen::Index>(std::ceil(record_.filter.Memory() / step_));
    out.first = std::min(out.first, out.end);
  }
  return out;
}

bool Channel::ReadingAt(Eigen::Index i, const At& at, double* value, double* slope) const {
  const double t = record_.t[static_cast<std::size_t>(i)];
  const Place p =
      PlaceAt(at.clocks.at.ModelTime(RecordTime(t, at.values), at.clocks.pivot), at.start);
  if (p.first < at.shown.first || p.first < 0 || p.first + 4 > at.shown.end) return false;
  *value = *slope = 0.0;
  for (int k = 0; k < 4; ++k) {
    *value += p.value[k] * at.shown.values(p.first + k);
    *slope += p.slope[k] * at.shown.values(p.first + k);
  }
  return true;
}

bool Channel::IsBeyond(Eigen::Index i, double model) const {
  for (const double side : {1.0, -1.0}) {
    const double bound = BoundOf(record_, i, side);
    if (std::isfinite(bound) && side * model >= bound) return true;
  }
  return false;
}

void Channel::Evaluate(const Eigen::VectorXd& numbers, const Clocks& clocks,
                       const Eigen::VectorXd& unknowns, Rows* rows) const {
  const Values at = ValuesOf(unknowns);
  const Shown shown = Show(numbers);
  const double start = GridStart(clocks.reference, clocks.pivot);
  const double record_rate = 1.0 / (1.0 + clocks.at.drift), own_rate = 1.0 / (1.0 + at.drift);
  rows->residual.setZero();
  rows->by_time.setZero();
  rows->by_unknown.setZero();
  rows->known = 0;
  for (Eigen::Index i = 0; i < record_.y.size(); ++i) {
    if (!aside_.empty() && aside_[static_cast<std::size_t>(i)]) continue;
    double value = 0.0, slope = 0.0;
    if (!ReadingAt(i, {at, clocks, shown, start}, &value, &slope)) continue;
    const double model = record_.scale * at.gain * value + at.bias;
    double reading = record_.y(i);
    if (clipped_ > 0) {
      if (IsBeyond(i, model)) continue;
      for (const double side : {1.0, -1.0}) {
        const double bound = BoundOf(record_, i, side);
        if (std::isfinite(bound)) reading = side * bound;
      }
    }
    const double weight = 1.0 / record_.sigma(i);
    rows->residual(i) = weight * (reading - model);
    rows->by_time(i) = -weight * record_.scale * at.gain * slope;
    ++rows->known;
    for (std::size_t j = 0; j < fitted_.size(); ++j) {
      double& cell = rows->by_unknown(i, static_cast<Eigen::Index>(j));
      if (fitted_[j].value == &Values::gain) cell = -weight * record_.scale * value;
      if (fitted_[j].value == &Values::bias) cell = -weight;
      if (fitted_[j].value == &Values::delay) cell = -rows->by_time(i) * record_rate;
      if (fitted_[j].value == &Values::drift) {
        const double t = record_.t[static_cast<std::size_t>(i)];
        cell = -rows->by_time(i) * record_rate * own_rate * own_rate * (t - record_.pivot);
      }
    }
  }
  Eigen::Index row = record_.y.size();
  for (std::size_t j = 0; j < fitted_.size(); ++j) {
    const Prior& prior = fitted_[j].prior;
    if (prior.kind != Foreknowledge::kNormal) continue;
    rows->residual(row) = (at.*fitted_[j].value - prior.mean) / prior.sigma;
    rows->by_unknown(row++, static_cast<Eigen::Index>(j)) = 1.0 / prior.sigma;
  }
}

Eigen::VectorXd Channel::Response(const Eigen::VectorXd& change, const Clocks& clocks,
                                  const Eigen::VectorXd& unknowns) const {
  const Values at = ValuesOf(unknowns);
  const Eigen::VectorXd shown = record_.filter.Apply(change, step_);
  const double start = GridStart(clocks.reference, clocks.pivot);
  Eigen::VectorXd out = Eigen::VectorXd::Zero(rows());
  for (Eigen::Index i = 0; i < record_.y.size(); ++i) {
    if (!aside_.empty() && aside_[static_cast<std::size_t>(i)]) continue;
    const double t = record_.t[static_cast<std::size_t>(i)];
    const Place p = PlaceAt(clocks.at.ModelTime(RecordTime(t, at), clocks.pivot), start);
    if (p.first < 0) continue;
    double value = 0.0;
    for (int k = 0; k < 4; ++k) value += p.value[k] * shown(p.first + k);
    out(i) = -record_.scale * at.gain * value / record_.sigma(i);
  }
  return out;
}

ResidualKind::Rows Channel::RowsAt(const Eigen::VectorXd& numbers, const Clocks& clocks,
                                   const Eigen::VectorXd& unknowns) const {
  Rows out;
  out.residual.resize(rows());
  out.by_time.resize(rows());
  out.by_unknown.resize(rows(), static_cast<Eigen::Index>(fitted_.size()));
  Evaluate(numbers, clocks, unknowns, &out);
  return out;
}

Eigen::VectorXd Channel::Simulated(const Eigen::VectorXd& numbers, const Clocks& clocks,
                                   const Eigen::VectorXd& unknowns) const {
  const Values at = ValuesOf(unknowns);
  const Shown shown = Show(numbers);
  const double start = GridStart(clocks.reference, clocks.pivot);
  Eigen::VectorXd out = Eigen::VectorXd::Constant(record_.y.size(), kNan);
  for (Eigen::Index i = 0; i < out.size(); ++i) {
    double value = 0.0, slope = 0.0;
    if (!ReadingAt(i, {at, clocks, shown, start}, &value, &slope)) continue;
    out(i) = record_.scale * at.gain * value + at.bias;
  }
  return out;
}

}  // namespace unfurl::correlate
