#include "correlate/modes/identify.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/error.h"
#include "correlate/modes/decay_judges.h"
#include "correlate/modes/joint_grid.h"

namespace unfurl::correlate {

namespace {

// A structure that noise drives shakes all through: mean square of the first half of all signals
// over that of the second, each signal over its own.
double Fading(std::span<const DecaySignal> signals) {
  const JointSignals joint = OnJointGrid(signals);
  double half[2] = {0.0, 0.0};
  const Eigen::Index n = joint.samples();
  Eigen::Index done = 0;
  for (const auto& s : joint.stretches) {
    for (Eigen::Index i = 0; i < s.value.cols(); ++i, ++done) {
      half[2 * done < n ? 0 : 1] += s.value.col(i).squaredNorm();
    }
  }
  return half[1] > 0.0 ? half[0] / half[1] : 1.0;
}

// The ambient record's modes where a free decay's would stand.
ModalFit AsModalFit(const AmbientFit& from) {
  ModalFit out;
  out.decay.status = from.status;
  out.decay.message = from.message;
  for (const AmbientMode& m : from.modes) {
    out.decay.modes.push_back(m.mode);
    out.decay.explained += m.mode.share;
  }
  out.decay.explained = std::min(1.0, out.decay.explained);
  out.poles = from.poles;
  out.step = from.step;
  out.low = from.low;
  out.high = from.high;
  return out;
}

void TakeForAmbient(std::span<const DecaySignal> signals, const AmbientOptions& options,
                    Identification* out) {
  out->excitation = Excitation::kAmbient;
  out->ambient = IdentifyAmbientModes(signals, options);
  out->fit = AsModalFit(*out->ambient);
}

}  // namespace

Excitation ParseExcitation(const std::string& text, const std::string& where) {
  for (const Excitation e : {Excitation::kByTheData, Excitation::kDecay, Excitation::kAmbient}) {
    if (text == Name(e)) return e;
  }
  throw Error("a record is not '" + text + "'", where, "say auto, decay or ambient");
}

namespace {

// The samples that the fit was made to.
std::vector<DecaySignal> UpTo(std::span<const DecaySignal> signals, const ModalFit& fit) {
  std::vector<DecaySignal> out(signals.begin(), signals.end());
  for (DecaySignal& s : out) {
    if (!fit.cut) break;
    const auto n =
        static_cast<std::size_t>(std::upper_bound(s.t.begin(), s.t.end(), fit.until) - s.t.begin());
    s.t.resize(n);
    s.value.resize(n);
    if (!s.sigma.empty()) s.sigma.resize(n);
  }
  return out;
}

constexpr double kAllOfIt = 0.9;   // explained [-]
constexpr double kByNoise = 0.01;  // chance below which what is left is no noise

void Doubt(const std::string& words, Identification* out) {
  out->why += (out->doubtful ? ". And " : ". But ") + words;
  out->doubtful = true;
}

// A free decay whose sines leave much that is no noise: in so few cycles, say, modes are missed.
void DoubtWhatIsLeft(Identification* out) {
  const DecayFit& fit = out->fit.decay;
  if (!fit.Usable() || out->doubtful || fit.whiteness > kByNoise) return;
  double weakest = 1.0 - kAllOfIt;
  for (const Mode& m : fit.modes) weakest = std::min(weakest, m.share);
  if (1.0 - fit.explained < weakest) return;
  Doubt(fmt::format(
            "its modes explain {:.3g}% of it, and what they leave is no noise and as strong as a "
            "mode: others are missing (of few cycles, or close to these), or it is no free decay, "
            "and the standard errors do not hold",
            100.0 * fit.explained),
        out);
}

// What was taken for a free decay: whether its modes are those of all of it.
void JudgeDecay(std::span<const DecaySignal> signals, const DecayOptions& options,
                Identification* out) {
  DoubtWhatIsLeft(out);
  const std::vector<DecaySignal> fitted = UpTo(signals, out->fit);
  const std::string steady = SteadyMotions(fitted, out->fit.decay);
  if (!steady.empty()) {
    Doubt("what swings at " + steady +
              " Hz does not fade: something that goes on, a machine or the mains, looks so",
          out);
  }
  const std::string pairs = OverlappingModes(out->fit.decay);
  if (!pairs.empty()) {
    Doubt("its modes of " + pairs +
              " lie within each other's width, with no other shape: they may be one that changes "
              "as it decays (friction, play, a stiffness that is not linear)",
          out);
  }
  const std::string other = WidenByLaterPart(fitted, options, kByNoise, &out->fit.decay);
  if (!other.empty()) {
    Doubt("the later half of its energy has other modes (" + other +
              "): modes are missing, or the structure changes as it decays (friction, play). The "
              "standard errors are widened by the difference",
          out);
  }
}

}  // namespace

const char* Name(Excitation excitation) {
  switch (excitation) {
    case Excitation::kByTheData:
      return "auto";
    case Excitation::kDecay:
      return "decay";
    case Excitation::kAmbient:
      return "ambient";
  }
  return "";
}

Identification Identify(std::span<const DecaySignal> signals, Excitation excitation,
                        const ModalOptions& decay, const AmbientOptions& ambient) {
  Identification out;
  if (excitation == Excitation::kAmbient) {
    TakeForAmbient(signals, ambient, &out);
    out.why = "It was to be taken for ambient";
    return out;
  }
  out.fit = IdentifyModes(signals, decay);
  if (excitation == Excitation::kDecay) {
    out.why = "It was to be taken for a free decay";
    JudgeDecay(signals, decay.decay, &out);
    return out;
  }
  // Of forces that go on, damped sines can imitate as much as a record of few memories holds: some,
  // close to each other, stand for one mode. They leave more than a tenth, and do not fade.
  constexpr double kMost = 0.5;  // explained [-]
  // Mean square of the first half over the second's: a third of a memory within half of the record;
  // and what chance makes of twenty memories once in some thousand times.
  constexpr double kFades = 2.0, kSurelyFades = 4.0;
  const DecayFit& fit = out.fit.decay;
  const double fading = Fading(signals);
  const bool sines = fit.Usable() && (fit.whiteness > kByNoise || fit.explained >= kAllOfIt);
  if (sines || (fit.Usable() && fit.explained >= kMost && fading >= kFades)) {
    out.why = fmt::format("Damped sines from its beginning explain {:.3g}% of it{}: a free decay",
                          100.0 * fit.explained,
                          fit.whiteness > kByNoise ? " and leave nothing but noise" : "");
    out.doubtful = fit.whiteness <= kByNoise && fading < kSurelyFades;
    if (out.doubtful) {
      out.why +=
          ". But what they leave is no noise: forces that go on can look so in a record of few "
          "memories of the structure, and then the standard errors do not hold (--modes ambient "
          "takes it for that)";
    }
    JudgeDecay(signals, decay.decay, &out);
    return out;
  }
  if (fading >= kSurelyFades) {
    out.why = fmt::format(
        "It fades, the first half has {:.2g} times the second's mean square: a free decay", fading);
    JudgeDecay(signals, decay.decay, &out);
    return out;
  }
  ModalFit as_decay = std::move(out.fit);
  TakeForAmbient(signals, ambient, &out);
  if (out.ambient->status == DecayStatus::kTooLittle) {  // not to be judged as ambient at all
    out = {};
    out.fit = std::move(as_decay);
    out.why = "It is too short to be told from a free decay";
    JudgeDecay(signals, decay.decay, &out);
    return out;
  }
  out.why = fmt::format(
      "It goes on all through, the second half with {:.2g} of the first's mean square, and damped "
      "sines from its beginning explain {:.2g}% of it: taken for ambient, driven by noise",
      1.0 / fading, 100.0 * (as_decay.decay.Usable() ? as_decay.decay.explained : 0.0));
  return out;
}

}  // namespace unfurl::correlate
