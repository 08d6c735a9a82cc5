#include "measure/raw_lines.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>

#include "base/error.h"
#include "base/text.h"
#include "measure/raw_source.h"

namespace unfurl::measure {

// Stamps, one row a line: `t [s]`, and `slot` if the schedule is not a plain cycle.
class RawStamps {
 public:
  RawStamps(const std::string& path, const data::TrialHeader& header)
      : path_(path), header_(header), stream_(path) {
    if (!Next()) throw Error("holds no stamps", path, "give a header line and a row for each line");
    const std::vector<std::string> names = Split(text_, ',');
    for (std::size_t k = 0; k < names.size(); ++k) {
      const std::string_view name = Trim(names[k]);
      if (name == "t [s]") {
        t_ = static_cast<int>(k);
      } else if (name == "slot") {
        slot_ = static_cast<int>(k);
      } else {
        throw Error(fmt::format("unknown column '{}'", name), Where(), "give 't [s]' and 'slot'");
      }
    }
    if (t_ < 0) throw Error("has no column 't [s]'", Where(), "name the column of stamps so");
  }

  // The stamp of the next line; `slot` is left alone where the file does not give it.
  double Read(std::int32_t* slot) {
    if (!Next()) {
      throw Error("has fewer stamps than there are lines", path_, "give one for each line");
    }
    const std::vector<std::string> cells = Split(text_, ',');
    double t = 0.0;
    const std::size_t columns = slot_ >= 0 ? 2 : 1;
    if (cells.size() != columns || !ParseDouble(Trim(cells[static_cast<std::size_t>(t_)]), &t) ||
        !std::isfinite(t)) {
      throw Error("is no stamp", Where(), "give a number of seconds");
    }
    if (!(t > last_)) {
      throw Error(fmt::format("the stamp {} does not come after {}", t, last_), Where(),
                  "stamps must rise");
    }
    last_ = t;
    if (slot_ >= 0) {
      const std::string name(Trim(cells[static_cast<std::size_t>(slot_)]));
      const auto at = std::find(header_.slots.begin(), header_.slots.end(), name);
      if (at == header_.slots.end()) {
        throw Error(fmt::format("the slot '{}' is not known", name), Where(),
                    "recording.slots lists " + JoinWords(header_.slots));
      }
      *slot = static_cast<std::int32_t>(at - header_.slots.begin());
    }
    return t;
  }
  bool AtEnd() { return !Next(); }

 private:
  bool Next() {
    while (std::getline(stream_, text_)) {
      ++line_;
      const std::string_view row = Trim(text_);
      if (!row.empty() && row.front() != '#') return true;
    }
    return false;
  }
  std::string Where() const { return fmt::format("{}:{}", path_, line_); }

  std::string path_;
  const data::TrialHeader& header_;
  std::ifstream stream_;
  std::string text_;
  std::size_t line_ = 0;
  int t_ = -1, slot_ = -1;
  double last_ = -1e300;
};

namespace {

// Mean of all lines of each camera's active pixels, camera after camera.
std::vector<double> MeanOf(const data::RawLayout& layout, bool lit) {
  constexpr std::size_t kBlock = 64;  // lines held at once
  const std::size_t cameras_each = layout.together() ? layout.header.cameras.size() : 1;
  std::vector<double> means;
  for (std::size_t f = 0; f < layout.files.size(); ++f) {
    const data::RawLayout::Files& files = layout.files[f];
    const std::size_t width = layout.Width(f);
    std::vector<std::uint16_t> lines(kBlock * width);
    const auto source = OpenRawSource(layout, f, lit ? files.flat : files.flat_dark);
    std::vector<double> sum(width, 0.0);
    std::size_t all = 0;
    while (const std::size_t n = source->Read(kBlock, lines.data())) {
      for (std::size_t i = 0; i < n; ++i) {
        for (std::size_t k = 0; k < width; ++k) sum[k] += lines[i * width + k];
      }
      all += n;
    }
    if (all == 0) throw Error("the flat field holds no line", files.where, "record some");
    std::size_t first = 0;  // of a camera's elements in the line
    for (std::size_t c = f; c < f + cameras_each; ++c) {
      const data::LineFormat& format = layout.header.format.Of(c);
      for (std::size_t k = 0; k < static_cast<std::size_t>(format.active); ++k) {
        means.push_back(sum[first + format.first_active() + k] / static_cast<double>(all));
      }
      first += format.elements();
    }
  }
  return means;
}

std::vector<float> FlatField(const data::RawLayout& layout) {
  constexpr double kLeast = 0.05, kMost = 20.0;  // of the mean: beyond, it was not evenly lit
  std::vector<double> light = MeanOf(layout, true);
  const std::vector<double> dark = MeanOf(layout, false);
  const data::LineFormats& formats = layout.header.format;
  std::vector<float> response;
  for (std::size_t c = 0; c < layout.header.cameras.size(); ++c) {
    const std::size_t first = formats.ActiveBefore(c), end = formats.ActiveBefore(c + 1);
    double mean = 0.0;
    for (std::size_t k = first; k < end; ++k) {
      light[k] -= dark[k];
      mean += light[k] / static_cast<double>(end - first);
    }
    for (std::size_t k = first; k < end; ++k) {
      const double r = light[k] / mean;
      if (!(mean > 0.0) || !(r >= kLeast && r <= kMost)) {
        throw Error(fmt::format("pixel {} of camera {} responds with {} times the mean", k - first,
                                layout.header.cameras[c], r),
                    layout.files[layout.together() ? 0 : c].where,
                    "record the flat field evenly lit and not saturated");
      }
      response.push_back(static_cast<float>(r));
    }
  }
  return response;
}

}  // namespace

struct RawLines::Impl {
  data::RawLayout layout;
  std::vector<std::unique_ptr<RawSource>> sources;
  std::unique_ptr<RawStamps> stamps;
  std::vector<std::uint16_t> buffer;
  std::size_t next = 0;  // line
};

RawLines::RawLines(const data::RawLayout& layout) : impl_(std::make_unique<Impl>()) {
  impl_->layout = layout;
  data::RawLayout& own = impl_->layout;
  if (!own.files[0].flat.empty()) own.header.response = FlatField(own);
  for (std::size_t f = 0; f < own.files.size(); ++f) {
    impl_->sources.push_back(OpenRawSource(own, f, own.files[f].lines));
  }
  if (!own.stamps.empty()) impl_->stamps = std::make_unique<RawStamps>(own.stamps, own.header);
}

RawLines::~RawLines() = default;

const data::TrialHeader& RawLines::header() const { return impl_->layout.header; }
double RawLines::done() const { return impl_->sources[0]->done(); }

bool RawLines::Read(std::size_t count, data::TrialBlock* block) {
  Impl& im = *impl_;
  const data::RawLayout& layout = im.layout;
  const std::size_t line_counts = layout.header.line_counts();
  im.buffer.resize(count * line_counts);
  block->Resize(count, layout.header);
  std::size_t lines = 0;
  for (std::size_t f = 0; f < im.sources.size(); ++f) {
    const std::size_t got = im.sources[f]->Read(count, im.buffer.data());
    if (f > 0 && got != lines) {
      throw Error(fmt::format("ends after {} lines, others after {} or more",
                              im.next + std::min(got, lines), im.next + std::max(got, lines)),
                  layout.files[got < lines ? f : f - 1].where,
                  "every camera must have as many lines");
    }
    lines = got;
    const std::size_t width = layout.Width(f);
    const std::size_t before = layout.header.format.ElementsBefore(f);
    for (std::size_t i = 0; i < lines; ++i) {
      std::copy_n(&im.buffer[i * width], width, &block->counts[i * line_counts + before]);
    }
  }
  block->Resize(lines, layout.header);
  for (std::size_t i = 0; i < lines; ++i, ++im.next) {
    block->slot[i] = layout.cycle[(layout.first_slot + im.next) % layout.cycle.size()];
    block->t[i] = im.stamps ? im.stamps->Read(&block->slot[i])
                            : layout.start + static_cast<double>(im.next) / layout.header.line_rate;
  }
  if (lines == 0 && im.next == 0) {
    throw Error("holds no line", layout.files[0].where, "give files with lines");
  }
  if (lines < count && im.stamps && !im.stamps->AtEnd()) {
    throw Error("has more stamps than there are lines", layout.stamps, "give one for each line");
  }
  return lines > 0;
}

}  // namespace unfurl::measure
