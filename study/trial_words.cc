#include "study/trial_words.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/count.h"
#include "base/fixed_number.h"
#include "base/length.h"
#include "base/number.h"
#include "base/text.h"
#include "correlate/compare/wrong_readings.h"
#include "correlate/fit/goodness.h"
#include "correlate/residual/channel.h"
#include "correlate/residual/row_layout.h"
#include "correlate/tolerance.h"
#include "study/between_words.h"

namespace unfurl::study {

namespace {

const char* FastOrSlow(double drift) { return drift > 0.0 ? "fast" : "slow"; }

// "of 0.02"; what is too small to be computed is no zero.
std::string Probability(double p) {
  constexpr double kLeast = 1e-12;  // what rounding leaves of 1 - p [-]
  return p < kLeast ? fmt::format("below {:.0e}", kLeast) : fmt::format("of {:.2g}", p);
}

// "the marks'".
std::string Whose(const correlate::Observations& o) {
  return o.marks.empty() ? "the channels'" : o.others.empty() ? "the marks'" : "the data's";
}

// Which law the data want beside the model's.
std::string RivalWords(const std::vector<std::string>& parameters, const correlate::Constancy& c,
                       const correlate::RivalLaw& law, const std::vector<double>& values) {
  std::vector<std::string> others;
  for (std::size_t j = 0; j < parameters.size() && j < c.with_rival.size(); ++j) {
    others.push_back(fmt::format("{} {:.4g}", parameters[j], values[j] + c.with_rival[j]));
  }
  return fmt::format(
      " With {} they would be explained better than by noise whatever its memory (probability that "
      "noise does so {:.2g}): {} {}, and then about {}. Add it to the scene and fit both; a law "
      "like it looks the same.",
      law.name, c.p_value,
      NumberWithError(law.amount * c.rival_part, std::abs(law.amount) * c.rival_sigma), law.unit,
      JoinWords(others));
}

// What of a model that does not explain its data changes along the record; empty: nothing is seen
// to.
std::string ConstancyWords(const std::vector<std::string>& parameters,
                           const correlate::Constancy& c, const correlate::FitTrial& trial,
                           const std::vector<double>& values) {
  if (!(c.p_value < correlate::kGoodnessLevel / 3.0)) return "";
  if (c.rival >= 0) {
    return RivalWords(parameters, c, trial.rivals[static_cast<std::size_t>(c.rival)], values);
  }
  if (c.most < 0) return "";
  std::string what =
      "the motion's size by {:+.2g} of it at the record's begin and {:+.2g} at its "
      "end";
  double factor = 1.0;
  if (c.most < c.parameters) {
    what = parameters[static_cast<std::size_t>(c.most)] +
           " by {:+.2g} at the record's begin and {:+.2g} at its end";
  } else if (c.clock()) {
    what = "the clock by {:+.2g} ms at the record's begin and {:+.2g} ms at its end";
    factor = 1e3;
  }
  return " Along the record the data want other values, by more than noise does whatever its "
         "memory (probability " +
         fmt::format("{:.2g}", c.p_value) + "): most surely " +
         fmt::format(fmt::runtime(what), factor * c.at_begin, factor * c.at_end) +
         ". So does what changes with the motion's size or rate: friction, another law of damping, "
         "a stiffness that is not constant.";
}

std::string NoExplanation(const std::string& whose, const correlate::TrialResult& t) {
  const correlate::GoodnessOfFit& g = t.goodness;
  if (g.p_covariances() >= correlate::kGoodnessLevel) {
    return fmt::format(
        " The model does not explain them, though they are no more than {} noise: the values may "
        "be off by more than their standard errors.",
        whose);
  }
  return fmt::format(
      " The model does not explain them: neither {} covariances (probability {}) "
      "nor stationary noise ({:.2g}){}. It lacks an effect, or the data are off by more than "
      "their covariances say; the values may be off by more than their standard errors.",
      whose, Probability(g.p_covariances()), g.p_noise(),
      t.error_check == correlate::ErrorCheck::kFiner ||
              t.error_check == correlate::ErrorCheck::kLadder
          ? fmt::format(" nor a finer model, with which {:.0f}% of the excess disappears",
                        100.0 * g.mesh_takes)
          : std::string());
}

// Whether residuals are correlated in time, and what was done about it.
std::string CorrelationWords(const correlate::TrialResult& t) {
  if (t.plain.white()) {
    return t.goodness.outcome == correlate::Explained::kYes ? " and white, as they should be."
                                                            : " and white.";
  }
  if (t.noise.series.empty() || t.noise.white()) {
    return ", and are correlated in time: the standard errors are widened for it.";
  }
  double share = 0.0, rho = 0.0, variance = 0.0;
  for (const correlate::MarkovNoise& n : t.noise.series) {
    variance += n.variance;
    share += n.variance * n.share;
    rho += n.variance * n.share * n.rho;
  }
  return fmt::format(
             ", and are correlated in time: {:.0f}% of their variance is shared by neighbouring "
             "samples (correlation {:.3f} from one to the next); the fit is weighted for it",
             100.0 * share / variance, share > 0.0 ? rho / share : 0.0) +
         (t.whitened.white() ? ", after which they are white."
                             : ", and the standard errors are widened for what is left of it.");
}

// The residuals of one trial: how large, whether they are correlated, what was done about it,
// and whether the model explains them.
std::string ResidualWords(const correlate::FitTrial& trial, const correlate::TrialResult& t,
                          const std::vector<std::string>& parameters,
                          const std::vector<double>& values, bool several, bool apart) {
  const correlate::Observations& o = *trial.observations;
  const std::string of = several ? " of " + t.name : "";
  const std::string whose = Whose(o);
  const correlate::GoodnessOfFit& g = t.goodness;
  if (g.below) {
    return fmt::format(
        "The residuals{} are {:.1g} of {} sigma and follow one another, as they do where a record "
        "was computed or its sigma is far too large. Standard errors and intervals are those of "
        "that sigma.",
        of, std::sqrt(t.chi2_per_dof), whose);
  }
  std::string words = fmt::format("The residuals{} are {:.2f} times {} sigma{}", of,
                                  std::sqrt(t.chi2_per_dof), whose, CorrelationWords(t));
  switch (g.outcome) {
    case correlate::Explained::kYes:
      break;
    case correlate::Explained::kNoise:
      words += fmt::format(
          " By {} covariances that has a probability {}; by stationary noise it is "
          "plausible ({:.2g}). If it is noise ({}), the standard errors include it; a "
          "smooth effect that the model lacks would look the same.",
          whose, Probability(g.p_covariances()), g.p_noise(),
          o.marks.empty() ? "of the instruments" : "of the optics");
      break;
    case correlate::Explained::kMesh:
      words += fmt::format(
          " By {} covariances that has a probability {}; with a finer model {:.0f}% of "
          "the excess disappears.",
          whose, Probability(g.p_covariances()), 100.0 * g.mesh_takes);
      break;
    case correlate::Explained::kNo:
      if (apart) {
        words += several ? " The model does not explain all trials together."
                         : " The model does not explain them.";
        break;
      }
      words += NoExplanation(whose, t) + ConstancyWords(parameters, g.constancy, trial, values);
      if (correlate::LeastNoiseOverMotion(o) < correlate::kLoosestTolerance) {
        words +=
            " The stated noise is less than a simulation's tolerance of the motion: what is left "
            "may be the simulation's own error, too.";
      }
      break;
  }
  return words;
}

// Of a trial whose residuals are noise, and far more of it than its sigmas say, while another's are
// what they say; empty: it is not so.
std::string TooQuiet(const correlate::FitResult& r, std::size_t trial) {
  constexpr double kFar =
      2.0;  // of the sigmas, and of the other trial's: beyond, no noise by chance
  if (r.trials[trial].goodness.outcome != correlate::Explained::kNoise) return "";
  const double times = std::sqrt(r.trials[trial].chi2_per_dof);
  double least = times;
  for (const correlate::TrialResult& t : r.trials) {
    if (t.goodness.outcome == correlate::Explained::kYes) {
      least = std::min(least, std::sqrt(t.chi2_per_dof));
    }
  }
  if (times < kFar || times < kFar * least) return "";
  return fmt::format(
      "The sigmas of {} look {:.2g} times too small, those of the other trials do not: it counts "
      "for {:.0f} times as much as it should. Say trial.sigma_factor = {:.2g} of its marks, or the "
      "sigma of its channels.",
      r.trials[trial].name, times, times * times, times);
}

// Standard errors from zero below which the model's own error may be all that there is.
constexpr double kTold = 2.0;

// Of the clock's drift, all parts [-]; 0: it was not fitted.
double SigmaOfDrift(const correlate::TrialResult& t) {
  for (std::size_t i = 0; i < t.nuisances.size(); ++i) {
    if (t.nuisances[i].kind == correlate::Nuisance::Kind::kDrift) {
      return t.nuisance_sigma(static_cast<Eigen::Index>(i));
    }
  }
  return 0.0;
}

// What was known of clock and frame (`contradicted`: the data contradict some of what was stated,
// of any trial, or a trial goes by itself, which then is to blame for the model's pace), what of a
// drift the data show, and what was put aside. `clocks`: of how many trials a drift was fitted.
void AddPlacementWords(const correlate::Observations& o, const correlate::TrialResult& t,
                       const std::string& of, std::ptrdiff_t clocks, bool contradicted,
                       data::FitRecord* record) {
  using correlate::Foreknowledge;
  auto add = [&](std::string words) { record->reasons.push_back(std::move(words)); };
  const correlate::Placement& known = o.placement;
  if (known.offset.kind == Foreknowledge::kKnown) {
    add(fmt::format("The time offset{} was known, {} s, and not sought.", of, known.offset.mean));
  } else if (known.offset.kind == Foreknowledge::kNormal) {
    add(fmt::format("The time offset{} was known beforehand, {} s; with the data it is {:.6g} s.",
                    of, NumberWithError(known.offset.mean, known.offset.sigma), t.at.offset));
  }
  if (known.frame.kind == Foreknowledge::kKnown) {
    add("The frame" + of + " was known, and not sought.");
  } else if (known.frame.kind == Foreknowledge::kNormal) {
    add(fmt::format("The frame{} was known beforehand to {:.3g} mm and {:.3g} mrad.", of,
                    1e3 * known.frame.sigma_shift, 1e3 * known.frame.sigma_rotation));
  }
  const correlate::DriftTest& drift = t.drift;
  if (drift.called) {
    const double all = SigmaOfDrift(t);
    add(fmt::format(
        "The data call for a clock{} that runs {} by {} parts in a million ({:.0f} "
        "times its standard error): it is fitted. {}If the clock is right, say so "
        "(trial.drift = \"known\").",
        of, FastOrSlow(t.at.drift), NumberWithError(1e6 * std::abs(t.at.drift), 1e6 * drift.sigma),
        std::sqrt(drift.deviance),
        std::abs(t.at.drift) > kTold * all ? ""
        : clocks > 1
            ? fmt::format("Of {} clocks only what they differ by is known so well; what they have "
                          "in common the parameters make up for (with it: ± {}). ",
                          clocks, Number(1e6 * all, 2))
            : fmt::format("The model's own error may look the same (with it: ± {}). ",
                          Number(1e6 * all, 2))));
  } else if (drift.too_large && !contradicted) {
    add(
        fmt::format("A clock{} that runs {} by {:.2g}% would lower the residuals most, and no "
                    "clock does: look at what sets the pace of the model (gravity, masses, "
                    "springs), or say what is known of the clock (trial.drift).",
                    of, FastOrSlow(drift.drift), 100.0 * std::abs(drift.drift)));
  }
}

// Samples that stick out, the farthest by name.
void AddGrossWords(const correlate::Observations& o, const correlate::TrialResult& t,
                   const std::string& of, data::FitRecord* record) {
  const correlate::GrossErrors& gross = t.gross;
  if (gross.in_bursts > 0) {
    record->reasons.push_back(fmt::format(
        "Out of the line of their neighbours, but in bursts or too often: {}{}. A motion that "
        "the model lacks, or a disturbance; all count.",
        Counted(gross.in_bursts, "sample"), of));
  }
  if (gross.samples.empty()) return;
  constexpr std::size_t kNamed = 5;  // as many as a sentence bears; the file has all
  std::vector<correlate::GrossSample> far = gross.samples;
  std::stable_sort(far.begin(), far.end(),
                   [](const correlate::GrossSample& a, const correlate::GrossSample& b) {
                     return a.sigmas > b.sigmas;
                   });
  std::vector<std::string> names;
  for (std::size_t i = 0; i < std::min(kNamed, far.size()); ++i) {
    names.push_back(fmt::format("{} at {} s ({:.3g} sigma)", o.marks[far[i].mark].name,
                                FixedNumber(far[i].t), far[i].sigmas));
  }
  record->reasons.push_back(
      fmt::format("Gross errors, which count for next to nothing: {} of {}{}: {}{}.",
                  gross.samples.size(), Counted(o.size(), "sample"), of,
                  far.size() > kNamed ? "the farthest are " : "", JoinWords(names)));
}

// Likewise of each channel.
void AddChannelGrossWords(const correlate::Observations& o, const correlate::TrialResult& t,
                          const std::string& of, data::FitRecord* record) {
  for (const correlate::ChannelGross& gross : t.channel_gross) {
    if (gross.errors.in_bursts == 0) continue;
    record->reasons.push_back(fmt::format(
        "Out of the line of their neighbours, but in bursts or too often: {} of {}{}. A motion "
        "that the model lacks, or a disturbance; all count.",
        Counted(gross.errors.in_bursts, "reading"), gross.name, of));
  }
  for (std::string& words : correlate::GrossWords(o, t.channel_gross, of)) {
    record->reasons.push_back(std::move(words));
  }
}

// How what was recorded beside the marks lies to the model.
void AddOtherWords(const correlate::Observations& o, const correlate::TrialResult& t,
                   const std::string& of, data::FitRecord* record) {
  const correlate::ResidualKind::Clocks clocks = correlate::ClocksOf(o, t.reference, t.at.clock());
  const correlate::RowLayout layout(o);
  for (std::size_t k = 0; k < o.others.size(); ++k) {
    // As the fit left it: without the readings that it put aside.
    const bool left = t.kinds.size() == o.others.size();
    const correlate::ResidualKind& kind = left ? *t.kinds[k] : *o.others[k];
    for (std::string& words :
         kind.Words(kind.NumbersOf(t.prediction), clocks, layout.OwnOf(k, t.at.own), of)) {
      record->reasons.push_back(std::move(words));
    }
  }
}

// What the model's own error was judged by, and what it is.
std::string ErrorWords(const correlate::Observations& o, const correlate::TrialResult& t,
                       const std::string& of) {
  const std::string size =
      o.marks.empty() ? fmt::format("moves the channels{} by {:.2g} of their sigma, RMS", of,
                                    t.model_error_sigmas)
                      : fmt::format("moves the marks{} by {} RMS, {:.2g} of their sigma", of,
                                    LengthText(t.model_error_rms), t.model_error_sigmas);
  switch (t.error_check) {
    case correlate::ErrorCheck::kLadder:
      return "What the finest rung still lacks, by its change from the rung below, " + size +
             "; it is in the standard errors and intervals.";
    case correlate::ErrorCheck::kFiner:
      return "The model's own error, by a finer model and a tighter tolerance, " + size +
             "; it is in the standard errors and intervals.";
    case correlate::ErrorCheck::kTolerance:
      return "A tighter tolerance " + size +
             "; that is in the standard errors and intervals. No finer model was run.";
    case correlate::ErrorCheck::kNone:
      break;
  }
  return (t.error_check_failure.empty() ? "No model with less error of its own was run" + of
                                        : "The model with less error of its own failed" + of +
                                              " (" + t.error_check_failure + ")") +
         ": the standard errors and intervals are those of the data alone.";
}

}  // namespace

void AddTrialWords(const std::vector<std::string>& parameters,
                   const std::vector<correlate::FitTrial>& trials, const correlate::FitResult& r,
                   bool apart, data::FitRecord* record) {
  const bool several = r.trials.size() > 1;
  const bool contradicted = std::any_of(r.stated.begin(), r.stated.end(),
                                        [](const correlate::Stated& s) { return s.contradicted; });
  const auto clocks =
      std::count_if(r.trials.begin(), r.trials.end(), [](const auto& t) { return t.drift.called; });
  for (std::size_t k = 0; k < r.trials.size(); ++k) {
    const correlate::TrialResult& t = r.trials[k];
    record->reasons.push_back(ResidualWords(trials[k], t, parameters, r.Theta(), several, apart));
    if (std::string words = TooQuiet(r, k); !words.empty()) record->reasons.push_back(words);
    if (!t.less_weight.empty()) {
      double from = std::numeric_limits<double>::infinity(), least = 1.0;
      for (const correlate::LessWeight& l : t.less_weight) {
        from = std::min(from, l.from);
        least = std::min(least, l.weight);
      }
      record->reasons.push_back(
          fmt::format("From {} s on the simulated motion depends on the solver's tolerance "
                      "(impacts magnify "
                      "its errors): {} sections of marks have less weight there, down to {:.2g}.",
                      FixedNumber(from, 2), t.less_weight.size(), least));
    }
    const std::string of = several ? " of " + t.name : "";
    if (std::string words = BetweenWords(t, of); !words.empty()) record->reasons.push_back(words);
    AddOtherWords(*trials[k].observations, t, several ? " in " + t.name : "", record);
    AddPlacementWords(*trials[k].observations, t, of, clocks, contradicted || apart, record);
    AddGrossWords(*trials[k].observations, t, of, record);
    AddChannelGrossWords(*trials[k].observations, t, of, record);
    record->reasons.push_back(ErrorWords(*trials[k].observations, t, of));
  }
}

}  // namespace unfurl::study
