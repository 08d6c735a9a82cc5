#include "campaign/rare.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/folder.h"
#include "campaign/json_number.h"
#include "campaign/record.h"

namespace unfurl::campaign {

namespace {

namespace fs = std::filesystem;
using Kind = data::CampaignDesign::Kind;
using nlohmann::ordered_json;

constexpr char kBatch[] = "batch-";

std::string BatchFolder(const std::string& folder, std::size_t batch) {
  return (fs::path(folder) / fmt::format("{}{:04d}", kBatch, batch)).string();
}

std::size_t ResponseOf(const data::Campaign& plan) {
  std::size_t k = 0;
  while (plan.responses[k].name != plan.design.failure) ++k;
  return k;
}

// A batch as a plan of rows.
data::Campaign RowsOf(const data::Campaign& plan, const Inputs& inputs,
                      const std::vector<std::vector<double>>& points) {
  data::Campaign out = plan;
  out.design.kind = Kind::kFile;
  out.design.rows.clear();
  for (const std::vector<double>& u : points) {
    std::vector<double> x(u.size());
    inputs.ValuesAt(u, x);
    out.design.rows.push_back(std::move(x));
  }
  out.design.runs = points.size();
  return out;
}

const char* MethodName(RareMethod method) {
  constexpr const char* kNames[] = {"subset simulation", "importance sampling", "random runs"};
  return kNames[static_cast<int>(method)];
}

void Judge(RareResult* out) {
  if (out->usable) return;
  out->message = out->notes.empty() ? "the levels do not lead to failures" : out->notes.front();
}

RareResult FromJson(const ordered_json& j) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  RareResult r;
  r.response = j.at("response");
  r.unit = j.at("unit");
  r.method = j.at("method");
  r.usable = j.at("usable");
  r.probability = j.at("probability");
  r.variation = NumberOr(j.at("variation"), kInfinity);
  r.interval = {NumberOr(j.at("interval").at(0), 0.0), NumberOr(j.at("interval").at(1), kInfinity)};
  r.with_failed = j.at("with_failed");
  r.runs = j.at("runs");
  r.failed = j.at("failed");
  r.notes = j.at("notes").get<std::vector<std::string>>();
  for (const ordered_json& l : j.at("levels")) {
    SubsetLevel level;
    level.threshold = l.at("threshold");
    level.probability = l.at("probability");
    level.error = NumberOr(l.at("variation"), kInfinity);
    level.acceptance = l.at("acceptance");
    level.failed = l.at("failed");
    level.runs = l.at("runs");
    r.levels.push_back(level);
  }
  Judge(&r);
  return r;
}

RareResult ResultOf(const RareFailureResult& from, const std::string& response,
                    const std::string& unit) {
  RareResult r;
  r.response = response;
  r.unit = unit;
  r.method = MethodName(from.method);
  r.probability = from.probability;
  r.variation = from.variation;
  r.interval = from.interval;
  r.with_failed = from.with_failed;
  r.runs = from.runs;
  r.failed = from.failed;
  r.levels = from.subset.levels;
  r.notes = from.notes;
  r.usable = from.usable;
  Judge(&r);
  return r;
}

// Runs of all batches so far.
class Runs {
 public:
  explicit Runs(const data::Campaign& plan) { record_.responses.resize(plan.responses.size()); }

  // Adds a batch whose parts are all there; returns its margins.
  std::vector<double> Add(const OpenCampaign& batch, std::size_t margin) {
    const std::size_t k = record_.responses.size();
    const std::uint64_t first = record_.runs;
    std::vector<double> margins;
    for (const PartFile& file : batch.folder.Parts()) {
      const Part part = ReadPart(file.path, batch.folder.identity(), k);
      if (part.range.first != margins.size()) continue;  // a second copy
      for (std::uint64_t i = 0; i < part.range.count; ++i) {
        for (std::size_t r = 0; r < k; ++r) {
          record_.responses[r].push_back(part.responses[i * k + r]);
        }
        margins.push_back(part.responses[i * k + margin]);
      }
      for (std::size_t f = 0; f < part.failed.size(); ++f) {
        record_.failed.push_back(first + part.failed[f]);
        record_.messages.push_back(part.messages[f]);
      }
    }
    const auto& rows = batch.inputs.plan().design.rows;
    values_.insert(values_.end(), rows.begin(), rows.end());
    record_.runs += rows.size();
    return margins;
  }

  const CampaignRecord& record() const { return record_; }
  const std::vector<std::vector<double>>& values() const { return values_; }

 private:
  CampaignRecord record_;
  std::vector<std::vector<double>> values_;
};

}  // namespace

RareResult RunRare(const data::Campaign& plan, const std::string& folder, const JobOptions& job,
                   const EngineOptions& engine, const std::string& out,
                   const std::function<void(double, const std::string&)>& progress) {
  const Inputs inputs(plan);
  const std::size_t margin = ResponseOf(plan);
  RareFailureOptions options;
  options.dimensions = static_cast<int>(plan.variables.size());
  options.runs =
      static_cast<int>(std::min<std::uint64_t>(plan.design.runs, std::numeric_limits<int>::max()));
  options.seed = plan.design.seed;
  options.confidence = plan.confidence;
  RareFailure rare(options);
  Runs runs(plan);
  std::vector<std::string> files;
  std::error_code ignored;
  fs::create_directories(folder, ignored);
  double seconds = 0.0;  // of the runs so far
  for (std::size_t batch = 0; !rare.Done(); ++batch) {
    const OpenCampaign open =
        OpenPlan(RowsOf(plan, inputs, rare.Batch()), BatchFolder(folder, batch), job);
    files = open.files;
    EngineOptions local = engine;
    local.progress = [&](std::uint64_t done) {
      const auto so_far = static_cast<double>(runs.record().runs + done);
      progress(std::min(0.99, so_far / static_cast<double>(plan.design.runs)),
               fmt::format("{:.0f} of at most {} runs", so_far, plan.design.runs));
    };
    const std::uint64_t so_far = runs.record().runs;
    if (so_far > 0) local.mean = seconds / static_cast<double>(so_far);
    seconds += RunLocally(open.folder, open.inputs.runs(), local).run_seconds;
    rare.Answer(runs.Add(open, margin));
  }
  RareResult result = ResultOf(rare.result(), plan.design.failure, plan.responses[margin].unit);
  WriteRecord(plan, files, runs.values(), runs.record(), RareJson(result).dump(), out);
  return result;
}

ordered_json RareJson(const RareResult& r) {
  ordered_json out = {{"response", r.response},
                      {"unit", r.unit},
                      {"method", r.method},
                      {"usable", r.usable},
                      {"probability", r.probability},
                      {"variation", NumberOrNull(r.variation)},
                      {"interval", {NumberOrNull(r.interval.low), NumberOrNull(r.interval.high)}},
                      {"with_failed", r.with_failed},
                      {"runs", r.runs},
                      {"failed", r.failed},
                      {"notes", r.notes},
                      {"levels", ordered_json::array()}};
  for (const SubsetLevel& l : r.levels) {
    out["levels"].push_back({{"threshold", l.threshold},
                             {"probability", l.probability},
                             {"variation", NumberOrNull(l.error)},
                             {"acceptance", l.acceptance},
                             {"failed", l.failed},
                             {"runs", l.runs}});
  }
  return out;
}

void RemoveRare(const std::string& folder) {
  for (const std::string& name : NamesIn(folder)) {
    if (name.starts_with(kBatch)) {
      CampaignFolder::Open((fs::path(folder) / name).string()).Remove();
    }
  }
  std::error_code ignored;
  fs::remove(folder, ignored);
}

bool IsRare(const std::string& path) { return HasRareText(path); }

RareResult ReadRare(const std::string& path) {
  const ordered_json j = ordered_json::parse(ReadRareText(path), nullptr, false);
  try {
    return FromJson(j);
  } catch (const nlohmann::json::exception&) {
    throw Error("holds no result of a search for rare failures", path, "make the file anew");
  }
}

}  // namespace unfurl::campaign
