#pragma once

#include "correlate/compare/comparison.h"
#include "report/page.h"

namespace unfurl::cli {

using correlate::ComparedSignal;
using correlate::ComparedSpectrum;
using correlate::Comparison;

inline constexpr double kMilli = 1e3;  // metres and radians are shown in thousandths

const char* Other(const Comparison& c);  // "simulated", or "reference"

// Parts of the page, each under a heading of its own.
void AddScorePanels(const Comparison& c, report::Page* page);
void AddDensityPanels(const Comparison& c, report::Page* page);
void AddModePanels(const Comparison& c, report::Page* page);

// Charts that the page and the paper's figures share: an angle of a body; x and y of a mark; both
// spectra of a signal.
report::Chart AngleChart(const Comparison& c, const ComparedSignal& s);
report::Chart MarkChart(const Comparison& c, const std::string& mark);
report::Chart SpectrumChart(const Comparison& c, const ComparedSpectrum& s);
const ComparedSignal* FindSignal(const Comparison& c, const std::string& name);
// Names of the marks, those that move most first.
std::vector<std::string> MarksByMotion(const Comparison& c);

// Charts and tables of a comparison that succeeded, onto any page.
void AddComparisonPanels(const Comparison& c, report::Page* page);

// The page of it.
void WriteComparisonPage(const std::string& path, const Comparison& c,
                         const data::Provenance& provenance);

}  // namespace unfurl::cli
