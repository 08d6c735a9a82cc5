#include "correlate/modes/decay_judges.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

#include "base/number.h"
#include "base/statistics.h"

namespace unfurl::correlate {

namespace {

// The stamp from which on the strongest mode has half of its energy left.
double HalfTime(const DecayFit& fit) {
  const auto strongest =
      std::max_element(fit.modes.begin(), fit.modes.end(),
                       [](const Mode& a, const Mode& b) { return a.share < b.share; });
  const double decay = -strongest->pole.real();
  return decay > 0.0 ? fit.start + 0.5 * std::numbers::ln2 / decay
                     : std::numeric_limits<double>::infinity();
}

std::vector<DecaySignal> From(std::span<const DecaySignal> signals, double stamp) {
  std::vector<DecaySignal> out;
  for (const DecaySignal& s : signals) {
    const auto first = std::lower_bound(s.t.begin(), s.t.end(), stamp) - s.t.begin();
    out.push_back(
        {s.name, {s.t.begin() + first, s.t.end()}, {s.value.begin() + first, s.value.end()}, {}});
    if (!s.sigma.empty()) out.back().sigma.assign(s.sigma.begin() + first, s.sigma.end());
  }
  return out;
}

// One number of a mode, in the whole and in the later part.
struct Compared {
  double whole, sigma, later, later_sigma;
  double difference() const { return later - whole; }
  // Of the difference, in its standard errors: the later part's samples are among the whole's.
  double times() const {
    constexpr double kLeast = 0.25;  // of the later's variance: what is left of it by rounding
    const double variance =
        std::max(later_sigma * later_sigma - sigma * sigma, kLeast * later_sigma * later_sigma);
    return variance > 0.0 ? std::abs(difference()) / std::sqrt(variance) : 0.0;
  }
};

// Whether two shapes are one within their errors; of a single signal they always are.
bool OneShape(const Mode& a, const Mode& b) {
  constexpr double kSigmas = 3.0;  // chance has a difference beyond those once in some hundreds
  const std::complex<double> factor = a.shape.dot(b.shape) / a.shape.squaredNorm();
  const double off = (b.shape - factor * a.shape).squaredNorm();
  const double error =
      std::norm(factor) * a.shape_sigma.squaredNorm() + b.shape_sigma.squaredNorm();
  return a.shape.size() == 1 || off <= kSigmas * kSigmas * error;
}

}  // namespace

std::string OverlappingModes(const DecayFit& fit) {
  std::string out;
  const Mode* before = nullptr;
  for (const Mode& m : fit.modes) {  // by rising frequency
    if (before != nullptr &&
        m.frequency - before->frequency <
            m.damping * m.frequency + before->damping * before->frequency &&
        OneShape(*before, m)) {
      out += fmt::format("{}{} and {} Hz", out.empty() ? "" : ", ", Number(before->frequency, 5),
                         Number(m.frequency, 5));
    }
    before = &m;
  }
  return out;
}

std::string SteadyMotions(std::span<const DecaySignal> signals, const DecayFit& fit) {
  constexpr double kSigmas = 2.0;  // 95% of what its damping may be
  constexpr double kFaded = 0.1;   // of the amplitude: less in a whole record is no decay to see
  double end = fit.start;
  for (const DecaySignal& s : signals) {
    if (!s.t.empty()) end = std::max(end, s.t.back());
  }
  std::string out;
  for (const Mode& m : fit.modes) {
    const double most = (m.damping + kSigmas * m.damping_sigma) * std::abs(m.pole);
    if (-std::expm1(-most * (end - fit.start)) > kFaded) continue;
    out += (out.empty() ? "" : ", ") + Number(m.frequency, 5);
  }
  return out;
}

std::string WidenByLaterPart(std::span<const DecaySignal> signals, const DecayOptions& options,
                             double chance, DecayFit* fit) {
  if (!fit->Usable() || fit->modes.empty()) return "";
  constexpr double kSeen = 9.0;  // of an amplitude's square over its error's: three of those
  const double half = HalfTime(*fit);
  std::vector<std::size_t> which;
  std::vector<std::complex<double>> poles;
  for (std::size_t k = 0; k < fit->modes.size(); ++k) {
    const Mode& m = fit->modes[k];
    if (m.evidence * std::exp(2.0 * m.pole.real() * (half - fit->start)) < kSeen) continue;
    which.push_back(k);
    poles.push_back(m.pole);
  }
  if (poles.empty()) return "";
  const DecayFit later = FitDecay(From(signals, half), poles, options);
  if (later.status == DecayStatus::kNotConverged || later.status == DecayStatus::kNothingFound) {
    return "it does not hold these by itself";
  }
  if (!later.Usable() || later.modes.size() != which.size()) return "";

  const double far = NormalQuantile(1.0 - 0.5 * chance / (2.0 * static_cast<double>(which.size())));
  Eigen::VectorXd added = Eigen::VectorXd::Zero(2 * static_cast<Eigen::Index>(fit->modes.size()));
  double most = 0.0;
  std::string words;
  for (std::size_t i = 0; i < which.size(); ++i) {
    Mode& m = fit->modes[which[i]];
    const Mode& l = later.modes[i];
    const Compared f{m.frequency, m.frequency_sigma, l.frequency, l.frequency_sigma};
    const Compared z{m.damping, m.damping_sigma, l.damping, l.damping_sigma};
    if (std::max(f.times(), z.times()) <= far) continue;
    const auto row = 2 * static_cast<Eigen::Index>(which[i]);
    added(row) = f.difference();
    added(row + 1) = z.difference();
    m.frequency_sigma = std::hypot(m.frequency_sigma, f.difference());
    m.damping_sigma = std::hypot(m.damping_sigma, z.difference());
    if (std::max(f.times(), z.times()) <= most) continue;
    most = std::max(f.times(), z.times());
    words = f.times() >= z.times()
                ? fmt::format("{} Hz becomes {}", Number(f.whole, 5),
                              NumberWithError(f.later, f.later_sigma))
                : fmt::format("at {} Hz a damping of {}% becomes {}", Number(f.whole, 5),
                              Number(100.0 * z.whole, 3),
                              NumberWithError(100.0 * z.later, 100.0 * z.later_sigma));
  }
  if (fit->covariance.rows() == added.size()) fit->covariance += added * added.transpose();
  return words;
}

}  // namespace unfurl::correlate
