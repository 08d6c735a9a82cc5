#include "data/campaign.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <set>

#include "base/text.h"
#include "data/beside.h"
#include "data/campaign_reader.h"
#include "data/csv.h"
#include "data/fit.h"
#include "data/toml_kind.h"

namespace unfurl::data {

namespace {

using CampaignKind = CampaignDistribution::Kind;

constexpr int kMostLevels = 1'000'000;         // of a grid's variable: what an integer key may say
constexpr int kMostBlocks = 1024;              // far beyond what an error needs
constexpr int kMostRuns = 2'000'000'000;       // what an integer key may say
constexpr int kRareRuns = 5000;                // find 1e-4 within a factor of 1.5
constexpr int kMostOfMorris = 1024;            // levels; beyond 10 nothing changes
constexpr double kHighestConfidence = 0.9999;  // beyond it no interval of a campaign is finite

using Numbers = std::vector<double>;

// A key that gives a distribution, how many numbers it holds (-1: any, 0: a file's), and what they
// have to fulfil.
struct CampaignForm {
  const char* key;
  CampaignKind kind;
  int numbers;
  bool (*right)(const Numbers& n);
  const char* wrong;
};
const CampaignForm kForms[] = {
    {"normal", CampaignKind::kNormal, 2, [](const Numbers& n) { return n[1] > 0.0; },
     "the second number, sigma, is not positive"},
    {"uniform", CampaignKind::kUniform, 2, [](const Numbers& n) { return n[0] < n[1]; },
     "low is not below high"},
    {"log_normal", CampaignKind::kLogNormal, 2,
     [](const Numbers& n) { return n[0] > 0.0 && n[1] > 1.0; },
     "the median is not positive, or the factor not above 1"},
    {"log_uniform", CampaignKind::kLogUniform, 2,
     [](const Numbers& n) { return n[0] > 0.0 && n[0] < n[1]; }, "not 0 < low < high"},
    {"triangular", CampaignKind::kTriangular, 3,
     [](const Numbers& n) { return n[0] <= n[1] && n[1] <= n[2] && n[0] < n[2]; },
     "not low <= mode <= high"},
    {"values", CampaignKind::kTable, -1, [](const Numbers& n) { return !n.empty(); },
     "there are no values"},
    {"samples", CampaignKind::kSamples, 0, [](const Numbers& n) { return !n.empty(); },
     "there are no values"},
};

const char* kFormsInWords =
    "give one of normal = [mean, sigma], uniform = [low, high], log_normal = [median, factor], "
    "log_uniform = [low, high], triangular = [low, mode, high], values = [...], samples = \"FILE\"";

// The column of this name, or the only one.
std::vector<double> Samples(const TomlTable& t, const std::string& name, const std::string& file) {
  const CsvTable table = CsvTable::Load(file);
  const std::string wanted = t.StringOr("column", name);
  const int column = table.columns().size() == 1 && !t.Has("column") ? 0 : table.Find(wanted);
  if (column < 0) {
    t.Fail("samples", fmt::format("{} has no column '{}'", file, wanted),
           "name one with column = \"...\"");
  }
  std::vector<double> out;
  for (std::size_t r = 0; r < table.rows(); ++r) out.push_back(table.Number(r, column));
  return out;
}

const CampaignForm& FormOf(const TomlTable& t) {
  const CampaignForm* found = nullptr;
  for (const CampaignForm& form : kForms) {
    if (!t.Has(form.key)) continue;
    if (found != nullptr) {
      t.Fail(form.key, fmt::format("stands beside '{}'", found->key), kFormsInWords);
    }
    found = &form;
  }
  if (found == nullptr) t.Fail("", "has no distribution", kFormsInWords);
  return *found;
}

CampaignDistribution ReadDistribution(const TomlTable& t, const std::string& name, Campaign* plan) {
  const CampaignForm& form = FormOf(t);
  CampaignDistribution out;
  out.kind = form.kind;
  if (form.kind == CampaignKind::kSamples) {
    const std::string file = FileBeside(t, "samples", plan->path);
    out.values = Samples(t, name, file);
    plan->inputs.push_back(file);
  } else if (form.kind == CampaignKind::kTable) {
    out.values = t.Numbers("values", -1);
    out.weights = t.NumbersOr("weights", std::vector<double>(out.values.size(), 1.0),
                              static_cast<int>(out.values.size()), kPositive);
  } else {
    out.numbers = t.Numbers(form.key, form.numbers);
  }
  if (!form.right(form.numbers > 0 ? out.numbers : out.values)) {
    t.Fail(form.key, form.wrong, kFormsInWords);
  }
  if (t.Has("truncate")) {
    const std::vector<double> cut = t.Numbers("truncate", 2);
    if (!(cut[0] < cut[1])) t.Fail("truncate", "encloses nothing", "give [low, high]");
    out.low = cut[0];
    out.high = cut[1];
  }
  return out;
}

CampaignVariable ReadVariable(const TomlTable& t, const std::string& name, Campaign* plan) {
  CampaignVariable v;
  v.name = name;
  v.where = t.Where();
  CheckCampaignName(t, name);
  v.unit = t.StringOr("unit", "");
  if (plan->job.scene.empty()) {
    if (t.Has("keys")) {
      t.Fail("keys", "belongs to a scene", "put {" + name + "} where the steps want the value");
    }
  } else {
    v.keys = t.Strings("keys");
    if (v.keys.empty()) {
      t.Fail("keys", "a variable that drives nothing", "name at least one key of the scene");
    }
  }
  v.levels = t.IntegerOr("levels", 0, 1, kMostLevels);
  if (plan->design.kind == CampaignDesign::Kind::kFile) {
    for (const CampaignForm& form : kForms) {
      if (t.Has(form.key)) {
        t.Fail(form.key, "stands beside a design from a file", "leave it out: the file has values");
      }
    }
    return v;
  }
  v.distribution = ReadDistribution(t, name, plan);
  if (plan->design.kind != CampaignDesign::Kind::kGrid) return v;
  if (v.distribution.kind == CampaignKind::kTable) {
    if (v.levels > 0) t.Fail("levels", "stands beside values", "leave it out: each value is one");
    v.levels = static_cast<int>(v.distribution.values.size());
  } else if (v.levels == 0) {
    t.FailMissing("levels");
  }
  return v;
}

// A fit's estimate as variables: normal, with the fit's covariance, cut off at its bounds.
void ReadPosterior(const TomlTable& t, Campaign* plan) {
  const std::string file = FileBeside(t, "fit", plan->path);
  const FitRecord fit = ReadFit(file);
  plan->inputs.push_back(file);
  std::vector<std::string> names;
  for (const FitRecord::Parameter& p : fit.parameters) names.push_back(p.name);
  const std::vector<std::string> wanted = t.StringsOr("parameters", names);
  std::vector<std::size_t> taken;
  for (const std::string& name : wanted) {
    const auto found = std::find(names.begin(), names.end(), name);
    if (found == names.end()) {
      t.Fail("parameters", fmt::format("{} has no parameter '{}'", file, name),
             "it has " + JoinWords(names));
    }
    taken.push_back(static_cast<std::size_t>(found - names.begin()));
  }
  for (const std::size_t p : taken) {
    const FitRecord::Parameter& from = fit.parameters[p];
    if (!(from.sigma > 0.0) || !std::isfinite(from.sigma)) {
      t.Fail("fit", fmt::format("{} does not determine '{}'", file, from.name),
             "leave it out of parameters = [...], and give a distribution of it");
    }
    CampaignVariable v;
    v.name = from.name;
    v.unit = from.unit;
    if (!plan->job.scene.empty()) v.keys = from.keys;
    v.where = t.Where();
    v.distribution.numbers = {from.value, from.sigma};
    v.distribution.low = from.low;
    v.distribution.high = from.high;
    plan->variables.push_back(std::move(v));
  }
  for (std::size_t i = 0; i < taken.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const auto a = static_cast<Eigen::Index>(taken[i]), b = static_cast<Eigen::Index>(taken[j]);
      const double value =
          fit.covariance(a, b) / (fit.parameters[taken[i]].sigma * fit.parameters[taken[j]].sigma);
      if (value != 0.0) {
        plan->correlations.push_back({wanted[i], wanted[j], value, t.Where("fit")});
      }
    }
  }
}

void ReadCorrelations(const TomlTable& root, Campaign* plan) {
  std::set<std::string> known;
  for (const CampaignVariable& v : plan->variables) known.insert(v.name);
  for (const TomlTable& t : root.TableArray("correlation")) {
    CampaignCorrelation c;
    c.where = t.Where();
    const std::vector<std::string> names = t.Strings("between");
    if (names.size() != 2 || names[0] == names[1]) {
      t.Fail("between", "does not name two variables", "give [\"first\", \"second\"]");
    }
    for (const std::string& name : names) {
      if (known.count(name) == 0) {
        t.Fail("between", fmt::format("there is no variable '{}'", name), "name two of the plan's");
      }
    }
    c.first = names[0];
    c.second = names[1];
    c.value = t.Number("value", {-1.0, 1.0, true, true});
    for (const CampaignCorrelation& other : plan->correlations) {
      if ((other.first == c.first && other.second == c.second) ||
          (other.first == c.second && other.second == c.first)) {
        t.Fail("between", "is said twice", "leave one out");
      }
    }
    plan->correlations.push_back(std::move(c));
  }
}

CampaignDesign::Kind DesignOf(const TomlTable& t) {
  using D = CampaignDesign::Kind;
  const std::map<std::string, D> kinds = {{"random", D::kRandom}, {"latin", D::kLatin},
                                          {"sobol", D::kSobol},   {"grid", D::kGrid},
                                          {"file", D::kFile},     {"saltelli", D::kSaltelli},
                                          {"morris", D::kMorris}, {"rare", D::kRare}};
  std::vector<std::string> names;
  names.reserve(kinds.size());
  for (const auto& [name, kind] : kinds) names.push_back(name);
  return kinds.at(t.ChoiceOr("design", "latin", names));
}

// A table of values, a column a variable.
void ReadRows(const TomlTable& t, Campaign* plan) {
  const std::string file = FileBeside(t, "file", plan->path);
  const CsvTable table = CsvTable::Load(file);
  plan->inputs.push_back(file);
  std::vector<int> columns;
  for (const CampaignVariable& v : plan->variables) {
    columns.push_back(table.Find(v.name));
    if (columns.back() < 0) {
      t.Fail("file", fmt::format("{} has no column '{}'", file, v.name),
             "give it a column of each variable's name");
    }
  }
  for (std::size_t r = 0; r < table.rows(); ++r) {
    std::vector<double> row;
    row.reserve(columns.size());
    for (const int column : columns) row.push_back(table.Number(r, column));
    plan->design.rows.push_back(std::move(row));
  }
  if (plan->design.rows.empty()) {
    t.Fail("file", file + " has no rows", "give it a line for each run");
  }
  plan->design.runs = plan->design.rows.size();
}

void ReadDesign(const TomlTable& t, Campaign* plan) {
  CampaignDesign& d = plan->design;
  using D = CampaignDesign::Kind;
  d.kind = DesignOf(t);
  d.seed = static_cast<std::uint64_t>(t.IntegerOr("seed", 1, 0, kMostRuns));
  if (d.kind != D::kGrid && d.kind != D::kFile) {
    d.runs = static_cast<std::uint64_t>(
        t.IntegerOr("runs", d.kind == D::kRare ? kRareRuns : 1000, 1, kMostRuns));
  }
  if (d.kind == D::kLatin || d.kind == D::kSobol) {
    d.blocks = t.IntegerOr("blocks", static_cast<int>(std::min<std::uint64_t>(16, d.runs)), 1,
                           kMostBlocks);
  }
  if (d.kind == D::kMorris) d.levels = t.IntegerOr("levels", 4, 2, kMostOfMorris);
  if (d.kind == D::kRare) d.failure = t.String("failure");
  d.until = t.StringOr("until", "");
  if (d.until.empty()) return;
  if (d.kind != D::kRandom && d.kind != D::kSobol) {
    t.Fail("until", "asks for a design to which runs can be added",
           "take design = \"random\" or \"sobol\"");
  }
  d.most = static_cast<std::uint64_t>(t.IntegerOr("most", 1'000'000, 1, kMostRuns));
}

void CheckRare(const TomlTable& t, const Campaign& plan) {
  if (plan.design.kind != CampaignDesign::Kind::kRare) return;
  for (const CampaignResponse& r : plan.responses) {
    if (r.name != plan.design.failure) continue;
    if (r.yes_no) {
      t.Fail("failure", fmt::format("'{}' is yes or no", r.name),
             "name a margin: a response that falls below 0 by degrees as failure comes");
    }
    return;
  }
  t.Fail("failure", fmt::format("there is no response '{}'", plan.design.failure),
         "name one of the plan's: a margin, negative where it failed");
}

Campaign ReadCampaignFrom(const TomlTable& root, const std::string& path) {
  Campaign plan;
  plan.path = path;
  const TomlTable t = root.Table("campaign");
  plan.name = t.StringOr("name", std::filesystem::path(path).stem().string());
  plan.confidence = t.NumberOr("confidence", 0.95, {0.5, kHighestConfidence});
  ReadCampaignJob(root.Table("job"), &plan);
  ReadDesign(t, &plan);
  if (const auto posterior = root.TableOrNone("posterior")) ReadPosterior(*posterior, &plan);
  for (const auto& [name, table] : root.NamedTables("variable")) {
    for (const CampaignVariable& v : plan.variables) {
      if (v.name == name) {
        table.Fail("", fmt::format("'{}' is a parameter of the posterior, too", name),
                   "leave it out of one of them");
      }
    }
    plan.variables.push_back(ReadVariable(table, name, &plan));
  }
  if (plan.variables.empty()) {
    t.Fail("", "there is no [variable.NAME]", "say which numbers scatter, and how");
  }
  ReadCorrelations(root, &plan);
  if (plan.design.kind == CampaignDesign::Kind::kFile) ReadRows(t, &plan);
  ReadCampaignResponses(root, &plan);
  CheckRare(t, plan);
  if (const auto slurm = root.TableOrNone("slurm")) {
    plan.slurm = slurm->StringsOr("options", {});
  }
  root.RefuseUnknownKeys();
  return plan;
}

}  // namespace

Campaign ReadCampaign(const std::string& path, const std::vector<std::string>& overrides) {
  const TomlTable root = LoadToml(path, overrides);
  return ReadAsKind(root, "campaign", [&] { return ReadCampaignFrom(root, path); });
}

Campaign ParseCampaign(const std::string& text, const std::string& name) {
  return ReadCampaignFrom(ParseToml(text, name), name);
}

}  // namespace unfurl::data
