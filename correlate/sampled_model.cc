#include "correlate/sampled_model.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/statistics.h"
#include "base/text.h"

namespace unfurl::correlate {

double MedianStep(std::span<const double> stamps) {
  if (stamps.size() < 2) return 0.0;
  std::vector<double> steps(stamps.size() - 1);
  for (std::size_t i = 0; i + 1 < stamps.size(); ++i) steps[i] = stamps[i + 1] - stamps[i];
  return Median(steps);
}

LocalCubic CubicAt(std::span<const double> stamps, double t) {
  const std::size_t n = stamps.size();
  LocalCubic c;
  c.count = static_cast<int>(std::min<std::size_t>(n, 4));
  const auto after =
      static_cast<std::size_t>(std::upper_bound(stamps.begin(), stamps.end(), t) - stamps.begin());
  const std::size_t before = after >= 2 ? after - 2 : 0;
  c.first = std::min(before, n - static_cast<std::size_t>(c.count));
  const double* s = stamps.data() + c.first;
  for (int i = 0; i < c.count; ++i) {
    double weight = 1.0;
    double slope = 0.0;
    for (int j = 0; j < c.count; ++j) {
      if (j == i) continue;
      double partial = 1.0 / (s[i] - s[j]);  // derivative of factor j times the other factors
      for (int l = 0; l < c.count; ++l) {
        if (l != i && l != j) partial *= (t - s[l]) / (s[i] - s[l]);
      }
      slope += partial;
      weight *= (t - s[j]) / (s[i] - s[j]);
    }
    c.value[i] = weight;
    c.slope[i] = slope;
  }
  return c;
}

namespace {

// Marks that move at a run's start, beyond round-off, were not held before it.
bool StartsAtRest(const std::vector<Eigen::Matrix3Xd>& velocity) {
  constexpr double kRoundOff = 1e-9;  // of the highest speed
  double first = 0.0, highest = 0.0;
  for (const Eigen::Matrix3Xd& v : velocity) {
    if (v.cols() == 0) continue;
    first = std::max(first, v.col(0).norm());
    highest = std::max(highest, v.colwise().norm().maxCoeff());
  }
  return first <= kRoundOff * highest;
}

}  // namespace

bool KnownWhileHeld(const std::string& unit) {
  return unit.find('N') == std::string::npos && unit.find("/s^2") == std::string::npos;
}

SampledModel::SampledModel(const data::Run& run, const std::vector<std::string>& marks,
                           const std::vector<std::string>& quantities)
    : samples_(FromRun(run, marks)) {
  const auto n = static_cast<Eigen::Index>(run.t.size());
  for (const MarkSeries& series : samples_.marks) {
    Eigen::Matrix3Xd v(3, 0);
    if (run.Find(series.name + ".vx") >= 0 && run.Find(series.name + ".vy") >= 0) {
      v = Eigen::Matrix3Xd::Zero(3, n);
      v.row(0) = Eigen::Map<const Eigen::RowVectorXd>(run.Column(series.name + ".vx").data(), n);
      v.row(1) = Eigen::Map<const Eigen::RowVectorXd>(run.Column(series.name + ".vy").data(), n);
    }
    velocity_.push_back(std::move(v));
  }
  samples_.held_before = StartsAtRest(velocity_);
  for (const std::string& name : quantities) {
    const int column = run.Find(name);
    if (column < 0) continue;
    const auto c = static_cast<std::size_t>(column);
    quantities_.push_back({name, run.t, Eigen::Map<const Eigen::VectorXd>(run.columns[c].data(), n),
                           samples_.held_before && KnownWhileHeld(run.quantities[c].units)});
  }
  for (const data::RunEvent& e : run.events) events_.push_back({e.t, e.kind, e.where});
  FindSteps();
}

SampledModel::SampledModel(Observations tracks) : samples_(std::move(tracks)) {
  velocity_.assign(samples_.marks.size(), Eigen::Matrix3Xd(3, 0));
  FindSteps();
}

Stamps EvenStamps(const std::vector<std::string>& marks, double low, double high, double step) {
  Stamps stamps;
  stamps.marks = marks;
  const auto count = static_cast<std::size_t>(std::max(2.0, std::ceil((high - low) / step) + 1.0));
  std::vector<double> grid(count);
  for (std::size_t i = 0; i < count; ++i) grid[i] = low + static_cast<double>(i) * step;
  stamps.t.assign(marks.size(), grid);
  return stamps;
}

SampledModel::SampledModel(const Model& model, std::span<const double> theta,
                           const std::vector<std::string>& marks, double low, double high,
                           double step) {
  const Stamps stamps = EvenStamps(marks, low, high, step);
  *this = SampledModel(stamps, model.Evaluate(theta, stamps));
}

SampledModel::SampledModel(const Stamps& stamps, Prediction prediction) {
  samples_.has_sigma = false;
  samples_.held_before = prediction.held_before;
  samples_.frame = "model";
  if (prediction.status != ModelStatus::kGood) {
    good_ = false;
    message_ = prediction.message;
    return;
  }
  events_ = std::move(prediction.events);
  for (std::size_t m = 0; m < stamps.marks.size(); ++m) {
    MarkSeries series;
    series.name = stamps.marks[m];
    series.t = stamps.t[m];
    series.p = std::move(prediction.marks[m].p);
    series.cov.resize(6, series.p.cols());
    series.cov.colwise() = (Eigen::Matrix<double, 6, 1>() << 1, 0, 0, 1, 0, 1).finished();
    series.shared.resize(3, 0);
    velocity_.push_back(std::move(prediction.marks[m].v));
    samples_.marks.push_back(std::move(series));
  }
  for (std::size_t q = 0; q < stamps.quantities.size(); ++q) {
    quantities_.push_back({stamps.quantities[q].quantity, stamps.quantities[q].t,
                           std::move(prediction.quantities[q].values), prediction.held_before});
  }
  FindSteps();
}

std::pair<double, double> SampledModel::Span() const {
  double first = samples_.Start(), last = samples_.End();
  for (const QuantitySeries& q : quantities_) {
    if (q.t.empty()) continue;
    first = std::min(first, q.t.front());
    last = std::max(last, q.t.back());
  }
  return {first, last};
}

void SampledModel::FindSteps() {
  for (const MarkSeries& series : samples_.marks) median_step_.push_back(MedianStep(series.t));
}

Eigen::VectorXd ValuesAt(std::span<const double> stamps, std::span<const double> values, bool held,
                         std::span<const double> wanted) {
  const auto n = static_cast<Eigen::Index>(wanted.size());
  Eigen::VectorXd out = Eigen::VectorXd::Constant(n, std::numeric_limits<double>::quiet_NaN());
  if (stamps.size() < 2) return out;
  for (Eigen::Index i = 0; i < n; ++i) {
    const double t = wanted[static_cast<std::size_t>(i)];
    if (t < stamps.front()) {
      if (held) out(i) = values.front();
      continue;
    }
    if (t > stamps.back()) continue;
    const LocalCubic c = CubicAt(stamps, t);
    out(i) = 0.0;
    for (int j = 0; j < c.count; ++j) {
      out(i) += c.value[j] * values[c.first + static_cast<std::size_t>(j)];
    }
  }
  return out;
}

Eigen::VectorXd SampledModel::QuantityAt(const std::string& name,
                                         const std::vector<double>& t) const {
  const auto found = std::find_if(quantities_.begin(), quantities_.end(),
                                  [&](const QuantitySeries& q) { return q.name == name; });
  if (found == quantities_.end()) return ValuesAt({}, {}, false, t);
  const Eigen::VectorXd& values = found->values;
  return ValuesAt(found->t, {values.data(), static_cast<std::size_t>(values.size())}, found->held,
                  t);
}

Prediction SampledModel::Evaluate(std::span<const double>, const Stamps& stamps) const {
  Prediction out;
  out.events = events_;
  for (std::size_t m = 0; m < stamps.marks.size(); ++m) {
    const int index = samples_.FindMark(stamps.marks[m]);
    if (index < 0) {
      std::vector<std::string> names;
      for (const MarkSeries& s : samples_.marks) names.push_back(s.name);
      throw Error("the reference has no mark '" + stamps.marks[m] + "'", "marks",
                  "it has " + JoinWords(names));
    }
    const MarkSeries& s = samples_.marks[static_cast<std::size_t>(index)];
    const Eigen::Matrix3Xd& v = velocity_[static_cast<std::size_t>(index)];
    const double widest = kMaxGap * median_step_[static_cast<std::size_t>(index)];
    const auto n = static_cast<Eigen::Index>(stamps.t[m].size());
    MarkMotion motion;
    motion.p = Eigen::Matrix3Xd::Zero(3, n);
    motion.v = Eigen::Matrix3Xd::Zero(3, n);
    motion.known.assign(stamps.t[m].size(), 0);
    if (samples_.has_sigma) motion.cov = Eigen::Matrix<double, 6, Eigen::Dynamic>::Zero(6, n);
    for (Eigen::Index i = 0; i < n && s.size() >= 2; ++i) {
      const double t = stamps.t[m][static_cast<std::size_t>(i)];
      auto& known = motion.known[static_cast<std::size_t>(i)];
      if (t < s.t.front()) {
        if (!samples_.held_before) continue;
        motion.p.col(i) = s.p.col(0);
        known = 1;
        continue;
      }
      if (t > s.t.back()) continue;
      const std::size_t after = std::min<std::size_t>(
          static_cast<std::size_t>(std::upper_bound(s.t.begin(), s.t.end(), t) - s.t.begin()),
          s.size() - 1);
      const double gap = s.t[after] - s.t[after - 1];
      if (gap > widest) continue;
      known = 1;
      if (v.cols() > 0) {  // cubic Hermite
        const auto a = static_cast<Eigen::Index>(after - 1), b = static_cast<Eigen::Index>(after);
        const double u = (t - s.t[after - 1]) / gap;
        const double h00 = (1 + 2 * u) * (1 - u) * (1 - u), h01 = u * u * (3 - 2 * u);
        const double h10 = gap * u * (1 - u) * (1 - u), h11 = -gap * u * u * (1 - u);
        motion.p.col(i) = h00 * s.p.col(a) + h10 * v.col(a) + h01 * s.p.col(b) + h11 * v.col(b);
        const double d = 6 * u * (1 - u) / gap;
        motion.v.col(i) = d * (s.p.col(b) - s.p.col(a)) + (1 - u) * (1 - 3 * u) * v.col(a) +
                          u * (3 * u - 2) * v.col(b);
        continue;
      }
      const LocalCubic c = CubicAt(s.t, t);
      for (int j = 0; j < c.count; ++j) {
        const auto from = static_cast<Eigen::Index>(c.first) + j;
        motion.p.col(i) += c.value[j] * s.p.col(from);
        motion.v.col(i) += c.slope[j] * s.p.col(from);
        if (samples_.has_sigma) {
          motion.cov.col(i) += c.value[j] * c.value[j] * s.cov.col(from);
        }
      }
    }
    out.marks.push_back(std::move(motion));
  }
  for (const QuantityStamps& q : stamps.quantities) {
    out.quantities.push_back({q.key, QuantityAt(q.quantity, q.t)});
  }
  return out;
}

}  // namespace unfurl::correlate
