#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "base/fixed_number.h"
#include "base/statistics.h"
#include "correlate/compare/comparison_measures.h"

namespace unfurl::correlate {

namespace {

constexpr std::size_t kFewestOfModes = 32;  // samples of a signal whose modes are sought

// A signal's part within the window of the spectra, of both; nothing: too short.
std::optional<std::pair<DecaySignal, DecaySignal>> PartOf(const Comparison& c,
                                                          const ComparedSignal& s) {
  const auto [first, last] = WithinSpectra(c, s);
  if (last < first + kFewestOfModes) return std::nullopt;
  const auto part = [&, from = static_cast<std::ptrdiff_t>(first),
                     to = static_cast<std::ptrdiff_t>(last)](const std::vector<double>& x) {
    return x.empty() ? x : std::vector<double>(x.begin() + from, x.begin() + to);
  };
  return std::pair(DecaySignal{s.name, part(s.t), part(s.measured), {}},
                   DecaySignal{s.name, part(s.t), part(s.reference), {}});
}

// Each sample's own error: what the calibration adds moves all of them alike.
std::vector<double> OwnSigmas(const Comparison& c, const ComparedSignal& s,
                              const std::vector<double>& t) {
  std::vector<double> out;
  if (!c.observations.has_sigma) return out;
  const Eigen::Matrix3d R_MW = c.alignment.at.X_WM.linear().transpose();
  const MarkSeries& series = c.observations.marks[s.id.mark];
  for (const double at_time : t) {
    const auto at = std::lower_bound(series.t.begin(), series.t.end(), at_time);
    const Eigen::Matrix3d cov = Symmetric(series.cov.col(at - series.t.begin()));
    out.push_back(std::sqrt((R_MW * cov * R_MW.transpose())(s.id.axis, s.id.axis)));
  }
  return out;
}

// Signals whose modes are sought, of both records.
struct Sought {
  std::vector<DecaySignal> measured, reference;
  std::vector<std::string> units;
};

Sought SignalsOf(const Comparison& c) {
  Sought out;
  for (const ComparedSignal& s : c.signals) {
    if (!s.id.InPlane() && !s.id.IsChannel()) continue;
    auto part = PartOf(c, s);
    if (!part) continue;
    auto& [measured, reference] = *part;
    if (s.id.IsChannel()) {
      const auto [low, high] = std::minmax_element(measured.value.begin(), measured.value.end());
      if (*low == *high) continue;  // a switch that stays
      const auto first = WithinSpectra(c, s).first;
      if (!s.sigma.empty()) {
        const auto from = s.sigma.begin() + static_cast<std::ptrdiff_t>(first);
        measured.sigma.assign(from, from + static_cast<std::ptrdiff_t>(measured.t.size()));
      }
    } else {
      measured.sigma = OwnSigmas(c, s, measured.t);
    }
    out.measured.push_back(std::move(measured));
    if (!reference.value.empty()) out.reference.push_back(std::move(reference));
    out.units.emplace_back(s.id.Unit());
  }
  return out;
}

// Signals of unlike units, each over its own RMS about its mean, the reference's by the same.
void MakeAlike(Sought* sought) {
  const auto& units = sought->units;
  if (std::all_of(units.begin(), units.end(), [&](const auto& u) { return u == units[0]; })) return;
  for (std::size_t j = 0; j < sought->measured.size(); ++j) {
    DecaySignal& m = sought->measured[j];
    const double rms = std::sqrt(Variance(m.value));
    for (double& v : m.value) v /= rms;
    for (double& v : m.sigma) v /= rms;
    if (j < sought->reference.size()) {
      for (double& v : sought->reference[j].value) v /= rms;
    }
    sought->units[j] = "1";
  }
}

// Of a record that is longer than what the modes were fitted to: what the rest would add.
void AddModesWindow(Comparison* c) {
  constexpr double kAll = 0.99;  // information: the standard error is within half a per cent
  if (!c->modes_until) return;
  const Mode* least = nullptr;
  for (const Mode& mode : c->measured_modes.decay.modes) {
    if (least == nullptr || mode.information < least->information) least = &mode;
  }
  std::string rest;
  if (least != nullptr && least->information >= kAll) {
    rest = "their vibrations have decayed by then, and later samples would add nothing";
  } else if (least != nullptr) {
    rest = fmt::format(
        "that of {:.4g} Hz has not decayed by then, and all samples would tell its frequency "
        "{:.2g} "
        "times as well",
        least->frequency, 1.0 / std::sqrt(least->information));
  }
  c->reasons.push_back(
      fmt::format("Modes are those of {:.6g} to {:.6g} s{}{}; --from and --to choose another part.",
                  c->spectrum_from, *c->modes_until, rest.empty() ? "" : ": ", rest));
}

void AddVibration(const char* whose, const std::string& vibration, bool doubtful,
                  const std::optional<AmbientFit>& ambient, Comparison* c) {
  if (!ambient && !doubtful) return;
  c->reasons.push_back(fmt::format("{} vibration: {}.", whose, vibration));
  if (!ambient) return;
  for (const std::string& doubt : ambient->doubts) c->reasons.push_back(doubt + ".");
  for (const AmbientMode& m : ambient->modes) {
    for (const std::string& doubt : m.doubts) {
      c->reasons.push_back(fmt::format("Mode of {:.4g} Hz: {}.", m.mode.frequency, doubt));
    }
  }
}

}  // namespace

void FillModes(const ComparisonOptions& options, Comparison* c) {
  // After a deployment the whole still swings slowly, by less than a period: a cubic stands for it.
  ModalOptions decay;
  decay.decay.trend = 3;
  Sought sought = SignalsOf(*c);
  MakeAlike(&sought);
  for (const DecaySignal& s : sought.measured) c->mode_signals.push_back(s.name);
  c->mode_units = sought.units;
  Identification measured = Identify(sought.measured, options.modes, decay);
  c->measured_modes = std::move(measured.fit);
  c->measured_vibration = std::move(measured.why);
  c->measured_doubtful = measured.doubtful;
  c->measured_ambient = std::move(measured.ambient);
  if (c->measured_modes.cut) c->modes_until = c->measured_modes.until;
  if (!sought.reference.empty()) {
    // That a record is ambient says nothing of the model that it is held against.
    const bool decays = options.modes == Excitation::kDecay;
    Identification reference =
        Identify(sought.reference, decays ? Excitation::kDecay : Excitation::kByTheData, decay);
    c->reference_modes = std::move(reference.fit);
    c->reference_vibration = std::move(reference.why);
    c->reference_doubtful = reference.doubtful;
    c->reference_ambient = std::move(reference.ambient);
  }
  if (c->measured_ambient || c->reference_ambient) {
    UseDensityPeaks(options, c->measured_ambient.has_value(), c->reference_ambient.has_value(), c);
  }
  c->mode_pairs = PairModes(c->measured_modes.decay.modes, c->reference_modes.decay.modes);
}

void AddModeReasons(Comparison* c) {
  const bool alone = c->reference.empty();
  if (c->measured_modes.decay.Usable()) {
    const auto shared = std::count_if(c->mode_pairs.begin(), c->mode_pairs.end(),
                                      [](const ModePair& p) { return p.a >= 0 && p.b >= 0; });
    c->reasons.push_back(fmt::format(
        "Its {} holds {} modes{}{}.", c->measured_ambient ? "response to noise" : "free decay",
        c->measured_modes.decay.modes.size(),
        alone ? ""
              : fmt::format(", {} of which the reference has too (within 10% and alike "
                            "in shape)",
                            shared),
        c->measured_doubtful ? ", in doubt" : ""));
  } else if (!c->measured_modes.decay.message.empty()) {
    c->reasons.push_back("No modes: " + c->measured_modes.decay.message + ".");
  }
  AddVibration("The record's", c->measured_vibration, c->measured_doubtful, c->measured_ambient, c);
  AddVibration("The reference's", c->reference_vibration, c->reference_doubtful,
               c->reference_ambient, c);
  AddModesWindow(c);
}

void AddPeakReasons(Comparison* c) {
  std::size_t pairs = 0, peaks = 0;
  double farthest = 0.0;  // of a pair, over the measured frequency [-]
  for (const ComparedSpectrum& s : c->spectra) {
    for (const PeakPair& p : s.pairs) {
      peaks += p.a >= 0 ? 1 : 0;
      if (p.a < 0 || p.b < 0) continue;
      ++pairs;
      const double f = s.measured_peaks[static_cast<std::size_t>(p.a)].frequency;
      const double g = s.reference_peaks[static_cast<std::size_t>(p.b)].frequency;
      farthest = std::max(farthest, std::abs(g - f) / f);
    }
  }
  if (peaks == 0 || c->reference.empty()) return;
  c->reasons.push_back(fmt::format(
      "Of {} spectral peaks measured after {} s, {} have a partner in the reference within "
      "two bins, at most {:.1f}% away in frequency.",
      peaks, FixedNumber(c->spectrum_from, 2), pairs, 100.0 * farthest));
}

}  // namespace unfurl::correlate
