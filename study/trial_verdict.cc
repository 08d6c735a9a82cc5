#include "study/trial_verdict.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "base/text.h"

namespace unfurl::study {

namespace {

// The probability that a rise of -2 log likelihood stands for.
double Logistic(double rise) {
  return 1.0 / (1.0 + std::exp(std::clamp(-0.5 * rise, -700.0, 700.0)));
}

bool Sure(double deviance, const EffectJudge& judge, const TrialEffect& e) {
  return ProbabilityOfEffect(deviance, judge.rows, e) > kSure;
}

// What the fit leaves is then no noise but a motion that the model lacks, of which an effect may
// take a part by chance: only what takes nearly all of it is beyond that.
bool BeyondChance(const EffectJudge& judge, const TrialEffect& e) {
  return judge.explained || e.share >= kSure;
}

constexpr double kOneSided = 1.645;  // 95% of a normal deviate lie below

TrialEffect::Shift LargestShift(const TrialEffect& e) {
  TrialEffect::Shift largest;
  for (const TrialEffect::Shift& s : e.shifts) {
    if (std::abs(s.sigmas) > std::abs(largest.sigmas)) largest = s;
  }
  return largest;
}

// Why nothing can be told.
std::string Doubt(const EffectJudge& judge, const TrialEffect& e) {
  if (!judge.explained) {
    return fmt::format(
        "the fit does not explain the data, and what it lacks may hide this or look like it{}",
        e.share > 0.0 ? fmt::format(" (which takes {:.0f}% of the residuals' squares)",
                                    std::floor(100.0 * e.share))
                      : "");
  }
  if (e.probability > kSure) {
    if (Sure(e.deviance_least, judge, e)) {
      return "the simulator's own scatter is as large as what it rests on";
    }
    if (e.settled) return "values of the parameters might still take it away";
  }
  if (!e.settled) {
    return fmt::format("not settled within {} runs; a larger --budget may tell", e.runs);
  }
  if (e.change > judge.part) {
    return fmt::format(
        "the data prefer neither, and the fitted motions are {:.2g} of a sigma apart", e.change);
  }
  if (e.change + kOneSided * e.change_sigma > judge.part) {
    return fmt::format("its change is known to {:.2g} only", e.change_sigma);
  }
  const TrialEffect::Shift shift = LargestShift(e);
  if (std::abs(shift.sigmas) > judge.part) {
    return fmt::format("the data prefer neither, and it moves {} by {:.2g} of a standard error",
                       shift.name, std::abs(shift.sigmas));
  }
  return {};
}

// Parameters go with the effect, which could have left it out by themselves.
bool BetterWithout(const TrialEffect& e) {
  return !e.released.empty() &&
         Logistic(e.deviance + e.deviance_error + e.deviance_left) < 1.0 - kSure;
}

}  // namespace

double ProbabilityOfEffect(double deviance, double rows, const TrialEffect& effect) {
  // Those that go with it, or its size, which comes with it.
  const double more = effect.effect.there   ? static_cast<double>(effect.released.size())
                      : effect.unit.empty() ? 0.0
                                            : 1.0;
  return Logistic(deviance - more * std::log(rows));
}

void JudgeEffect(const EffectJudge& judge, TrialEffect* e) {
  const double shift = std::abs(LargestShift(*e).sigmas);
  const bool there = e->effect.there;
  const double low = std::min(e->deviance, e->deviance_least) - e->deviance_error;
  const double high = e->deviance + e->deviance_error + (there ? e->deviance_left : 0.0);
  const bool small = e->change + kOneSided * e->change_sigma <= judge.part && shift <= judge.part;
  const bool against = ProbabilityOfEffect(high, judge.rows, *e) < 1.0 - kSure;
  if (Sure(low, judge, *e) && BeyondChance(judge, *e)) {
    e->verdict = EffectVerdict::kNeeded;
  } else if (judge.explained && e->settled && e->probability <= kSure && small) {
    e->verdict = EffectVerdict::kNotNeeded;
  } else if (judge.explained && (there || e->settled) && against && e->released.empty() &&
             e->unit.empty()) {
    e->verdict = EffectVerdict::kAgainst;
  } else {
    e->verdict = EffectVerdict::kCannotTell;
    e->message = Doubt(judge, *e);
  }
}

void DoubtBesideOthers(std::vector<TrialEffect>* effects) {
  std::string why;
  std::vector<std::string> lacked;
  for (const TrialEffect& e : *effects) {
    if (!e.effect.there && e.verdict == EffectVerdict::kNeeded) lacked.push_back(e.effect.name);
  }
  for (const TrialEffect& e : *effects) {
    if (!why.empty()) break;
    const std::string& name = e.effect.name;
    if (e.effect.there && e.verdict == EffectVerdict::kAgainst) {
      why = fmt::format("the trial contradicts {}: weigh it again without", name);
    } else if (!e.effect.there && e.verdict == EffectVerdict::kNeeded) {
      why = fmt::format("the scene lacks {}{}: weigh it again with that",
                        lacked.size() > 1 ? "one at least of " : "", JoinWords(lacked));
    } else if (e.effect.there && e.fitted && BetterWithout(e)) {
      why = fmt::format(
          "the fit is better without {} than with any value of its own: it has not found its "
          "lowest minimum, or bounds keep {} from vanishing",
          name, JoinWords(e.released));
    }
  }
  if (why.empty()) return;
  for (TrialEffect& e : *effects) {
    if (e.verdict != EffectVerdict::kNotNeeded || !e.effect.there) continue;
    e.verdict = EffectVerdict::kCannotTell;
    e.message = why;
  }
}

}  // namespace unfurl::study
