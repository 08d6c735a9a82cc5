#include "study/study_binding.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <mutex>

#include "base/error.h"
#include "base/text.h"
#include "correlate/fit/command_model.h"
#include "data/beside.h"
#include "data/formats.h"
#include "data/h5.h"
#include "data/tracks.h"
#include "sim/methods/choose_method.h"
#include "study/channel_unit_check.h"
#include "study/driven_keys.h"
#include "study/other_laws.h"
#include "study/rungs.h"
#include "study/scene_model.h"
#include "study/trial_observations.h"
#include "study/unit_check.h"

namespace unfurl::study {

namespace {

// Which calibration tracks were reconstructed with: the hash of the rig that `reconstruct` read.
std::string CalibrationOf(const std::string& path) {
  if (path.empty()) return {};
  if (data::FormatOf(path) != data::FileFormat::kHdf5) return {};
  const data::Provenance made =
      data::H5Reader(path, data::kTracksSchema, data::kTracksVersion).ReadProvenance();
  return made.inputs.size() == 2 ? made.inputs[1].sha256 : std::string();
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

// The scene with the study's keys; what the scene does not take is placed at the study.
std::unique_ptr<SceneModel> BindScene(const data::Study& study, const SceneModelOptions& options,
                                      std::span<const double> theta) {
  try {
    return std::make_unique<SceneModel>(options, theta);
  } catch (const Error& e) {
    const std::string text = e.what();
    if (!text.starts_with("--set ")) throw;
    throw Error("the scene does not take a key that the study drives: " + text.substr(6),
                study.path, "look the key up in " + study.scene);
  }
}

// What a trial names has to be in the scene.
void CheckNames(const data::StudyTrial& from, const correlate::Observations& observations,
                const SceneModel& model) {
  for (const correlate::MarkSeries& m : observations.marks) {
    if (std::find(model.marks().begin(), model.marks().end(), m.name) == model.marks().end()) {
      throw Error("the scene has no mark '" + m.name + "'", from.where,
                  "name the marks to use; the scene has " + JoinWords(model.marks()));
    }
  }
  auto check_place = [&](const std::string& kind, const std::string& where, const std::string& at) {
    const std::vector<std::string>& known = kind == "watch" ? model.watches() : model.joints();
    if (std::find(known.begin(), known.end(), where) != known.end()) return;
    throw Error(fmt::format("the scene has no {} '{}'", kind == "watch" ? "watch" : "joint", where),
                at, known.empty() ? "it has none" : "it has " + JoinWords(known));
  };
  for (const data::StudyEvent& e : from.events) check_place(e.kind, e.where, e.at);
  for (const data::StudyChannel& c : from.channels) {
    if (!c.event.empty()) check_place(c.event, c.joint, c.at);
  }
}

void BindScenes(const data::Study& study, const data::StudyTrial& from, const std::string& path,
                const std::vector<double>& theta, BindFor what, data::TextFiles* texts,
                correlate::FitTrial* trial, BoundStudy* bound) {
  correlate::Observations& observations = *bound->observations.back();
  constexpr double kAtFirst = 1e-5;  // where the tolerance is still to be chosen
  SceneModelOptions binding;
  binding.scene = study.scene;
  binding.texts = texts;
  binding.set = study.set;
  binding.rtol = study.rtol > 0.0 ? study.rtol : kAtFirst;
  binding.set.insert(binding.set.end(), from.set.begin(), from.set.end());
  for (const data::StudyParameter& p : study.parameters) binding.keys.push_back(p.keys);
  RefuseDrivenKeys(from.set, study.parameters, from.where);
  auto model = BindScene(study, binding, theta);
  CheckNames(from, observations, *model);
  AddChannels(from, &model->quantities(), &observations);
  for (const std::string& file : model->files()) bound->inputs.push_back(file);
  if (what == BindFor::kFit) {
    if (!observations.marks.empty()) RefuseOtherUnits(observations, *model, theta, path);
    RefuseOtherChannelUnits(from, study.parameters, observations, *model, theta);
  }
  const std::vector<SceneRung> rungs = RungsOf(study.fidelity, model->beams());
  // Each once: the fit begins with the motions that the tolerance was chosen by.
  std::map<std::pair<double, std::size_t>, std::shared_ptr<SceneModel>> made;
  std::mutex making;
  auto at = [&](double rtol, std::size_t rung) {
    constexpr double kDigits = 1e6;  // of the logarithm; a product may be rounded otherwise
    const std::lock_guard lock(making);
    auto& one = made[{std::round(kDigits * std::log10(rtol)), rung}];
    if (one != nullptr) return one;
    SceneModelOptions options = binding;
    options.rtol = rtol;
    if (rung < rungs.size()) {
      options.set.insert(options.set.end(), rungs[rung].set.begin(), rungs[rung].set.end());
    }
    return one = BindScene(study, options, theta);
  };
  if (study.rtol == 0.0) {
    // The residuals to come: noise, and what the finest rung leaves.
    std::shared_ptr<SceneModel> finer;
    double part = 0.0;
    if (rungs.size() > 1 && rungs[1].error > 0.0 && rungs[1].error < rungs[0].error) {
      finer = at(sim::TighterTolerance(binding.rtol), 1);
      part = rungs.back().error / (rungs[0].error - rungs[1].error);
    }
    bound->tolerance.push_back(correlate::ChooseTolerance(
        [&](double rtol) { return at(rtol, 0); }, finer.get(), theta, *trial->observations, part));
    binding.rtol = bound->tolerance.back().rtol;
  }
  auto keep = [&](std::shared_ptr<SceneModel> kept) {
    bound->models.push_back(std::move(kept));
    return bound->models.back().get();
  };
  trial->model = keep(at(binding.rtol, 0));
  trial->tighter = keep(at(sim::TighterTolerance(binding.rtol), 0));
  if (what == BindFor::kFit) {
    const SceneModel& plain = *at(binding.rtol, 0);
    const double length = std::min(observations.End() - observations.Start(), plain.duration());
    for (OtherLaw& law : OtherLawsOf(plain.joint_records(), plain, theta, length)) {
      SceneModelOptions options = binding;
      if (!rungs.empty()) {
        options.set.insert(options.set.end(), rungs[0].set.begin(), rungs[0].set.end());
      }
      options.set.insert(options.set.end(), law.set.begin(), law.set.end());
      trial->rivals.push_back({keep(BindScene(study, options, theta)), std::move(law.name),
                               std::move(law.unit), law.amount});
    }
  }
  if (rungs.empty()) return;
  trial->model_name = rungs[0].name;
  trial->model_relative_error = rungs[0].error > 0.0 ? rungs[0].error : 1.0;
  for (std::size_t r = 1; r < rungs.size(); ++r) {
    trial->rungs.push_back({keep(at(binding.rtol, r)), rungs[r].name, rungs[r].error});
  }
}

void BindCommand(const data::Study& study, const data::StudyTrial& from, correlate::FitTrial* trial,
                 BoundStudy* bound) {
  AddChannels(from, nullptr, bound->observations.back().get());
  const bool csv = data::FormatOf(study.command->tracks) != data::FileFormat::kHdf5;
  if (csv && !from.channels.empty()) {
    throw Error("a CSV of tracks holds no channels", from.channels.front().at,
                "let the program write a run file (.h5)");
  }
  if (!from.events.empty() && csv) {
    throw Error("a CSV of tracks holds no events", from.events.front().at,
                "let the program write a run file (.h5), or leave the event out");
  }
  correlate::CommandModelOptions options;
  for (const data::StudyParameter& p : study.parameters) options.parameters.push_back(p.name);
  options.words = study.command->words;
  options.files = study.command->files;
  options.tracks = study.command->tracks;
  options.timeout = study.command->timeout;
  options.retries = study.command->retries;
  options.study_folder = std::filesystem::absolute(study.path).parent_path().string();
  bound->models.push_back(std::make_unique<correlate::CommandModel>(options));
  trial->model = bound->models.back().get();
  if (study.command->finer.empty() || !study.fidelity.wanted) return;
  options.words = study.command->finer;
  bound->models.push_back(std::make_unique<correlate::CommandModel>(options));
  trial->model_name = "the program";
  trial->rungs.push_back({bound->models.back().get(), "the finer program", 0.0});
}

}  // namespace

BoundStudy Bind(const data::Study& study, const std::string& tracks, BindFor what) {
  data::TextFiles texts;  // every model of the study sees the same scene
  BoundStudy bound;
  bound.inputs.push_back(study.path);
  if (!tracks.empty() && study.trials.size() > 1) {
    throw Error("one file of tracks for several trials", "--tracks",
                "name each trial's tracks in the study");
  }
  bound.problem.parameters = ParametersOf(study);
  std::vector<double> theta;
  for (const correlate::Parameter& p : bound.problem.parameters) theta.push_back(p.start);
  if (study.command) {
    for (const std::string& file : study.command->files) {
      data::RequireFile(file, study.command->where);
      bound.inputs.push_back(file);
    }
  } else {
    data::RequireFile(study.scene, study.scene_at);
  }
  for (const data::StudyTrial& from : study.trials) {
    const std::string path = tracks.empty() ? from.tracks : tracks;
    if (tracks.empty() && !path.empty()) data::RequireFile(path, from.tracks_at);
    bound.observations.push_back(std::make_unique<correlate::Observations>(ReadTrial(from, path)));
    correlate::FitTrial trial;
    trial.name = from.name;
    trial.observations = bound.observations.back().get();
    trial.calibration = CalibrationOf(path);
    if (study.command) {
      BindCommand(study, from, &trial, &bound);
    } else {
      BindScenes(study, from, path, theta, what, &texts, &trial, &bound);
    }
    bound.problem.trials.push_back(trial);
    if (!path.empty()) bound.inputs.push_back(path);
    for (const data::StudyChannel& c : from.channels) bound.inputs.push_back(c.file);
  }
  std::vector<std::string> once;
  for (const std::string& input : bound.inputs) {
    if (std::find(once.begin(), once.end(), input) == once.end()) once.push_back(input);
  }
  bound.inputs = once;

  correlate::FitOptions& options = bound.options;
  options.stages = study.stages;
  options.stages_by_impacts = study.stages_by_impacts;
  options.free = study.free;
  options.max_iterations = study.max_iterations;
  options.search.screened = study.screened;
  options.search.starts = study.starts;
  options.search.seed = static_cast<std::uint64_t>(study.seed);
  options.whiten = study.whiten;
  options.profile.wanted = !study.profile_levels.empty();
  options.profile.levels = study.profile_levels;
  options.profile.max_evaluations = study.profile_evaluations;
  return bound;
}

std::string IdentityOf(const data::Provenance& provenance) {
  std::string text = provenance.program + "\n";
  for (const data::InputFile& input : provenance.inputs) text += input.sha256 + "\n";
  for (const auto& [key, value] : provenance.options) text += fmt::format("{} = {}\n", key, value);
  return text;
}

}  // namespace unfurl::study
