#include "cli/campaign_text.h"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "base/count.h"
#include "base/number.h"
#include "base/table.h"

namespace unfurl::cli {

namespace {

using campaign::CampaignAnswers;
using campaign::ResponseAnswer;
using nlohmann::ordered_json;
using CampaignTextRows = std::vector<std::vector<std::string>>;

std::string Named(const ResponseAnswer& r) {
  return r.unit.empty() ? r.name : r.name + " [" + r.unit + "]";
}

std::string CampaignTextPercent(double part) { return fmt::format("{:g}%", 100.0 * part); }

std::string IntervalOf(const campaign::Interval& interval, int digits = 4) {
  return fmt::format("{} to {}", Number(interval.low, digits), Number(interval.high, digits));
}

// Runs for half the interval, where that is known.
std::string RunsForHalf(const ResponseAnswer& r) {
  if (!r.convergence || r.convergence->history.empty()) return "-";
  const campaign::AnswerAt& now = r.convergence->history.back();
  if (!std::isfinite(now.half_width) || now.half_width <= 0.0) return "-";
  // By the law of independent runs.
  return fmt::format("{:.0f}", 4.0 * static_cast<double>(now.n));
}

const campaign::QuantileEstimate* QuantileAt(const campaign::Summary& s, double p) {
  for (const campaign::QuantileEstimate& q : s.quantiles) {
    if (q.p == p) return &q;
  }
  return nullptr;
}

}  // namespace

CampaignTextRows ProbabilityRows(const CampaignAnswers& a) {
  CampaignTextRows rows = {{"", "P", CampaignTextPercent(a.confidence) + " interval", "yes", "of",
                            "runs for half of it"}};
  for (const ResponseAnswer& r : a.responses) {
    if (!r.proportion) continue;
    rows.push_back({r.name, Number(r.proportion->value), IntervalOf(r.proportion->interval),
                    fmt::format("{}", r.proportion->yes), fmt::format("{}", r.proportion->n),
                    RunsForHalf(r)});
  }
  return rows;
}

CampaignTextRows NumberRows(const CampaignAnswers& a) {
  CampaignTextRows rows = {{"", "mean", CampaignTextPercent(a.confidence) + " interval", "sigma",
                            "least", "5%", "median", "95%", "most", "runs for half of it"}};
  for (const ResponseAnswer& r : a.responses) {
    if (!r.summary) continue;
    const campaign::Summary& s = *r.summary;
    const auto quantile = [&](double p) {
      const campaign::QuantileEstimate* q = QuantileAt(s, p);
      return q == nullptr ? std::string("-") : Number(q->value);
    };
    rows.push_back({Named(r), Number(s.mean), IntervalOf(s.mean_interval), Number(s.sigma, 3),
                    Number(s.minimum), quantile(0.05), Number(s.median), quantile(0.95),
                    Number(s.maximum), RunsForHalf(r)});
  }
  return rows;
}

CampaignTextRows ExtremeRows(const CampaignAnswers& a) {
  CampaignTextRows rows = {{"", "least", "in run", "most", "in run"}};
  for (const ResponseAnswer& r : a.responses) {
    if (r.present == 0) continue;
    rows.push_back({Named(r), Number(r.minimum), fmt::format("{}", r.minimum_run),
                    Number(r.maximum), fmt::format("{}", r.maximum_run)});
  }
  return rows;
}

CampaignTextRows ToleranceRows(const CampaignAnswers& a) {
  CampaignTextRows rows = {{"", "part", "lies between", "below", "above", "if normal, between"}};
  for (const ResponseAnswer& r : a.responses) {
    if (!r.summary) continue;
    for (const campaign::ToleranceEstimate& t : r.summary->tolerance) {
      if (!t.two_sided && !t.upper && !t.lower) continue;
      rows.push_back({Named(r), CampaignTextPercent(t.content),
                      t.two_sided ? IntervalOf(*t.two_sided) : "-",
                      t.upper ? Number(*t.upper) : "-", t.lower ? Number(*t.lower) : "-",
                      t.normal ? IntervalOf(*t.normal) : "-"});
    }
  }
  return rows;
}

CampaignTextRows CorrelationRows(const CampaignAnswers& a) {
  CampaignTextRows rows = {{"rank correlation"}};
  for (const std::string& variable : a.variables) rows[0].push_back(variable);
  for (const ResponseAnswer& r : a.responses) {
    if (r.correlations.empty()) continue;
    rows.push_back({r.name});
    for (const campaign::VariableCorrelation& c : r.correlations) {
      // What may as well be nothing is said to be.
      const bool told = c.interval.low > 0.0 || c.interval.high < 0.0;
      rows.back().push_back(told ? Number(c.value, 2) : "(" + Number(c.value, 1) + ")");
    }
  }
  return rows;
}

CampaignTextRows SurrogateRows(const CampaignAnswers& a) {
  CampaignTextRows rows = {{"share by a surrogate"}};
  for (const std::string& variable : a.variables) rows[0].push_back(variable);
  rows[0].push_back("explained");
  for (const ResponseAnswer& r : a.responses) {
    if (!r.surrogate || !r.surrogate->usable()) continue;
    rows.push_back({r.name});
    for (const campaign::ChaosIndex& i : r.surrogate->indices()) {
      rows.back().push_back(Number(i.total, 2));
    }
    rows.back().push_back(fmt::format("{:.1f}%", 100.0 * r.surrogate->q2()));
  }
  return rows;
}

CampaignTextRows ShareRows(const CampaignAnswers& a) {
  CampaignTextRows rows = {{"", "variable", "alone", "+-", "with interactions", "+-", ""}};
  for (const ResponseAnswer& r : a.responses) {
    if (!r.indices) continue;
    for (std::size_t j = 0; j < r.indices->inputs.size(); ++j) {
      const campaign::SobolIndex& s = r.indices->inputs[j];
      rows.push_back({r.name, a.variables[j], Number(s.first, 3), Number(s.first_error, 2),
                      Number(s.total, 3), Number(s.total_error, 2),
                      r.indices->usable ? "" : "not usable"});
    }
  }
  return rows;
}

CampaignTextRows ScreeningRows(const CampaignAnswers& a) {
  CampaignTextRows rows = {{"", "variable", "rank", "mu*", "+-", "sigma", ""}};
  for (const ResponseAnswer& r : a.responses) {
    if (!r.screening) continue;
    for (std::size_t j = 0; j < r.screening->inputs.size(); ++j) {
      const campaign::MorrisEffect& e = r.screening->inputs[j];
      rows.push_back({Named(r), a.variables[j], fmt::format("{}", e.rank), Number(e.mu_star, 3),
                      Number(e.mu_star_error, 2), Number(e.sigma, 3),
                      r.screening->usable ? "" : "not usable"});
    }
  }
  return rows;
}

std::string CampaignHead(const CampaignAnswers& a) {
  return fmt::format("{}: {}, design {}{}", a.name,
                     Counted(static_cast<std::size_t>(a.runs), "run"), a.design,
                     a.failed == 0 ? "" : fmt::format(", {} of them failed", a.failed));
}

std::string CampaignText(const CampaignAnswers& a) {
  std::string out = CampaignHead(a) + "\n";
  constexpr std::size_t kMostReasons = 5;  // lines; the page and --json have all
  for (std::size_t i = 0; i < a.reasons.size() && i < kMostReasons; ++i) {
    out += fmt::format("  {} failed: {}\n", a.reasons[i].second, a.reasons[i].first);
  }
  if (a.reasons.size() > kMostReasons) {
    out += fmt::format("  and for {} reasons more\n", a.reasons.size() - kMostReasons);
  }
  for (const CampaignTextRows& rows : {ProbabilityRows(a), NumberRows(a)}) {
    if (rows.size() > 1) out += AlignedTable(rows);
  }
  if (const CampaignTextRows rows = CorrelationRows(a); rows.size() > 1) out += AlignedTable(rows);
  if (const CampaignTextRows rows = SurrogateRows(a); rows.size() > 1) out += AlignedTable(rows);
  if (const CampaignTextRows rows = ShareRows(a); rows.size() > 1) {
    out += "shares of the variance (Sobol's indices)\n" + AlignedTable(rows);
  }
  if (const CampaignTextRows rows = ScreeningRows(a); rows.size() > 1) {
    out += "change from one end of a variable to the other (Morris)\n" + AlignedTable(rows);
  }
  if (ProbabilityRows(a).size() == 1 && NumberRows(a).size() == 1) {
    if (const CampaignTextRows rows = ExtremeRows(a); rows.size() > 1) out += AlignedTable(rows);
  }
  for (const std::string& note : a.notes) out += "note: " + note + "\n";
  return out;
}

}  // namespace unfurl::cli
