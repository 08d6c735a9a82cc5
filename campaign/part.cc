#include "campaign/part.h"

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <limits>

#include "base/cpu_time.h"
#include "base/error.h"
#include "base/text.h"
#include "data/h5.h"

namespace unfurl::campaign {

namespace {

constexpr char kPartSchema[] = "unfurl/campaign_part";
constexpr int kPartVersion = 1;

}  // namespace

RunRange ShardRange(std::uint64_t runs, std::uint64_t i, std::uint64_t n) {
  // Without a product that may be too large: the first `rest` parts have one more.
  const std::uint64_t each = runs / n, rest = runs % n, k = i - 1;
  RunRange out;
  out.first = each * k + std::min(k, rest);
  out.count = each + (k < rest ? 1 : 0);
  return out;
}

bool ParseRange(const std::string& text, RunRange* range) {
  const std::size_t colon = text.find(':');
  std::uint64_t first = 0, end = 0;
  if (colon == std::string::npos || !ParseWhole(std::string_view(text).substr(0, colon), &first) ||
      !ParseWhole(std::string_view(text).substr(colon + 1), &end) || end <= first) {
    return false;
  }
  *range = {first, end - first};
  return true;
}

std::string RangeText(const RunRange& range) {
  return fmt::format("{}:{}", range.first, range.end());
}

Part RunPart(const Inputs& inputs, Job* job, const RunRange& range,
             const std::function<void(std::uint64_t)>& progress) {
  const double cpu = CpuSeconds();
  const auto start = std::chrono::steady_clock::now();
  Part part;
  part.range = range;
  const std::size_t k = inputs.plan().responses.size();
  part.responses.resize(range.count * k);
  std::vector<double> values(inputs.plan().variables.size());
  for (std::uint64_t i = 0; i < range.count; ++i) {
    inputs.Values(range.first + i, values);
    const RunOutcome outcome =
        job->Run(range.first + i, values, std::span(part.responses).subspan(i * k, k));
    if (!outcome.good) {
      part.failed.push_back(range.first + i);
      part.messages.push_back(outcome.message);
    }
    if (progress) progress(i + 1);
  }
  part.cpu_seconds = CpuSeconds() - cpu;
  part.wall_seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return part;
}

Part FailedPart(const RunRange& range, std::size_t responses, const std::string& message) {
  Part part;
  part.range = range;
  part.responses.assign(range.count * responses, std::numeric_limits<double>::quiet_NaN());
  for (std::uint64_t i = 0; i < range.count; ++i) {
    part.failed.push_back(range.first + i);
    part.messages.push_back(message);
  }
  return part;
}

void WritePart(const std::string& path, const Part& part, const std::string& identity,
               std::size_t responses) {
  data::Provenance provenance;
  provenance.program = data::ProgramVersion();
  provenance.command = "unfurl campaign";
  data::H5Writer file(path, kPartSchema, kPartVersion, provenance);
  file.Attribute("/", "identity", identity);
  file.Attribute("/", "first", static_cast<std::int64_t>(part.range.first));
  file.Attribute("/", "count", static_cast<std::int64_t>(part.range.count));
  file.Attribute("/", "cpu_seconds", part.cpu_seconds);
  file.Attribute("/", "wall_seconds", part.wall_seconds);
  file.Write({"/response", "1", "responses of each run, in the plan's order and units", {}},
             part.responses, {part.range.count, responses});
  if (!part.failed.empty()) {
    std::vector<double> failed(part.failed.begin(), part.failed.end());
    file.Write({"/failed", "1", "runs that failed", {}}, failed);
    file.Write({"/message", "1", "why", {}}, part.messages);
  }
  file.Commit();
}

Part ReadPart(const std::string& path, const std::string& identity, std::size_t responses) {
  const data::H5Reader file(path, kPartSchema, kPartVersion);
  if (file.StringAttribute("/", "identity") != identity) {
    file.Fail("belongs to another campaign", "/", "remove it");
  }
  Part part;
  const std::int64_t first = file.IntAttribute("/", "first"),
                     count = file.IntAttribute("/", "count");
  const std::vector<std::size_t> dims = file.Dims("/response");
  if (first < 0 || count < 0 || dims.size() != 2 || dims[1] != responses ||
      dims[0] != static_cast<std::size_t>(count)) {
    file.Fail("does not hold the runs that it names", "/response", "remove it; it is made again");
  }
  part.range = {static_cast<std::uint64_t>(first), static_cast<std::uint64_t>(count)};
  part.cpu_seconds = file.DoubleAttribute("/", "cpu_seconds");
  part.wall_seconds = file.DoubleAttribute("/", "wall_seconds");
  part.responses = file.ReadDoubles("/response");
  if (file.Has("/failed")) {
    for (const double run : file.ReadDoubles("/failed")) {
      if (!(run >= static_cast<double>(first)) || !(run < static_cast<double>(first + count)) ||
          (!part.failed.empty() && run <= static_cast<double>(part.failed.back()))) {
        file.Fail("names runs that are not its own", "/failed", "remove it; it is made again");
      }
      part.failed.push_back(static_cast<std::uint64_t>(run));
    }
    part.messages = file.ReadStrings("/message");
    if (part.messages.size() != part.failed.size()) {
      file.Fail("has not one message a failure", "/message", "remove it; it is made again");
    }
  }
  return part;
}

}  // namespace unfurl::campaign
