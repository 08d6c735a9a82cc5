#include "calib/plan.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/table.h"
#include "cli/uncertainty_panel.h"
#include "cli/verb.h"
#include "data/lab.h"
#include "data/rig.h"
#include "report/page.h"

namespace unfurl::cli {

namespace {

using nlohmann::ordered_json;

constexpr double kUsable = 0.5;      // share of the volume that must be found at all
constexpr double kLittleLost = 0.9;  // share that must still be found for a camera to be spared

struct Arguments {
  std::string input, report;
  std::vector<std::string> overrides;
  calib::PlanOptions plan;
  calib::MapOptions map;
};

bool IsHdf5(const std::string& path) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored)) return false;  // a pipe is read once
  std::ifstream file(path, std::ios::binary);
  char signature[4] = {};
  file.read(signature, sizeof signature);
  return file.gcount() == 4 && std::string(signature, 4) == "\x89HDF";
}

struct Outcome {
  calib::Plan plan;
  std::vector<LossRow> rows;
  std::vector<std::string> words;
  report::Level level = report::Level::kGood;
  std::string headline;
};

void Judge(Outcome* out) {
  const calib::UncertaintyMap& all = out->rows[0].map;
  out->words.push_back(fmt::format(
      "With all cameras {:.0f}% of the volume is found, half of it within {:.2f} mm, 95% within "
      "{:.2f} mm (one sigma, 3-D).",
      100.0 * all.Found(), 1e3 * all.Quantile(0.5), 1e3 * all.Quantile(0.95)));
  if (all.Found() < kUsable) {
    out->level = report::Level::kBad;
    out->headline = "This layout finds less than half of the volume";
    return;
  }
  out->headline = "Any one camera may fail";
  for (std::size_t k = 1; k < out->rows.size(); ++k) {
    const double left = out->rows[k].map.Found() / all.Found();
    if (left >= kLittleLost) continue;
    out->level = report::Level::kCare;
    out->headline = "Not every camera may fail";
    out->words.push_back(fmt::format("{}, {:.0f}% of what was found is lost.", out->rows[k].name,
                                     100.0 * (1.0 - left)));
  }
  for (const std::string& advice : out->plan.advice) out->words.push_back(advice);
}

void WritePage(const Arguments& arguments, const Outcome& out, const data::Provenance& provenance) {
  report::Page page("Plan of a rig", arguments.input);
  page.AddWords(out.level, out.headline, out.words);
  report::Table table;
  const auto rows = LossTable(out.rows);
  table.title = "Error of a found point";
  table.note = fmt::format("3-D, one sigma: calibration and readings of {} px.",
                           arguments.map.reading_sigma_px);
  table.header = rows[0];
  table.rows.assign(rows.begin() + 1, rows.end());
  page.AddTable(table);
  // One scale for all, so that they compare; what is worse has the last colour.
  double high = 0.0;
  for (const LossRow& row : out.rows) {
    const double q = 1e3 * row.map.Quantile(0.9);
    if (std::isfinite(q)) high = std::max(high, q);
  }
  for (const LossRow& row : out.rows) {
    page.AddMap(UncertaintyPanel(row.map, row.name, "", high > 0.0 ? high : std::nan("")));
  }
  if (!out.plan.weak.empty()) {
    report::Table weak;
    weak.title = "What such a survey would barely determine";
    weak.header = {"camera", "direction", "sigma", "moves points by [mm]", "advice"};
    weak.text_columns = {0, 1, 4};
    for (const calib::WeakDirection& w : out.plan.weak) {
      weak.rows.push_back({out.plan.rig.cameras[static_cast<std::size_t>(w.camera)].name, w.name,
                           fmt::format("{:.2g} {}", w.sigma, w.unit),
                           fmt::format("{:.3f}", 1e3 * w.point_rms), w.advice});
    }
    page.AddTable(weak);
  }
  page.AddOrigin(provenance);
  page.Write(arguments.report);
}

int RunPlan(const Common& common, Arguments arguments) {
  data::Provenance provenance = StartProvenance(common);
  provenance.AddInput(arguments.input);
  Outcome out;
  if (IsHdf5(arguments.input)) {
    if (!arguments.overrides.empty()) {
      throw Error("--set changes a laboratory, and this is a rig", arguments.input,
                  "leave it out, or give LAB.toml");
    }
    out.plan.rig = data::ReadRig(arguments.input);
    out.plan.sees = calib::SeenOnRow(out.plan.rig);
  } else {
    arguments.plan.reading_sigma_px = arguments.map.reading_sigma_px;
    out.plan = calib::PlanLab(data::ReadLab(arguments.input, arguments.overrides), arguments.plan);
  }
  out.rows = LossRows(out.plan.rig, out.plan.sees, arguments.map);
  Judge(&out);
  if (!arguments.report.empty()) WritePage(arguments, out, provenance);

  ordered_json summary = {{"input", arguments.input}, {"verdict", out.headline}};
  summary["reasons"] = out.words;
  for (const LossRow& row : out.rows) {
    summary["cases"].push_back({{"cameras", row.name},
                                {"found", row.map.Found()},
                                {"median_m", row.map.Quantile(0.5)},
                                {"p95_m", row.map.Quantile(0.95)},
                                {"max_m", row.map.Quantile(1.0)}});
  }
  std::string text = out.headline + "\n";
  for (const std::string& words : out.words) text += "  - " + words + "\n";
  text += "\n" + AlignedTable(LossTable(out.rows));
  if (!arguments.report.empty()) text += "\n-> " + arguments.report + "\n";
  Finish(common, summary, text);
  return out.level == report::Level::kBad ? kExitNotUsable : kExitGood;
}

}  // namespace

Verb AddPlan(CLI::App& program, Common& common) {
  Verb verb = DeclareVerb(program, common, "plan",
                          "How well a proposed or a calibrated rig will find points, and what "
                          "the loss of a camera does",
                          "unfurl plan lab.toml --report plan.html\n"
                          "  unfurl plan rig.h5");
  CLI::App* app = verb.app;
  VerbFiles& files = *verb.files;
  auto arguments = std::make_shared<Arguments>();
  files.Read("INPUT", &arguments->input, "A laboratory [TOML], or a rig [HDF5]")->required();
  files.Write("--report", &arguments->report, "A page with the maps [HTML]");
  app->add_option("--points", arguments->plan.survey_points,
                  "Number of surveyed points assumed, at random in the volume")
      ->capture_default_str()
      ->check(CLI::Range(12, 100000));
  app->add_option("--reading-sigma", arguments->map.reading_sigma_px,
                  "Standard deviation of one reading [px]")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  app->add_option("--columns", arguments->map.columns, "Cells of the map along x and along y")
      ->capture_default_str()
      ->check(CLI::Range(1, 200));
  app->add_option("--layers", arguments->map.layers, "Slices of the map")
      ->capture_default_str()
      ->check(CLI::Range(1, 50));
  app->add_option("--seed", arguments->plan.seed, "Random seed of the points' positions")
      ->capture_default_str();
  files.Overrides(&arguments->overrides, "Another value for a key of the lab (repeatable)");
  verb.run = [&common, arguments] { return RunPlan(common, *arguments); };
  return verb;
}

}  // namespace unfurl::cli
