#include "study/trial_effects.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/cpu_time.h"
#include "base/error.h"
#include "correlate/fit/refit.h"
#include "correlate/residual/row_layout.h"
#include "study/effect_versions.h"
#include "study/latch_words.h"
#include "study/rivals.h"
#include "study/sized_effects.h"
#include "study/trial_observations.h"
#include "study/trial_verdict.h"

namespace unfurl::study {

namespace {

// Both fits' rows of a trial, without those of samples that either has no answer for.
struct Rows {
  Eigen::VectorXd a, b;
  double count = 0.0;  // of those that are left
};

Rows BothKnown(const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
  const Eigen::Index n = std::min(a.size(), b.size());
  Rows out{a.head(n), b.head(n)};
  for (Eigen::Index i = 0; i < n; ++i) {
    if (out.a(i) == 0.0 || out.b(i) == 0.0) out.a(i) = out.b(i) = 0.0;
    out.count += out.a(i) != 0.0 ? 1.0 : 0.0;
  }
  return out;
}

// Sums of squares over all trials.
struct Evidence {
  double as_is = 0.0, switched = 0.0;  // of the whitened residuals, priors with them
  double count = 0.0;                  // of rows
  double change = 0.0;                 // of the residuals from one to the other, not whitened
};

Evidence Gather(const correlate::Refitted& as_is, const correlate::Refitted& switched) {
  Evidence out;
  for (std::size_t t = 0; t < as_is.residual.size(); ++t) {
    const Rows plain = BothKnown(as_is.residual[t], switched.residual[t]);
    out.change += (plain.a - plain.b).squaredNorm();
    const Rows white = BothKnown(as_is.whitened[t], switched.whitened[t]);
    out.as_is += white.a.squaredNorm();
    out.switched += white.b.squaredNorm();
    out.count += white.count;
  }
  out.as_is += as_is.prior_squares;
  out.switched += switched.prior_squares;
  out.count = std::max(1.0, out.count);
  return out;
}

// RMS of what lies between the fitted marks [m].
double MarksMove(const correlate::Refitted& a, const correlate::Refitted& b) {
  double squares = 0.0, count = 0.0;
  for (std::size_t t = 0; t < a.metres.size(); ++t) {
    for (std::size_t m = 0; m < a.metres[t].size(); ++m) {
      const Eigen::Matrix3Xd &x = a.metres[t][m], &y = b.metres[t][m];
      for (Eigen::Index i = 0; i < x.cols(); ++i) {
        if (x.col(i).isZero(0.0) || y.col(i).isZero(0.0)) continue;
        squares += (x.col(i) - y.col(i)).squaredNorm();
        count += 1.0;
      }
    }
  }
  return count > 0.0 ? std::sqrt(squares / count) : 0.0;
}

double Seconds(const correlate::Refitted& r) {
  double out = 0.0;
  for (const auto& p : r.prediction) out += p->seconds;
  return out;
}

// By how much the change without an effect is uncertain with the parameters that go with it.
double ChangeSigma(const std::vector<correlate::Parameter>& parameters,
                   const correlate::Refitted& as_is, const std::vector<std::string>& released) {
  double squares = 0.0;
  for (std::size_t j = 0; j < parameters.size(); ++j) {
    const bool gone =
        std::find(released.begin(), released.end(), parameters[j].name) != released.end();
    if (gone) squares += as_is.moves[j] * as_is.moves[j];
  }
  return std::sqrt(squares);
}

// What switching did to the fit.
void Compare(const StudyFit& fit, const correlate::Refitted& as_is,
             const correlate::FitProblem& version, const correlate::Refitted& switched,
             const Evidence& e, TrialEffect* out) {
  out->fitted = true;
  out->settled = switched.status == correlate::RefitStatus::kSettled;
  // Residuals that are larger than their sigmas are not believed to tell as finely as these say.
  const double scale = std::max(1.0, e.as_is / e.count);
  const double sign = out->effect.there ? 1.0 : -1.0;
  out->deviance = sign * (e.switched - e.as_is) / scale;
  out->deviance_left = (1.0 - as_is.least) * e.as_is / scale;
  out->deviance_least = out->effect.there ? (switched.least * e.switched - e.as_is) / scale
                                          : out->deviance - (1.0 - as_is.least) * e.as_is / scale;
  const double more = std::max(e.switched, e.as_is);
  out->share = more > 0.0 ? std::max(0.0, sign * (e.switched - e.as_is)) / more : 0.0;
  out->left = e.switched / e.count;
  out->deviance_error = (switched.scatter + as_is.scatter) / scale;
  out->probability = ProbabilityOfEffect(out->deviance, e.count, *out);
  out->change = std::sqrt(e.change / e.count);
  out->change_rms = MarksMove(as_is, switched);
  const correlate::HeldOut& with = out->effect.there ? as_is.held_out : switched.held_out;
  const correlate::HeldOut& without = out->effect.there ? switched.held_out : as_is.held_out;
  out->held_out = correlate::CompareHeldOut(with, without);
  const auto& before = fit.problem().parameters;
  out->change_sigma = ChangeSigma(before, as_is, out->released);
  for (std::size_t i = 0; i < version.parameters.size(); ++i) {
    for (std::size_t j = 0; j < before.size(); ++j) {
      const double sigma = fit.result.parameters[j].sigma;
      if (before[j].name != version.parameters[i].name || !(sigma > 0.0)) continue;
      out->shifts.push_back({before[j].name, (switched.theta[i] - as_is.theta[j]) / sigma});
    }
  }
  for (std::size_t t = 0; t < as_is.prediction.size(); ++t) {
    constexpr double kTell = 1e-6;  // of the record: less is the simulator's own scatter
    const correlate::Observations& o = *fit.problem().trials[t].observations;
    for (std::string& word : LatchWords(as_is.prediction[t]->events, switched.prediction[t]->events,
                                        kTell * (o.End() - o.Start()))) {
      out->latches.push_back(std::move(word));
    }
  }
  const double was = Seconds(as_is), is = Seconds(switched);
  if (was > 0.0 && is > 0.0) out->saved = 1.0 - is / was;
}

// Versions of the study refitted from where the fit as it is came out.
class TrialBench {
 public:
  TrialBench(const data::Study& study, const TrialEffectsOptions& options, const StudyFit& fit)
      : options_(options),
        fit_(fit),
        versions_(study, fit),
        refits_(fit.problem(), fit.result, fit.binding->options) {
    double runs = 0.0;
    for (const correlate::EvaluationRecord& e : fit.result.evaluations) {
      runs += e.fidelity == correlate::Fidelity::kMain ? 1.0 : 0.0;
    }
    const double trials = static_cast<double>(fit.problem().trials.size());
    // Two rounds of slopes and steps at the least.
    const std::size_t least = 2 * (fit.problem().parameters.size() + 2);
    how_.runs = std::max(least, static_cast<std::size_t>(options.budget * runs / trials));
    how_.workers = options.workers;
    const EffectVersion version = versions_.AsItIs();
    // A fit with a ladder ends within a part of all its errors: the way to the minimum may be long,
    // and all others begin at its end.
    correlate::RefitOptions whole = how_;
    whole.runs *= 2;
    whole.looks *= 2;
    as_is_ = refits_.Refit(version.binding.problem, whole);
    if (Trouble().empty()) refits_.GoOnFrom(as_is_);
  }

  std::vector<EffectSwitch> Effects() const { return versions_.Effects(options_.each); }
  // Why nothing can be compared; empty: it can.
  std::string Trouble() const {
    const bool came = as_is_.status == correlate::RefitStatus::kSettled ||
                      as_is_.status == correlate::RefitStatus::kBudget;
    if (came) return {};
    return "the fit as it is cannot be followed: " + as_is_.message;
  }

  void Weigh(const std::vector<std::string>& set, TrialEffect* e) const {
    const double start = CpuSeconds();
    try {
      Fitted(set, e);
    } catch (const NoQuantity& missing) {
      e->verdict = EffectVerdict::kCannotTell;
      e->message = fmt::format(
          "channel {} records it ('{}'): leave the channel out to ask whether the rest needs it",
          missing.channel(), missing.quantity());
    } catch (const Error& error) {
      if (error.kind() == ErrorKind::kMachine) throw;  // says nothing about the effect
      e->verdict = EffectVerdict::kFailed;
      e->message = error.what();
    }
    e->seconds = CpuSeconds() - start;
  }

  double rows() const { return as_is_.rows; }
  std::vector<SizedEffect> Sized() const { return versions_.Sized(options_.each); }
  void WeighOfSize(const SizedEffect& sized, TrialEffect* e) const {
    WeighSized(
        sized, as_is_.rows,
        [this](const std::vector<std::string>& set, TrialEffect* at) { Weigh(set, at); }, e);
    if (!e->fitted) return;
    e->message.clear();
    if (e->size_sigma > 0.0) {
      JudgeEffect({.part = options_.part, .rows = as_is_.rows, .explained = Explains(fit_)}, e);
    } else {
      e->verdict = EffectVerdict::kCannotTell;
      e->message = "the trial does not tell its size";
    }
  }

 private:
  void Fitted(const std::vector<std::string>& set, TrialEffect* e) const {
    const EffectVersion version = versions_.Switched(set, e->effect.there);
    e->released = version.released;
    correlate::RefitOptions how = how_;
    how.look_first = version.look_first;
    const correlate::Refitted found = refits_.Refit(version.binding.problem, how);
    e->runs = found.runs;
    e->looks = found.looks;
    e->message = found.message;
    if (found.status == correlate::RefitStatus::kFailed) {
      e->verdict = EffectVerdict::kFailed;
      return;
    }
    if (found.status == correlate::RefitStatus::kNotAligned) {
      // A model that cannot even be laid beside the trial is refuted.
      e->verdict = e->effect.there ? EffectVerdict::kNeeded : EffectVerdict::kNotNeeded;
      return;
    }
    const Evidence evidence = Gather(as_is_, found);
    // So is one whose clock left the record: it has next to nothing to be compared with.
    constexpr double kBeside = 0.5;  // of the rows that the fit as it is answers for
    if (evidence.count < kBeside * as_is_.rows) {
      e->verdict = e->effect.there ? EffectVerdict::kNeeded : EffectVerdict::kNotNeeded;
      e->message = "it cannot be laid beside the trial";
      return;
    }
    Compare(fit_, as_is_, version.binding.problem, found, evidence, e);
    JudgeEffect({.part = options_.part, .rows = evidence.count, .explained = Explains(fit_)}, e);
  }

  const TrialEffectsOptions& options_;
  const StudyFit& fit_;
  EffectVersions versions_;
  correlate::Refits refits_;
  correlate::RefitOptions how_;
  correlate::Refitted as_is_;
};

// All that is not needed left out together, and looked at once more; what changes most stays first.
void Reduce(const TrialBench& bench, double part, TrialEffects* out) {
  std::vector<const TrialEffect*> order;
  for (const TrialEffect& e : out->effects) {
    if (e.effect.there && e.verdict == EffectVerdict::kNotNeeded) order.push_back(&e);
  }
  std::stable_sort(order.begin(), order.end(), [](const TrialEffect* a, const TrialEffect* b) {
    return a->change < b->change;
  });
  while (!order.empty()) {
    TrialEffect together;
    for (const TrialEffect* e : order) {
      together.effect.set.insert(together.effect.set.end(), e->effect.set.begin(),
                                 e->effect.set.end());
    }
    if (order.size() == 1) {  // that was looked at already
      together.change = order[0]->change;
      together.verdict = EffectVerdict::kNotNeeded;
    } else {
      bench.Weigh(together.effect.set, &together);
    }
    if (together.verdict == EffectVerdict::kNotNeeded && together.change <= part) {
      out->set = together.effect.set;
      out->reduced_change = together.change;
      for (const TrialEffect* e : order) out->left_out.push_back(e->effect.name);
      return;
    }
    order.pop_back();
  }
}

bool GoodBySigmas(const StudyFit& fit) {
  const auto& trials = fit.result.trials;
  return std::all_of(trials.begin(), trials.end(), [](const correlate::TrialResult& t) {
    return t.goodness.outcome == correlate::Explained::kYes;
  });
}

}  // namespace

void TrialEffectsOptions::Check() const {
  if (!(part > 0.0) || !std::isfinite(part)) {
    throw Error("is out of its range", "--part", "give a positive part of a sigma");
  }
  if (!(budget > 0.0) || !std::isfinite(budget)) {
    throw Error("is out of its range", "--budget", "give a positive part of the fit's runs");
  }
}

TrialEffects WeighTrialEffects(const data::Study& asked, const TrialEffectsOptions& options) {
  options.Check();
  if (asked.command) {
    throw Error("the effects of a program are not known", asked.command->where,
                "name a scene, or switch them in studies of your own");
  }
  data::Study study = asked;
  study.profile_levels.clear();  // intervals are not what is asked here

  // 1. As it is.
  TrialEffects out;
  if (options.progress) options.progress(0.0, "as it is");
  const double start = CpuSeconds();
  FitStudyOptions fit;
  fit.workers = options.workers;
  fit.allow_programs = options.allow_programs;
  out.fit = Fit(study, fit);
  // Profiles come upon better points at times. A fit that is good by its data's own sigmas has no
  // need of them.
  if (!out.fit.Usable() || !GoodBySigmas(out.fit)) out.fit = Fit(asked, fit);
  out.seconds = CpuSeconds() - start;
  if (!out.fit.Usable()) return out;

  // 2. Each switched, all others fitted again from there.
  const TrialBench bench(study, options, out.fit);
  const std::vector<EffectSwitch> switches = bench.Effects();
  const std::vector<SizedEffect> sized = bench.Sized();
  const double steps = static_cast<double>(switches.size() + sized.size()) + 2.0;
  for (const EffectSwitch& effect : switches) {
    if (options.progress) {
      options.progress(static_cast<double>(out.effects.size() + 1) / steps, effect.name);
    }
    TrialEffect e;
    e.effect = effect;
    if (bench.Trouble().empty()) {
      bench.Weigh(effect.set, &e);
    } else {
      e.verdict = EffectVerdict::kCannotTell;
      e.message = bench.Trouble();
    }
    out.effects.push_back(std::move(e));
  }

  for (const SizedEffect& effect : sized) {
    if (!bench.Trouble().empty()) break;
    if (options.progress) {
      options.progress(static_cast<double>(out.effects.size() + 1) / steps, effect.name);
    }
    TrialEffect e;
    bench.WeighOfSize(effect, &e);
    out.effects.push_back(std::move(e));
  }

  if (!Explains(out.fit)) {
    if (options.progress) options.progress(1.0 - 1.0 / steps, "with what it may miss");
    FitMissing(study, fit, sized, &out.effects);
  }

  DoubtBesideOthers(&out.effects);
  DoubtRivals(bench.rows(), &out.effects);

  // 3. All that is not needed left out together.
  if (options.progress) options.progress(1.0 - 1.0 / steps, "all that is not needed left out");
  Reduce(bench, options.part, &out);
  return out;
}

}  // namespace unfurl::study
