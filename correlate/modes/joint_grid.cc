#include "correlate/modes/joint_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "base/dense.h"
#include "correlate/sampled_model.h"

namespace unfurl::correlate {

namespace {

constexpr double kLobes = 8.0;  // of a low pass, to either side: 60 dB and a narrow edge

// A sinc under a Hann window, of a low pass that cuts at half of a rate 1 / width; x from its
// middle [width].
double Kernel(double x) {
  if (std::abs(x) >= kLobes) return 0.0;
  const double y = std::numbers::pi * x;
  const double sinc = std::abs(y) < 1e-9 ? 1.0 : std::sin(y) / y;
  return sinc * (0.5 + 0.5 * std::cos(y / kLobes));
}

// The mean of the steps that are no gaps: stamps may be rounded, and their median step with them.
double MeanStep(const std::vector<double>& t) {
  const double widest = SampledModel::kMaxGap * MedianStep(t);
  double sum = 0.0, count = 0.0;
  for (std::size_t i = 1; i < t.size(); ++i) {
    if (t[i] - t[i - 1] > widest) continue;
    sum += t[i] - t[i - 1];
    count += 1.0;
  }
  return sum / std::max(1.0, count);
}

// One signal between its gaps, asked for at any instant.
class Sampler {
 public:
  Sampler(const DecaySignal& signal, double step) : signal_(signal), own_(MeanStep(signal.t)) {
    faster_ = step > 1.9 * own_;  // of twice the rate, or nearly: else the cubic will do
    width_ = step;
  }

  // NaN: not known there. Instants are asked for in rising order.
  double At(double t) {
    const std::vector<double>& s = signal_.t;
    while (next_ < s.size() && s[next_] < t) ++next_;
    return faster_ ? Filtered(t) : Interpolated(t);
  }

 private:
  bool Gap(std::size_t i) const {
    return signal_.t[i] - signal_.t[i - 1] > SampledModel::kMaxGap * own_;
  }
  double Interpolated(double t) const {
    constexpr double kSame = 1e-6;  // of a step: on the stamp
    const std::vector<double>& s = signal_.t;
    for (const std::size_t i : {next_, next_ - 1}) {
      if (i < s.size() && std::abs(s[i] - t) <= kSame * own_) return signal_.value[i];
    }
    if (next_ == 0 || next_ >= s.size() || Gap(next_)) return kNone;
    const LocalCubic c = CubicAt(s, t);
    double sum = 0.0;
    for (int j = 0; j < c.count; ++j) {
      sum += c.value[j] * signal_.value[c.first + static_cast<std::size_t>(j)];
    }
    return sum;
  }
  double Filtered(double t) const {
    const std::vector<double>& s = signal_.t;
    const double half = kLobes * width_;
    if (t - half < s.front() || t + half > s.back()) return kNone;
    double sum = 0.0, weights = 0.0;
    std::size_t first = next_;
    while (first > 0 && s[first - 1] > t - half) --first;
    for (std::size_t i = first; i < s.size() && s[i] < t + half; ++i) {
      if (i > first && Gap(i)) return kNone;
      const double w = Kernel((s[i] - t) / width_);
      sum += w * signal_.value[i];
      weights += w;
    }
    return sum / weights;
  }

  static constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  const DecaySignal& signal_;
  double own_;  // mean step [s]
  double width_ = 0.0;
  bool faster_ = false;
  std::size_t next_ = 0;  // first stamp that is not before the instant
};

// Takes each signal's straight line out, over all stretches, and scales it to an RMS of 1.
void Normalise(JointSignals* joint) {
  if (joint->stretches.empty()) return;
  const Eigen::Index l = joint->stretches.front().value.rows();
  const auto n = static_cast<double>(joint->samples());
  double middle = 0.0;
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(l);
  for (const auto& s : joint->stretches) {
    const auto count = static_cast<double>(s.value.cols());
    middle += count * (s.start + 0.5 * joint->step * (count - 1.0)) / n;
    mean += s.value.rowwise().sum() / n;
  }
  Eigen::VectorXd slope = Eigen::VectorXd::Zero(l);
  double square = 0.0;
  for (const auto& s : joint->stretches) {
    for (Eigen::Index i = 0; i < s.value.cols(); ++i) {
      const double t = s.start + joint->step * static_cast<double>(i) - middle;
      slope += t * (s.value.col(i) - mean);
      square += t * t;
    }
  }
  if (square > 0.0) slope /= square;
  const Eigen::VectorXd level = mean;
  Eigen::VectorXd squares = Eigen::VectorXd::Zero(l);
  Eigen::VectorXd largest = Eigen::VectorXd::Zero(l);
  for (auto& s : joint->stretches) {
    largest = largest.cwiseMax(s.value.cwiseAbs().rowwise().maxCoeff());
    for (Eigen::Index i = 0; i < s.value.cols(); ++i) {
      const double t = s.start + joint->step * static_cast<double>(i) - middle;
      s.value.col(i) -= level + t * slope;
    }
    squares += s.value.rowwise().squaredNorm();
  }
  constexpr double kRoundOff = 1e-12;  // of a constant's size
  joint->scale.clear();
  for (Eigen::Index j = 0; j < l; ++j) {
    double rms = std::sqrt(squares(j) / n);
    if (!(rms > kRoundOff * largest(j))) rms = 0.0;
    joint->scale.push_back(rms);
    for (auto& s : joint->stretches) s.value.row(j) *= rms > 0.0 ? 1.0 / rms : 0.0;
  }
}

}  // namespace

Eigen::Index JointSignals::samples() const {
  Eigen::Index n = 0;
  for (const Stretch& s : stretches) n += s.value.cols();
  return n;
}

double JointSignals::Duration() const { return step * static_cast<double>(samples()); }

JointSignals OnJointGrid(std::span<const DecaySignal> signals) {
  JointSignals out;
  double first = -std::numeric_limits<double>::infinity(), last = -first;
  for (const DecaySignal& s : signals) {
    if (s.t.size() < 4) return {};  // a cubic's
    out.step = std::max(out.step, MeanStep(s.t));
    first = std::max(first, s.t.front());
    last = std::min(last, s.t.back());
  }
  if (signals.empty() || !(last > first)) return {};
  std::vector<Sampler> samplers;
  for (const DecaySignal& s : signals) samplers.emplace_back(s, out.step);
  const auto l = static_cast<Eigen::Index>(signals.size());
  const auto count = static_cast<Eigen::Index>((last - first) / out.step + 1e-6) + 1;
  Eigen::MatrixXd all(l, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const double t = first + out.step * static_cast<double>(i);
    for (Eigen::Index j = 0; j < l; ++j) all(j, i) = samplers[static_cast<std::size_t>(j)].At(t);
  }
  for (Eigen::Index i = 0, from = 0; i <= count; ++i) {
    if (i < count && all.col(i).allFinite()) continue;
    if (i > from) {
      out.stretches.push_back(
          {first + out.step * static_cast<double>(from), all.middleCols(from, i - from)});
    }
    from = i + 1;
  }
  Normalise(&out);
  return out;
}

JointSignals Decimated(const JointSignals& joint, Eigen::Index factor) {
  JointSignals out;
  out.step = joint.step * static_cast<double>(factor);
  out.scale = joint.scale;
  const auto half = static_cast<Eigen::Index>(kLobes) * factor;
  Eigen::VectorXd h(2 * half + 1);
  for (Eigen::Index i = 0; i < h.size(); ++i) {
    h(i) = Kernel(static_cast<double>(i - half) / static_cast<double>(factor));
  }
  h /= h.sum();
  for (const auto& s : joint.stretches) {
    const Eigen::Index n = s.value.cols();
    if (n < h.size()) continue;
    const Eigen::Index count = (n - h.size()) / factor + 1;
    JointSignals::Stretch slow{s.start + joint.step * static_cast<double>(half),
                               Eigen::MatrixXd(s.value.rows(), count)};
    for (Eigen::Index i = 0; i < count; ++i) {
      slow.value.col(i) = s.value.middleCols(i * factor, h.size()) * h;
    }
    out.stretches.push_back(std::move(slow));
  }
  return out;
}

}  // namespace unfurl::correlate
