#include "study/trial_effects.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>

#include "base/error.h"
#include "correlate/residual/row_layout.h"
#include "study/quick_fit.h"

namespace unfurl::study {

namespace {

using Clock = std::chrono::steady_clock;

double Since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// "key=value" or "key=": whether what it changes is `key` or holds it.
bool Touches(const std::string& assignment, const std::string& key) {
  const std::string changed = assignment.substr(0, assignment.find('='));
  return key == changed || key.starts_with(changed + ".") || key.starts_with(changed + "[");
}

// The study with an effect switched, and the parameters that go with it.
data::Study Switched(const data::Study& study, const std::vector<std::string>& set,
                     std::vector<std::string>* released) {
  data::Study out = study;
  for (data::StudyTrial& trial : out.trials) {
    trial.set.insert(trial.set.end(), set.begin(), set.end());
  }
  for (data::StudyParameter& p : out.parameters) {
    std::erase_if(p.keys, [&](const std::string& key) {
      return std::any_of(set.begin(), set.end(),
                         [&](const std::string& s) { return Touches(s, key); });
    });
    if (p.keys.empty()) released->push_back(p.name);
  }
  std::erase_if(out.parameters, [](const data::StudyParameter& p) { return p.keys.empty(); });
  for (std::vector<std::string>& stage : out.free) {
    std::erase_if(stage, [&](const std::string& name) {
      return std::find(released->begin(), released->end(), name) != released->end();
    });
  }
  return out;
}

// Begins where the fit as it is came out: what is left to move is small, or told by the cost.
void StartAt(const data::FitRecord& record, data::Study* study) {
  for (data::StudyParameter& p : study->parameters) {
    for (const auto& found : record.parameters) {
      if (found.name == p.name) p.start = std::clamp(found.value, p.low, p.high);
    }
  }
}

// Rows of both fits in the samples' own sigmas, without those that either put aside, whitened by
// the noise of the first.
struct Rows {
  Eigen::VectorXd a, b;
  double count = 0.0;  // of data rows that are not zero
};

Rows RowsOf(const correlate::Observations& o, const correlate::TrialResult& a,
            const correlate::TrialResult& b) {
  Rows out{a.residual, b.residual};
  const correlate::RowLayout layout(o);
  const Eigen::Index n = std::min(out.a.size(), out.b.size());
  out.a.conservativeResize(n);
  out.b.conservativeResize(n);
  for (const correlate::TrialResult* t : {&a, &b}) {
    for (const correlate::GrossSample& g : t->gross.samples) {
      const correlate::RowSeries& s = layout.series[g.mark];
      out.a.segment(s.Row(g.index), s.axes).setZero();
      out.b.segment(s.Row(g.index), s.axes).setZero();
    }
  }
  for (Eigen::Index i = 0; i < n; ++i) {
    if (out.a(i) == 0.0 || out.b(i) == 0.0) out.a(i) = out.b(i) = 0.0;
    out.count += out.a(i) != 0.0 ? 1.0 : 0.0;
  }
  return out;
}

// Sums of squares over all trials, by the noise of the fit as it is.
struct Evidence {
  double as_is = 0.0, switched = 0.0;  // of the residuals
  double stale = 0.0;                  // of what a quick fit may have wrong
  double count = 0.0;                  // of data rows
  double change = 0.0;                 // of the residuals from one to the other, not whitened
};

Evidence Gather(const StudyFit& as_is, const correlate::FitResult& switched,
                const std::vector<Eigen::VectorXd>& stale) {
  Evidence out;
  for (std::size_t t = 0; t < as_is.result.trials.size(); ++t) {
    const correlate::Observations& o = *as_is.problem().trials[t].observations;
    const correlate::TrialResult &a = as_is.result.trials[t], &b = switched.trials[t];
    Rows rows = RowsOf(o, a, b);
    Eigen::VectorXd lacks = stale.empty() ? Eigen::VectorXd() : stale[t];
    out.change += (rows.a - rows.b).squaredNorm();
    out.count += rows.count;
    if (!a.noise.series.empty() && !a.noise.white()) {
      const correlate::RowWhitening whitening(o, a.noise);
      whitening.Apply(rows.a);
      whitening.Apply(rows.b);
      if (lacks.size() > 0) whitening.Apply(lacks);
    }
    out.as_is += rows.a.squaredNorm();
    out.switched += rows.b.squaredNorm();
    out.stale += lacks.squaredNorm();
  }
  out.count = std::max(1.0, out.count);
  return out;
}

// Residuals that are larger than their sigmas are not believed to tell as finely as these say.
double DevianceOf(const Evidence& e, double switched) {
  return (switched - e.as_is) / std::max(1.0, e.as_is / e.count);
}

// That the effect is in the trial, by Schwarz's approximation of Bayes' factor: a parameter more
// costs log n.
double ProbabilityOf(double deviance, const Evidence& e, const TrialEffect& effect) {
  const double released = static_cast<double>(effect.released.size());
  const double rise = effect.effect.there ? deviance - released * std::log(e.count) : -deviance;
  return 1.0 / (1.0 + std::exp(std::clamp(-0.5 * rise, -700.0, 700.0)));
}

// What switching did to the fit.
void Compare(const StudyFit& as_is, const correlate::FitProblem& problem,
             const correlate::FitResult& switched, const Evidence& e, TrialEffect* out) {
  out->change = std::sqrt(e.change / e.count);
  out->deviance = DevianceOf(e, e.switched);
  out->probability = ProbabilityOf(out->deviance, e, *out);
  out->shifts.clear();
  const auto& before = as_is.problem().parameters;
  for (std::size_t i = 0; i < problem.parameters.size(); ++i) {
    for (std::size_t j = 0; j < before.size(); ++j) {
      const correlate::ParameterEstimate& was = as_is.result.parameters[j];
      if (before[j].name != problem.parameters[i].name || !(was.sigma > 0.0)) continue;
      out->shifts.push_back(
          {before[j].name, (switched.parameters[i].value - was.value) / was.sigma});
    }
  }
}

constexpr double kSure = 0.99;  // 100 to 1

// Whether the effect is needed whatever a quick fit has wrong: no parameters of the finest rung
// bring the residuals below what it left less that.
bool NeededAnyhow(const Evidence& e, const TrialEffect& effect) {
  const double least = std::max(0.0, std::sqrt(e.switched) - std::sqrt(e.stale));
  return ProbabilityOf(DevianceOf(e, least * least), e, effect) > kSure;
}

void Judge(double part, TrialEffect* e) {
  double shift = 0.0;
  for (const TrialEffect::Shift& s : e->shifts) shift = std::max(shift, std::abs(s.sigmas));
  if (e->probability > kSure) {
    e->verdict = EffectVerdict::kNeeded;
  } else if (e->change <= part && shift <= part) {
    e->verdict = EffectVerdict::kNotNeeded;
  } else {
    e->verdict = e->probability < 1.0 - kSure && e->released.empty() ? EffectVerdict::kAgainst
                                                                     : EffectVerdict::kCannotTell;
  }
}

// Of a fit that gave no estimate. A model that cannot even be laid beside the trial is refuted; one
// that does not run, or whose search did not end, says nothing.
EffectVerdict VerdictOf(correlate::FitStatus status, bool there) {
  if (status == correlate::FitStatus::kNotAligned && there) return EffectVerdict::kNeeded;
  return status == correlate::FitStatus::kNotConverged ? EffectVerdict::kCannotTell
                                                       : EffectVerdict::kFailed;
}

// Whether a quick fit settles that an effect is needed, with what it found.
bool NeededByQuick(const StudyFit& as_is, const QuickFit& quick, TrialEffect* e) {
  if (quick.result.status == correlate::FitStatus::kNotAligned) {
    e->message = quick.result.message;
    return true;
  }
  if (!quick.result.Usable()) return false;
  const Evidence evidence = Gather(as_is, quick.result, quick.stale);
  if (!NeededAnyhow(evidence, *e)) return false;
  Compare(as_is, quick.binding.problem, quick.result, evidence, e);
  return true;
}

FitStudyOptions FitOptionsOf(const TrialEffectsOptions& options) {
  FitStudyOptions out;
  out.workers = options.workers;
  out.allow_programs = options.allow_programs;
  return out;
}

// Fits of the study with effects switched, from where the fit as it is came out.
class Bench {
 public:
  Bench(const data::Study& study, const TrialEffectsOptions& options, const StudyFit& as_is)
      : study_(study), options_(options), as_is_(as_is), quick_(as_is) {}

  // kUnjudged: there is a fit to be judged.
  EffectVerdict FitWithout(const std::vector<std::string>& set, TrialEffect* e) const {
    data::Study other = Switched(study_, set, &e->released);
    StartAt(as_is_.record, &other);
    other.screened = 0;  // a fit that does not come near is answer enough, and looks nowhere else
    if (other.parameters.empty()) {
      e->message = "it takes all parameters of the study with it";
      return EffectVerdict::kFailed;
    }
    const Clock::time_point start = Clock::now();
    EffectVerdict verdict = EffectVerdict::kFailed;
    try {
      verdict = Fitted(other, e);
    } catch (const Error& error) {
      e->message = error.what();
    }
    e->seconds = Since(start);
    return verdict;
  }

 private:
  EffectVerdict Fitted(const data::Study& other, TrialEffect* e) const {
    // First at the price of the lowest rung: that an effect is needed often shows there already.
    if (e->effect.there) {
      const auto quick = quick_.Fit(other, options_.workers);
      if (quick && NeededByQuick(as_is_, *quick, e)) return EffectVerdict::kNeeded;
    }
    const StudyFit fit = Fit(other, FitOptionsOf(options_));
    if (!fit.Usable()) {
      e->message = fit.result.message;
      return VerdictOf(fit.result.status, e->effect.there);
    }
    Compare(as_is_, fit.problem(), fit.result, Gather(as_is_, fit.result, {}), e);
    return EffectVerdict::kUnjudged;
  }

  const data::Study& study_;
  const TrialEffectsOptions& options_;
  const StudyFit& as_is_;
  QuickFits quick_;
};

}  // namespace

void TrialEffectsOptions::Check() const {
  if (!(part > 0.0) || !std::isfinite(part)) {
    throw Error("is out of its range", "TrialEffectsOptions.part",
                "give a positive part of a sigma");
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
  const data::TomlTable document = data::LoadToml(study.scene, study.set);
  const std::vector<EffectSwitch> switches =
      EffectsOf(data::ReadScene(document, study.scene), document, options.each);
  const double fits = static_cast<double>(switches.size()) + 2.0;
  std::size_t done = 0;
  auto tell = [&](const std::string& what) {
    if (options.progress) options.progress(static_cast<double>(done++) / fits, what);
  };

  // 1. As it is.
  TrialEffects out;
  tell("as it is");
  const Clock::time_point start = Clock::now();
  out.fit = Fit(study, FitOptionsOf(options));
  out.seconds = Since(start);
  if (!out.fit.Usable()) return out;

  // 2. Each switched, all others fitted again from there.
  const Bench bench(study, options, out.fit);
  for (const EffectSwitch& effect : switches) {
    tell(effect.name);
    TrialEffect e;
    e.effect = effect;
    e.verdict = bench.FitWithout(effect.set, &e);
    if (e.verdict == EffectVerdict::kUnjudged) Judge(options.part, &e);
    out.effects.push_back(std::move(e));
  }

  // 3. All that is not needed left out together, and looked at once more.
  tell("all that is not needed left out");
  std::vector<const TrialEffect*> order;
  for (const TrialEffect& e : out.effects) {
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
    const bool one = order.size() == 1;  // that was looked at already
    if (one) together.change = order[0]->change;
    if (one || (bench.FitWithout(together.effect.set, &together) == EffectVerdict::kUnjudged &&
                together.change <= options.part)) {
      out.set = together.effect.set;
      out.reduced_change = together.change;
      for (const TrialEffect* e : order) out.left_out.push_back(e->effect.name);
      break;
    }
    order.pop_back();
  }
  return out;
}

}  // namespace unfurl::study
