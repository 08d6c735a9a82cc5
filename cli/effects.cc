// `unfurl effects`: which effects of a scene, or of a trial, count.
#include "study/effects.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/length.h"
#include "base/progress.h"
#include "base/table.h"
#include "base/text.h"
#include "cli/verb.h"
#include "data/atomic_file.h"
#include "data/formats.h"
#include "report/page.h"
#include "study/trial_effects.h"

namespace unfurl::cli {

namespace {

using nlohmann::ordered_json;

struct Arguments {
  std::string input, out, report, sigma;
  std::vector<std::string> sets;
  double part = 0.3, duration = 0.0;
  bool each = false;
  std::size_t workers = 0;
};

// What both kinds of input come to.
struct Told {
  bool usable = true;   // the study's fit
  std::string message;  // of one that is not
  std::string head, closing;
  std::vector<std::vector<std::string>> rows;  // the first is the header
  ordered_json json;
  std::vector<std::string> set;  // of the reduced scene
  std::string scene;             // that it is made from
  std::string left_out;          // in words
  std::vector<std::string> scene_sets;
};

// "without" of an effect that is there, "with" of one that is not.
std::string Label(const study::EffectSwitch& effect) {
  return (effect.there ? "without " : "with ") + effect.name;
}

std::string LeftOut(const std::vector<std::string>& names) {
  return names.empty() ? "nothing can be left out" : "can be left out: " + JoinWords(names);
}

Told OfScene(const Common& common, const Arguments& a) {
  study::SceneEffectsOptions options;
  options.part = a.part;
  options.duration = a.duration;
  options.each = a.each;
  if (!a.sigma.empty() && (!ParseLength(a.sigma, &options.sigma) || !(options.sigma > 0.0))) {
    throw Error("'" + a.sigma + "' is no length", "--sigma", "write 0.2mm, say");
  }
  study::SceneEffects e;
  {
    Progress progress("effects", !common.quiet);
    options.progress = [&](double part, const std::string& what) { progress.Update(part, what); };
    e = study::WeighEffects(a.input, a.sets, options);
  }
  Told out;
  out.head = fmt::format(
      "{}: {:g} s, {:.2g} s of CPU; a tighter tolerance moves its marks by {} RMS at most\n",
      a.input, e.duration, e.seconds, LengthText(e.floor));
  out.rows = {{"", "verdict", "mark", "RMS", "largest", "CPU saved", "latches"}};
  out.json = {{"scene", a.input},     {"duration", e.duration}, {"rtol", e.rtol},
              {"seconds", e.seconds}, {"floor", e.floor},       {"effects", ordered_json::array()}};
  for (const study::EffectChange& c : e.effects) {
    const bool ran = c.message.empty();
    const double saved = 100.0 * (1.0 - c.seconds / e.seconds);
    out.rows.push_back({Label(c.effect), study::Name(c.verdict), c.mark,
                        ran ? LengthText(c.rms) : "-", ran ? LengthText(c.largest) : "-",
                        ran ? fmt::format("{:.0f}%", saved) : "-",
                        ran ? (c.latches.empty() ? "the same" : JoinWords(c.latches)) : c.message});
    ordered_json one = {{"name", c.effect.name},
                        {"there", c.effect.there},
                        {"set", c.effect.set},
                        {"verdict", study::Name(c.verdict)}};
    if (ran) {
      one["mark"] = c.mark;
      one["rms"] = c.rms;
      one["largest"] = c.largest;
      one["seconds"] = c.seconds;
      one["latches"] = c.latches;
    } else {
      one["message"] = c.message;
    }
    out.json["effects"].push_back(std::move(one));
  }
  if (options.sigma > 0.0) {
    out.closing = fmt::format(
        "{}; together that moves the marks by {} RMS, and saves {:.0f}% CPU\n", LeftOut(e.left_out),
        LengthText(e.reduced_rms), 100.0 * (1.0 - e.reduced_seconds / e.seconds));
  } else {
    out.closing = "no verdicts without --sigma, the error of a mark in the trial that is meant\n";
  }
  out.json["left_out"] = e.left_out;
  out.left_out = LeftOut(e.left_out);
  out.json["reduced_rms"] = e.reduced_rms;
  out.set = e.set;
  out.scene = a.input;
  out.scene_sets = a.sets;
  return out;
}

std::string ShiftText(const study::TrialEffect& e) {
  std::vector<std::string> words;
  for (const auto& s : e.shifts) words.push_back(fmt::format("{} {:+.2f}", s.name, s.sigmas));
  for (const std::string& name : e.released) words.push_back(name + " gone");
  return JoinWords(words);
}

Told OfStudy(const Common& common, const Arguments& a) {
  if (!a.sigma.empty()) {
    throw Error("is the trial's own", "--sigma", "leave it out for a study");
  }
  study::TrialEffectsOptions options;
  options.part = a.part;
  options.each = a.each;
  options.workers = a.workers;
  study::TrialEffects e;
  const data::Study study = data::ReadStudy(a.input, a.sets);
  {
    Progress progress("effects", !common.quiet);
    options.progress = [&](double part, const std::string& what) { progress.Update(part, what); };
    e = study::WeighTrialEffects(study, options);
  }
  Told out;
  out.usable = e.fit.Usable();
  out.message = e.fit.result.message;
  out.head = fmt::format("{}: {}\n", a.input, e.fit.record.verdict);
  out.rows = {{"", "verdict", "probability", "deviance", "change", "parameters move by"}};
  out.json = {{"study", a.input},
              {"scene", study.scene},
              {"verdict", e.fit.record.verdict},
              {"seconds", e.seconds},
              {"effects", ordered_json::array()}};
  for (const study::TrialEffect& t : e.effects) {
    const bool ran = t.message.empty();
    out.rows.push_back(
        {Label(t.effect), study::Name(t.verdict), ran ? fmt::format("{:.3g}", t.probability) : "-",
         ran ? fmt::format("{:+.4g}", t.deviance) : "-",
         ran ? fmt::format("{:.2g}", t.change) : "-", ran ? ShiftText(t) : t.message});
    ordered_json one = {{"name", t.effect.name},
                        {"there", t.effect.there},
                        {"set", t.effect.set},
                        {"verdict", study::Name(t.verdict)},
                        {"released", t.released}};
    if (ran) {
      one["probability"] = t.probability;
      one["deviance"] = t.deviance;
      one["change"] = t.change;
      one["seconds"] = t.seconds;
      for (const auto& s : t.shifts) one["shifts"][s.name] = s.sigmas;
    } else {
      one["message"] = t.message;
    }
    out.json["effects"].push_back(std::move(one));
  }
  out.closing = fmt::format(
      "(probability that the effect is in the trial; deviance: by how much -2 log likelihood "
      "rises; "
      "change of the fitted motion in sigmas of the data; parameters in standard errors)\n{}\n",
      LeftOut(e.left_out));
  out.json["left_out"] = e.left_out;
  out.left_out = LeftOut(e.left_out);
  out.json["reduced_change"] = e.reduced_change;
  out.set = e.set;
  out.scene = study.scene;
  out.scene_sets = study.set;
  return out;
}

void WritePage(const Common& common, const Arguments& a, const Told& told) {
  report::Page page("Effects", a.input);
  page.AddWords(report::Level::kGood, std::string(told.closing.begin(), told.closing.end() - 1),
                {told.head});
  report::Table table;
  table.title = "What each effect counts for";
  table.header = told.rows.front();
  table.header.front() = "run";
  table.rows.assign(told.rows.begin() + 1, told.rows.end());
  table.text_columns = {0, 1, static_cast<int>(table.header.size()) - 1};
  page.AddTable(table);
  data::Provenance provenance = StartProvenance(common);
  provenance.AddInput(a.input);
  page.AddOrigin(provenance);
  page.Write(a.report);
}

int Run(const Common& common, const Arguments& a) {
  Told told = data::KindOf(a.input) == "study" ? OfStudy(common, a) : OfScene(common, a);
  if (!told.usable) return FitNotUsable(a.input, told.message);
  std::string text = told.head + AlignedTable(told.rows) + told.closing;
  if (!a.out.empty()) {
    data::WriteTextFile(
        a.out, fmt::format("# Made from {} by `unfurl effects`; {}.\n{}", told.scene, told.left_out,
                           study::ReducedScene(told.scene, told.scene_sets, told.set)));
    text += "reduced scene -> " + a.out + "\n";
    told.json["reduced_scene"] = a.out;
  }
  if (!a.report.empty()) {
    WritePage(common, a, told);
    text += "page -> " + a.report + "\n";
    told.json["report"] = a.report;
  }
  Finish(common, told.json, text);
  return kExitGood;
}

}  // namespace

Verb AddEffects(CLI::App& program, Common& common) {
  Verb verb = DeclareVerb(program, common, "effects",
                          "Which effects a scene or a trial calls for, and which can be left out",
                          "unfurl effects scene.toml --sigma 0.2mm -o reduced.toml");
  CLI::App* app = verb.app;
  VerbFiles& files = *verb.files;
  auto a = std::make_shared<Arguments>();
  files
      .Read("INPUT", &a->input,
            "A scene: each effect off, at its parameters; a study: the parameters fitted again "
            "without each (TOML)")
      ->required();
  files.Write("-o,--output", &a->out, "Where to write the scene without what is not needed (TOML)");
  files.Page(&a->report, "Also write a page (HTML)");
  files.Overrides(&a->sets, "Overrides a key of the scene or study (repeatable)");
  app->add_option("--sigma", a->sigma, "Of a scene: error of a mark's coordinate, such as 0.2mm")
      ->type_name("LENGTH");
  app->add_option("--part", a->part,
                  "Of a sigma: what is left out may move marks and parameters by less")
      ->capture_default_str();
  app->add_option("--duration", a->duration, "Of a scene: seconds to simulate (default: its own)");
  app->add_option("--workers", a->workers, "Of a study: simulations at a time; 0: all cores");
  app->add_flag("--each", a->each, "Each joint, beam and spring for itself");
  verb.run = [&common, a] { return Run(common, *a); };
  return verb;
}

}  // namespace unfurl::cli
