#include "correlate/modes/ambient_judges.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/number.h"
#include "base/probability.h"
#include "base/statistics.h"
#include "correlate/modes/lag_covariances.h"

namespace unfurl::correlate {

namespace {

// P(F > f) with d1 and d2 degrees of freedom, by the cube root [Paulson 1942]: to some per cent of
// itself from three degrees on.
double FisherTail(double f, double d1, double d2) {
  const double root = std::cbrt(f), a = 2.0 / (9.0 * d1), b = 2.0 / (9.0 * d2);
  return NormalCdf(-((1.0 - b) * root - (1.0 - a)) / std::sqrt(b * root * root + a));
}

// The strength of all signals together, each over its own, in stretches of a length [s].
Eigen::VectorXd Strengths(const JointSignals& joint, double seconds) {
  const auto length = static_cast<Eigen::Index>(std::max(1.0, seconds / joint.step));
  std::vector<double> out;
  for (const auto& s : joint.stretches) {
    for (Eigen::Index from = 0; from + length <= s.value.cols(); from += length) {
      out.push_back(s.value.middleCols(from, length).squaredNorm() /
                    static_cast<double>(s.value.rows() * length));
    }
  }
  return Eigen::Map<const Eigen::VectorXd>(out.data(), static_cast<Eigen::Index>(out.size()));
}

// Whether the strength differs from eighth to eighth of the record by more than within them:
// analysis of variance of the logarithms of stretches that are four memories long.
void JudgeStrength(const JointSignals& joint, const AmbientOptions& options, AmbientFit* fit) {
  constexpr double kMemories = 4.0;  // apart by as many, strengths are independent [-]
  // Parts: enough to see a change that begins anywhere. In each: so that they scatter [-].
  constexpr Eigen::Index kParts = 8, kFewestEach = 3;
  double memory = 0.0;
  for (const AmbientMode& m : fit->modes) {
    // One that never forgets is no random vibration, and is judged elsewhere.
    if (m.mode.damping > m.mode.damping_sigma) memory = std::max(memory, MemoryOf(m.mode));
  }
  // A hundredth of the record where nothing is known to vibrate: whatever is left forgets by then.
  const double length = std::max(kMemories * memory, 0.01 * fit->duration);
  const Eigen::VectorXd strength = Strengths(joint, length);
  const Eigen::Index each = strength.size() / kParts;
  if (each < kFewestEach || !(strength.minCoeff() > 0.0)) return;
  const Eigen::VectorXd y = strength.head(each * kParts).array().log();
  double within = 0.0;
  Eigen::VectorXd mean(kParts);
  for (Eigen::Index k = 0; k < kParts; ++k) {
    const auto own = y.segment(k * each, each);
    mean(k) = own.mean();
    within += (own.array() - mean(k)).square().sum();
  }
  const double between = static_cast<double>(each) * (mean.array() - mean.mean()).square().sum();
  const double d1 = kParts - 1, d2 = static_cast<double>(kParts * (each - 1));
  fit->strength_ratio = std::exp(0.5 * (mean.maxCoeff() - mean.minCoeff()));
  if (!(within > 0.0)) return;
  fit->stationary = FisherTail((between / d1) / (within / d2), d1, d2);
  if (fit->stationary >= options.chance) return;
  fit->doubts.push_back(fmt::format(
      "The record is not stationary: the strongest eighth is {:.2g} times as strong as the weakest "
      "(chance {:.1g}). Frequencies and dampings hold if only the strength of what drives the "
      "structure changed",
      fit->strength_ratio, fit->stationary));
}

// Real weights that show a mode: its shape, turned so that as much of it as can be is real.
Eigen::VectorXd WeightsOf(const Mode& mode, const std::vector<double>& scale) {
  Eigen::VectorXcd shape = mode.shape;
  for (Eigen::Index j = 0; j < shape.size(); ++j) shape(j) /= scale[static_cast<std::size_t>(j)];
  const std::complex<double> square = shape.transpose() * shape;
  const Eigen::VectorXd real = (shape * std::polar(1.0, -0.5 * std::arg(square))).real();
  return real / std::max(real.norm(), 1e-300);
}

// A mode that a machine may have made.
void JudgeHarmonic(const JointSignals& joint, const AmbientOptions& options, double width,
                   const AmbientFit& fit, AmbientMode* m) {
  // Half the half-power width in bins of the record below which it looks like a line: the
  // ordinates about a line's would be a fifth of the mode's own peak.
  constexpr double kResolved = 3.0;
  const double f = m->mode.frequency;
  m->bandwidth_bins = std::max(0.0, m->mode.damping) * f * fit.duration;
  // At its likeliest narrowest.
  const double narrowest = (m->mode.damping - 2.0 * m->mode.damping_sigma) * f * fit.duration;
  for (const SteadyLine& line : fit.lines) {
    if (std::abs(line.frequency - f) > std::max(width, 2.0 / fit.duration)) continue;
    m->harmonic = narrowest < kResolved;
    m->doubts.push_back(
        m->harmonic
            ? fmt::format(
                  "something drives it at a steady {} Hz: a machine's frequency rather than "
                  "the structure's",
                  Number(line.frequency, 5))
            : fmt::format("something drives the structure at a steady {} Hz, within its width; its "
                          "values may be drawn to that",
                          Number(line.frequency, 5)));
    return;
  }
  const double length = 2.0 * std::max(width, 20.0 / fit.duration);
  Steadiness s = SteadinessOf(joint, WeightsOf(m->mode, joint.scale), f, length);
  if (s.sigma > 0.0) {
    m->steadiness = s.value;
    // No more independent amplitudes than the mode has memories.
    const double memories = fit.duration / std::max(MemoryOf(m->mode), joint.step);
    const double sigma = std::max(s.sigma, 2.0 / std::sqrt(memories));
    const auto modes = static_cast<double>(fit.modes.size());
    if (s.value < 1.0 - NormalQuantile(1.0 - options.chance / modes) * sigma) {
      m->harmonic = true;
      m->doubts.push_back(fmt::format(
          "its amplitude is too steady for a structure that noise drives ({:.2f} of the "
          "variance): a machine's, whose frequency wanders",
          s.value));
      return;
    }
  }
  if (m->bandwidth_bins < kResolved) {
    m->harmonic = true;
    m->doubts.push_back(fmt::format(
        "it is as narrow as the record resolves ({:.2g} mHz): a machine's frequency cannot be told "
        "from it, nor its damping",
        1e3 / fit.duration));
  }
}

// A mode that what is not linear may have made of a stronger one: a coarse or clipped reading, a
// joint. The n-th multiple of a random vibration is at most as strong as that of a square wave, an
// n-th of it, and at least as wide as it is.
void JudgeMultiple(const AmbientOptions& options, const AmbientFit& fit, AmbientMode* m) {
  constexpr int kHighest = 9;  // a ninth of the amplitude, an eightieth of the variance
  const Mode& own = m->mode;
  const double modes = static_cast<double>(fit.modes.size());
  const double far = NormalQuantile(1.0 - 0.5 * options.chance / (modes * kHighest));
  for (const AmbientMode& other : fit.modes) {
    const Mode& of = other.mode;
    const double n = std::round(own.frequency / of.frequency);
    if (n < 2.0 || n > kHighest || own.share * n * n > of.share) continue;
    const double sigma = std::hypot(own.frequency_sigma, n * of.frequency_sigma);
    if (std::abs(own.frequency - n * of.frequency) > far * sigma) continue;
    const double widest = (own.damping + 2.0 * own.damping_sigma) * own.frequency;
    if (widest < (of.damping - 2.0 * of.damping_sigma) * of.frequency) continue;
    m->doubts.push_back(fmt::format(
        "it lies at {:.0f} times the frequency of a stronger one, {} Hz: a coarse or clipped "
        "reading, or a joint that is not linear, shows as much",
        n, Number(of.frequency, 4)));
    return;
  }
}

}  // namespace

double MemoryOf(const Mode& mode) {
  constexpr double kLeast = 1e-4;  // a damping below which it would outlast any record
  return 1.0 / (2.0 * std::max(kLeast, mode.damping) * std::abs(mode.pole));
}

void JudgeLeftOut(AmbientFit* fit) {
  std::vector<AmbientSwing> kept;
  std::stable_sort(fit->left_out.begin(), fit->left_out.end(),
                   [](const AmbientSwing& a, const AmbientSwing& b) { return a.share > b.share; });
  // Within the wider half-width of two they are one motion, of which a high order makes several.
  auto one = [](double f, double width, double g, double other) {
    return std::abs(f - g) < std::max(width * f, other * g);
  };
  for (const AmbientSwing& s : fit->left_out) {
    const bool mode = std::any_of(fit->modes.begin(), fit->modes.end(), [&](const AmbientMode& m) {
      return one(s.frequency, s.damping, m.mode.frequency, m.mode.damping);
    });
    const bool twin = std::any_of(kept.begin(), kept.end(), [&](const AmbientSwing& k) {
      return one(s.frequency, s.damping, k.frequency, k.damping);
    });
    if (!mode && !twin) kept.push_back(s);
  }
  fit->left_out = std::move(kept);
  for (const AmbientSwing& s : fit->left_out) {
    fit->doubts.push_back(fmt::format(
        "A motion about {} Hz, damped by some {:.2g}%, goes on all through the record with {:.0f}% "
        "of the variance and is none of the modes: its pole does not stay where it is from order "
        "to order. A longer record may make a mode of it; or it is the colour of what drives the "
        "structure",
        Number(s.frequency, 3), 100.0 * s.damping, std::clamp(100.0 * s.share, 1.0, 100.0)));
  }
}

void JudgeRecord(const JointSignals& joint, const AmbientOptions& options, AmbientFit* fit) {
  for (const SteadyLine& line : FindSteadyLines(joint, options.chance)) {
    if (line.frequency >= fit->low && line.frequency <= fit->high) fit->lines.push_back(line);
  }
  if (!fit->lines.empty()) {
    std::string list;
    for (const SteadyLine& line : fit->lines) {
      list += (list.empty() ? "" : ", ") + Number(line.frequency, 5);
    }
    fit->doubts.push_back("Something drives the structure at a steady frequency: " + list + " Hz");
  }
  JudgeStrength(joint, options, fit);
}

void JudgeModes(const JointSignals& joint, const AmbientOptions& options, AmbientFit* fit) {
  // Of a damping known worse than to a quarter the interval is not symmetric any more, and 95% of
  // it is only roughly that.
  constexpr double kRough = 0.25;
  const auto modes = static_cast<double>(fit->modes.size());
  for (AmbientMode& m : fit->modes) {
    const double width = std::max(0.0, m.mode.damping) * m.mode.frequency;
    JudgeHarmonic(joint, options, width, *fit, &m);
    if (!m.harmonic) JudgeMultiple(options, *fit, &m);
    if (!m.harmonic && m.mode.damping_sigma > kRough * m.mode.damping) {
      const double times = std::pow(m.mode.damping_sigma / (0.1 * m.mode.damping), 2);
      m.doubts.push_back(fmt::format(
          "the record is too short for its damping: one {:.2g} times as long would tell it to a "
          "tenth",
          times));
    }
    const double far = NormalQuantile(1.0 - 0.5 * options.chance / modes);
    if (!m.harmonic && std::abs(m.shift) > far * m.shift_sigma) {
      m.doubts.push_back(
          fmt::format("its frequency moves by {} Hz from the record's first half to "
                      "its second: the structure changes, or is not linear",
                      NumberWithError(m.shift, m.shift_sigma)));
    }
  }
}

}  // namespace unfurl::correlate
