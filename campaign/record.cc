#include "campaign/record.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/count.h"
#include "base/error.h"
#include "base/progress.h"
#include "data/h5.h"

namespace unfurl::campaign {

namespace {

constexpr char kRun[] = "/run", kRare[] = "/rare";
constexpr int kRecordVersion = 1;
constexpr std::size_t kBlock = 4096;   // runs that are held at a time: megabytes
constexpr std::size_t kMessage = 200;  // letters: a line or two
constexpr int kDeflate = 1;            // pays in size, hardly costs

// The same whatever engine made the runs: the command is the one that would make them here.
data::Provenance ProvenanceOf(const data::Campaign& plan, const std::vector<std::string>& files) {
  data::Provenance out;
  out.program = data::ProgramVersion();
  out.command = "unfurl campaign " + plan.path;
  for (const std::string& file : files) out.AddInput(file);
  out.seed = plan.design.seed;
  return out;
}

class RecordWriter {
 public:
  RecordWriter(const data::Campaign& plan, const std::vector<std::string>& files,
               const std::string& out)
      : plan_(plan), file_(out, kCampaignSchema, kRecordVersion, ProvenanceOf(plan, files)) {
    AddText("/plan", "the plan with all that it read from other files, JSON",
            data::CampaignJson(plan));
    const std::vector<std::string> scale = {kRun};
    run_ = file_.Series({kRun, "1", "number of the run, from 0", {}}, data::H5Type::kInt32, {},
                        kBlock, kDeflate);
    good_ = file_.Series({"/good", "1", "1: the run ended well; 0: it failed", scale},
                         data::H5Type::kUint8, {}, kBlock, kDeflate);
    for (const data::CampaignVariable& v : plan.variables) {
      variables_.push_back(file_.Series(
          {"/variable/" + v.name, v.unit.empty() ? "1" : v.unit, "value in each run", scale},
          data::H5Type::kDouble, {}, kBlock, kDeflate));
    }
    for (const data::CampaignResponse& r : plan.responses) {
      const std::string what = r.yes_no ? "1: yes, 0: no" : "of each run";
      responses_.push_back(file_.Series({"/response/" + r.name, r.unit.empty() ? "1" : r.unit,
                                         what + "; NaN: it failed, or has none", scale},
                                        data::H5Type::kDouble, {}, kBlock, kDeflate));
    }
  }

  // `values` d and `responses` k a run, run after run, in order.
  void Append(std::span<const double> values, std::span<const double> responses) {
    const std::size_t d = variables_.size(), k = responses_.size(), n = responses.size() / k;
    std::vector<std::int32_t> run(n);
    for (std::size_t i = 0; i < n; ++i) run[i] = static_cast<std::int32_t>(runs_ + i);
    run_.Append(run);
    AppendColumns(values, n, d, &variables_);
    AppendColumns(responses, n, k, &responses_);
    runs_ += n;
  }

  void AddText(const std::string& path, const std::string& what, const std::string& text) {
    file_.Write({path, "1", what, {}}, std::vector<std::string>{text});
  }

  void Finish(const std::vector<std::uint64_t>& failed, const std::vector<std::string>& messages) {
    std::size_t next = 0;
    for (std::uint64_t first = 0; first < runs_; first += kBlock) {
      std::vector<std::uint8_t> good(std::min<std::uint64_t>(kBlock, runs_ - first), 1);
      for (; next < failed.size() && failed[next] < first + good.size(); ++next) {
        good[failed[next] - first] = 0;
      }
      good_.Append(good);
    }
    if (!failed.empty()) {
      std::vector<std::int32_t> runs(failed.begin(), failed.end());
      std::vector<std::string> cut = messages;
      for (std::string& text : cut) text.resize(std::min(text.size(), kMessage));
      file_.Write({"/failure/run", "1", "runs that failed", {}}, runs);
      file_.Write({"/failure/message", "1", "why", {"/failure/run"}}, cut);
    }
    file_.Commit();
  }

 private:
  void AppendColumns(std::span<const double> rows, std::size_t n, std::size_t columns,
                     std::vector<data::H5Series>* series) {
    column_.resize(n);
    for (std::size_t j = 0; j < columns; ++j) {
      for (std::size_t i = 0; i < n; ++i) column_[i] = rows[i * columns + j];
      (*series)[j].Append(column_);
    }
  }

  const data::Campaign& plan_;
  data::H5Writer file_;
  data::H5Series run_, good_;
  std::vector<data::H5Series> variables_, responses_;
  std::vector<double> column_;
  std::uint64_t runs_ = 0;
};

// Values of a design that has no points of its own.
void ReadRows(const data::H5Reader& file, CampaignRecord* out) {
  out->plan.design.rows.assign(out->runs, std::vector<double>(out->plan.variables.size()));
  for (std::size_t j = 0; j < out->plan.variables.size(); ++j) {
    const std::string path = "/variable/" + out->plan.variables[j].name;
    const std::vector<double> column = file.ReadDoubles(path);
    if (column.size() != out->runs) {
      file.Fail("has not one value a run", path, "make the file anew");
    }
    for (std::uint64_t i = 0; i < out->runs; ++i) out->plan.design.rows[i][j] = column[i];
  }
}

}  // namespace

void MergeParts(const CampaignFolder& folder, const Inputs& inputs,
                const std::vector<std::string>& files, const std::string& out) {
  const std::uint64_t runs = inputs.runs();
  if (const std::uint64_t missing = folder.MissingRuns(runs); missing > 0) {
    throw Error(fmt::format("{} of {} {} missing", missing, Counted(runs, "run"),
                            missing == 1 ? "is" : "are"),
                folder.path(), "`unfurl campaign resume` computes them");
  }
  const std::size_t d = inputs.plan().variables.size(), k = inputs.plan().responses.size();
  RecordWriter writer(inputs.plan(), files, out);
  std::vector<std::uint64_t> failed;
  std::vector<std::string> messages;
  std::vector<double> values;
  std::uint64_t next = 0;
  for (const PartFile& file : folder.Parts()) {
    if (file.range.end() <= next || file.range.first >= runs) continue;
    ThrowIfInterrupted();
    const Part part = ReadPart(file.path, folder.identity(), k);
    if (part.range.first != file.range.first || part.range.count != file.range.count) {
      throw Error("holds other runs than its name says", file.path, "remove it, and resume");
    }
    const std::uint64_t end = std::min(part.range.end(), runs);
    for (std::size_t f = 0; f < part.failed.size(); ++f) {
      if (part.failed[f] < next || part.failed[f] >= end) continue;
      failed.push_back(part.failed[f]);
      messages.push_back(part.messages[f]);
    }
    while (next < end) {
      const std::uint64_t count = std::min<std::uint64_t>(kBlock, end - next);
      values.resize(count * d);
      for (std::uint64_t i = 0; i < count; ++i) {
        inputs.Values(next + i, std::span(values).subspan(i * d, d));
      }
      writer.Append(values,
                    std::span(part.responses).subspan((next - part.range.first) * k, count * k));
      next += count;
    }
  }
  writer.Finish(failed, messages);
}

void WriteRecord(const data::Campaign& plan, const std::vector<std::string>& files,
                 const std::vector<std::vector<double>>& values, const CampaignRecord& record,
                 const std::string& rare, const std::string& out) {
  RecordWriter writer(plan, files, out);
  std::vector<double> row(plan.responses.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    for (std::size_t r = 0; r < row.size(); ++r) row[r] = record.responses[r][i];
    writer.Append(values[i], row);
  }
  writer.AddText(kRare, "result of the subset simulation, JSON", rare);
  writer.Finish(record.failed, record.messages);
}

bool HasRareText(const std::string& path) {
  return data::H5Reader(path, kCampaignSchema, kRecordVersion).Has(kRare);
}

std::string ReadRareText(const std::string& path) {
  const data::H5Reader file(path, kCampaignSchema, kRecordVersion);
  const std::vector<std::string> text = file.ReadStrings(kRare);
  if (text.size() != 1) file.Fail("holds no result", kRare, "make the file anew");
  return text[0];
}

CampaignRecord ReadRecord(const std::string& path) {
  const data::H5Reader file(path, kCampaignSchema, kRecordVersion);
  CampaignRecord out;
  const std::vector<std::string> text = file.ReadStrings("/plan");
  if (text.size() != 1) file.Fail("holds no plan", "/plan", "make the file anew");
  out.plan = data::CampaignFromJson(text[0], path);
  const std::vector<std::size_t> dims = file.Dims(kRun);
  out.runs = dims.empty() ? 0 : dims[0];
  for (const data::CampaignResponse& r : out.plan.responses) {
    out.responses.push_back(file.ReadDoubles("/response/" + r.name));
    if (out.responses.back().size() != out.runs) {
      file.Fail("has not one value a run", "/response/" + r.name, "make the file anew");
    }
  }
  if (out.plan.design.kind == data::CampaignDesign::Kind::kRare) ReadRows(file, &out);
  if (out.runs == 0 || Inputs(out.plan).runs() != out.runs) {
    file.Fail("has not as many runs as its plan", kRun, "make the file anew");
  }
  if (file.Has("/failure/run")) {
    for (const std::int32_t run : file.ReadInts("/failure/run")) {
      if (run < 0 || static_cast<std::uint64_t>(run) >= out.runs) {
        file.Fail("names a run that is not there", "/failure/run", "make the file anew");
      }
      out.failed.push_back(static_cast<std::uint64_t>(run));
    }
    if (!std::is_sorted(out.failed.begin(), out.failed.end())) {
      file.Fail("does not rise", "/failure/run", "make the file anew");
    }
    out.messages = file.ReadStrings("/failure/message");
    if (out.messages.size() != out.failed.size()) {
      file.Fail("has not one message a failure", "/failure/message", "make the file anew");
    }
  }
  return out;
}

}  // namespace unfurl::campaign
