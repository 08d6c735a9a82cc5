#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <utility>

#include "base/error.h"
#include "data/campaign.h"

namespace unfurl::data {

namespace {

using nlohmann::ordered_json;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// JSON has no infinity: a bound that is none is null.
ordered_json Bound(double value) {
  return std::isfinite(value) ? ordered_json(value) : ordered_json();
}
double Bound(const ordered_json& value, double none) {
  return value.is_null() ? none : value.get<double>();
}

ordered_json ToJson(const CampaignVariable& v) {
  const CampaignDistribution& d = v.distribution;
  return {{"name", v.name},        {"unit", v.unit},
          {"keys", v.keys},        {"kind", static_cast<int>(d.kind)},
          {"numbers", d.numbers},  {"values", d.values},
          {"weights", d.weights},  {"low", Bound(d.low)},
          {"high", Bound(d.high)}, {"levels", v.levels},
          {"where", v.where}};
}

// A whole number that T holds: what a cast makes of another is not defined.
template <typename T>
T Whole(const ordered_json& value) {
  const bool fits = value.is_number_unsigned()  ? std::in_range<T>(value.get<std::uint64_t>())
                    : value.is_number_integer() ? std::in_range<T>(value.get<std::int64_t>())
                                                : false;
  if (!fits) throw std::out_of_range("whole number");
  return value.get<T>();
}

// A number that stands for one of `count` kinds.
template <typename Kind>
Kind KindOf(const ordered_json& value, int count) {
  const int number = Whole<int>(value);
  if (number < 0 || number >= count) throw std::out_of_range("kind");
  return static_cast<Kind>(number);
}
constexpr int kDistributions = 7, kSources = 4, kDesigns = 8;  // members of the enumerations

// What the program relies on, and a record of a stranger may not have.
void CheckWhole(const Campaign& plan) {
  const auto need = [](bool good) {
    if (!good) throw std::out_of_range("plan");
  };
  const auto variable = [&](const std::string& name) {
    return std::any_of(plan.variables.begin(), plan.variables.end(),
                       [&](const CampaignVariable& v) { return v.name == name; });
  };
  need(!plan.variables.empty() && !plan.responses.empty() && plan.confidence > 0.0 &&
       plan.confidence < 1.0);
  for (const CampaignVariable& v : plan.variables) {
    using Kind = CampaignDistribution::Kind;
    const CampaignDistribution& d = v.distribution;
    const std::size_t numbers = d.kind == Kind::kTriangular                          ? 3
                                : d.kind == Kind::kTable || d.kind == Kind::kSamples ? 0
                                                                                     : 2;
    need(d.numbers.size() == numbers || plan.design.kind == CampaignDesign::Kind::kFile);
  }
  for (const CampaignCorrelation& c : plan.correlations) {
    need(c.first != c.second && variable(c.first) && variable(c.second));
  }
  for (const std::vector<double>& row : plan.design.rows) {
    need(row.size() == plan.variables.size());
  }
  if (plan.design.kind == CampaignDesign::Kind::kFile) need(!plan.design.rows.empty());
  if (plan.design.kind == CampaignDesign::Kind::kRare) {
    need(std::any_of(plan.responses.begin(), plan.responses.end(),
                     [&](const CampaignResponse& r) { return r.name == plan.design.failure; }));
  }
}

CampaignVariable Variable(const ordered_json& j) {
  CampaignVariable v;
  v.name = j.at("name");
  v.unit = j.at("unit");
  v.keys = j.at("keys").get<std::vector<std::string>>();
  v.distribution.kind = KindOf<CampaignDistribution::Kind>(j.at("kind"), kDistributions);
  v.distribution.numbers = j.at("numbers").get<std::vector<double>>();
  v.distribution.values = j.at("values").get<std::vector<double>>();
  v.distribution.weights = j.at("weights").get<std::vector<double>>();
  v.distribution.low = Bound(j.at("low"), -kInfinity);
  v.distribution.high = Bound(j.at("high"), kInfinity);
  v.levels = Whole<int>(j.at("levels"));
  v.where = j.at("where");
  return v;
}

ordered_json ToJson(const CampaignResponse& r) {
  return {{"name", r.name},
          {"unit", r.unit},
          {"source", static_cast<int>(r.source)},
          {"quantity", r.quantity},
          {"event", r.event},
          {"joint", r.joint},
          {"count", r.count},
          {"of", r.of},
          {"at", r.at},
          {"from", r.from},
          {"to", Bound(r.to)},
          {"expression", r.expression},
          {"step", r.step},
          {"pointer", r.pointer},
          {"above", r.above ? ordered_json(*r.above) : ordered_json()},
          {"below", r.below ? ordered_json(*r.below) : ordered_json()},
          {"yes_no", r.yes_no},
          {"where", r.where}};
}

CampaignResponse Response(const ordered_json& j) {
  CampaignResponse r;
  r.name = j.at("name");
  r.unit = j.at("unit");
  r.source = KindOf<CampaignResponse::Source>(j.at("source"), kSources);
  r.quantity = j.at("quantity");
  r.event = j.at("event");
  r.joint = j.at("joint");
  r.count = Whole<int>(j.at("count"));
  r.of = j.at("of");
  r.at = j.at("at");
  r.from = j.at("from");
  r.to = Bound(j.at("to"), kInfinity);
  r.expression = j.at("expression");
  r.step = Whole<int>(j.at("step"));
  r.pointer = j.at("pointer");
  if (!j.at("above").is_null()) r.above = j.at("above").get<double>();
  if (!j.at("below").is_null()) r.below = j.at("below").get<double>();
  r.yes_no = j.at("yes_no");
  r.where = j.at("where");
  return r;
}

ordered_json ToJson(const CampaignJob& job) {
  return {{"scene", job.scene},       {"set", job.set},         {"rtol", job.rtol},
          {"duration", job.duration}, {"rate", job.rate},       {"steps", job.steps},
          {"files", job.files},       {"timeout", job.timeout}, {"where", job.where}};
}

CampaignJob Job(const ordered_json& j) {
  CampaignJob job;
  job.scene = j.at("scene");
  job.set = j.at("set").get<std::vector<std::string>>();
  job.rtol = j.at("rtol");
  job.duration = j.at("duration");
  job.rate = j.at("rate");
  job.steps = j.at("steps").get<std::vector<std::vector<std::string>>>();
  job.files = j.at("files").get<std::vector<std::string>>();
  job.timeout = j.at("timeout");
  job.where = j.at("where");
  return job;
}

ordered_json ToJson(const CampaignDesign& d) {
  return {{"kind", static_cast<int>(d.kind)},
          {"runs", d.runs},
          {"seed", d.seed},
          {"blocks", d.blocks},
          {"levels", d.levels},
          {"until", d.until},
          {"most", d.most},
          {"failure", d.failure},
          {"rows", d.rows}};
}

CampaignDesign DesignOf(const ordered_json& j) {
  CampaignDesign d;
  d.kind = KindOf<CampaignDesign::Kind>(j.at("kind"), kDesigns);
  d.runs = Whole<std::uint64_t>(j.at("runs"));
  d.seed = Whole<std::uint64_t>(j.at("seed"));
  d.blocks = Whole<int>(j.at("blocks"));
  d.levels = Whole<int>(j.at("levels"));
  d.until = j.at("until");
  d.most = Whole<std::uint64_t>(j.at("most"));
  d.failure = j.at("failure");
  d.rows = j.at("rows").get<std::vector<std::vector<double>>>();
  return d;
}

}  // namespace

std::string CampaignJson(const Campaign& plan) {
  ordered_json j = {{"name", plan.name},
                    {"path", plan.path},
                    {"confidence", plan.confidence},
                    {"inputs", plan.inputs},
                    {"slurm", plan.slurm},
                    {"job", ToJson(plan.job)},
                    {"design", ToJson(plan.design)}};
  for (const CampaignVariable& v : plan.variables) j["variables"].push_back(ToJson(v));
  j["correlations"] = ordered_json::array();
  for (const CampaignCorrelation& c : plan.correlations) {
    j["correlations"].push_back({{"first", c.first}, {"second", c.second}, {"value", c.value}});
  }
  for (const CampaignResponse& r : plan.responses) j["responses"].push_back(ToJson(r));
  try {
    return j.dump();
  } catch (const ordered_json::type_error&) {  // JSON is UTF-8; a file's name may be any bytes
    throw Error("a name that is not UTF-8, which the record of a campaign cannot keep", plan.path,
                "rename the file or the folder that it names");
  }
}

Campaign CampaignFromJson(const std::string& text, const std::string& where) {
  try {
    const ordered_json j = ordered_json::parse(text);
    Campaign plan;
    plan.name = j.at("name");
    plan.path = j.at("path");
    plan.confidence = j.at("confidence");
    plan.inputs = j.at("inputs").get<std::vector<std::string>>();
    plan.slurm = j.at("slurm").get<std::vector<std::string>>();
    plan.job = Job(j.at("job"));
    plan.design = DesignOf(j.at("design"));
    for (const ordered_json& v : j.at("variables")) plan.variables.push_back(Variable(v));
    for (const ordered_json& c : j.at("correlations")) {
      plan.correlations.push_back({c.at("first"), c.at("second"), c.at("value"), where});
    }
    for (const ordered_json& r : j.at("responses")) plan.responses.push_back(Response(r));
    CheckWhole(plan);
    return plan;
  } catch (const std::exception&) {  // nlohmann's, and ours
    throw Error("holds no plan of this program", where, "make it anew with `unfurl campaign PLAN`");
  }
}

}  // namespace unfurl::data
