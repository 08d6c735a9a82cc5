// `unfurl effects`: which effects of a scene, or of a trial, count.
#include "study/effects.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/length.h"
#include "base/progress.h"
#include "base/sentence.h"
#include "base/table.h"
#include "base/text.h"
#include "cli/effects_study.h"
#include "cli/verb.h"
#include "data/atomic_file.h"
#include "data/formats.h"
#include "report/page.h"

namespace unfurl::cli {

namespace {

using nlohmann::ordered_json;

using EffectsArguments = EffectsArguments;
using Told = EffectsTold;

Told OfScene(const Common& common, const EffectsArguments& a) {
  study::SceneEffectsOptions options;
  options.part = a.part;
  options.duration = a.duration;
  options.each = a.each;
  if (!a.sigma.empty()) options.sigma = LengthOption(a.sigma, "--sigma");
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
    out.rows.push_back({EffectLabel(c.effect), study::Name(c.verdict), c.mark,
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
  if (options.sigma > 0.0 && e.left_out.empty()) {
    out.closing = LeftOutWords(e.left_out) + "\n";
  } else if (options.sigma > 0.0) {
    out.closing =
        fmt::format("{}; together that moves the marks by {} RMS, and saves {:.0f}% CPU\n",
                    LeftOutWords(e.left_out), LengthText(e.reduced_rms),
                    100.0 * (1.0 - e.reduced_seconds / e.seconds));
  } else {
    out.closing = "no verdicts without --sigma, the error of a mark in the trial that is meant\n";
  }
  out.json["left_out"] = e.left_out;
  out.title = "What each effect counts for";
  out.note =
      "How far the mark that is moved most is moved (RMS and at most) by a run without the "
      "effect, or with one that the scene leaves out, and how many of the latches' times. CPU "
      "saved: negative where "
      "the run takes longer.";
  out.text_columns = {0, 1, 6};
  out.left_out = LeftOutWords(e.left_out);
  out.json["reduced_rms"] = e.reduced_rms;
  out.set = e.set;
  out.scene = a.input;
  out.scene_sets = a.sets;
  return out;
}

void WritePage(const Common& common, const EffectsArguments& a, const Told& told) {
  report::Page page("Effects", a.input);
  const std::string closing(told.closing.begin(), told.closing.end() - 1);
  page.AddWords(told.explained ? report::Level::kGood : report::Level::kCare,
                Capitalised(told.headline.empty() ? closing : told.headline), {told.head});
  report::Table table;
  table.title = told.title;
  table.note = told.note;
  table.header = told.rows.front();
  table.header.front() = "run";
  table.rows.assign(told.rows.begin() + 1, told.rows.end());
  table.text_columns = told.text_columns;
  page.AddTable(table);
  data::Provenance provenance = StartProvenance(common);
  provenance.AddInput(a.input);
  if (!a.rival.empty()) provenance.AddInput(a.rival);
  page.AddOrigin(provenance);
  page.Write(a.report);
}

int RunEffects(const Common& common, const EffectsArguments& a) {
  const bool of_study = data::KindOf(a.input) == "study";
  if (!of_study && !a.rival.empty()) {
    throw Error("a scene has no rivals", "--rival", "compare studies of the same trial");
  }
  if (!a.rival.empty() && !a.out.empty()) {
    throw Error("rivals come to no reduced scene", "--output", "leave it out");
  }
  Told told = !of_study         ? OfScene(common, a)
              : a.rival.empty() ? EffectsOfStudy(common, a)
                                : EffectsOfRivals(common, a);
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
  auto a = std::make_shared<EffectsArguments>();
  files
      .Read("INPUT", &a->input,
            "A scene: each effect off, at its parameters; a study: the parameters fitted again "
            "without each (TOML)")
      ->required();
  files.WriteForm("-o,--output", &a->out, ".toml",
                  "Where to write the scene without what is not needed (TOML)");
  files.Page(&a->report, "Also write a page (HTML)");
  files.Overrides(&a->sets, "Overrides a key of the scene or study (repeatable)");
  app->add_option("--sigma", a->sigma, "Of a scene: error of a mark's coordinate, such as 0.2mm")
      ->type_name("LENGTH");
  app->add_option("--part", a->part,
                  "Of a sigma: what is left out may move marks and parameters by less")
      ->capture_default_str();
  app->add_option("--duration", a->duration, "Of a scene: seconds to simulate (default: its own)");
  app->add_option("--workers", a->workers, "Of a study: simulations at a time; 0: all cores");
  app->add_option("--budget", a->budget,
                  "Of a study: runs for each effect, in parts of those that the fit takes; what is "
                  "not settled by then is left open")
      ->capture_default_str();
  files.Read("--rival", &a->rival,
             "Of a study: another study of the same trial, a competing law; how probable is each");
  app->add_flag("--each", a->each, "Each joint, beam and spring for itself");
  verb.run = [&common, a] { return RunEffects(common, *a); };
  return verb;
}

}  // namespace unfurl::cli
