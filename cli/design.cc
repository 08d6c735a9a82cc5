// `unfurl design`: what of a trial tells of each parameter, and what would tell more.
#include "study/design.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/number.h"
#include "base/progress.h"
#include "base/table.h"
#include "campaign/json_number.h"
#include "cli/design_page.h"
#include "cli/verb.h"
#include "data/atomic_file.h"
#include "data/lab.h"
#include "data/rig.h"
#include "data/toml_override.h"
#include "data/toml_study.h"
#include "measure/camera_model.h"
#include "study/design_advice.h"

namespace unfurl::cli {

namespace {

using nlohmann::ordered_json;

struct DesignArguments {
  std::string study, candidates, rig, lab, write_lab, write_study, report, trial;
  std::vector<std::string> sets, wanted, kept;
  int stretches = 8;
  std::size_t workers = 0;
  bool allow_programs = false;
};

ordered_json ToJson(const study::StudyDesign& d, const study::DesignCase& c) {
  ordered_json out = {{"name", c.name}};
  if (!c.message.empty()) {
    out["message"] = c.message;
    return out;
  }
  if (!c.cycle.empty()) out["cycle"] = c.cycle;
  for (std::size_t j = 0; j < c.alone.size(); ++j) {
    const std::string& name = d.tells.parameters[j];
    out["sigma"][name] = campaign::NumberOrNull(c.alone[j]);
    out["sigma_together"][name] = campaign::NumberOrNull(c.together[j]);
  }
  return out;
}

ordered_json ToJson(const study::StudyDesign& d, const std::vector<study::DesignCase>& cases) {
  ordered_json out = ordered_json::array();
  for (const study::DesignCase& c : cases) out.push_back(ToJson(d, c));
  return out;
}

ordered_json ToJson(const study::StudyDesign& d,
                    const std::vector<correlate::Contribution>& parts) {
  ordered_json out = ordered_json::array();
  for (const correlate::Contribution& c : parts) {
    ordered_json one = {{"name", c.name}, {"readings", c.readings}};
    for (std::size_t j = 0; j < c.share.size(); ++j) {
      one["share"][d.tells.parameters[j]] = c.share[j];
      one["without"][d.tells.parameters[j]] = campaign::NumberOrNull(c.without[j]);
    }
    out.push_back(std::move(one));
  }
  return out;
}

ordered_json Json(const DesignArguments& a, const study::StudyDesign& d) {
  ordered_json out = {{"study", a.study},
                      {"advice", study::Advice(d)},
                      {"verdict", d.fit.record.verdict},
                      {"parameters", ordered_json::object()},
                      {"wanted", d.wanted}};
  for (std::size_t j = 0; j < d.now.size(); ++j) {
    out["parameters"][d.tells.parameters[j]] = {
        {"sigma", d.now[j]}, {"white", d.tells.sigma[j]}, {"prior", d.tells.priors[j]}};
  }
  out["tells"] = {{"series", ToJson(d, d.tells.series)},
                  {"lines", ToJson(d, d.tells.lines)},
                  {"times", ToJson(d, d.tells.times)}};
  out["cycle"] = d.cycle;
  out["again"] = ToJson(d, d.again);
  if (!d.cycle.empty()) out["schedule"] = ToJson(d, d.schedule);
  out["marks"] = ToJson(d, d.marks);
  out["channels"] = ToJson(d, d.channels);
  out["trials"] = ToJson(d, d.trials);
  out["notes"] = d.notes;
  return out;
}

std::string Text(const DesignArguments& a, const study::StudyDesign& d) {
  std::string out =
      fmt::format("{}: {}\nThe fit: {}\n", a.study, study::Advice(d), d.fit.record.verdict);
  for (std::size_t j = 0; j < d.now.size(); ++j) {
    const auto& p = d.fit.record.parameters[j];
    out += fmt::format("  {} {:.5g}{}, standard error of the data {}\n", p.name, p.value,
                       UnitAfter(p.unit), Number(d.now[j], 2));
  }
  out += "\nwhat the trials at hand tell (share of the information; error without it)\n";
  out += AlignedTable(ContributionRows(d.tells.series, d.tells.parameters, "what"));
  if (!d.tells.lines.empty()) {
    out += "\n" + AlignedTable(ContributionRows(d.tells.lines, d.tells.parameters, "line"));
  }
  if (!d.tells.cameras.empty()) {
    out += "\n" + AlignedTable(ContributionRows(d.tells.cameras, d.tells.parameters, "camera"));
  }
  out += "\n" + AlignedTable(ContributionRows(d.tells.times, d.tells.parameters, "time"));
  out +=
      "\nwhat to do next (standard error over today's: by that trial alone, and together with "
      "what is there)\n";
  std::vector<study::DesignCase> next = {d.again};
  if (!d.cycle.empty()) next.push_back(d.schedule);
  out += AlignedTable(PlanRows(d, next, "cycle"));
  if (d.cycle.empty()) out += fmt::format("(no strobe to plan: {})\n", d.no_cycle);
  if (!d.marks.empty()) out += "\n" + AlignedTable(PlanRows(d, d.marks, "with the mark"));
  if (!d.channels.empty()) out += "\n" + AlignedTable(PlanRows(d, d.channels, "with"));
  if (!d.trials.empty()) out += "\n" + AlignedTable(PlanRows(d, d.trials, "trial"));
  for (const study::DesignCase& c : d.trials) {
    if (!c.message.empty()) out += fmt::format("{}: {}\n", c.name, c.message);
  }
  for (const std::string& note : d.notes) out += "note: " + note + "\n";
  return out;
}

// The candidate that leaves least open of the wanted parameters, with what is there.
std::size_t BestTrial(const study::StudyDesign& d) {
  std::size_t best = d.trials.size();
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t t = 0; t < d.trials.size(); ++t) {
    const double cost = study::FactorOf(d, d.trials[t]);
    if (cost < least) least = cost, best = t;
  }
  return best;
}

correlate::CameraSights SightsOf(const data::Rig& rig) {
  correlate::CameraSights out;
  for (const data::RigCamera& camera : rig.cameras) out.names.push_back(camera.name);
  out.gradient = [rig](std::size_t camera, const Eigen::Vector3d& p) -> Eigen::Vector3d {
    return measure::ReadingGradient(rig.cameras[camera], p);
  };
  return out;
}

void CheckOutputs(const DesignArguments& a, const study::DesignOptions& options) {
  if (!a.write_lab.empty() && a.lab.empty()) {
    throw Error("there is no laboratory to write", "--write-lab", "name it with --lab");
  }
  if (!a.write_study.empty() && options.candidates.trials.empty()) {
    throw Error("there is no trial to choose from", "--write-study",
                "list [trial.NAME] in the file of --candidates");
  }
}

std::string WriteOutputs(const DesignArguments& a, const study::DesignOptions& options,
                         const study::StudyDesign& d, ordered_json* json) {
  std::string text;
  if (!a.write_lab.empty()) {
    std::string slots;
    for (const std::string& slot : d.schedule.cycle) {
      slots += fmt::format("{}\"{}\"", slots.empty() ? "" : ", ", slot);
    }
    data::WriteTextFile(
        a.write_lab,
        fmt::format("# Made from {} by `unfurl design`, with another cycle.\n{}", a.lab,
                    data::TextWithOverrides(a.lab, {"strobe.slots=[" + slots + "]"})));
    text += "laboratory with that cycle -> " + a.write_lab + "\n";
    (*json)["lab"] = a.write_lab;
  }
  if (!a.write_study.empty()) {
    const std::size_t best = BestTrial(d);
    if (best == d.trials.size()) {
      throw Error("none of the candidate trials runs", "--write-study",
                  "see the table for each one's reason");
    }
    const data::DesignTrial& next = options.candidates.trials[best];
    data::WriteTextFile(
        a.write_study,
        fmt::format(
            "# Made from {} by `unfurl design`: with the next trial, \"{}\", whose tracks are "
            "to be recorded.\n{}",
            a.study, next.name,
            data::StudyWithTrial(a.study, a.sets, d.trial, next.name, next.name + ".h5",
                                 next.set)));
    text += fmt::format("study with the trial \"{}\" -> {}\n", next.name, a.write_study);
    (*json)["next_study"] = a.write_study;
    (*json)["next_trial"] = next.name;
  }
  return text;
}

int RunDesign(const Common& common, const DesignArguments& a) {
  const data::Study study = data::ReadStudy(a.study, a.sets);
  study::DesignOptions options;
  if (!a.candidates.empty()) options.candidates = data::ReadDesign(a.candidates);
  options.wanted = a.wanted;
  options.kept = a.kept;
  options.trial = a.trial;
  options.stretches = a.stretches;
  options.workers = a.workers;
  options.allow_programs = ProgramsAllowed(a.allow_programs);
  if (!a.lab.empty()) {
    const data::Lab lab = data::ReadLab(a.lab);
    options.cycle = lab.strobe.slots;
    options.line_rate = lab.strobe.line_rate;
  }
  if (!a.rig.empty()) options.cameras = SightsOf(data::ReadRig(a.rig));
  CheckOutputs(a, options);
  study::StudyDesign d;
  try {
    Progress progress("design", !common.quiet);
    options.progress = [&](double part, const std::string& what) { progress.Update(part, what); };
    d = study::DesignStudy(study, options);
  } catch (const Error& e) {
    throw AtOption(e, {{"DesignOptions.wanted", "--for"},
                       {"DesignOptions.kept", "--keep"},
                       {"DesignOptions.trial", "--trial"},
                       {"DesignOptions.cycle", "--lab"},
                       {"DesignOptions.cameras", "--rig"},
                       {"DesignOptions.stretches", "--stretches"}});
  }
  if (!d.fit.Usable()) return FitNotUsable(a.study, d.fit.result.message);
  ordered_json json = Json(a, d);
  std::string text = Text(a, d) + WriteOutputs(a, options, d, &json);
  if (!a.report.empty()) {
    data::Provenance provenance = StartProvenance(common);
    for (const std::string& input : d.fit.binding->inputs) provenance.AddInput(input);
    WriteDesignPage(a.report, study.name, d, provenance);
    text += "page -> " + a.report + "\n";
    json["report"] = a.report;
  }
  Finish(common, json, text);
  return kExitGood;
}

}  // namespace

Verb AddDesign(CLI::App& program, Common& common) {
  Verb verb = DeclareVerb(program, common, "design",
                          "What a trial tells of each parameter, and what to measure next",
                          "unfurl design study.toml --candidates next.toml --report design.html");
  CLI::App* app = verb.app;
  VerbFiles& files = *verb.files;
  auto a = std::make_shared<DesignArguments>();
  files.Read("STUDY", &a->study, "The study, whose trials are recorded (TOML)")->required();
  files.Read("--candidates", &a->candidates,
             "Marks, instruments and trials to choose from (TOML; docs/design.md)");
  files.Read("--rig", &a->rig, "The rig that saw the marks, for what each camera tells (HDF5)");
  files.Read("--lab", &a->lab, "The laboratory, for the strobe's cycle (default: as tracks show)");
  files.Write("--write-lab", &a->write_lab, "Write the laboratory with the best cycle (TOML)");
  files.Write("--write-study", &a->write_study,
              "Write the study with the best of the candidate trials added (TOML)");
  files.Page(&a->report, "Also write a page (HTML)");
  files.Overrides(&a->sets, "Overrides a key of the study (repeatable)");
  app->add_option("--for", a->wanted, "Parameters whose errors count (default: all)")
      ->delimiter(',')
      ->type_name("NAMES");
  app->add_option("--keep", a->kept, "Marks that stay lit in some line of the cycle")
      ->delimiter(',')
      ->type_name("NAMES");
  app->add_option("--trial", a->trial, "The trial to plan others like (default: the first)")
      ->type_name("NAME");
  app->add_option("--stretches", a->stretches, "Stretches of time to tell apart")
      ->capture_default_str();
  app->add_option("--workers", a->workers, "Simulations at a time (default: one per core)");
  AddAllowPrograms(app, &a->allow_programs);
  verb.run = [&common, a] { return RunDesign(common, *a); };
  return verb;
}

}  // namespace unfurl::cli
