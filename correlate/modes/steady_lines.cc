#include "correlate/modes/steady_lines.h"

#include <algorithm>
#include <cmath>
#include <complex>

#include "base/dense.h"
#include "correlate/modes/turn.h"
#include "correlate/spectra/fft.h"
#include "correlate/window.h"

namespace unfurl::correlate {

namespace {

const JointSignals::Stretch& Longest(const JointSignals& joint) {
  return *std::max_element(
      joint.stretches.begin(), joint.stretches.end(),
      [](const auto& a, const auto& b) { return a.value.cols() < b.value.cols(); });
}

// Power of a row, windowed, at the bins of its transform.
std::vector<double> Periodogram(const Eigen::VectorXd& row, const std::vector<double>& window) {
  std::vector<double> x(window.size());
  for (std::size_t i = 0; i < x.size(); ++i) x[i] = window[i] * row(static_cast<Eigen::Index>(i));
  std::vector<double> out;
  for (const std::complex<double>& v : RealFft(x)) out.push_back(std::norm(v));
  return out;
}

}  // namespace

std::vector<SteadyLine> FindSteadyLines(const JointSignals& joint, double chance) {
  // Ordinates to either side, those next to the peak, which a Hann window gives to it, left out.
  // The window correlates neighbours: sixteen are worth eleven independent ones.
  constexpr std::size_t kNear = 2, kFar = 10;
  constexpr double kWorth = 11.0;
  std::vector<SteadyLine> out;
  if (joint.stretches.empty()) return out;
  const auto& s = Longest(joint);
  const auto n = static_cast<std::size_t>(s.value.cols());
  if (n < 8 * kFar) return out;
  const std::vector<double> window = WindowValues(SpectralWindow::kHann, n);
  const double gain = CoherentGain(SpectralWindow::kHann) * static_cast<double>(n) / 2.0;
  const auto tests = 0.5 * static_cast<double>(n) * static_cast<double>(s.value.rows());
  for (Eigen::Index j = 0; j < s.value.rows(); ++j) {
    if (!(joint.scale[static_cast<std::size_t>(j)] > 0.0)) continue;
    const std::vector<double> power = Periodogram(s.value.row(j).transpose(), window);
    for (std::size_t k = kFar + 2; k + kFar < power.size(); ++k) {
      if (power[k] < power[k - 1] || power[k] < power[k + 1]) continue;
      double about = 0.0;
      for (std::size_t d = kNear + 1; d <= kFar; ++d) about += power[k - d] + power[k + d];
      about /= 2.0 * static_cast<double>(kFar - kNear);
      const double ratio = power[k] / about;
      const double p = tests * std::pow(1.0 + ratio / kWorth, -kWorth);
      if (!(p < chance)) continue;
      // Its place between the bins, from its higher neighbour.
      const bool up = power[k + 1] > power[k - 1];
      const double beside = std::sqrt(std::max(power[k - 1], power[k + 1]) / power[k]);
      const double off = BinOffset(SpectralWindow::kHann, beside) * (up ? 1.0 : -1.0);
      SteadyLine line;
      line.frequency = (static_cast<double>(k) + off) / (static_cast<double>(n) * joint.step);
      line.chance = std::min(1.0, p);
      line.signal = j;
      line.amplitude = joint.scale[static_cast<std::size_t>(j)] * std::sqrt(power[k]) / gain /
                       WindowResponse(SpectralWindow::kHann, off);
      out.push_back(line);
    }
  }
  // One line in several signals is one, and the clearest says where it is.
  std::stable_sort(out.begin(), out.end(),
                   [](const SteadyLine& a, const SteadyLine& b) { return a.chance < b.chance; });
  const double apart = 2.0 / (static_cast<double>(n) * joint.step);
  std::vector<SteadyLine> kept;
  for (const SteadyLine& line : out) {
    const bool known = std::any_of(kept.begin(), kept.end(), [&](const SteadyLine& other) {
      return std::abs(other.frequency - line.frequency) < apart;
    });
    if (!known) kept.push_back(line);
  }
  std::sort(kept.begin(), kept.end(),
            [](const SteadyLine& a, const SteadyLine& b) { return a.frequency < b.frequency; });
  return kept;
}

Steadiness SteadinessOf(const JointSignals& joint, const Eigen::VectorXd& shape, double frequency,
                        double width) {
  // Fewer amplitudes say nothing of their distribution.
  constexpr double kFewest = 20.0;
  Steadiness out;
  if (!(width > 0.0)) return out;
  // Means over 1 / width, weighted by a Hann window, one after another: independent but for a sixth
  // of their variance.
  const auto length = static_cast<Eigen::Index>(std::max(8.0, 2.0 / (width * joint.step)));
  const std::vector<double> window =
      WindowValues(SpectralWindow::kHann, static_cast<std::size_t>(length));
  double count = 0.0, sum = 0.0, squares = 0.0;
  for (const auto& s : joint.stretches) {
    const Eigen::RowVectorXd q = shape.transpose() * s.value;
    for (Eigen::Index from = 0; from + length <= q.size(); from += length) {
      std::complex<double> z = 0.0;
      for (Eigen::Index i = 0; i < length; ++i) {
        const double angle = kTau * frequency * joint.step * static_cast<double>(from + i);
        z += window[static_cast<std::size_t>(i)] * q(from + i) * std::polar(1.0, -angle);
      }
      const double power = std::norm(z);
      count += 1.0;
      sum += power;
      squares += power * power;
    }
  }
  if (count < kFewest) return out;
  const double mean = sum / count;
  out.value = (squares / count - mean * mean) / (mean * mean);
  // Of exponential variables, whose variance is their squared mean: that of the ratio is 4 / n.
  out.sigma = 2.0 / std::sqrt(count);
  return out;
}

}  // namespace unfurl::correlate
