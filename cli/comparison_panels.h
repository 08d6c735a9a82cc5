#pragma once

#include <string>
#include <vector>

#include "correlate/compare/comparison.h"
#include "report/page.h"

namespace unfurl::cli {

inline constexpr double kMilli = 1e3;  // metres and radians are shown in thousandths

const char* Other(const correlate::Comparison& c);  // "simulated", or "reference"

// Marks and angles in thousandths, channels in their own unit.
inline double Shown(const correlate::SignalId& id) { return id.IsChannel() ? 1.0 : kMilli; }
inline std::string ShownUnit(const correlate::SignalId& id) {
  return id.IsChannel() ? id.unit : id.IsAngle() ? "mrad" : "mm";
}

// Parts of the page, each under a heading of its own.
void AddResidualPanels(const correlate::Comparison& c, report::Page* page);
void AddScorePanels(const correlate::Comparison& c, report::Page* page);
void AddSpectrumPanels(const correlate::Comparison& c, report::Page* page);
void AddDensityPanels(const correlate::Comparison& c, report::Page* page);
void AddModePanels(const correlate::Comparison& c, report::Page* page);

// Charts that the page and the paper's figures share: an angle of a body; x and y of a mark; both
// spectra of a signal.
report::Chart AngleChart(const correlate::Comparison& c, const correlate::ComparedSignal& s);
enum class MarkOrigin { kFrame, kReferenceStart };  // what positions are counted from
report::Chart MarkChart(const correlate::Comparison& c, std::size_t mark,
                        MarkOrigin origin = MarkOrigin::kFrame);
report::Chart SpectrumChart(const correlate::Comparison& c, const correlate::ComparedSpectrum& s);
// The table of errors mark by mark, its heads first, of a comparison that has some.
std::vector<std::vector<std::string>> MarkErrorRows(const correlate::Comparison& c);
// Indices of the marks, those that move most first.
std::vector<std::size_t> MarksByMotion(const correlate::Comparison& c);

// Charts and tables of a comparison that succeeded, onto any page.
void AddComparisonPanels(const correlate::Comparison& c, report::Page* page);

// The page of it.
void WriteComparisonPage(const std::string& path, const correlate::Comparison& c,
                         const data::Provenance& provenance);

}  // namespace unfurl::cli
