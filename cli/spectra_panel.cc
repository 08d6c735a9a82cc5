#include <fmt/format.h>

#include "base/fixed_number.h"
#include "cli/comparison_panels.h"
#include "correlate/compare/comparison.h"
#include "report/page.h"

namespace unfurl::cli {

namespace {

std::string Hertz(const std::vector<correlate::Peak>& peaks, int index, bool amplitude, double k) {
  if (index < 0) return "-";
  const correlate::Peak& p = peaks[static_cast<std::size_t>(index)];
  return amplitude ? fmt::format("{:.3g}", k * p.amplitude) : fmt::format("{:.3f}", p.frequency);
}

// By signal: the peaks, and of two records each beside its partner.
report::Table PeaksTable(const correlate::Comparison& c) {
  const bool alone = c.reference.empty(), by_density = c.spectra.front().by_density;
  report::Table table;
  table.title = "Peaks";
  table.note = by_density ? "Noise drives this record: what stands out of its averaged density by "
                            "more than chance, and the root mean square around it, strongest first"
                          : "Frequencies between the bins, strongest first";
  table.note += alone ? "." : "; partners lie within two bins.";
  const char* amplitude = by_density ? "measured RMS" : "measured amplitude";
  table.header = {
      "signal", "measured [Hz]", std::string(Other(c)) + " [Hz]", "difference [%]", amplitude,
      Other(c), "unit"};
  table.text_columns = {0, 6};
  if (alone) {
    table.header = {"signal", "frequency [Hz]", amplitude, "unit"};
    table.text_columns = {0, 3};
  }
  for (const correlate::ComparedSpectrum& s : c.spectra) {
    const double k = Shown(s.id);
    for (const correlate::PeakPair& p : s.pairs) {
      if (alone) {
        table.rows.push_back({s.name, Hertz(s.measured_peaks, p.a, false, k),
                              Hertz(s.measured_peaks, p.a, true, k), ShownUnit(s.id)});
        continue;
      }
      std::string difference = "-";
      if (p.a >= 0 && p.b >= 0) {
        const double a = s.measured_peaks[static_cast<std::size_t>(p.a)].frequency;
        const double b = s.reference_peaks[static_cast<std::size_t>(p.b)].frequency;
        difference = fmt::format("{:+.2f}", 100.0 * (b - a) / a);
      }
      table.rows.push_back({s.name, Hertz(s.measured_peaks, p.a, false, k),
                            Hertz(s.reference_peaks, p.b, false, k), difference,
                            Hertz(s.measured_peaks, p.a, true, k),
                            Hertz(s.reference_peaks, p.b, true, k), ShownUnit(s.id)});
    }
  }
  return table;
}

}  // namespace

report::Chart SpectrumChart(const correlate::Comparison& c, const correlate::ComparedSpectrum& s) {
  report::Chart chart;
  chart.title = "Spectrum of " + s.name;
  chart.note = s.note;
  chart.x = {"frequency", "Hz", false};
  chart.y = {"amplitude", ShownUnit(s.id), true};
  auto curve = [&](const char* name, const correlate::Spectrum& of, report::Style style,
                   int color) {
    // The first bin holds what detrending left.
    report::Series series{name, {}, {}, {}, style, color};
    for (std::size_t i = 1; i < of.frequency.size(); ++i) {
      series.x.push_back(of.frequency[i]);
      series.y.push_back(Shown(s.id) * of.amplitude[i]);
    }
    chart.series.push_back(std::move(series));
  };
  if (!s.reference.frequency.empty()) curve(Other(c), s.reference, report::Style::kLine, 1);
  curve("measured", s.measured, report::Style::kLine, 0);
  for (const correlate::Peak& p : s.measured_peaks) {
    chart.markers.push_back({p.frequency, fmt::format("{:.2f} Hz", p.frequency), -1});
  }
  return chart;
}

void AddSpectrumPanels(const correlate::Comparison& c, report::Page* page) {
  if (c.spectra.empty()) return;
  page->AddSection(c.reference.empty() ? "Spectra" : "Both spectra",
                   fmt::format("From {} to {} s on the record's clock{}. Each spectrum: {}.",
                               FixedNumber(c.spectrum_from, 2), FixedNumber(c.spectrum_to, 2),
                               c.latches.empty() ? "" : ", after the last latch",
                               c.spectra.front().measured.convention));
  for (const correlate::ComparedSpectrum& s : c.spectra) {
    const bool shown = !s.id.IsCoordinate() || s.id.axis == 1;
    if (shown) page->AddSpectrum(SpectrumChart(c, s));
  }
  const report::Table table = PeaksTable(c);
  if (!table.rows.empty()) page->AddTable(table);
}

}  // namespace unfurl::cli
