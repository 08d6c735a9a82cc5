#include "cli/cost_rig.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/count.h"
#include "base/error.h"
#include "base/length.h"
#include "base/progress.h"
#include "base/statistics.h"
#include "base/table.h"
#include "calib/calibrate_survey.h"
#include "calib/wand_data.h"
#include "data/atomic_file.h"
#include "data/csv.h"
#include "data/rig.h"
#include "data/survey.h"
#include "measure/survey_readings.h"
#include "report/page.h"

namespace unfurl::cli {

namespace {

using calib::SurveyCost;
using calib::SurveySetting;
using nlohmann::ordered_json;

std::string What(const SurveySetting& of) {
  if (of.poses > 0)
    return fmt::format("bar in {}, {}", Counted(static_cast<std::size_t>(of.poses), "pose"),
                       Counted(static_cast<std::size_t>(of.points), "point"));
  std::string text =
      fmt::format("{}, {}", Counted(static_cast<std::size_t>(of.points), "point"), Name(of.places));
  if (of.shots > 1) text += fmt::format(", {} shots", of.shots);
  if (!of.lens.empty()) text += fmt::format(", lens {}", of.lens);
  if (!of.estimator.empty()) text += ", some wild, " + of.estimator;
  return text;
}

std::vector<std::vector<std::string>> CostRigRows(const SurveyCost& cost) {
  std::vector<std::vector<std::string>> rows = {{"survey", "hours", "error", "of it calibration",
                                                 "and beside its covariance", "CPU [s]", "best"}};
  for (const SurveySetting& of : cost.settings) {
    if (!of.problem.empty()) {
      rows.push_back({What(of), fmt::format("{:.2f}", of.hours), of.problem, "", "", "", ""});
      continue;
    }
    rows.push_back({What(of), fmt::format("{:.2f}", of.hours), LengthText(of.error),
                    LengthText(of.calibration), LengthText(of.bias),
                    fmt::format("{:.2g}", of.cpu_seconds), of.on_front ? "*" : ""});
  }
  return rows;
}

ordered_json Json(const std::string& input, const SurveyCost& cost) {
  ordered_json out = {{"input", input},
                      {"need_m", cost.need},
                      {"floor_px", cost.floor_px},
                      {"readings_m", cost.readings},
                      {"advice", cost.advice},
                      {"advised", cost.advised < 0 ? ordered_json() : ordered_json(cost.advised)},
                      {"settings", ordered_json::array()}};
  for (const SurveySetting& of : cost.settings) {
    ordered_json one = {{"points", of.points}, {"places", Name(of.places)}, {"shots", of.shots}};
    if (of.poses > 0) one["poses"] = of.poses;
    if (!of.lens.empty()) one["lens"] = of.lens;
    if (!of.estimator.empty()) one["estimator"] = of.estimator;
    one["hours"] = of.hours;
    if (of.problem.empty()) {
      one["error_m"] = of.error;
      one["calibration_m"] = of.calibration;
      one["bias_m"] = of.bias;
      one["cpu_seconds"] = of.cpu_seconds;
      one["best"] = of.on_front;
    } else {
      one["problem"] = of.problem;
    }
    out["settings"].push_back(one);
  }
  return out;
}

void WritePage(const std::string& path, const std::string& input, const SurveyCost& cost,
               const data::Provenance& provenance) {
  report::Page page("What surveying costs", input);
  page.AddWords(cost.advised < 0 ? report::Level::kCare : report::Level::kGood, cost.advice.front(),
                {cost.advice.begin() + 1, cost.advice.end()});
  report::Chart chart;
  chart.title = "Error against hours of surveying";
  chart.note = "3-D, RMS over the volume, of calibration and reading.";
  chart.x = {"surveying", "h", true};
  chart.y = {"error", "mm", true};
  const auto add = [&](const std::string& name, const auto& wanted) {
    std::vector<std::pair<double, double>> dots;
    for (const SurveySetting& of : cost.settings) {
      if (of.problem.empty() && of.lens.empty() && of.estimator.empty() && wanted(of)) {
        dots.emplace_back(of.hours, 1e3 * of.error);
      }
    }
    if (dots.empty()) return;
    std::sort(dots.begin(), dots.end());
    report::Series series;
    series.name = name;
    series.style = report::Style::kDots;
    for (const auto& [hours, error] : dots) {
      series.x.push_back(hours);
      series.y.push_back(error);
    }
    chart.series.push_back(std::move(series));
  };
  for (const auto places :
       {calib::SurveyPlaces::kVolume, calib::SurveyPlaces::kLevels, calib::SurveyPlaces::kLower}) {
    add(Name(places),
        [&](const SurveySetting& of) { return of.poses == 0 && of.places == places; });
  }
  add("bar", [](const SurveySetting& of) { return of.poses > 0; });
  if (!chart.series.empty()) page.AddChart(chart);
  report::Table table;
  table.title = "What was tried";
  table.note =
      "Best: nothing is both quicker to survey and better. Of wild readings the mean of some "
      "draws, "
      "by what found points are off.";
  const auto rows = CostRigRows(cost);
  table.header = rows[0];
  table.text_columns = {0, 6};
  table.rows.assign(rows.begin() + 1, rows.end());
  page.AddTable(table);
  page.AddOrigin(provenance);
  page.Write(path);
}

// The rig that a survey of one's own gives, and what its points and readings are known to.
data::Rig RigOf(const std::string& path, calib::SurveyCostOptions* options, bool own_sigma,
                bool own_reading) {
  data::Survey survey = data::ReadSurvey(path);
  measure::FindSurveyReadings(&survey, options->workers);
  const calib::Observations data = calib::FromSurvey(survey, path);
  std::vector<double> points, readings;
  for (const Eigen::Matrix3d& cov : data.cov) points.push_back(std::sqrt(cov.trace() / 3.0));
  for (const calib::Reading& r : data.readings) readings.push_back(r.s_px);
  calib::CalibrateOptions calibrate;
  calibrate.workers = options->workers;
  data::Rig rig = calib::FitRig(data, calibrate, path).rig;
  if (!own_sigma) options->point_sigma = Median(points);
  if (!own_reading) options->reading_sigma_px = Median(readings);
  return rig;
}

std::string Minutes(double hours) {
  return hours < 1.0 ? fmt::format("{:.0f} min", 60.0 * hours) : fmt::format("{:.1f} h", hours);
}

// Sentences and commands.
void Advise(const CostRigArguments& of, SurveyCost* cost) {
  std::vector<std::string>& out = cost->advice;
  const std::string input = of.rig.empty() ? "--survey " + of.survey : "--rig " + of.rig;
  const SurveySetting* best = nullptr;
  for (const SurveySetting& one : cost->settings) {
    if (one.problem.empty() && one.estimator.empty() && one.lens.empty() &&
        (best == nullptr || one.error < best->error)) {
      best = &one;
    }
  }
  if (best == nullptr) {
    out.push_back("No survey that was tried determines these cameras.");
    return;
  }
  if (cost->advised < 0) {
    out.push_back(fmt::format("Nothing that was tried reaches {}: the best, {}, reaches {}.",
                              LengthText(cost->need), What(*best), LengthText(best->error)));
    if (cost->readings > cost->need) {
      out.push_back(
          fmt::format("The readings alone give {}: no survey helps; readings of the trial "
                      "must be better.",
                      LengthText(cost->readings)));
    }
  } else {
    best = &cost->settings[static_cast<std::size_t>(cost->advised)];
    out.push_back(fmt::format("{}: {} in {} of surveying, the quickest that reaches {}.",
                              What(*best), LengthText(best->error), Minutes(best->hours),
                              LengthText(cost->need)));
  }
  if (best->poses > 0) {
    out.push_back(fmt::format(
        "Then: unfurl calibrate --wand readings.csv --bar {} --points few.csv -o rig.h5", of.bar));
  } else {
    out.push_back(fmt::format(
        "Places to survey: unfurl cost {} --points {} --places {} --shots {} --poses 0 --lay-out "
        "points.csv; then: unfurl calibrate survey.csv -o rig.h5",
        input, best->points, Name(best->places), best->shots));
  }
  const SurveySetting *robust = nullptr, *ordinary = nullptr;
  for (const SurveySetting& one : cost->settings) {
    if (!one.problem.empty()) continue;
    if (one.estimator == "robust") robust = &one;
    if (one.estimator == "ordinary") ordinary = &one;
  }
  if (robust != nullptr && ordinary != nullptr) {
    out.push_back(fmt::format(
        "With {:.3g}% of the readings anywhere, {} points leave {} by the robust estimator, which "
        "calibrate uses, and {} by ordinary least squares.",
        100.0 * of.cost.wild, robust->points, LengthText(robust->calibration),
        LengthText(ordinary->calibration)));
  }
}

void WritePlaces(const CostRigArguments& of, const data::Rig& rig, const SurveyCost& cost) {
  const SurveySetting& one = cost.settings[static_cast<std::size_t>(cost.advised)];
  const data::Survey survey = calib::SurveyOf(rig, one, of.cost);
  data::CsvWriter writer(
      {{"id", ""}, {"x", "m"}, {"y", "m"}, {"z", "m"}, {"sx", "m"}, {"sy", "m"}, {"sz", "m"}});
  for (Eigen::Index i = 0; i < survey.p.cols(); ++i) {
    std::vector<std::string> cells = {survey.id[static_cast<std::size_t>(i)]};
    for (Eigen::Index k = 0; k < 3; ++k) cells.push_back(fmt::format("{:.7g}", survey.p(k, i)));
    for (const Eigen::Index k : {0, 3, 5}) {
      cells.push_back(fmt::format("{:.3g}", std::sqrt(survey.cov(k, i))));
    }
    writer.Row(cells);
  }
  data::WriteTextFile(of.lay_out, writer.text());
}

constexpr const char* kOwnOptions[] = {"--points",
                                       "--places",
                                       "--shots",
                                       "--poses",
                                       "--few",
                                       "--bar",
                                       "--station",
                                       "--station-at",
                                       "--point-sigma",
                                       "--reading-sigma",
                                       "--minutes-per-point",
                                       "--seconds-per-shot",
                                       "--seconds-per-pose",
                                       "--minutes-before",
                                       "--wild",
                                       "--draws",
                                       "--need",
                                       "--lay-out"};

// Those options that are texts. Throws Error for what they cannot be.
void ReadOptions(CostRigArguments* arguments) {
  CostRigArguments& of = *arguments;
  calib::SurveyCostOptions& cost = of.cost;
  cost.need = NeedOption(of.need);
  if (cost.poses.size() == 1 && cost.poses.front() == 0) cost.poses.clear();
  cost.places.clear();
  for (const std::string& name : of.places) {
    cost.places.push_back(calib::ParseSurveyPlaces(name, "--places"));
  }
  if (!of.bar.empty()) {
    const calib::WandBar bar = calib::ParseBar(of.bar, "--bar");
    if (bar.places.size() != 1) {
      throw Error("has more than two marks", "--bar", "give one length");
    }
    cost.bar = bar.places.front();
    cost.bar_sigma = bar.sigma;
  }
  if (!of.point_sigma.empty()) cost.point_sigma = LengthOption(of.point_sigma, "--point-sigma");
  if (of.station.empty() != of.station_at.empty()) {
    throw Error("comes without the other", of.station.empty() ? "--station-at" : "--station",
                "give the station's accuracy and where it stands");
  }
  if (!of.station.empty()) {
    cost.station = calib::ParseStationAccuracy(of.station, "--station");
    cost.station_at = Eigen::Vector3d::Map(of.station_at.data());
  }
}

}  // namespace

std::string CostRigOptionGiven(const CLI::App& app) {
  for (const char* option : kOwnOptions) {
    if (app.get_option(option)->count() > 0) return option;
  }
  return {};
}

void AddCostRigOptions(Verb* verb, CostRigArguments* s) {
  CLI::App* app = verb->app;
  VerbFiles& files = *verb->files;
  files.Read("--rig", &s->rig,
             "In place of INPUT: a rig [HDF5]: what calibrating it anew costs and brings");
  files.Read("--survey", &s->survey,
             "In place of INPUT: a survey [CSV, HDF5]: the same of the rig that it gives, by its "
             "points' and readings' errors");
  constexpr int kMost = 10000;  // of points, shots or poses: more are a slip of the keyboard
  const auto list = [&](const char* name, auto* values, int low, const char* help) {
    app->add_option(name, *values, help)
        ->delimiter(',')
        ->capture_default_str()
        ->check(CLI::Range(low, kMost));
  };
  list("--points", &s->cost.points, 12, "Of a rig: numbers of surveyed points");
  app->add_option("--places", s->places, "Of a rig: where they are: volume, levels, lower")
      ->delimiter(',')
      ->capture_default_str()
      ->type_name("NAMES");
  list("--shots", &s->cost.shots, 1, "Of a rig: readings of each point, averaged");
  list("--poses", &s->cost.poses, 0, "Of a rig: poses of a bar; 0: no bar");
  const auto number = [&](const char* name, auto* value, double low, double high,
                          const char* help) {
    app->add_option(name, *value, help)->capture_default_str()->check(CLI::Range(low, high));
  };
  number("--few", &s->cost.few, 3, kMost, "Of a rig: surveyed points beside the bar");
  app->add_option("--bar", s->bar,
                  "Of a rig: the bar, as 0.75m+-0.1mm (default: a third of the volume, +-0.1mm)")
      ->type_name("LENGTH");
  app->add_option("--station", s->station,
                  "Of a rig: the total station's accuracy, as \"1mm+2ppm, 1arcsec\"; in place of "
                  "--point-sigma")
      ->type_name("ACCURACY");
  app->add_option("--station-at", s->station_at, "Of a rig: where it stands: x, y, z [m]")
      ->delimiter(',')
      ->expected(3);
  app->add_option("--point-sigma", s->point_sigma,
                  "Of a rig: standard deviation of a surveyed point, per axis (default: the "
                  "survey's, or 0.3mm)")
      ->type_name("LENGTH");
  number("--reading-sigma", &s->cost.reading_sigma_px, 1e-6, 100,
         "Of a rig: standard deviation of one reading [px] (default: the survey's)");
  number("--minutes-per-point", &s->cost.minutes_per_point, 0, 1e4,
         "Of a rig: to move the LED, aim and measure [min]");
  number("--seconds-per-shot", &s->cost.seconds_per_shot, 0, 1e6, "Of a rig: of one reading [s]");
  number("--seconds-per-pose", &s->cost.seconds_per_pose, 0, 1e6,
         "Of a rig: of one pose of the bar [s]");
  number("--minutes-before", &s->cost.minutes_before, 0, 1e6, "Of a rig: to set up [min]");
  number("--wild", &s->cost.wild, 0, 0.49,
         "Of a rig: share of wild readings that estimators are tried by");
  number("--draws", &s->cost.draws, 0, kMost,
         "Of a rig: surveys for each estimator; 0: none is tried");
  AddNeedOption(app, &s->need);
  files.Write("--lay-out", &s->lay_out, "Of a rig: write the places of what is advised [CSV]");
}

int RunCostRig(const Common& common, CostRigArguments of, const std::string& report) {
  data::Provenance provenance = StartProvenance(common);
  const std::string& input = of.rig.empty() ? of.survey : of.rig;
  provenance.AddInput(input);
  calib::SurveyCostOptions& cost = of.cost;
  ReadOptions(&of);
  cost.Check();
  const calib::SurveyCostOptions usual;
  const data::Rig rig = of.rig.empty() ? RigOf(of.survey, &cost, !of.point_sigma.empty(),
                                               cost.reading_sigma_px != usual.reading_sigma_px)
                                       : data::ReadRig(of.rig);
  if (of.bar.empty()) {
    cost.bar = (rig.volume_high - rig.volume_low).maxCoeff() / 3.0;
    of.bar = fmt::format("{:.3g}m+-{:.3g}mm", cost.bar, 1e3 * cost.bar_sigma);
  }
  Progress progress("cost", !common.quiet && !common.json);
  cost.progress = [&](double done) { progress.Update(done); };
  SurveyCost found = calib::StudySurveyCost(rig, input, cost);
  Advise(of, &found);
  if (!report.empty()) WritePage(report, input, found, provenance);
  ordered_json json = Json(input, found);
  std::string text;
  for (const std::string& words : found.advice) text += words + "\n";
  text += "\n" + AlignedTable(CostRigRows(found));
  text += fmt::format(
      "\nerrors are 3-D, RMS over the volume; a point takes {} min, a pose {} s, setting up {} "
      "min; "
      "the readings alone give {}\n",
      cost.minutes_per_point, cost.seconds_per_pose, cost.minutes_before,
      LengthText(found.readings));
  if (!of.lay_out.empty() && found.advised >= 0) {
    WritePlaces(of, rig, found);
    text += "-> " + of.lay_out + "\n";
  }
  if (!report.empty()) {
    json["report"] = report;
    text += "-> " + report + "\n";
  }
  Finish(common, json, text);
  if (found.advised >= 0) return kExitGood;
  return NotUsable(input, found.advice.front());
}

}  // namespace unfurl::cli
