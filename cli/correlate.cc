#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "cli/comparison.h"
#include "cli/verb.h"
#include "data/atomic_file.h"

namespace unfurl::cli {

namespace {

using nlohmann::ordered_json;

struct Settings {
  std::string record, reference, output, report;
  ComparisonOptions options;
};

ordered_json PeakJson(const std::vector<correlate::Peak>& peaks, int index) {
  if (index < 0) return nullptr;
  const correlate::Peak& p = peaks[static_cast<std::size_t>(index)];
  return {{"frequency", p.frequency}, {"amplitude", p.amplitude}};
}

ordered_json Json(const Comparison& c) {
  const correlate::Alignment& a = c.alignment;
  ordered_json json = {{"record", c.record},
                       {"reference", c.reference},
                       {"status", correlate::Name(a.status)},
                       {"verdict", c.verdict},
                       {"reasons", c.reasons}};
  if (!a.Usable()) return json;
  json["marks"] = c.marks;
  json["time_offset"] = {{"value", a.at.offset}, {"sigma", a.Sigma("time offset")}, {"unit", "s"}};
  ordered_json rotation, translation;
  for (Eigen::Index row = 0; row < 3; ++row) {
    rotation.push_back(
        {a.at.X_WM.linear()(row, 0), a.at.X_WM.linear()(row, 1), a.at.X_WM.linear()(row, 2)});
    translation.push_back(a.at.X_WM.translation()(row));
  }
  json["frame"] = {{"rotation", rotation}, {"translation", translation}};
  for (std::size_t i = 0; i < a.unknowns.size(); ++i) {
    if (a.unknowns[i].rfind("frame", 0) == 0) {
      json["frame"]["sigma"][a.unknowns[i]] = a.Sigma(a.unknowns[i]);
    }
  }
  json["overlap"] = {a.overlap_start, a.overlap_end};
  json["r2"] = a.r2;
  json["chi2_per_dof"] = a.chi2_per_dof;
  for (const correlate::MarkError& e : c.errors) {
    json["errors"].push_back({{"mark", e.mark},
                              {"samples", e.samples},
                              {"rmse", e.rmse},
                              {"rmse_in_plane", e.rmse_in_plane},
                              {"rmse_across", e.rmse_across},
                              {"bias_across", e.bias_across},
                              {"largest", e.largest},
                              {"largest_at", e.largest_at},
                              {"sigmas", e.sigmas}});
  }
  for (const ComparedSpectrum& s : c.spectra) {
    ordered_json peaks = ordered_json::array();
    for (const correlate::PeakPair& p : s.pairs) {
      peaks.push_back({{"measured", PeakJson(s.measured_peaks, p.a)},
                       {"reference", PeakJson(s.reference_peaks, p.b)}});
    }
    json["spectra"].push_back({{"signal", s.name},
                               {"convention", s.measured.convention},
                               {"resolution", s.measured.resolution},
                               {"peaks", peaks}});
  }
  return json;
}

std::string Text(const Comparison& c) {
  std::string text = c.verdict + "\n";
  for (const std::string& reason : c.reasons) text += "  " + reason + "\n";
  if (!c.alignment.Usable()) return text;
  std::vector<std::vector<std::string>> rows = {
      {"mark", "samples", "RMSE [mm]", "in plane", "across", "largest", "at [s]", "in sigmas"}};
  for (const correlate::MarkError& e : c.errors) {
    rows.push_back({e.mark, std::to_string(e.samples), fmt::format("{:.3f}", 1e3 * e.rmse),
                    fmt::format("{:.3f}", 1e3 * e.rmse_in_plane),
                    fmt::format("{:.3f}", 1e3 * e.rmse_across),
                    fmt::format("{:.3f}", 1e3 * e.largest), fmt::format("{:.3f}", e.largest_at),
                    e.sigmas > 0.0 ? fmt::format("{:.2f}", e.sigmas) : "-"});
  }
  text += AlignedTable(rows);
  rows = {{"signal", "peaks: measured / reference [Hz]"}};
  for (const ComparedSpectrum& s : c.spectra) {
    std::string list;
    for (const correlate::PeakPair& p : s.pairs) {
      auto hertz = [](const std::vector<correlate::Peak>& peaks, int index) {
        return index < 0 ? std::string("-")
                         : fmt::format("{:.3f}", peaks[static_cast<std::size_t>(index)].frequency);
      };
      list += (list.empty() ? "" : ", ") + hertz(s.measured_peaks, p.a) + " / " +
              hertz(s.reference_peaks, p.b);
    }
    rows.push_back({s.name, list.empty() ? "none" : list});
  }
  return text + AlignedTable(rows);
}

int CorrelateVerb(const Common& common, const Settings& s) {
  const Comparison comparison = Compare(s.record, s.reference, s.options);
  data::Provenance provenance = StartProvenance(common);
  provenance.AddInput(s.record);
  provenance.AddInput(s.reference);
  const ordered_json json = Json(comparison);
  if (!s.output.empty()) data::WriteTextFile(s.output, json.dump(2) + "\n");
  if (!s.report.empty()) WriteComparisonPage(s.report, comparison, provenance);
  Finish(common, json, Text(comparison));
  return comparison.alignment.Usable() ? kExitGood : kExitNotUsable;
}

}  // namespace

Verb AddCorrelate(CLI::App& program, Common& common) {
  CLI::App* app = DeclareVerb(program, common, "correlate",
                              "Two records side by side: time and frame aligned, errors, spectra",
                              "unfurl correlate tracks.h5 run.h5 --report correlate.html");
  auto settings = std::make_shared<Settings>();
  app->add_option("A", settings->record, "A run, or tracks (.h5, .csv)")->required();
  app->add_option("B", settings->reference, "The reference: a run, or tracks")->required();
  app->add_option("-o,--output", settings->output, "The numbers as a file (JSON)");
  app->add_option("--report", settings->report, "A page to look at (HTML)");
  app->add_option("--marks", settings->options.marks, "Marks to compare (default: all in common)")
      ->delimiter(',');
  app->add_option("--from", settings->options.from, "Spectra from this time on A's clock [s]");
  app->add_option("--to", settings->options.to, "to this (default: after the last latch)");
  return {app, [&common, settings] { return CorrelateVerb(common, *settings); }};
}

}  // namespace unfurl::cli
