#include "cli/comparison_panels.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/fixed_number.h"
#include "base/number.h"
#include "base/sentence.h"
#include "cli/residual_views.h"

namespace unfurl::cli {

namespace {

using report::Chart;
using report::Series;
using report::Style;

std::string ComparisonPanelsPercent(double part) { return Number(100.0 * part, 3); }

// Stable poles in one colour, all others in grey behind them; dots at rising frequencies.
Chart StabilisationChart(const std::string& whose, const correlate::ModalFit& fit) {
  Chart chart;
  chart.title = "Stabilisation diagram: " + whose;
  chart.note = fmt::format(
      "Each dot is a pole that is found at that order, between {} and {} Hz. "
      "Physical "
      "modes form columns over the orders; poles of noise scatter. Lines: the modes of the fit.",
      Number(fit.low, 3), Number(fit.high, 3));
  chart.x = {"frequency", "Hz", false};
  chart.y = {"order", "", false};
  Series other{"not stable", {}, {}, {}, Style::kDots, 6};
  Series stable{"stable in frequency, damping and shape", {}, {}, {}, Style::kDots, 0};
  std::vector<correlate::StabilisationPole> poles = fit.poles;
  std::stable_sort(poles.begin(), poles.end(),
                   [](const auto& a, const auto& b) { return a.frequency < b.frequency; });
  double last = 0.0;
  for (const correlate::StabilisationPole& p : poles) {
    // Charts keep one value per place: poles of one frequency are set apart by nothing visible.
    last = std::max(p.frequency, last * (1.0 + 1e-9));
    Series& s = p.stable() ? stable : other;
    s.x.push_back(last);
    s.y.push_back(p.order);
  }
  chart.series = {std::move(other), std::move(stable)};
  for (const correlate::Mode& m : fit.decay.modes) {
    chart.markers.push_back({m.frequency, Number(m.frequency, 4) + " Hz", -1});
  }
  return chart;
}

// A mark that swings far moves on an arc, and across it at twice the frequency: no mode.
std::string Harmonics(const std::vector<correlate::Mode>& modes) {
  constexpr double kSigmas =
      3.0;  // of the difference: frequencies nearer than this are called equal
  std::string words;
  for (const correlate::Mode& m : modes) {
    for (const correlate::Mode& of : modes) {
      const double off = m.frequency - 2.0 * of.frequency;
      if (std::abs(off) > kSigmas * std::hypot(m.frequency_sigma, 2.0 * of.frequency_sigma) ||
          m.share > of.share) {
        continue;
      }
      words += fmt::format(
          " {} Hz is twice {} Hz within its error and weaker: rather the second harmonic of that "
          "large "
          "motion than a mode of its own.",
          Number(m.frequency, 4), Number(of.frequency, 4));
    }
  }
  return words;
}

// Of the modes' amplitudes: millimetres of marks; a unit that all channels share; over each one's
// own RMS.
std::string AmplitudeUnit(const correlate::Comparison& c) {
  if (!c.marks.empty() || c.mode_units.empty()) return "mm";
  return c.mode_units.front() == "1" ? "of its RMS" : c.mode_units.front();
}

// Of a record without a reference.
void AddModesAlone(const correlate::Comparison& c, report::Page* page) {
  const double shown = c.marks.empty() ? 1.0 : kMilli;
  report::Table table;
  table.title = "Modes";
  table.note =
      "Natural frequency and damping ratio with standard errors. The share is that of the measured "
      "motion about its slow trend.";
  table.header = {"frequency [Hz]", "damping [%]", "amplitude [" + AmplitudeUnit(c) + "]",
                  "share [%]"};
  table.text_columns = {};
  for (const correlate::Mode& m : c.measured_modes.decay.modes) {
    table.rows.push_back({NumberWithError(m.frequency, m.frequency_sigma),
                          NumberWithError(100.0 * m.damping, 100.0 * m.damping_sigma),
                          Number(shown * m.amplitude.cwiseAbs().maxCoeff(), 3),
                          ComparisonPanelsPercent(m.share)});
  }
  if (!table.rows.empty()) page->AddTable(table);
}

void AddModeTable(const correlate::Comparison& c, report::Page* page) {
  if (c.reference.empty()) return AddModesAlone(c, page);
  const std::string unit = AmplitudeUnit(c);
  const double shown = c.marks.empty() ? 1.0 : kMilli;
  report::Table table;
  table.title = "Modes";
  table.note =
      "Natural frequency and damping ratio with standard errors. \"Off\" is the difference in "
      "units "
      "of its own standard error: beyond three it is no chance. MAC: 1 where the two vibrate in "
      "the "
      "same shape, 0 where the shapes have nothing in common. The share is that of the measured "
      "motion about its slow trend.";
  table.header = {"measured [Hz]",
                  std::string(Other(c)) + " [Hz]",
                  "difference [%]",
                  "off",
                  "damping, measured [%]",
                  std::string("damping, ") + Other(c) + " [%]",
                  "off",
                  "MAC",
                  "amplitude [" + unit + "]",
                  "share [%]"};
  table.text_columns = {};
  const auto& A = c.measured_modes.decay.modes;
  const auto& B = c.reference_modes.decay.modes;
  auto off = [](double a, double b, double sa, double sb) {
    const double s = std::hypot(sa, sb);
    return s > 0.0 ? Number((b - a) / s, 2) : std::string("-");
  };
  for (const correlate::ModePair& p : c.mode_pairs) {
    std::vector<std::string> row(table.header.size(), "-");
    if (p.a >= 0) {
      const correlate::Mode& m = A[static_cast<std::size_t>(p.a)];
      row[0] = NumberWithError(m.frequency, m.frequency_sigma);
      row[4] = NumberWithError(100.0 * m.damping, 100.0 * m.damping_sigma);
      row[8] = Number(shown * m.amplitude.cwiseAbs().maxCoeff(), 3);
      row[9] = ComparisonPanelsPercent(m.share);
    }
    if (p.b >= 0) {
      const correlate::Mode& m = B[static_cast<std::size_t>(p.b)];
      row[1] = NumberWithError(m.frequency, m.frequency_sigma);
      row[5] = NumberWithError(100.0 * m.damping, 100.0 * m.damping_sigma);
    }
    if (p.a >= 0 && p.b >= 0) {
      const correlate::Mode& a = A[static_cast<std::size_t>(p.a)];
      const correlate::Mode& b = B[static_cast<std::size_t>(p.b)];
      row[2] = Number(100.0 * (b.frequency - a.frequency) / a.frequency, 2);
      row[3] = off(a.frequency, b.frequency, a.frequency_sigma, b.frequency_sigma);
      row[6] = off(a.damping, b.damping, a.damping_sigma, b.damping_sigma);
      row[7] = fmt::format("{:.3f}", p.mac);
    }
    table.rows.push_back(std::move(row));
  }
  if (!table.rows.empty()) page->AddTable(table);
}

void AddShapeTable(const correlate::Comparison& c, report::Page* page) {
  const auto& modes = c.measured_modes.decay.modes;
  if (modes.empty()) return;
  report::Table table;
  table.title = "Measured shapes";
  table.note =
      "Each signal's part in each mode, over that of the one that moves most, with its standard "
      "error; in brackets, where it is clear, the phase in degrees: 0 moves with it, 180 against "
      "it.";
  table.header = {"signal"};
  for (const correlate::Mode& m : modes) table.header.push_back(Number(m.frequency, 4) + " Hz");
  for (std::size_t j = 0; j < c.mode_signals.size(); ++j) {
    std::vector<std::string> row = {c.mode_signals[j]};
    for (const correlate::Mode& m : modes) {
      const auto at = static_cast<Eigen::Index>(j);
      const std::complex<double> v = m.shape(at);
      const double sigma = std::hypot(m.shape_sigma(0, at), m.shape_sigma(1, at)) / std::sqrt(2.0);
      std::string cell = sigma > 0.0 ? NumberWithError(std::abs(v), sigma) : "1";
      // A part that is no more than its error has no phase.
      if (sigma > 0.0 && std::abs(v) > 2.0 * sigma) {
        cell += fmt::format(" ({})", std::lround(57.29577951308232 * std::arg(v)));
      }
      row.push_back(std::move(cell));
    }
    table.rows.push_back(std::move(row));
  }
  page->AddTable(table);
}

// Measured less reference, over the readings' own sigmas, or, where none are told, over the RMS.
ResidualGroup GroupOf(const correlate::ComparedSignal& s, bool has_sigma) {
  ResidualGroup group{s.name, {}, {}};
  for (std::size_t i = 0; i < s.t.size(); ++i) {
    const double off = s.measured[i] - s.reference[i];
    if (!std::isfinite(off) || (has_sigma && !(s.sigma[i] > 0.0))) continue;
    group.along.push_back(s.t[i]);
    group.value.push_back(has_sigma ? off / s.sigma[i] : off);
  }
  if (!has_sigma) DivideByRms(&group);
  return group;
}

}  // namespace

const char* Other(const correlate::Comparison& c) {
  return c.reference_is_run ? "simulated" : "reference";
}

void AddScorePanels(const correlate::Comparison& c, report::Page* page) {
  if (c.scores.empty()) return;
  report::Table errors, rating;
  errors.title = "How alike: errors and energies";
  errors.note = fmt::format(
      "Of what moved since the start; the test is {}. NRMSE: RMS distance over the range of "
      "motion. R "
      "squared: 1 is perfect, 0 no better than standing still in the middle. Sprague-Geers and "
      "Russell "
      "separate size from timing: M is the relative error in size (negative: too small), P the "
      "phase "
      "error as a part of half a turn; C combines both. Russell's C up to 0.15 is called "
      "excellent, up to 0.28 acceptable.",
      c.record_is_test ? "the measured record" : "the reference");
  errors.header = {"",
                   c.marks.empty() ? "RMSE" : "RMSE [mm, mrad]",
                   "NRMSE [%]",
                   "R squared",
                   "largest",
                   "in sigmas",
                   "Sprague-Geers M",
                   "P",
                   "C",
                   "Russell M",
                   "P",
                   "C"};
  rating.title = "How alike: ISO/TS 18571";
  rating.note =
      "Four scores between 0 and 1. Corridor: how much of the time the two are close. Phase: how "
      "little one must be shifted to fit best. Magnitude: how alike in size after shift and "
      "warping. "
      "Slope: how alike in steepness, averaged over nine samples. Overall: 0.4, 0.2, 0.2, 0.2 of "
      "them; above 0.94 excellent, 0.80 good, 0.58 fair. The standard is made for crash signals at "
      "10 "
      "kHz; at the rate here nine samples are longer, so slopes are judged more mildly. A mark's "
      "scores are the mean of the coordinates in which it moves.";
  rating.header = {"",      "corridor", "phase", "magnitude",
                   "slope", "overall",  "grade", "sampled every [ms]"};
  rating.text_columns = {0, 6};
  for (const correlate::ComparedScore& s : c.scores) {
    const auto& v = s.score;
    const bool channel = s.of == correlate::ComparedScore::Of::kChannel;
    const double k = channel ? 1.0 : kMilli;
    const std::string unit = channel && !s.unit.empty() ? " " + s.unit : "";
    errors.rows.push_back(
        {s.name, Number(k * v.rmse, 3) + unit, ComparisonPanelsPercent(v.nrmse),
         std::isfinite(v.r2) ? fmt::format("{:.5f}", v.r2) : "-", Number(k * v.largest, 3) + unit,
         s.sigmas > 0.0 ? Number(s.sigmas, 3) : "-", Number(v.sprague_geers_magnitude, 2),
         Number(v.sprague_geers_phase, 2), Number(v.sprague_geers, 2),
         Number(v.russell_magnitude, 2), Number(v.russell_phase, 2), Number(v.russell, 2)});
    if (!s.rated) continue;
    auto score = [](double x) { return fmt::format("{:.3f}", x); };
    rating.rows.push_back({s.name, score(s.rating.corridor), score(s.rating.phase),
                           score(s.rating.magnitude), score(s.rating.slope),
                           score(s.rating.overall), correlate::Name(s.rating.grade),
                           Number(kMilli * s.rating_step, 3)});
  }
  page->AddTable(errors);
  if (!rating.rows.empty()) page->AddTable(rating);
}

void AddDensityPanels(const correlate::Comparison& c, report::Page* page) {
  // Of the strongest signal alone: the file of numbers has them all.
  const correlate::ComparedSpectrum* shown = nullptr;
  double most = -1.0;
  for (const correlate::ComparedSpectrum& s : c.spectra) {
    const double peak = s.measured_peaks.empty() ? 0.0 : s.measured_peaks.front().amplitude;
    if (s.density.segments < 2 || s.id.IsAngle() || peak <= most) continue;
    shown = &s;
    most = peak;
  }
  if (shown != nullptr) {
    const correlate::CrossSpectrum& d = shown->density;
    Chart power, coherence;
    power.title = "Power spectral density of " + shown->name;
    power.note = Capitalised(d.convention) + ".";
    power.x = coherence.x = {"frequency", "Hz", false};
    power.y = {"density",
               shown->id.IsChannel() ? "(" + shown->id.unit + ")\u00b2/Hz" : "m\u00b2/Hz", true};
    coherence.title = "Coherence of " + shown->name;
    coherence.note = fmt::format(
        "1 where one is a linear function of the other at that frequency, 0 where they are "
        "unrelated; below the dashed line, {:.2f}, it may be chance. With a decay in few segments "
        "it "
        "says which frequencies both hold, not more.",
        d.no_coherence);
    coherence.y = {"coherence", "", false};
    coherence.height_px = 200;
    const std::vector<double> f(d.frequency.begin() + 1, d.frequency.end());
    const bool alone = d.yy.empty();
    if (!alone) {
      power.series.push_back({Other(c), f, {d.yy.begin() + 1, d.yy.end()}, {}, Style::kLine, 1});
    }
    power.series.push_back({"measured", f, {d.xx.begin() + 1, d.xx.end()}, {}, Style::kLine, 0});
    if (!alone)
      coherence.series.push_back(
          {"coherence", f, {d.coherence.begin() + 1, d.coherence.end()}, {}, Style::kLine, 2});
    coherence.series.push_back(
        {"may be chance", f, std::vector<double>(f.size(), d.no_coherence), {}, Style::kDashes, 6});
    page->AddSpectrum(std::move(power));
    if (!alone) page->AddSpectrum(std::move(coherence));
  }
  report::Table table;
  table.title = "Whole spectra and operating shapes";
  table.note =
      "FRAC: 1 where the two complex spectra differ by a factor only. MAC: how alike the "
      "deformations "
      "of all marks are at a frequency that both show.";
  table.header = {"", "FRAC", "measured [Hz]", std::string(Other(c)) + " [Hz]", "MAC"};
  for (const correlate::ComparedSpectrum& s : c.spectra) {
    if (s.frac >= 0.0) {
      table.rows.push_back({"spectrum of " + s.name, fmt::format("{:.4f}", s.frac), "", "", ""});
    }
  }
  for (const correlate::OperatingShape& s : c.operating_shapes) {
    table.rows.push_back({"operating shape", "", Number(s.measured_frequency, 4),
                          Number(s.reference_frequency, 4), fmt::format("{:.3f}", s.mac)});
  }
  if (!table.rows.empty()) page->AddTable(table);
}

void AddModePanels(const correlate::Comparison& c, report::Page* page) {
  const correlate::DecayFit& d = c.measured_modes.decay;
  std::string words =
      c.measured_ambient
          ? fmt::format(
                "{}. By covariance-driven stochastic subspace identification, {} to "
                "{} s; amplitudes are RMS. Measured: {}.",
                c.measured_vibration, FixedNumber(c.spectrum_from, 2),
                FixedNumber(c.spectrum_to, 2), d.message)
          : fmt::format(
                "Damped sines common to all signals, from {} to {} s, beside a slow "
                "cubic trend of each. Measured: {}.",
                FixedNumber(c.spectrum_from, 2), FixedNumber(c.spectrum_to, 2), d.message);
  if (d.Usable() && d.chi2_per_dof > 4.0) {
    // Beyond twice the sigma, as in the alignment.
    words += fmt::format(
        " The residual is {} times the measurement's standard deviation: more happens here than a "
        "linear "
        "free "
        "decay (impacts in a clearance, friction), and the values are those of the linear decay "
        "that "
        "fits best. The standard errors are widened for it.",
        Number(std::sqrt(d.chi2_per_dof), 2));
  }
  if (!c.measured_ambient) words += Harmonics(d.modes);
  page->AddSection(c.measured_ambient ? "Modes of the ambient record" : "Modes from the free decay",
                   words);
  AddModeTable(c, page);
  AddShapeTable(c, page);
  if (!c.measured_modes.poles.empty()) {
    page->AddSpectrum(StabilisationChart("measured", c.measured_modes));
  }
  if (!c.reference_modes.poles.empty()) {
    page->AddSpectrum(StabilisationChart(Other(c), c.reference_modes));
  }
}

void AddResidualPanels(const correlate::Comparison& c, report::Page* page) {
  if (c.reference.empty()) return;
  const bool channels = c.marks.empty();
  ResidualViews own, stated;
  for (ResidualViews* views : {&own, &stated}) {
    views->of = channels ? "channel" : "coordinate";
    views->along = {"time", "s", false};
    views->scatter = false;  // over time they are above
  }
  own.words = channels ? "over each channel's RMS" : "over each coordinate's RMS";
  own.own_scale = true;
  stated.words = "over the measurement's sigma";
  for (const correlate::ComparedSignal& s : c.signals) {
    if (s.id.IsAngle()) continue;  // of two marks that are here already
    const bool has_sigma =
        s.sigma.size() == s.t.size() &&
        std::any_of(s.sigma.begin(), s.sigma.end(), [](double sigma) { return sigma > 0.0; });
    ResidualGroup group = GroupOf(s, has_sigma);
    if (!group.value.empty()) (has_sigma ? stated : own).groups.push_back(std::move(group));
  }
  AddResidualViews(stated, page);
  AddResidualViews(own, page);
}

}  // namespace unfurl::cli
