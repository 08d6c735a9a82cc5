#include "campaign/answers.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "base/count.h"
#include "base/text.h"
#include "campaign/statistics/rank_correlation.h"

namespace unfurl::campaign {

namespace {

// Runs that a surrogate is fitted to: beyond them it gains little, and takes seconds.
constexpr std::size_t kMostOfSurrogate = 2000;
constexpr std::size_t kMostVariables = 30;  // of a surrogate, whose terms grow as their square

using Kind = data::CampaignDesign::Kind;

// Commonest first; of those that are as common, by their words.
std::vector<std::pair<std::string, std::uint64_t>> Reasons(
    const std::vector<std::string>& messages) {
  std::map<std::string, std::uint64_t> counts;
  for (const std::string& message : messages) ++counts[message];
  std::vector<std::pair<std::string, std::uint64_t>> out(counts.begin(), counts.end());
  std::stable_sort(out.begin(), out.end(),
                   [](const auto& a, const auto& b) { return a.second > b.second; });
  return out;
}

void FindExtremes(const std::vector<double>& values, ResponseAnswer* out) {
  for (std::uint64_t run = 0; run < values.size(); ++run) {
    const double v = values[run];
    if (std::isnan(v)) continue;
    const bool first = out->present++ == 0;
    if (first || v < out->minimum) out->minimum = v, out->minimum_run = run;
    if (first || v > out->maximum) out->maximum = v, out->maximum_run = run;
  }
}

// Values of drawn runs that have the response, in the order of runs, with their blocks.
struct Draws {
  std::vector<double> values;
  std::vector<int> blocks;
  std::uint64_t failed = 0;  // drawn runs that failed
};

Draws DrawsOf(const CampaignRecord& record, const std::vector<std::uint64_t>& runs,
              const std::vector<int>& blocks, const std::vector<double>& values) {
  Draws out;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    if (std::binary_search(record.failed.begin(), record.failed.end(), runs[i])) ++out.failed;
    if (std::isnan(values[runs[i]])) continue;
    out.values.push_back(values[runs[i]]);
    if (!blocks.empty()) out.blocks.push_back(blocks[i]);
  }
  return out;
}

// Correlations and a surrogate, of drawn runs.
void AnswerVariables(const CampaignRecord& record, const Inputs& inputs,
                     const std::vector<std::uint64_t>& runs, const std::vector<double>& values,
                     ResponseAnswer* out) {
  const std::size_t d = record.plan.variables.size();
  std::vector<std::uint64_t> kept;
  for (const std::uint64_t run : runs) {
    if (!std::isnan(values[run])) kept.push_back(run);
  }
  std::vector<std::vector<double>> columns(d, std::vector<double>(kept.size()));
  std::vector<double> y(kept.size()), x(d);
  const std::size_t most = std::min(kept.size(), kMostOfSurrogate);
  Eigen::MatrixXd points(static_cast<Eigen::Index>(d), static_cast<Eigen::Index>(most));
  for (std::size_t i = 0; i < kept.size(); ++i) {
    y[i] = values[kept[i]];
    if (i < most) {
      inputs.Point(kept[i], x);
      for (std::size_t j = 0; j < d; ++j) {
        points(static_cast<Eigen::Index>(j), static_cast<Eigen::Index>(i)) = x[j];
      }
    }
    inputs.Values(kept[i], x);
    for (std::size_t j = 0; j < d; ++j) columns[j][i] = x[j];
  }
  if (out->minimum == out->maximum) return;
  for (std::size_t j = 0; j < d; ++j) {
    const double r = RankCorrelation(columns[j], y);
    out->correlations.push_back({r, RankCorrelationInterval(r, y.size(), out->confidence)});
  }
  if (out->yes_no || !record.plan.correlations.empty() || d > kMostVariables) return;
  ChaosOptions options;
  options.confidence = out->confidence;
  options.seed = record.plan.design.seed;
  out->surrogate = PolynomialChaos::Fit(points, std::span(y).first(most), options);
}

void AnswerDraws(const Draws& draws, double confidence, ResponseAnswer* out) {
  Wanted wanted;
  wanted.confidence = confidence;
  if (out->yes_no) {
    out->proportion = Proportion(draws.values, draws.blocks, confidence);
    if (draws.failed > 0) {
      const auto all = static_cast<double>(draws.values.size() + draws.failed);
      const auto yes = static_cast<double>(out->proportion->yes);
      out->proportion_with_failed =
          Interval{yes / all, (yes + static_cast<double>(draws.failed)) / all};
    }
    wanted.kind = AnswerKind::kProbability;
  } else {
    out->summary = Summarise(draws.values, draws.blocks, confidence);
  }
  out->convergence = RunsNeeded(wanted, draws.values, draws.blocks);
}

// What hangs on which variable, of designs that are made for it.
void AnswerShares(const Inputs& inputs, const std::vector<double>& values, ResponseAnswer* out) {
  const data::Campaign& plan = inputs.plan();
  if (plan.design.kind == Kind::kSaltelli) {
    out->indices = IndicesOfSaltelli(values, static_cast<int>(plan.variables.size()),
                                     plan.confidence, plan.design.seed);
  } else if (plan.design.kind == Kind::kMorris) {
    out->screening = ScreenMorris(inputs.design(), values);
  }
}

// What the statistics have to say, each sentence once, with the responses that it is about.
void AddNotesOfParts(CampaignAnswers* out) {
  std::vector<std::pair<std::string, std::vector<std::string>>> said;
  const auto add = [&](const std::string& name, const std::vector<std::string>& notes) {
    for (const std::string& note : notes) {
      auto found = std::find_if(said.begin(), said.end(),
                                [&](const auto& one) { return one.first == note; });
      if (found == said.end()) found = said.insert(said.end(), {note, {}});
      found->second.push_back(name);
    }
  };
  for (const ResponseAnswer& r : out->responses) {
    if (r.summary) add(r.name, r.summary->notes);
    if (r.indices) add(r.name, r.indices->notes);
    if (r.screening) add(r.name, r.screening->notes);
  }
  for (const auto& [note, names] : said) out->notes.push_back(JoinWords(names) + ": " + note);
}

void AddNotes(const Inputs& inputs, CampaignAnswers* out) {
  if (out->failed > 0 && out->failed < out->runs) {
    out->notes.push_back(fmt::format(
        "{} of {} failed: numbers are those of the others, which are not all of what was asked for",
        out->failed, Counted(out->runs, "run")));
  }
  if (!inputs.Drawn()) {
    out->notes.push_back(fmt::format(
        "the runs of a design '{}' are not drawn from the distributions: no probabilities follow",
        out->design));
  }
  for (const ResponseAnswer& r : out->responses) {
    if (r.absent == 0) continue;
    out->notes.push_back(fmt::format("{} good runs have no {}, which is of the other {} alone",
                                     r.absent, r.name, r.present));
  }
  AddNotesOfParts(out);
}

}  // namespace

const char* DesignName(Kind kind) {
  constexpr const char* kNames[] = {"random", "latin",    "sobol",  "grid",
                                    "file",   "saltelli", "morris", "rare"};
  return kNames[static_cast<int>(kind)];
}

std::vector<std::uint64_t> DrawnRuns(const Inputs& inputs, std::vector<int>* blocks) {
  std::vector<std::uint64_t> out;
  blocks->clear();
  if (!inputs.Drawn()) return out;
  const Kind kind = inputs.plan().design.kind;
  const std::uint64_t row = inputs.design().row();
  for (std::uint64_t run = 0; run < inputs.runs(); ++run) {
    if (kind == Kind::kSaltelli && run % row > 1) continue;
    out.push_back(run);
    if (inputs.design().blocks() > 0) blocks->push_back(inputs.design().Block(run));
  }
  return out;
}

CampaignAnswers Answer(const CampaignRecord& record) {
  const Inputs inputs(record.plan);
  CampaignAnswers out;
  out.name = record.plan.name;
  out.design = DesignName(record.plan.design.kind);
  out.confidence = record.plan.confidence;
  out.runs = record.runs;
  out.failed = record.failed.size();
  out.reasons = Reasons(record.messages);
  for (std::size_t j = 0; j < record.plan.variables.size(); ++j) {
    out.variables.push_back(record.plan.variables[j].name);
    out.distributions.push_back(inputs.distributions().empty() ? "from the file"
                                                               : inputs.distributions()[j].Words());
  }
  std::vector<int> blocks;
  const std::vector<std::uint64_t> drawn = DrawnRuns(inputs, &blocks);
  for (std::size_t k = 0; k < record.plan.responses.size(); ++k) {
    const data::CampaignResponse& from = record.plan.responses[k];
    ResponseAnswer r;
    r.name = from.name;
    r.unit = from.unit;
    r.yes_no = from.yes_no;
    FindExtremes(record.responses[k], &r);
    r.absent = out.runs - out.failed - r.present;
    const Draws draws = DrawsOf(record, drawn, blocks, record.responses[k]);
    r.confidence = out.confidence;
    if (!draws.values.empty()) {
      AnswerDraws(draws, out.confidence, &r);
      AnswerVariables(record, inputs, drawn, record.responses[k], &r);
    }
    AnswerShares(inputs, record.responses[k], &r);
    out.responses.push_back(std::move(r));
  }
  AddNotes(inputs, &out);
  if (out.failed == out.runs) {
    out.usable = false;
    out.message = "every run failed; the commonest reason: " + out.reasons.front().first;
  }
  return out;
}

}  // namespace unfurl::campaign
