#include "campaign/answers_json.h"

#include <nlohmann/json.hpp>

#include "campaign/json_number.h"

namespace unfurl::campaign {

namespace {

using nlohmann::ordered_json;

ordered_json Json(const Interval& interval) {
  return {NumberOrNull(interval.low), NumberOrNull(interval.high)};
}

ordered_json Json(const Summary& s) {
  ordered_json out = {{"mean", s.mean},
                      {"mean_error", NumberOrNull(s.mean_error)},
                      {"mean_interval", Json(s.mean_interval)},
                      {"sigma", s.sigma},
                      {"sigma_interval", Json(s.sigma_interval)},
                      {"median", s.median},
                      {"skewness", NumberOrNull(s.skewness)},
                      {"normality_p", s.normality_p},
                      {"quantiles", ordered_json::array()},
                      {"tolerance", ordered_json::array()}};
  for (const QuantileEstimate& q : s.quantiles) {
    out["quantiles"].push_back({{"p", q.p}, {"value", q.value}, {"interval", Json(q.interval)}});
  }
  for (const ToleranceEstimate& t : s.tolerance) {
    ordered_json one = {{"content", t.content}};
    if (t.two_sided) one["two_sided"] = Json(*t.two_sided);
    if (t.lower) one["lower"] = *t.lower;
    if (t.upper) one["upper"] = *t.upper;
    if (t.normal) one["normal"] = Json(*t.normal);
    one["runs_needed"] = t.runs_two_sided;
    out["tolerance"].push_back(std::move(one));
  }
  out["notes"] = s.notes;
  return out;
}

ordered_json Json(const CampaignAnswers& a, const SobolIndices& s) {
  ordered_json out = {{"usable", s.usable},       {"rows", s.rows},
                      {"dropped", s.dropped},     {"sum_of_first", s.sum_of_first},
                      {"sum_error", s.sum_error}, {"notes", s.notes}};
  for (std::size_t j = 0; j < s.inputs.size(); ++j) {
    const SobolIndex& i = s.inputs[j];
    out["variables"][a.variables[j]] = {{"first", i.first},
                                        {"first_error", NumberOrNull(i.first_error)},
                                        {"first_interval", Json(i.first_interval)},
                                        {"total", i.total},
                                        {"total_error", NumberOrNull(i.total_error)},
                                        {"total_interval", Json(i.total_interval)}};
  }
  return out;
}

ordered_json Json(const CampaignAnswers& a, const PolynomialChaos& s) {
  ordered_json out = {{"usable", s.usable()},      {"q2", s.q2()},
                      {"q2_lower", s.q2_lower()},  {"degree", s.degree()},
                      {"terms", s.terms().size()}, {"runs", s.runs()},
                      {"notes", s.notes()}};
  for (std::size_t j = 0; j < s.indices().size(); ++j) {
    const ChaosIndex& i = s.indices()[j];
    out["variables"][a.variables[j]] = {{"first", NumberOrNull(i.first)},
                                        {"first_error", NumberOrNull(i.first_error)},
                                        {"total", NumberOrNull(i.total)},
                                        {"total_error", NumberOrNull(i.total_error)}};
  }
  return out;
}

ordered_json Json(const CampaignAnswers& a, const MorrisScreening& s) {
  ordered_json out = {{"usable", s.usable},
                      {"trajectories", s.trajectories},
                      {"dropped", s.dropped},
                      {"notes", s.notes}};
  for (std::size_t j = 0; j < s.inputs.size(); ++j) {
    const MorrisEffect& e = s.inputs[j];
    out["variables"][a.variables[j]] = {{"mu", e.mu},
                                        {"mu_star", e.mu_star},
                                        {"mu_star_error", NumberOrNull(e.mu_star_error)},
                                        {"sigma", e.sigma},
                                        {"rank", e.rank}};
  }
  return out;
}

ordered_json Json(const CampaignAnswers& a, const ResponseAnswer& r) {
  ordered_json out = {
      {"unit", r.unit}, {"yes_no", r.yes_no}, {"present", r.present}, {"absent", r.absent}};
  if (r.present > 0) {
    out["minimum"] = r.minimum;
    out["minimum_run"] = r.minimum_run;
    out["maximum"] = r.maximum;
    out["maximum_run"] = r.maximum_run;
  }
  if (r.proportion) {
    out["probability"] = {{"value", r.proportion->value},
                          {"error", NumberOrNull(r.proportion->error)},
                          {"interval", Json(r.proportion->interval)},
                          {"yes", r.proportion->yes},
                          {"of", r.proportion->n}};
    if (r.proportion_with_failed) {
      out["probability"]["with_failed_runs"] = Json(*r.proportion_with_failed);
    }
  }
  if (r.summary) out["distribution"] = Json(*r.summary);
  for (std::size_t j = 0; j < r.correlations.size(); ++j) {
    out["rank_correlation"][a.variables[j]] = {{"value", r.correlations[j].value},
                                               {"interval", Json(r.correlations[j].interval)}};
  }
  if (r.surrogate) out["surrogate"] = Json(a, *r.surrogate);
  if (r.indices) out["indices"] = Json(a, *r.indices);
  if (r.screening) out["screening"] = Json(a, *r.screening);
  if (r.convergence) {
    out["convergence"] = ordered_json::array();
    for (const AnswerAt& at : r.convergence->history) {
      out["convergence"].push_back({{"runs", at.n},
                                    {"value", NumberOrNull(at.value)},
                                    {"half_width", NumberOrNull(at.half_width)}});
    }
  }
  return out;
}

}  // namespace

ordered_json AnswersJson(const CampaignAnswers& a) {
  ordered_json out = {{"campaign", a.name},         {"design", a.design},
                      {"confidence", a.confidence}, {"runs", a.runs},
                      {"failed", a.failed},         {"failures", ordered_json::array()}};
  for (const auto& [reason, count] : a.reasons) {
    out["failures"].push_back({{"message", reason}, {"runs", count}});
  }
  for (std::size_t j = 0; j < a.variables.size(); ++j) {
    out["variables"][a.variables[j]] = a.distributions[j];
  }
  for (const ResponseAnswer& r : a.responses) out["responses"][r.name] = Json(a, r);
  out["notes"] = a.notes;
  return out;
}

}  // namespace unfurl::campaign
