// `unfurl effects` of studies: effects by evidence, and rival laws.
#include "cli/effects_study.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.h"
#include "base/length.h"
#include "base/number.h"
#include "base/progress.h"
#include "base/text.h"
#include "data/study.h"
#include "study/rivals.h"
#include "study/trial_effects.h"

namespace unfurl::cli {

namespace {

using nlohmann::ordered_json;

std::string ShiftText(const study::TrialEffect& e) {
  std::vector<std::string> words;
  for (const auto& s : e.shifts) words.push_back(fmt::format("{} {:+.2f}", s.name, s.sigmas));
  for (const std::string& name : e.released) words.push_back(name + " gone");
  return JoinWords(words);
}

std::string GainText(const correlate::PredictiveGain& gain) {
  return gain.stretches > 1 ? fmt::format("{:+.3g} +- {:.2g}", gain.gain, gain.sigma) : "-";
}

ordered_json GainJson(const correlate::PredictiveGain& gain) {
  return {{"gain", gain.gain}, {"sigma", gain.sigma}, {"stretches", gain.stretches}};
}

void RefuseSigma(const EffectsArguments& a) {
  if (!a.sigma.empty()) throw Error("is the trial's own", "--sigma", "leave it out for a study");
  if (a.duration != 0.0) {
    throw Error("is the trial's own", "--duration", "leave it out for a study");
  }
}

std::string SizeText(const study::TrialEffect& t) {
  return NumberWithError(t.size, t.size_sigma) + UnitAfter(t.unit);
}

// What the scene lacks, with its size, and what can be left out.
std::string FoundWords(const study::TrialEffects& e) {
  std::vector<std::string> missed;
  for (const study::TrialEffect& t : e.effects) {
    if (t.effect.there || t.verdict != study::EffectVerdict::kNeeded) continue;
    missed.push_back(t.effect.name + (t.size_sigma > 0.0 ? " (" + SizeText(t) + ")" : ""));
  }
  return (missed.empty() ? "" : "the scene lacks " + JoinWords(missed) + "; ") +
         LeftOutWords(e.left_out);
}

// A row of the table and an object of the summary.
void AddEffect(const study::TrialEffect& t, EffectsTold* out) {
  ordered_json one = {{"name", t.effect.name},  {"there", t.effect.there},
                      {"set", t.effect.set},    {"verdict", study::Name(t.verdict)},
                      {"released", t.released}, {"runs", t.runs},
                      {"looks", t.looks},       {"seconds", t.seconds}};
  if (!t.message.empty()) one["message"] = t.message;
  if (t.size_sigma > 0.0) {
    one["size"] = t.size;
    one["size_sigma"] = t.size_sigma;
    one["unit"] = t.unit;
  }
  if (!t.fitted) {
    out->rows.push_back(
        {EffectLabel(t.effect), study::Name(t.verdict), "-", "-", "-", "-", "-", "-", t.message});
    out->json["effects"].push_back(std::move(one));
    return;
  }
  one["settled"] = t.settled;
  one["probability"] = t.probability;
  one["deviance"] = t.deviance;
  one["deviance_least"] = t.deviance_least;
  one["deviance_error"] = t.deviance_error;
  one["deviance_left"] = t.deviance_left;
  one["held_out"] = GainJson(t.held_out);
  one["share"] = t.share;
  one["change"] = t.change;
  one["change_sigma"] = t.change_sigma;
  one["change_rms"] = t.change_rms;
  one["saved"] = t.saved;
  one["latches"] = t.latches;
  for (const auto& s : t.shifts) one["shifts"][s.name] = s.sigmas;
  out->json["effects"].push_back(std::move(one));
  std::vector<std::string> words;
  if (t.size_sigma > 0.0) {
    words.push_back("size " + SizeText(t));
  }
  const std::string shifts = ShiftText(t);
  if (!shifts.empty()) words.push_back(shifts);
  if (!t.latches.empty()) words.push_back(JoinWords(t.latches));
  if (!t.message.empty()) words.push_back(t.message);
  out->rows.push_back({EffectLabel(t.effect), study::Name(t.verdict),
                       fmt::format("{:.3g}", t.probability), fmt::format("{:+.4g}", t.deviance),
                       GainText(t.held_out), fmt::format("{:.2g}", t.change),
                       LengthText(t.change_rms), fmt::format("{:.0f}%", 100.0 * t.saved),
                       fmt::format("{}", fmt::join(words, "; "))});
}

}  // namespace

std::string EffectLabel(const study::EffectSwitch& effect) {
  return (effect.there ? "without " : "with ") + effect.name;
}

std::string LeftOutWords(const std::vector<std::string>& names) {
  return names.empty() ? "nothing can be left out" : "can be left out: " + JoinWords(names);
}

EffectsTold EffectsOfStudy(const Common& common, const EffectsArguments& a) {
  RefuseSigma(a);
  study::TrialEffectsOptions options;
  options.part = a.part;
  options.each = a.each;
  options.budget = a.budget;
  options.workers = a.workers;
  options.Check();
  study::TrialEffects e;
  const data::Study study = data::ReadStudy(a.input, a.sets);
  {
    Progress progress("effects", !common.quiet);
    options.progress = [&](double part, const std::string& what) { progress.Update(part, what); };
    e = study::WeighTrialEffects(study, options);
  }
  EffectsTold out;
  out.usable = e.fit.Usable();
  out.message = e.fit.result.message;
  out.title = "What each effect counts for";
  out.head = fmt::format("{}: {}\n", a.input, e.fit.record.verdict);
  out.rows = {{"", "verdict", "probability", "deviance", "held out", "change", "of marks",
               "CPU saved", "parameters move by; latches"}};
  out.text_columns = {0, 1, 8};
  out.json = {{"study", a.input},
              {"scene", study.scene},
              {"verdict", e.fit.record.verdict},
              {"seconds", e.seconds},
              {"effects", ordered_json::array()}};
  for (const study::TrialEffect& t : e.effects) AddEffect(t, &out);
  out.note =
      "probability that the effect is in the trial; deviance: by how much -2 log likelihood rises "
      "without it; held out: how much better stretches of the record are predicted with it, in "
      "nats; change of the fitted motion in sigmas of the data; parameters in standard errors";
  out.headline = FoundWords(e);
  out.closing = fmt::format("({})\n{}\n", out.note, out.headline);
  out.explained = study::Explains(e.fit);
  if (!out.explained) {
    out.closing +=
        "the model does not explain the data: what is missing may speak for or against any of "
        "these effects, and only what is beyond that is told\n";
  }
  out.json["explains"] = out.explained;
  out.json["left_out"] = e.left_out;
  out.left_out = LeftOutWords(e.left_out);
  out.json["reduced_change"] = e.reduced_change;
  out.set = e.set;
  out.scene = study.scene;
  out.scene_sets = study.set;
  return out;
}

EffectsTold EffectsOfRivals(const Common& common, const EffectsArguments& a) {
  RefuseSigma(a);
  study::RivalsOptions options;
  options.workers = a.workers;
  const std::vector<data::Study> studies = {data::ReadStudy(a.input, a.sets),
                                            data::ReadStudy(a.rival)};
  std::vector<study::Rival> rivals;
  {
    Progress progress("rivals", !common.quiet);
    options.progress = [&](double part, const std::string& what) { progress.Update(part, what); };
    rivals = study::WeighRivals(studies, options);
  }
  EffectsTold out;
  const study::Rival& best = rivals.front();
  out.usable = best.message.empty();
  out.message = best.message;
  out.title = "Which law it is";
  out.head = fmt::format("{} and {}, on the same data\n", a.input, a.rival);
  out.rows = {
      {"", "probability", "deviance", "parameters", "held out", "explains the data", "study"}};
  out.text_columns = {0, 5, 6};
  out.json = {{"study", a.input}, {"rival", a.rival}, {"rivals", ordered_json::array()}};
  for (const study::Rival& r : rivals) {
    const bool fitted = r.message.empty();
    const std::string words = r.explains ? "yes" : "no";
    out.rows.push_back({r.name, fmt::format("{:.3g}", r.probability),
                        fitted ? fmt::format("{:+.4g}", r.deviance) : "-",
                        fmt::format("{:g}", r.parameters),
                        !fitted       ? "-"
                        : &r == &best ? "best"
                                      : GainText(r.behind) + " behind",
                        fitted ? words : r.message, r.path});
    ordered_json one = {{"name", r.name},
                        {"study", r.path},
                        {"probability", r.probability},
                        {"parameters", r.parameters}};
    if (fitted) {
      one["deviance"] = r.deviance;
      one["explains"] = r.explains;
      one["behind"] = GainJson(r.behind);
    } else {
      one["message"] = r.message;
    }
    out.json["rivals"].push_back(std::move(one));
  }
  out.closing =
      best.explains
          ? fmt::format("probably {}: {:.3g}, were one of them right and none preferred\n",
                        best.name, best.probability)
          : "none of them explains the data: probabilities among wrong laws tell which is nearer\n";
  out.explained = best.explains;
  out.json["best"] = best.name;
  out.json["explains"] = best.explains;
  return out;
}

}  // namespace unfurl::cli
