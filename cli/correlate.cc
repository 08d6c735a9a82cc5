#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/fixed_number.h"
#include "base/number.h"
#include "base/table.h"
#include "base/text.h"
#include "cli/comparison_panels.h"
#include "cli/paper_figures.h"
#include "cli/verb.h"
#include "correlate/compare/channel_comparison.h"
#include "correlate/compare/comparison_json.h"
#include "data/atomic_file.h"
#include "data/formats.h"
#include "study/compare_study.h"

namespace unfurl::cli {

namespace {

using nlohmann::ordered_json;

struct CorrelateSettings {
  std::string record, reference, output, report, figures, window = "hann";
  std::string offset, drift, frame;  // what is known of A beforehand; empty: nothing is said
  std::string modes = "auto", trial;
  std::vector<std::string> channels;  // NAME or NAME=NAME_IN_B; empty: marks, or all in common
  correlate::ComparisonOptions options;
};

std::string PeaksText(const correlate::Comparison& c) {
  const bool alone = c.reference.empty();
  std::vector<std::vector<std::string>> rows = {
      {"signal", alone ? "peaks [Hz]" : "peaks: measured / reference [Hz]"}};
  for (const correlate::ComparedSpectrum& s : c.spectra) {
    std::string list;
    for (const correlate::PeakPair& p : s.pairs) {
      auto hertz = [](const std::vector<correlate::Peak>& peaks, int index) {
        return index < 0 ? std::string("-")
                         : fmt::format("{:.3f}", peaks[static_cast<std::size_t>(index)].frequency);
      };
      list += (list.empty() ? "" : ", ") + hertz(s.measured_peaks, p.a);
      if (!alone) list += " / " + hertz(s.reference_peaks, p.b);
    }
    rows.push_back({s.name, list.empty() ? "none" : list});
  }
  return AlignedTable(rows);
}

// Nothing where no mode was found.
std::string ModesText(const correlate::Comparison& c) {
  std::vector<std::vector<std::string>> rows = {
      {"mode", "measured [Hz]", "damping [%]", "reference [Hz]", "damping [%]", "MAC"}};
  for (const correlate::ModePair& p : c.mode_pairs) {
    std::vector<std::string> row = {std::to_string(rows.size()), "-", "-", "-", "-", "-"};
    auto fill = [&](const correlate::ModalFit& fit, int index, std::size_t column) {
      if (index < 0) return;
      const correlate::Mode& m = fit.decay.modes[static_cast<std::size_t>(index)];
      row[column] = NumberWithError(m.frequency, m.frequency_sigma);
      row[column + 1] = NumberWithError(100.0 * m.damping, 100.0 * m.damping_sigma);
    };
    fill(c.measured_modes, p.a, 1);
    fill(c.reference_modes, p.b, 3);
    if (p.a >= 0 && p.b >= 0) row[5] = fmt::format("{:.3f}", p.mac);
    rows.push_back(std::move(row));
  }
  if (rows.size() == 1) return {};
  for (std::vector<std::string>& row : rows) {
    if (c.reference.empty()) row.resize(3);
  }
  return AlignedTable(rows);
}

std::string ChannelsText(const correlate::Comparison& c) {
  std::vector<std::vector<std::string>> rows = {
      {"channel", "unit", "of", "samples", "RMSE", "largest", "at [s]", "in sigmas"}};
  for (const correlate::ComparedScore& v : c.scores) {
    if (v.of != correlate::ComparedScore::Of::kChannel) continue;
    std::string of;
    for (const correlate::ComparedChannel& one : c.channels) {
      if (one.name == v.name) of = one.of;
    }
    rows.push_back({v.name, v.unit.empty() ? "-" : v.unit, of, std::to_string(v.score.samples),
                    fmt::format("{:.4g}", v.score.rmse), fmt::format("{:.4g}", v.score.largest),
                    FixedNumber(v.score.largest_at, 3),
                    v.sigmas > 0.0 ? fmt::format("{:.2f}", v.sigmas) : "-"});
  }
  return rows.size() > 1 ? AlignedTable(rows) : std::string();
}

std::string ScoresText(const correlate::Comparison& c) {
  if (c.scores.empty()) return {};
  std::vector<std::vector<std::string>> rows = {
      {"", "NRMSE [%]", "R2", "Sprague-Geers", "Russell", "ISO/TS 18571", "grade"}};
  for (const correlate::ComparedScore& v : c.scores) {
    auto number = [](double x, const char* format) {
      return std::isfinite(x) ? fmt::format(fmt::runtime(format), x) : std::string("-");
    };
    rows.push_back({v.name, number(100.0 * v.score.nrmse, "{:.3g}"), number(v.score.r2, "{:.5f}"),
                    number(v.score.sprague_geers, "{:.3g}"), number(v.score.russell, "{:.3g}"),
                    v.rated ? fmt::format("{:.3f}", v.rating.overall) : "-",
                    v.rated ? correlate::Name(v.rating.grade) : "-"});
  }
  return AlignedTable(rows);
}

std::string Text(const correlate::Comparison& c) {
  std::string text = c.verdict + "\n";
  for (const std::string& reason : c.reasons) text += "  " + reason + "\n";
  if (!c.alignment.Usable()) return text;
  return text + (c.errors.empty() ? std::string() : AlignedTable(MarkErrorRows(c))) +
         ChannelsText(c) + PeaksText(c) + ScoresText(c) + ModesText(c);
}

correlate::SpectralWindow WindowNamed(const std::string& name) {
  using W = correlate::SpectralWindow;
  const std::vector<std::pair<std::string, W>> all = {{"rectangular", W::kRectangular},
                                                      {"hann", W::kHann},
                                                      {"hamming", W::kHamming},
                                                      {"blackman", W::kBlackman},
                                                      {"blackman-harris", W::kBlackmanHarris},
                                                      {"flat-top", W::kFlatTop}};
  std::vector<std::string> names;
  for (const auto& [known, window] : all) {
    if (known == name) return window;
    names.push_back(known);
  }
  throw Error("there is no window '" + name + "'", "--window", "it is one of " + JoinWords(names));
}

bool IsStudy(const std::string& path) { return data::FormatOf(path) == data::FileFormat::kToml; }

// Marks, unless channels were asked for or one of the two holds nothing else.
correlate::Comparison Compared(const CorrelateSettings& s) {
  std::vector<correlate::ChannelName> pairs;
  for (const std::string& text : s.channels) {
    pairs.push_back(correlate::ParseChannelName(text, "--channels"));
  }
  if (s.reference.empty()) {
    std::vector<std::string> names;
    names.reserve(pairs.size());
    for (const correlate::ChannelName& pair : pairs) names.push_back(pair.name);
    return correlate::DescribeChannels(correlate::ChannelsOf(s.record), names, s.options, s.record);
  }
  if (IsStudy(s.record)) {
    if (!s.options.marks.empty()) {
      throw Error("of a study channels are compared", "--marks",
                  "give its tracks in its place, or leave it out");
    }
    return study::CompareStudy(data::ReadStudy(s.record), data::ReadRun(s.reference), s.reference,
                               s.trial, study::StudyChannelNames(pairs, "--channels"), s.options);
  }
  if (!s.trial.empty()) {
    throw Error("A is no study", "--trial", "leave it out, or give a study for A");
  }
  const bool channels =
      !pairs.empty() || correlate::HoldsChannels(s.record) || correlate::HoldsChannels(s.reference);
  if (!channels) return correlate::Compare(s.record, s.reference, s.options);
  if (!s.options.marks.empty()) {
    throw Error("marks and channels are compared apart", "--marks", "leave it or the channels out");
  }
  return correlate::CompareChannels(s.record, s.reference, pairs, s.options);
}

int CorrelateVerb(const Common& common, CorrelateSettings& s) {
  s.options.window = WindowNamed(s.window);
  if (s.options.from && s.options.to && !(*s.options.from < *s.options.to)) {
    throw Error(fmt::format("no time between {} and {} s", *s.options.from, *s.options.to),
                "--from, --to", "give the earlier one first");
  }
  correlate::Placement& known = s.options.placement;
  if (!s.offset.empty()) known.offset = correlate::ParsePrior(s.offset, "--offset");
  if (!s.drift.empty()) known.drift = correlate::ParsePrior(s.drift, "--drift");
  if (!s.frame.empty()) known.frame = correlate::ParseFramePrior(s.frame, "--frame");
  s.options.modes = correlate::ParseExcitation(s.modes, "--modes");
  const correlate::Comparison comparison = Compared(s);
  data::Provenance provenance = StartProvenance(common);
  provenance.AddInput(s.record);
  if (!s.reference.empty()) provenance.AddInput(s.reference);
  const ordered_json json = correlate::ComparisonJson(comparison);
  if (!s.output.empty()) data::WriteTextFile(s.output, JsonText(json));
  if (!s.report.empty()) WriteComparisonPage(s.report, comparison, provenance);
  std::string text = Text(comparison);
  if (!s.figures.empty() && comparison.alignment.Usable() && !comparison.marks.empty()) {
    text += WritePaperFigures(s.figures, comparison);
  }
  Finish(common, json, text);
  return comparison.alignment.Usable() ? kExitGood
                                       : NotUsable(s.record, comparison.alignment.message);
}

}  // namespace

Verb AddCorrelate(CLI::App& program, Common& common) {
  Verb verb = DeclareVerb(
      program, common, "correlate",
      "Compare two motions, simulated or measured: alignment, errors, spectra, modes; of\n"
      "marks or of channels. Of a record alone: spectra and modes",
      "unfurl correlate tracks.h5 run.h5 --report correlate.html");
  CLI::App* app = verb.app;
  VerbFiles& files = *verb.files;
  auto settings = std::make_shared<CorrelateSettings>();
  files
      .Read("A", &settings->record,
            "A run, tracks (.h5, .csv), channels (.csv, .uff, .h5), or a study: its channels")
      ->required();
  files.Read("B", &settings->reference,
             "The reference: a run, tracks or channels (default: none, A alone)");
  files.Write("-o,--output", &settings->output, "The results as a file (JSON)");
  files.Page(&settings->report, "Also write a page with pictures (HTML)");
  files.WriteFolder("--figures", &settings->figures, PaperFigureNames,
                    "A folder for the paper's figures 15, 16 and 17 of this trial (SVG)");
  app->add_option("--marks", settings->options.marks, "Marks to compare (default: all in common)")
      ->delimiter(',')
      ->type_name("NAMES");
  app->add_option(
         "--channels", settings->channels,
         "Channels to compare, NAME or NAME=ITS_NAME_IN_B; of a run its quantities,\n"
         "of tracks tip.x, .. (default: all in common, where A or B is a file of channels)")
      ->delimiter(',')
      ->type_name("NAMES");
  app->add_option("--trial", settings->trial,
                  "Of a study: the trial whose channels are compared (default: the only one)")
      ->type_name("NAME");
  app->add_option("--modes", settings->modes,
                  "What A's vibration is: auto (by the data), decay, ambient (driven by noise)")
      ->type_name("KIND");
  app->add_option(
      "--from", settings->options.from,
      "Spectra and modes from this time on A's clock [s]\n(default: after the last latch)");
  app->add_option("--to", settings->options.to, "to this (default: the end)");
  app->add_option("--window", settings->window,
                  "Of the spectra: hann, rectangular, hamming, blackman, blackman-harris, flat-top")
      ->type_name("WINDOW");
  app->add_flag("--clock-drift", settings->options.clock_drift,
                "A's clock may run at another rate than B's: find by how much");
  app->add_option("--offset", settings->offset,
                  "What A's clock shows when B's shows 0 [s], where it is known:\nfree, 0.25, "
                  "0.25+-0.001 (default: free)")
      ->type_name("VALUE[+-SIGMA]");
  app->add_option("--drift", settings->drift,
                  "By how much A's clock runs fast [1]: free, 2e-5, 0+-1e-4 (default: not at all)")
      ->type_name("VALUE[+-SIGMA]");
  app->add_option("--frame", settings->frame,
                  "Whether A's frame is B's: free, known, or known to SHIFT [m] and ROTATION [rad]")
      ->type_name("free|known|SHIFT,ROTATION");
  verb.run = [&common, settings] { return CorrelateVerb(common, *settings); };
  return verb;
}

}  // namespace unfurl::cli
