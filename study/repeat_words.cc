#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/number.h"
#include "base/text.h"
#include "study/repeat_record.h"

namespace unfurl::study {

namespace {

using Repeat = data::FitRecord::Repeat;
using RecordParameter = data::FitRecord::Parameter;

// A test that is wrong about trials that are alike in one campaign of twenty, however many
// parameters or trials it looks at (Bonferroni).
constexpr double kLevel = 0.05;

bool Shows(const Repeat& r, const Repeat::Parameter& q) {
  return q.alike_p * static_cast<double>(r.parameters.size()) < kLevel;
}

// More alike than in 2.5% of trials that are alike: the upper end of the scatter is 0.
bool TooAlike(const Repeat::Parameter& q) { return q.scatters && !(q.scatter_high95 > 0.0); }

// Standard deviations: of the value, or of its logarithm, which is a part of it.
std::string ScatterText(const Repeat::Parameter& q, const std::string& unit, double scatter) {
  constexpr int kDigits = 2;  // a scatter of few trials is not known better
  if (q.log) return Number(100.0 * scatter, kDigits) + "%";
  return Number(scatter, kDigits) + UnitAfter(unit);
}

std::string HowItScatters(const Repeat::Parameter& q, const std::string& unit) {
  const auto text = [&](double s) { return ScatterText(q, unit, s); };
  if (TooAlike(q)) {
    return fmt::format(
        "the trials are more alike than their own errors say, which are too large, or the trials "
        "not independent; a scatter of {} would show",
        text(q.visible));
  }
  if (!(q.scatter_low95 > 0.0)) {
    return fmt::format("scatters by less than {}", text(q.scatter_high95));
  }
  return fmt::format("scatters by {} (95% {} to {})", text(q.scatter), text(q.scatter_low95),
                     text(q.scatter_high95));
}

std::string VerdictOf(const Repeat& r, const Repeat::Parameter& q) {
  if (!q.scatters) return Shows(r, q) ? "one value does not do for all trials" : "one value";
  if (TooAlike(q)) return "more alike than the trials' errors say";
  return Shows(r, q) ? "scatters" : "alike";
}

// A probability that underflows is not none.
std::string ProbabilityText(double p) {
  constexpr double kLeast = 1e-12;  // below it the tails of the errors are anybody's guess
  return p < kLeast ? fmt::format("p below {:g}", kLeast) : fmt::format("p = {:.2g}", p);
}

constexpr int kNextDigits = 6;  // a narrow interval of a large value keeps two that differ

void JudgeParameter(const Repeat& r, const Repeat::Parameter& q, RecordParameter* p) {
  p->verdict = VerdictOf(r, q);
  const int digits = IntervalDigits(q.next_low95, q.next_high95, kNextDigits);
  p->reason =
      q.scatters
          ? fmt::format(
                "from trial to trial it {}; the next one's lies between {} and {}{} "
                "with 95%; alike with {}",
                HowItScatters(q, p->unit), Number(q.next_low95, digits),
                Number(q.next_high95, digits), UnitAfter(p->unit), ProbabilityText(q.alike_p))
          : fmt::format("taken as one value for all trials; they agree on it with {}",
                        ProbabilityText(q.alike_p));
}

std::string AlikeWords(const data::FitRecord& record) {
  const Repeat& r = record.repeat;
  std::vector<std::string> shown;
  for (std::size_t j = 0; j < r.parameters.size(); ++j) {
    if (Shows(r, r.parameters[j])) shown.push_back(record.parameters[j].name);
  }
  if (!shown.empty()) {
    return fmt::format("The trials are not alike: {} differ{} from trial to trial",
                       JoinWords(shown), shown.size() == 1 ? "s" : "");
  }
  if (r.alike_p < kLevel) {
    return fmt::format("The trials are not alike ({}), though no parameter by itself shows it",
                       ProbabilityText(r.alike_p));
  }
  return fmt::format("The trials are alike: one value of each parameter does for all (p = {:.2g})",
                     r.alike_p);
}

// Trials that lie where the others do not predict them.
std::vector<std::string> Unlike(const Repeat& r) {
  std::vector<std::string> out;
  for (std::size_t i = 0; i < r.trials.size(); ++i) {
    if (r.unlike_p[i] * static_cast<double>(r.trials.size()) < kLevel) out.push_back(r.trials[i]);
  }
  return out;
}

void AddLeftOutWords(const Repeat& r, data::FitRecord* record) {
  const auto least = std::min_element(r.unlike_p.begin(), r.unlike_p.end());
  double score = 0.0, count = 0.0;
  for (Eigen::Index k = 0; k < r.left_out_log_density.size(); ++k) {
    const double one = r.left_out_log_density(k);
    if (std::isfinite(one)) score += one, count += 1.0;
  }
  if (count == 0.0) return;
  record->checks["left_out_log_density [1]"] = score / count;
  record->reasons.push_back(fmt::format(
      "Each trial predicted by the others: {} is the least likely, p = {:.2g} (all parameters, one "
      "trial looked at); mean logarithm of the density {:.3g}.",
      r.trials[static_cast<std::size_t>(least - r.unlike_p.begin())], *least, score / count));
}

void AddNextWords(const correlate::NextTrial& next, data::FitRecord* record) {
  if (!next.failure.empty()) {
    record->reasons.push_back("No band of the next trial's marks: " + next.failure + ".");
    return;
  }
  // By which the band's ends are off: a tenth of its half is within what few trials leave open.
  constexpr double kNoticed = 0.1;
  if (next.bend > kNoticed) {
    record->reasons.push_back(
        fmt::format("The marks are not linear in the parameters over their scatter: the next "
                    "trial's band is off by about {:.0f}% of its half width.",
                    100.0 * next.bend));
  }
}

}  // namespace

void JudgeRepeat(const correlate::FittedTrials& fitted, const correlate::NextTrial& next,
                 data::FitRecord* record) {
  for (const std::string& why : fitted.left_out) record->reasons.push_back(why + ".");
  const Repeat& r = record->repeat;
  if (r.empty()) {
    record->status = "too few trials";
    record->message =
        fmt::format("{} of {} trials have a usable fit of their own; three are needed",
                    fitted.used.size(), record->trials.size());
    record->verdict = "No result: too few trials";
    record->reasons.push_back(record->message + ".");
    return;
  }
  record->status = "converged";
  record->verdict = AlikeWords(*record);
  const std::vector<std::string> unlike = Unlike(r);
  if (!unlike.empty()) {
    record->verdict += fmt::format("; {} {} unlike the others", JoinWords(unlike),
                                   unlike.size() == 1 ? "is" : "are");
  }
  record->verdict += ".";
  for (std::size_t j = 0; j < r.parameters.size(); ++j) {
    RecordParameter& p = record->parameters[j];
    JudgeParameter(r, r.parameters[j], &p);
    record->reasons.push_back(fmt::format(
        "{} = {}{}: {}", p.name, NumberWithError(p.value, p.sigma), UnitAfter(p.unit), p.reason));
  }
  AddLeftOutWords(r, record);
  AddNextWords(next, record);
  record->checks["alike_p [1]"] = r.alike_p;
  record->checks["next_bend [1]"] = next.bend;
}

}  // namespace unfurl::study
