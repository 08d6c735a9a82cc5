#include "campaign/inputs.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/statistics.h"

namespace unfurl::campaign {

namespace {

using data::Campaign;
using data::CampaignDistribution;
using Kind = data::CampaignDesign::Kind;

Distribution Plain(const CampaignDistribution& d) {
  const std::vector<double>& n = d.numbers;
  switch (d.kind) {
    case CampaignDistribution::Kind::kNormal:
      return Distribution::Normal(n.at(0), n.at(1));
    case CampaignDistribution::Kind::kUniform:
      return Distribution::Uniform(n.at(0), n.at(1));
    case CampaignDistribution::Kind::kLogNormal:
      return Distribution::LogNormal(n.at(0), n.at(1));
    case CampaignDistribution::Kind::kLogUniform:
      return Distribution::LogUniform(n.at(0), n.at(1));
    case CampaignDistribution::Kind::kTriangular:
      return Distribution::Triangular(n.at(0), n.at(1), n.at(2));
    case CampaignDistribution::Kind::kTable:
      return Distribution::Table(d.values, d.weights);
    case CampaignDistribution::Kind::kSamples:
      return Distribution::Empirical(d.values);
  }
  return Distribution::Uniform(0.0, 1.0);
}

Distribution Make(const data::CampaignVariable& v) {
  try {
    const CampaignDistribution& d = v.distribution;
    const Distribution plain = Plain(d);
    return std::isfinite(d.low) || std::isfinite(d.high) ? plain.Truncated(d.low, d.high) : plain;
  } catch (const Error& e) {
    throw Error(e.problem(), v.where, e.remedy());
  }
}

std::vector<Distribution> MakeAll(const Campaign& plan) {
  std::vector<Distribution> out;
  if (plan.design.kind == Kind::kFile) return out;
  for (const data::CampaignVariable& v : plan.variables) out.push_back(Make(v));
  return out;
}

Correlation MakeCorrelation(const Campaign& plan) {
  if (plan.correlations.empty()) return {};
  std::vector<std::string> names;
  for (const data::CampaignVariable& v : plan.variables) names.push_back(v.name);
  const auto d = static_cast<Eigen::Index>(names.size());
  Eigen::MatrixXd scores = Eigen::MatrixXd::Identity(d, d);
  for (const data::CampaignCorrelation& c : plan.correlations) {
    const auto i = std::find(names.begin(), names.end(), c.first) - names.begin();
    const auto j = std::find(names.begin(), names.end(), c.second) - names.begin();
    scores(i, j) = scores(j, i) = c.value;
  }
  try {
    return Correlation(scores, names);
  } catch (const Error& e) {
    throw Error(e.problem(), plan.correlations.front().where, e.remedy());
  }
}

DesignKind KindOf(Kind kind) {
  switch (kind) {
    case Kind::kLatin:
      return DesignKind::kLatin;
    case Kind::kSobol:
      return DesignKind::kSobol;
    case Kind::kGrid:
      return DesignKind::kGrid;
    case Kind::kSaltelli:
      return DesignKind::kSaltelli;
    case Kind::kMorris:
      return DesignKind::kMorris;
    case Kind::kRandom:
    case Kind::kFile:
    case Kind::kRare:
      break;
  }
  return DesignKind::kRandom;
}

Design MakeDesign(const Campaign& plan) {
  DesignSpec spec;
  spec.kind = KindOf(plan.design.kind);
  spec.runs = plan.design.runs;
  spec.seed = plan.design.seed;
  spec.dimensions = static_cast<int>(plan.variables.size());
  spec.blocks = plan.design.blocks;
  spec.morris_levels = plan.design.levels;
  if (spec.kind == DesignKind::kGrid) {
    for (const data::CampaignVariable& v : plan.variables) spec.levels.push_back(v.levels);
  }
  try {
    return Design(spec);
  } catch (const Error& e) {
    throw Error(e.problem(), plan.path + ":campaign", e.remedy());
  }
}

}  // namespace

bool Extendable(Kind kind) { return kind == Kind::kRandom || kind == Kind::kSobol; }

Inputs::Inputs(Campaign plan)
    : plan_(std::move(plan)),
      distributions_(MakeAll(plan_)),
      correlation_(MakeCorrelation(plan_)),
      design_(MakeDesign(plan_)) {
  const Kind kind = plan_.design.kind;
  if (!correlation_.none() && (kind == Kind::kSaltelli || kind == Kind::kMorris)) {
    throw Error("variables that go together have no shares of their own",
                plan_.correlations.front().where,
                "leave the correlation out, or take design = \"latin\"");
  }
}

std::uint64_t Inputs::runs() const { return HasRows() ? plan_.design.rows.size() : design_.size(); }

Inputs Inputs::WithRuns(std::uint64_t runs) const {
  Campaign plan = plan_;
  plan.design.runs = runs;
  return Inputs(std::move(plan));
}

void Inputs::Point(std::uint64_t run, std::span<double> u) const { design_.Point(run, u); }

void Inputs::Values(std::uint64_t run, std::span<double> x) const {
  if (HasRows()) {
    const std::vector<double>& row = plan_.design.rows[run];
    std::copy(row.begin(), row.end(), x.begin());
    return;
  }
  design_.Point(run, x);
  // A grid is a grid, whatever goes together elsewhere.
  const bool grid = plan_.design.kind == Kind::kGrid;
  if (!grid) correlation_.Apply(x);
  for (std::size_t j = 0; j < x.size(); ++j) {
    const CampaignDistribution& d = plan_.variables[j].distribution;
    if (grid && d.kind == CampaignDistribution::Kind::kTable) {
      // Each value once, in the order given, whatever its weight.
      const auto n = static_cast<double>(d.values.size());
      x[j] = d.values[static_cast<std::size_t>(x[j] * n)];
    } else {
      x[j] = distributions_[j].Quantile(x[j]);
    }
  }
}

void Inputs::ValuesAt(std::span<const double> u, std::span<double> x) const {
  std::copy(u.begin(), u.end(), x.begin());
  correlation_.Apply(x);
  for (std::size_t j = 0; j < x.size(); ++j) x[j] = distributions_[j].Quantile(x[j]);
}

std::vector<double> Inputs::Typical() const {
  std::vector<double> out(plan_.variables.size());
  if (plan_.design.kind == Kind::kFile) return plan_.design.rows.front();
  for (std::size_t j = 0; j < out.size(); ++j) out[j] = distributions_[j].Quantile(0.5);
  return out;
}

bool Inputs::Drawn() const {
  const Kind kind = plan_.design.kind;
  return kind != Kind::kGrid && kind != Kind::kMorris && !HasRows();
}

bool Inputs::HasRows() const {
  return plan_.design.kind == Kind::kFile || plan_.design.kind == Kind::kRare;
}

}  // namespace unfurl::campaign
