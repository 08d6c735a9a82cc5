#include "data/trial.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/text.h"
#include "data/h5.h"
#include "data/lab.h"
#include "data/line_format_io.h"

namespace unfurl::data {

void TrialBlock::Resize(std::size_t lines, const TrialHeader& header) {
  t.resize(lines);
  slot.resize(lines);
  counts.resize(lines * header.line_counts());
}

std::vector<std::string> MarksOfSlot(const std::string& slot) {
  std::vector<std::string> marks;
  if (slot == kDarkSlot) return marks;
  for (const std::string& mark : Split(slot, '+')) marks.emplace_back(Trim(mark));
  return marks;
}

struct TrialWriter::Impl {
  H5Writer file;
  H5Series t, slot, lines;

  Impl(const std::string& path, const Provenance& provenance)
      : file(path, kTrialSchema, kTrialVersion, provenance) {}
};

TrialWriter::TrialWriter(const std::string& path, const TrialHeader& header,
                         const Provenance& provenance)
    : impl_(std::make_unique<Impl>(path, provenance)) {
  // 16 lines of four cameras fill a chunk that HDF5's own cache holds. Deflate 1 halves the size
  // for little time; higher levels gain nothing on noise.
  constexpr std::size_t kChunk = 16;
  constexpr int kDeflate = 1;
  H5Writer& file = impl_->file;
  file.Write({"/cameras", "1", "names, in the order of the lines' second dimension"},
             header.cameras);
  file.Write({"/slots", "1", "what a line may show: a mark's name, or dark"}, header.slots);
  impl_->t = file.Series({"/t", "s", "middle of the line's flash on the recorder's clock"},
                         H5Type::kDouble, {}, 4096);
  impl_->slot = file.Series({"/slot", "1", "what was lit: index into slots", {"/t"}},
                            H5Type::kInt32, {}, 4096);
  impl_->lines = file.Series(
      {"/lines", "count",
       "counts: line x camera x element in read-out, or line x the elements of all cameras"},
      H5Type::kUint16, LineDims(header.format, header.cameras.size()), kChunk, kDeflate);
  WriteLineFormats(file, "/lines", header.format);
  file.Attribute("/lines", "line_rate [1/s]", header.line_rate);
  WriteResponse(file, header.response, header.cameras.size(), header.format);
}

TrialWriter::~TrialWriter() = default;

void TrialWriter::Append(const TrialBlock& block) {
  impl_->t.Append(std::span<const double>(block.t));
  impl_->slot.Append(std::span<const std::int32_t>(block.slot));
  impl_->lines.Append(std::span<const std::uint16_t>(block.counts));
}

void TrialWriter::Commit() { impl_->file.Commit(); }

struct TrialReader::Impl {
  H5Reader file;
  TrialHeader header;
  std::size_t lines = 0;

  explicit Impl(const std::string& path) : file(path, kTrialSchema, kTrialVersion) {}
};

TrialReader::TrialReader(const std::string& path) : impl_(std::make_unique<Impl>(path)) {
  const H5Reader& file = impl_->file;
  TrialHeader& header = impl_->header;
  header.cameras = file.ReadStrings("/cameras");
  header.slots = file.ReadStrings("/slots");
  header.format = ReadLineFormats(file, "/lines", header.cameras.size());
  header.line_rate = file.DoubleAttribute("/lines", "line_rate [1/s]");
  header.response = ReadResponse(file, header.cameras.size(), header.format);
  impl_->lines = file.Dims("/lines")[0];
  for (const char* name : {"/t", "/slot"}) {
    if (file.Dims(name) != std::vector<std::size_t>{impl_->lines}) {
      file.Fail(fmt::format("does not hold one entry for each of {} lines", impl_->lines), name,
                "make the file again");
    }
  }
}

TrialReader::~TrialReader() = default;

const std::string& TrialReader::path() const { return impl_->file.path(); }
const TrialHeader& TrialReader::header() const { return impl_->header; }
std::size_t TrialReader::size() const { return impl_->lines; }
Provenance TrialReader::ReadProvenance() const { return impl_->file.ReadProvenance(); }

void TrialReader::Read(std::size_t first, std::size_t count, TrialBlock* block) const {
  block->Resize(count, impl_->header);
  impl_->file.ReadRows("/t", first, count, std::span<double>(block->t));
  impl_->file.ReadRows("/slot", first, count, std::span<std::int32_t>(block->slot));
  impl_->file.ReadRows("/lines", first, count, std::span<std::uint16_t>(block->counts));
  const int slots = static_cast<int>(impl_->header.slots.size());
  for (std::size_t i = 0; i < count; ++i) {
    if (!std::isfinite(block->t[i])) {
      impl_->file.Fail(fmt::format("the stamp of line {} is not finite", first + i), "/t",
                       "make the file again");
    }
    if (block->slot[i] < 0 || block->slot[i] >= slots) {
      impl_->file.Fail(fmt::format("line {} names slot {} of {}", first + i, block->slot[i], slots),
                       "/slot", "make the file again");
    }
  }
}

}  // namespace unfurl::data
