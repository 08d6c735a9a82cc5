#include "calib/check.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/table.h"
#include "calib/observations.h"
#include "cli/check_page.h"
#include "cli/verb.h"
#include "data/rig.h"
#include "data/survey.h"
#include "data/survey_points.h"
#include "measure/survey_readings.h"

namespace unfurl::cli {

namespace {

using nlohmann::ordered_json;

struct Arguments {
  std::string rig, input, report;
  calib::Bar bar;
};

// Both ends of each placement, one after the other: ids "1a" and "1b", "2a" and "2b", ...
calib::Observations BarEnds(const data::ReadingTable& table, const data::Rig& rig,
                            const std::string& where) {
  std::map<std::string, std::array<Eigen::Index, 2>> placements;
  for (std::size_t k = 0; k < table.id.size(); ++k) {
    const std::string& id = table.id[k];
    if (id.size() < 2 || (id.back() != 'a' && id.back() != 'b')) {
      throw Error(fmt::format("the id '{}' does not end in a or b", id), where,
                  "name the ends of placement 1 of the bar 1a and 1b");
    }
    auto& ends =
        placements.try_emplace(id.substr(0, id.size() - 1), std::array<Eigen::Index, 2>{-1, -1})
            .first->second;
    ends[id.back() == 'a' ? 0 : 1] = static_cast<Eigen::Index>(k);
  }
  calib::Observations out;
  out.cameras = table.cameras;
  std::vector<Eigen::Index> rows;
  for (const auto& [name, ends] : placements) {
    if (ends[0] < 0 || ends[1] < 0) {
      throw Error(fmt::format("placement {} of the bar has one end only", name), where,
                  "give both ends, a and b");
    }
    rows.insert(rows.end(), ends.begin(), ends.end());
  }
  out.p.resize(3, static_cast<Eigen::Index>(rows.size()));
  out.p.colwise() = Eigen::Vector3d(0.5 * (rig.volume_low + rig.volume_high));
  for (std::size_t i = 0; i < rows.size(); ++i) {
    out.ids.push_back(table.id[static_cast<std::size_t>(rows[i])]);
    out.cov.emplace_back(Eigen::Matrix3d::Identity());
    for (Eigen::Index c = 0; c < table.u_px.cols(); ++c) {
      if (std::isnan(table.u_px(rows[i], c))) continue;
      out.readings.push_back({static_cast<int>(i), static_cast<int>(c), table.u_px(rows[i], c),
                              table.s_px(rows[i], c)});
    }
  }
  return out;
}

std::string Cell(double value, double scale, const char* format) {
  return std::isfinite(value) ? fmt::format(fmt::runtime(format), scale * value) : "-";
}

int RunCheck(const Common& common, const Arguments& arguments) {
  data::Provenance provenance = StartProvenance(common);
  const data::Rig rig = data::ReadRig(arguments.rig);
  provenance.AddInput(arguments.rig);
  provenance.AddInput(arguments.input);
  calib::CheckResult result;
  const bool bar = arguments.bar.length > 0.0;
  if (bar) {
    const data::ReadingTable table = data::ReadReadingsCsv(arguments.input);
    result =
        calib::CheckBar(rig, BarEnds(table, rig, arguments.input), arguments.bar, arguments.input);
  } else {
    data::Survey survey = data::ReadSurvey(arguments.input);
    measure::FindSurveyReadings(&survey);
    result = calib::CheckPoints(rig, calib::FromSurvey(survey, arguments.input), arguments.input);
  }

  ordered_json summary = {{"rig", arguments.rig},
                          {"input", arguments.input},
                          {"verdict", result.verdict},
                          {"reasons", result.reasons},
                          {"chance", result.chance},
                          {"rms", result.rms},
                          {"rms_predicted", result.rms_predicted}};
  std::vector<std::vector<std::string>> points = {
      {bar ? "bar" : "point", "off by [mm]", "predicted [mm]"}};
  for (const calib::CheckedPoint& point : result.points) {
    summary["points"].push_back({{"id", point.id},
                                 {"error", point.error},
                                 {"predicted", point.predicted},
                                 {"chance_without", point.chance_without}});
    points.push_back(
        {point.id, Cell(point.error, 1e3, "{:.3f}"), Cell(point.predicted, 1e3, "{:.3f}")});
  }
  std::vector<std::vector<std::string>> cameras = {
      {"camera", "readings", "off by, RMS [px]", "predicted [px]", "p-value without it"}};
  for (const calib::CheckedCamera& camera : result.cameras) {
    summary["cameras"].push_back({{"name", camera.name},
                                  {"readings", camera.readings},
                                  {"rms_px", camera.rms_px},
                                  {"rms_predicted_px", camera.rms_predicted_px},
                                  {"chance_without", camera.chance_without}});
    cameras.push_back({camera.name, std::to_string(camera.readings),
                       fmt::format("{:.3f}", camera.rms_px),
                       fmt::format("{:.3f}", camera.rms_predicted_px),
                       fmt::format("{:.2g}", camera.chance_without)});
  }
  std::string text = fmt::format("The calibration is {}.\n", result.verdict);
  for (const std::string& reason : result.reasons) text += "  - " + reason + "\n";
  text += "\n" + AlignedTable(points);
  if (!result.cameras.empty()) text += "\n" + AlignedTable(cameras);
  if (!arguments.report.empty()) {
    WriteCheckPage(arguments.report, arguments.input, rig, result, bar, provenance);
  }
  Finish(common, summary, text);
  if (result.chance >= calib::kDoubtful) return kExitGood;
  return NotUsable(arguments.input,
                   "the calibration is " + result.verdict +
                       (result.reasons.empty() ? "" : ": " + result.reasons.front()));
}

}  // namespace

Verb AddCheck(CLI::App& program, Common& common) {
  Verb verb = DeclareVerb(program, common, "check",
                          "Is a calibration still valid? From some points, or a bar of known "
                          "length",
                          "unfurl check rig.h5 ten_points.csv\n"
                          "  unfurl check rig.h5 bar_readings.csv --bar 1.2000 --bar-sigma 5e-5");
  CLI::App* app = verb.app;
  VerbFiles& files = *verb.files;
  auto arguments = std::make_shared<Arguments>();
  files.Read("RIG", &arguments->rig, "The rig to check [HDF5]")->required();
  files
      .Read("READINGS", &arguments->input,
            "A survey of some points [CSV, HDF5]; with --bar, readings of the bar's ends, ids "
            "1a, 1b, 2a, 2b, ... [CSV]")
      ->required();
  auto* length = app->add_option("--bar", arguments->bar.length, "Length of the bar [m]")
                     ->check(CLI::PositiveNumber);
  app->add_option("--bar-sigma", arguments->bar.sigma, "Standard deviation of that length [m]")
      ->check(CLI::NonNegativeNumber)
      ->needs(length);
  files.Write("--report", &arguments->report,
              "A page: verdict, cameras along the sensor, points or lengths [HTML]");
  verb.run = [&common, arguments] { return RunCheck(common, *arguments); };
  return verb;
}

}  // namespace unfurl::cli
