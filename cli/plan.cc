#include "calib/plan.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/length.h"
#include "base/table.h"
#include "base/text.h"
#include "calib/plan_survey.h"
#include "cli/space_panel.h"
#include "cli/uncertainty_panel.h"
#include "cli/verb.h"
#include "data/lab.h"
#include "data/rig.h"
#include "data/survey.h"
#include "report/page.h"

namespace unfurl::cli {

namespace {

using nlohmann::ordered_json;

struct PlanArguments {
  std::string input, report, need;
  std::string points = "200", station;  // a number or a file; an accuracy
  std::vector<double> station_at;       // [m]
  std::vector<std::string> overrides;
  calib::PlanOptions plan;
};

bool IsHdf5(const std::string& path) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored)) return false;  // a pipe is read once
  std::ifstream file(path, std::ios::binary);
  char signature[4] = {};
  file.read(signature, sizeof signature);
  return file.gcount() == 4 && std::string(signature, 4) == "\x89HDF";
}

report::Level LevelOfPlan(calib::PlanVerdict verdict) {
  switch (verdict) {
    case calib::PlanVerdict::kGood:
      return report::Level::kGood;
    case calib::PlanVerdict::kCare:
      return report::Level::kCare;
    case calib::PlanVerdict::kNotUsable:
      break;
  }
  return report::Level::kBad;
}

void WritePage(const PlanArguments& arguments, const calib::PlanResult& out,
               const data::Provenance& provenance) {
  report::Page page("Plan of a rig", arguments.input);
  page.AddWords(LevelOfPlan(out.verdict), out.headline, out.reasons);
  report::Table table;
  const auto rows = LossTable(out.cases);
  table.title = "Error of a found point";
  table.note = fmt::format("3-D, one sigma: calibration and readings of {} px.",
                           arguments.plan.map.reading_sigma_px);
  table.header = rows[0];
  table.rows.assign(rows.begin() + 1, rows.end());
  page.AddTable(table);
  // One scale for all, so that they compare; what is worse has the last colour.
  double high = 0.0;
  for (const calib::PlanCase& row : out.cases) {
    const double q = 1e3 * row.map.Quantile(0.9);
    if (std::isfinite(q)) high = std::max(high, q);
  }
  const double scale = high > 0.0 ? high : std::nan("");
  report::Space space = SpaceOf(
      out.planned.rig, "The rig in space",
      "Cameras with what they see, and the uncertainty of a found point with all of them or "
      "without one; colours as in the maps below.");
  for (const calib::PlanCase& row : out.cases) {
    space.ellipsoids.push_back(EllipsoidsOf(row.map, row.name, scale));
    space.ellipsoids.back().range.low = 0.0;
  }
  page.AddSpace(space);
  for (const calib::PlanCase& row : out.cases) {
    report::Map map = UncertaintyPanel(row.map, row.name, "", scale);
    map.low = 0.0;
    page.AddMap(map);
  }
  if (!out.planned.weak.empty()) {
    report::Table weak;
    weak.title = "What such a survey would barely determine";
    weak.header = {"camera", "direction", "sigma", "moves points by", "advice"};
    weak.text_columns = {0, 1, 4};
    for (const calib::WeakDirection& w : out.planned.weak) {
      weak.rows.push_back({out.planned.rig.cameras[static_cast<std::size_t>(w.camera)].name, w.name,
                           fmt::format("{:.2g} {}", w.sigma, w.unit), LengthText(w.point_rms),
                           w.advice});
    }
    page.AddTable(weak);
  }
  page.AddOrigin(provenance);
  page.Write(arguments.report);
}

// Places to survey by --points and --station, where either asks for other than the laboratory's.
void SetSurvey(PlanArguments* arguments, bool rig, data::Provenance* provenance) {
  // Fewer readings determine no camera (GuessOptions); more points are a slip of the keyboard.
  constexpr double kFewest = 12, kMost = 100000;
  double count = 0.0;
  if (ParseDouble(arguments->points, &count)) {
    if (count < kFewest || count > kMost || count != std::floor(count)) {
      throw Error(fmt::format("{} is no number of points", arguments->points), "--points",
                  fmt::format("give a whole number from {} to {}, or a file", kFewest, kMost));
    }
    arguments->plan.survey_points = static_cast<int>(count);
    if (!arguments->station.empty()) {
      throw Error("needs places to measure", "--station", "give them, as --points points.csv");
    }
    return;
  }
  provenance->AddInput(arguments->points);
  calib::PlannedStation station{.accuracy = arguments->station};
  if (arguments->station_at.size() == 3) {
    station.at = Eigen::Vector3d::Map(arguments->station_at.data());
  }
  if (!rig) station.sigma = data::ReadLab(arguments->input, arguments->overrides).survey.sigma;
  arguments->plan.survey =
      calib::PlannedSurvey(data::ReadPointsCsv(arguments->points), station, arguments->points);
}

int RunPlan(const Common& common, PlanArguments arguments) {
  data::Provenance provenance = StartProvenance(common);
  provenance.AddInput(arguments.input);
  arguments.plan.need = NeedOption(arguments.need);
  const bool rig = IsHdf5(arguments.input);
  if (rig && !arguments.overrides.empty()) {
    throw Error("--set changes a laboratory, and this is a rig", arguments.input,
                "leave it out, or give LAB.toml");
  }
  SetSurvey(&arguments, rig, &provenance);
  const calib::PlanResult out =
      rig ? calib::Plan(data::ReadRig(arguments.input), arguments.plan)
          : calib::Plan(data::ReadLab(arguments.input, arguments.overrides), arguments.plan);
  if (!arguments.report.empty()) WritePage(arguments, out, provenance);

  ordered_json summary = {{"input", arguments.input}, {"verdict", out.headline}};
  summary["reasons"] = out.reasons;
  summary["need_m"] = out.need;
  if (arguments.plan.survey) summary["points"] = arguments.plan.survey->size();
  for (const calib::PlanCase& row : out.cases) {
    summary["cases"].push_back({{"cameras", row.name},
                                {"found", row.map.Found()},
                                {"within_need", row.map.Within(out.need)},
                                {"median_m", row.map.Quantile(0.5)},
                                {"p95_m", row.map.Quantile(0.95)},
                                {"max_m", row.map.Quantile(1.0)}});
  }
  std::string text = out.headline + "\n";
  for (const std::string& words : out.reasons) text += "  - " + words + "\n";
  text += "\n" + AlignedTable(LossTable(out.cases));
  if (!arguments.report.empty()) text += "\n-> " + arguments.report + "\n";
  Finish(common, summary, text);
  return out.verdict == calib::PlanVerdict::kNotUsable ? NotUsable(arguments.input, out.headline)
                                                       : kExitGood;
}

}  // namespace

Verb AddPlan(CLI::App& program, Common& common) {
  Verb verb = DeclareVerb(program, common, "plan",
                          "Errors to expect of a proposed or calibrated rig over its volume, with "
                          "all cameras and with one lost",
                          "unfurl plan lab.toml --report plan.html\n"
                          "  unfurl plan lab.toml --points points.csv --station \"1mm+2ppm, "
                          "1arcsec\"\n"
                          "  unfurl plan rig.h5");
  CLI::App* app = verb.app;
  VerbFiles& files = *verb.files;
  auto arguments = std::make_shared<PlanArguments>();
  files.Read("INPUT", &arguments->input, "A laboratory [TOML], or a rig [HDF5]")->required();
  files.Page(&arguments->report, "A page with the maps [HTML]");
  AddNeedOption(app, &arguments->need);
  files.Read("--points", &arguments->points,
             "Points to survey: how many, at random in the volume (default 200), or a file of the "
             "places themselves [CSV]: id, x, y, z, with standard deviations or --station. With a "
             "rig: as calibrated anew by them");
  app->add_option("--station", arguments->station,
                  "The total station's accuracy, distances and angles, each point anew, as "
                  "\"1mm+0.1mm/m, 0.1mrad\" or \"1.5mm+2ppm, 1arcsec\"; in place of what POINTS "
                  "states")
      ->type_name("ACCURACY");
  app->add_option("--station-at", arguments->station_at,
                  "Where it stands: x, y, z [m], unless a comment '# station:' of POINTS says it")
      ->delimiter(',')
      ->expected(3);
  app->add_option("--reading-sigma", arguments->plan.map.reading_sigma_px,
                  "Standard deviation of one reading [px]")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  app->add_option("--columns", arguments->plan.map.columns, "Cells of the map along x and along y")
      ->capture_default_str()
      ->check(CLI::Range(1, 200));
  app->add_option("--layers", arguments->plan.map.layers, "Slices of the map")
      ->capture_default_str()
      ->check(CLI::Range(1, 50));
  app->add_option("--seed", arguments->plan.seed, "Random seed of the points' positions")
      ->capture_default_str();
  files.Overrides(&arguments->overrides, "Overrides a key of the lab (repeatable)");
  verb.run = [&common, arguments] { return RunPlan(common, *arguments); };
  return verb;
}

}  // namespace unfurl::cli
