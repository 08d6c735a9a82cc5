#include "correlate/fit.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/progress.h"
#include "base/text.h"
#include "cli/comparison.h"
#include "cli/fit_page.h"
#include "cli/scene_model.h"
#include "cli/verb.h"
#include "correlate/metrics.h"
#include "data/fit.h"
#include "data/study.h"
#include "data/tracks.h"
#include "report/number.h"

namespace unfurl::cli {

namespace {

using nlohmann::ordered_json;

struct Settings {
  std::string study, output, report, tracks;
  std::vector<std::string> sets;
  std::size_t workers = 0;
};

correlate::Observations ReadTrial(const data::StudyTrial& trial, const std::string& path) {
  const data::Tracks tracks = data::ReadTracks(path);
  if (tracks.smoothed) {
    throw Error("these tracks are smoothed: their errors are no longer independent", path,
                "fit to the tracks as reconstructed");
  }
  correlate::Window window;
  if (trial.window_low < trial.window_high) window = {trial.window_low, trial.window_high};
  return correlate::FromTracks(tracks, trial.marks, window);
}

std::vector<correlate::Parameter> ParametersOf(const data::Study& study) {
  std::vector<correlate::Parameter> out;
  for (const data::StudyParameter& from : study.parameters) {
    correlate::Parameter p;
    p.name = from.name;
    p.unit = from.unit;
    p.start = from.start;
    p.low = from.low;
    p.high = from.high;
    p.log = from.log;
    if (from.prior) {
      p.has_prior = true;
      p.prior_mean = from.prior->mean;
      p.prior_sigma = from.prior->sigma;
    }
    out.push_back(std::move(p));
  }
  return out;
}

// The whole in one sentence, worst news first.
void JudgeWhole(const correlate::FitResult& r, const std::vector<correlate::Parameter>& parameters,
                data::FitRecord* record) {
  if (!r.Usable()) {
    record->verdict = fmt::format("No result: {}", correlate::Name(r.status));
    record->reasons.push_back(r.message);
    return;
  }
  std::vector<std::string> known, limited, open;
  for (std::size_t j = 0; j < parameters.size(); ++j) {
    const auto verdict = r.parameters[j].verdict;
    (verdict == correlate::Verdict::kDetermined    ? known
     : verdict == correlate::Verdict::kMeshLimited ? limited
                                                   : open)
        .push_back(parameters[j].name);
  }
  auto are = [](const std::vector<std::string>& names) {
    return JoinWords(names) + (names.size() == 1 ? " is" : " are");
  };
  std::string words;
  if (!open.empty()) words += are(open) + " not determined by this trial; ";
  if (!limited.empty()) {
    words += are(limited) + " known, as well as the model's mesh allows; ";
  }
  if (!known.empty()) words += are(known) + " determined; ";
  words.resize(words.size() - 2);
  words[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(words[0])));
  record->verdict = words + ".";
  for (std::size_t j = 0; j < parameters.size(); ++j) {
    record->reasons.push_back(
        fmt::format("{} = {} {}: {}", parameters[j].name,
                    report::NumberWithError(r.parameters[j].value, r.parameters[j].sigma),
                    parameters[j].unit, r.parameters[j].reason));
  }
  record->reasons.push_back(fmt::format(
      "The residuals are {:.2f} times the marks' sigma{}.", std::sqrt(r.chi2_per_dof),
      r.noise.white() ? " and white, as they should be"
                      : ", and follow one another: the standard errors are widened for it"));
  if (!r.model_error.empty()) {
    record->reasons.push_back(fmt::format(
        "The model's own error (a finer mesh) moves the marks by {:.3g} mm RMS, {:.2g} of their "
        "sigma; it is in the standard errors.",
        1e3 * r.model_error_rms, r.model_error_sigmas));
  } else {
    record->reasons.push_back(
        "The model's own error was not looked at: the standard errors are those of the data "
        "alone.");
  }
}

data::FitRecord RecordOf(const data::Study& study,
                         const std::vector<correlate::Parameter>& parameters,
                         const correlate::FitResult& r,
                         const correlate::Observations& observations) {
  data::FitRecord record;
  record.study = study.name;
  record.status = correlate::Name(r.status);
  record.message = r.message;
  JudgeWhole(r, parameters, &record);
  const auto p = static_cast<Eigen::Index>(parameters.size());
  record.covariance = r.covariance.size() > 0 ? r.covariance : Eigen::MatrixXd::Zero(p, p);
  for (std::size_t j = 0; j < parameters.size(); ++j) {
    const correlate::ParameterEstimate& e = r.parameters[j];
    record.parameters.push_back({parameters[j].name, parameters[j].unit, study.parameters[j].keys,
                                 parameters[j].start, parameters[j].low, parameters[j].high,
                                 e.value, e.sigma, e.sigma_data, e.sigma_white, e.sigma_model,
                                 e.model_shift, e.kink, correlate::Name(e.verdict), e.reason});
  }
  for (const correlate::EvaluationRecord& e : r.evaluations) {
    record.evaluations.push_back({e.theta, e.purpose, e.message, e.stage,
                                  e.status != correlate::ModelStatus::kGood, e.cost});
  }
  record.checks["evaluations [1]"] = static_cast<double>(r.evaluations.size());
  if (r.prediction.marks.empty()) {
    for (auto* m : {&record.measured, &record.sigma, &record.simulated, &record.model_error}) {
      m->resize(3, 0);
    }
    return record;
  }

  const correlate::Registration& at = r.registration.at;
  const Eigen::Vector3d w = VectorFromRotation(at.X_WM.linear());
  const Eigen::Vector3d centre = at.X_WM * r.registration.centroid_M;
  for (std::size_t i = 0; i < r.nuisances.size(); ++i) {
    double value = 0.0;
    std::string unit = "1";
    if (i < 3) value = w(static_cast<Eigen::Index>(i)), unit = "rad";
    if (i >= 3 && i < 6) value = centre(static_cast<Eigen::Index>(i) - 3), unit = "m";
    if (i == 6) value = at.offset, unit = "s";
    if (i >= 7) value = at.z(static_cast<Eigen::Index>(i) - 7);
    record.nuisances.push_back(
        {r.nuisances[i], unit, value, r.nuisance_sigma(static_cast<Eigen::Index>(i))});
  }
  const auto n = static_cast<Eigen::Index>(observations.size());
  const auto measured = correlate::InModelFrame(observations, at);
  const auto sigma = correlate::SigmasInModelFrame(observations, at);
  for (auto* m : {&record.measured, &record.sigma, &record.simulated}) m->resize(3, n);
  record.model_error.resize(3, r.model_error.empty() ? 0 : n);
  Eigen::Index column = 0;
  for (std::size_t m = 0; m < observations.marks.size(); ++m) {
    record.marks.push_back(observations.marks[m].name);
    const Eigen::Index count = measured[m].cols();
    record.measured.middleCols(column, count) = measured[m];
    record.sigma.middleCols(column, count) = sigma[m];
    record.simulated.middleCols(column, count) =
        r.prediction.marks[m].p - (at.offset - r.offset_ref) * r.prediction.marks[m].v;
    if (!r.model_error.empty()) {
      record.model_error.middleCols(column, count) = r.model_error[m];
    }
    for (double t : observations.marks[m].t) {
      record.t.push_back(t);
      record.mark.push_back(static_cast<std::int32_t>(m));
    }
    column += count;
  }
  record.checks["chi2_per_dof [1]"] = r.chi2_per_dof;
  record.checks["residual_p_white [1]"] = r.noise.smallest_p;
  record.checks["effective_share [1]"] = r.noise.effective_share;
  record.checks["model_noise [m]"] = r.model_noise;
  record.checks["model_error_rms [m]"] = r.model_error_rms;
  record.checks["model_error_sigmas [1]"] = r.model_error_sigmas;
  record.checks["data_sigma [m]"] = r.data_sigma;
  return record;
}

std::string Text(const data::FitRecord& record, double seconds) {
  std::string text = record.verdict + "\n";
  for (const std::string& reason : record.reasons) text += "  " + reason + "\n";
  if (record.nuisances.empty()) return text;
  std::vector<std::vector<std::string>> rows = {
      {"parameter", "value", "error", "%", "of data", "of mesh", "unit", "verdict"}};
  for (const auto& p : record.parameters) {
    rows.push_back({p.name, fmt::format("{:.6g}", p.value), fmt::format("{:.2g}", p.sigma),
                    fmt::format("{:.2f}", 100.0 * p.sigma / std::abs(p.value)),
                    fmt::format("{:.2g}", p.sigma_data), fmt::format("{:.2g}", p.sigma_model),
                    p.unit, p.verdict});
  }
  text += AlignedTable(rows);
  for (const auto& n : record.nuisances) {
    if (n.name == "time offset") {
      text += fmt::format("time offset {} s\n", report::NumberWithError(n.value, n.sigma));
    }
  }
  std::size_t failed = 0;
  for (const auto& e : record.evaluations) failed += e.failed ? 1 : 0;
  text += fmt::format("{} evaluations of the model, {} failed, in {:.1f} s\n",
                      record.evaluations.size(), failed, seconds);
  return text;
}

ordered_json Json(const data::FitRecord& record, const std::string& output, double seconds) {
  ordered_json json = {{"fit", output},
                       {"status", record.status},
                       {"verdict", record.verdict},
                       {"reasons", record.reasons}};
  for (const auto& p : record.parameters) {
    json["parameters"].push_back({{"name", p.name},
                                  {"unit", p.unit},
                                  {"value", p.value},
                                  {"sigma", p.sigma},
                                  {"sigma_data", p.sigma_data},
                                  {"sigma_white", p.sigma_white},
                                  {"sigma_model", p.sigma_model},
                                  {"model_shift", p.model_shift},
                                  {"kink", p.kink},
                                  {"verdict", p.verdict}});
  }
  for (const auto& n : record.nuisances) {
    if (n.name.rfind("calibration", 0) == 0) continue;
    json["nuisances"].push_back({{"name", n.name}, {"value", n.value}, {"sigma", n.sigma}});
  }
  for (const auto& [name, value] : record.checks) json["checks"][name] = value;
  json["seconds"] = seconds;
  return json;
}

// The scene with the study's keys; what the scene does not take is placed at the study.
SceneModel Bind(const data::Study& study, const SceneModelOptions& options,
                std::span<const double> theta) {
  try {
    return SceneModel(options, theta);
  } catch (const Error& e) {
    const std::string text = e.what();
    if (text.rfind("--set ", 0) != 0) throw;
    throw Error("the scene does not take a key that the study drives: " + text.substr(6),
                study.path, "look the key up in " + study.scene);
  }
}

// Trial and model at the estimate, side by side, for the page.
Comparison AtEstimate(const SceneModel& model, const data::FitRecord& record,
                      const correlate::Observations& observations) {
  constexpr double kStep = 5e-4;  // [s]
  Comparison c;
  c.record = "the trial";
  c.reference = "the model at the estimate";
  c.reference_is_run = true;
  c.observations = observations;
  for (const correlate::MarkSeries& m : observations.marks) c.marks.push_back(m.name);
  std::vector<double> theta;
  for (const auto& p : record.parameters) theta.push_back(p.value);
  const double end = observations.End() - observations.Start();
  const correlate::SampledModel sampled(model, theta, c.marks, 0.0, end, kStep);
  if (!sampled.good()) return c;
  for (const correlate::ModelEvent& e : sampled.events()) {
    if (e.kind == "latch") c.latches.push_back(e);
  }
  CompareWith(sampled, {}, &c);
  return c;
}

int FitVerb(const Common& common, const Settings& s) {
  const auto start = std::chrono::steady_clock::now();
  const data::Study study = data::ReadStudy(s.study, s.sets);
  const data::StudyTrial& trial = study.trials.front();
  const std::string tracks = s.tracks.empty() ? trial.tracks : s.tracks;
  const correlate::Observations observations = ReadTrial(trial, tracks);

  correlate::FitProblem problem;
  problem.parameters = ParametersOf(study);
  std::vector<double> theta;
  SceneModelOptions binding{study.scene, study.set, {}, study.rtol};
  for (std::size_t j = 0; j < problem.parameters.size(); ++j) {
    theta.push_back(problem.parameters[j].start);
    binding.keys.push_back(study.parameters[j].keys);
  }
  SceneModel model = Bind(study, binding, theta);
  std::unique_ptr<SceneModel> finer;
  if (study.mesh_check) {
    SceneModelOptions fine = binding;
    for (const std::string& key : study.mesh_check->keys) {
      fine.set.push_back(fmt::format("{}={:.17g}", key, study.mesh_check->value));
    }
    fine.rtol = 0.1 * binding.rtol;
    finer = std::make_unique<SceneModel>(Bind(study, fine, theta));
    const double gain = std::pow(study.mesh_check->spacing_ratio, study.mesh_check->order);
    problem.finer = finer.get();
    problem.finer_factor = gain / (gain - 1.0);  // Richardson: what is left of the coarse error
  }
  problem.model = &model;
  problem.observations = &observations;
  for (const correlate::MarkSeries& m : observations.marks) {
    if (std::find(model.marks().begin(), model.marks().end(), m.name) == model.marks().end()) {
      throw Error("the scene has no mark '" + m.name + "'", trial.where,
                  "name the marks to use; the scene has " + JoinWords(model.marks()));
    }
  }
  data::Provenance provenance = StartProvenance(common);
  for (const std::string& input : {s.study, study.scene, tracks}) provenance.AddInput(input);
  for (const std::string& set : s.sets) {
    provenance.options["set " + set.substr(0, set.find('='))] = set.substr(set.find('=') + 1);
  }

  model.MeasureNoise(theta, observations.StampsAt(observations.Start()), s.workers);
  correlate::FitOptions options;
  options.stages = study.stages;
  options.max_iterations = study.max_iterations;
  options.workers = s.workers;
  Progress progress("fit", !common.quiet && !common.json);
  options.progress = [&](const correlate::FitProgress& at) {
    // Of a fit's length nobody knows more than that few take thirty evaluations a stage.
    constexpr double kTypical = 20.0;
    const double done = static_cast<double>(at.evaluations) /
                        (static_cast<double>(at.evaluations) + 0.5 * kTypical);
    std::string note = fmt::format("{} evaluations", at.evaluations);
    if (at.best_cost > 0.0) note += fmt::format(", best so far {:.4g}", at.best_cost);
    progress.Update(std::min(0.95, done), note);
  };
  const correlate::FitResult result = correlate::Fit(problem, options);
  const data::FitRecord record = RecordOf(study, problem.parameters, result, observations);
  const std::string output = s.output.empty() ? DefaultOutput(s.study, ".h5") : s.output;
  data::WriteFit(output, record, provenance);
  if (!s.report.empty()) {
    Comparison comparison;
    if (result.Usable()) comparison = AtEstimate(model, record, observations);
    WriteFitPage(s.report, {record, problem, result, comparison, provenance});
  }
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  Finish(common, Json(record, output, seconds), Text(record, seconds));
  return result.Usable() ? kExitGood : kExitNotUsable;
}

}  // namespace

Verb AddFit(CLI::App& program, Common& common) {
  CLI::App* app = DeclareVerb(program, common, "fit",
                              "Parameters of a scene, and what they are worth, from a trial",
                              "unfurl fit study.toml -o fit.h5 --report fit.html");
  auto settings = std::make_shared<Settings>();
  app->add_option("STUDY", settings->study, "The study (TOML)")->required();
  app->add_option("-o,--output", settings->output,
                  "The fit to write (default: the study's name, .h5)");
  app->add_option("--report", settings->report, "A page to look at (HTML)");
  app->add_option("--tracks", settings->tracks, "Tracks to fit to instead of the study's");
  app->add_option("--set", settings->sets, "Overrides a key of the study (repeatable)")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  app->add_option("--workers", settings->workers,
                  "Simulations at a time (default: one per core); does not change the result");
  return {app, [&common, settings] { return FitVerb(common, *settings); }};
}

}  // namespace unfurl::cli
