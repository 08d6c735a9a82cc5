// A channel cut, set to another clock, with another noise, without some of its readings.
#include <algorithm>
#include <cmath>

#include "base/statistics.h"
#include "correlate/residual/channel.h"
#include "correlate/tolerance.h"

namespace unfurl::correlate {

void LeaveOutHeld(ChannelRecord* record) {
  record->held = FindHeldRuns(record->t, record->y);
  if (record->held.empty()) return;
  LeaveOut(record->held, &record->t);
  for (Eigen::VectorXd* v : {&record->y, &record->sigma}) {
    std::vector<double> values(v->begin(), v->end());
    LeaveOut(record->held, &values);
    *v = Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
  }
}

std::shared_ptr<const ResidualKind> Channel::Within(const Window& window) const {
  ChannelRecord part = record_;
  part.t.clear();
  std::vector<Eigen::Index> keep;
  for (std::size_t i = 0; i < record_.t.size(); ++i) {
    if (!window.Contains(placed_[i])) continue;
    keep.push_back(static_cast<Eigen::Index>(i));
    part.t.push_back(record_.t[i]);
  }
  constexpr std::size_t kFewest = 4;  // of a cubic, as the constructor asks
  if (keep.size() < kFewest) return nullptr;
  part.y = record_.y(keep);
  part.sigma = record_.sigma(keep);
  auto out = std::make_shared<Channel>(std::move(part));
  out->has_sigma_ = has_sigma_;
  for (const Eigen::Index i : keep) {
    if (!aside_.empty()) out->aside_.push_back(aside_[static_cast<std::size_t>(i)]);
  }
  return out;
}

std::shared_ptr<const ResidualKind> Channel::WithoutDrift(double drift, double pivot) const {
  const double rate = 1.0 / (1.0 + drift);
  ChannelRecord moved = record_;
  for (double& t : moved.t) t = pivot + (t - pivot) * rate;
  moved.pivot = pivot + (moved.pivot - pivot) * rate;
  moved.delay.mean *= rate;
  moved.delay.sigma *= rate;
  auto out = std::make_shared<Channel>(std::move(moved));
  out->has_sigma_ = has_sigma_;
  out->aside_ = aside_;
  return out;
}

double Channel::NoiseInUse(double shown) const {
  return std::max(shown, kLoosestTolerance / NoiseOverMotion());
}

double Channel::NoiseOverMotion() const {
  std::vector<double> readings;
  for (std::size_t i = 0; i < record_.t.size(); ++i) {
    if (aside_.empty() || !aside_[i]) readings.push_back(record_.y(static_cast<Eigen::Index>(i)));
  }
  const double motion = std::sqrt(Variance(readings));
  return record_.sigma.mean() / motion;  // readings that never change have been refused
}

std::shared_ptr<const ResidualKind> Channel::Rescaled(const Eigen::VectorXd& residual) const {
  if (has_sigma_) return nullptr;
  const auto readings = residual.head(record_.y.size());
  const double known = static_cast<double>((readings.array() != 0.0).count());
  const double left = std::max(1.0, known - static_cast<double>(fitted_.size()));
  const double factor = NoiseInUse(std::sqrt(readings.squaredNorm() / left));
  constexpr double kSame = 1e-6;  // of what is in use already
  if (!(factor > 0.0) || !std::isfinite(factor) || std::abs(factor - 1.0) < kSame) return nullptr;
  ChannelRecord scaled = record_;
  scaled.sigma *= factor;
  auto out = std::make_shared<Channel>(std::move(scaled));
  out->has_sigma_ = false;
  out->aside_ = aside_;
  return out;
}

std::shared_ptr<const ResidualKind> Channel::Without(
    const std::vector<std::size_t>& samples) const {
  auto out = std::make_shared<Channel>(*this);
  out->aside_.assign(samples.empty() ? 0 : record_.t.size(), 0);
  for (const std::size_t i : samples) out->aside_[i] = 1;
  return out;
}

}  // namespace unfurl::correlate
