#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <map>

#include "base/error.h"
#include "base/text.h"
#include "data/atomic_file.h"
#include "data/tracks_exchange.h"
#include "data/tracks_grid.h"

namespace unfurl::data {

namespace {

static_assert(std::endian::native == std::endian::little);

constexpr std::size_t kBlock = 512;
constexpr double kMilli = 1e3;          // the file's lengths are in mm
constexpr float kResidualUnit = 0.01F;  // of a residual [mm]
constexpr int kMaskCameras = 7;
constexpr std::size_t kMostFrames = 65535;            // a 16-bit count
constexpr std::size_t kMostParameter = 255 * kBlock;  // bytes: the whole section
constexpr double kMostPoints = 1 << 20;

template <typename T>
void Put(T value, std::string* to) {
  char bytes[sizeof(T)];
  std::memcpy(bytes, &value, sizeof(T));
  to->append(bytes, sizeof(T));
}

// The parameter section: groups and their parameters, named, one after another.
class Parameters {
 public:
  void Group(const std::string& name) {
    ++group_;
    Put(static_cast<std::int8_t>(name.size()), &text_);
    Put(static_cast<std::int8_t>(-group_), &text_);
    text_ += name;
    Put(static_cast<std::int16_t>(3), &text_);
    Put(std::uint8_t{0}, &text_);
  }
  void Words(const std::string& name, const std::vector<std::string>& values) {
    std::size_t width = 1;
    for (const std::string& v : values)
      width = std::max(width, std::min<std::size_t>(v.size(), 127));
    std::string data;
    for (std::string v : values) {
      v.resize(width, ' ');
      data += v;
    }
    Parameter(name, -1, {width, values.size()}, data);
  }
  void Word(const std::string& name, const std::string& value) {
    Parameter(name, -1, {value.size()}, value);
  }
  void Integer(const std::string& name, std::uint16_t value) {
    std::string data;
    Put(value, &data);
    Parameter(name, 2, {}, data);
  }
  void Real(const std::string& name, float value) {
    std::string data;
    Put(value, &data);
    Parameter(name, 4, {}, data);
  }
  // Whole blocks, with the section's own header.
  std::string Section() const {
    std::string out = text_;
    Put(std::uint16_t{0}, &out);  // no name: the end
    const std::size_t blocks = (out.size() + 4 + kBlock - 1) / kBlock;
    std::string head;
    Put(std::uint8_t{1}, &head);
    Put(std::uint8_t{0x50}, &head);
    Put(static_cast<std::uint8_t>(blocks), &head);
    Put(std::uint8_t{84}, &head);  // little-endian
    out = head + out;
    out.resize(blocks * kBlock, '\0');
    return out;
  }

 private:
  void Parameter(const std::string& name, std::int8_t type, const std::vector<std::size_t>& dims,
                 const std::string& data) {
    Put(static_cast<std::int8_t>(name.size()), &text_);
    Put(static_cast<std::int8_t>(group_), &text_);
    text_ += name;
    Put(static_cast<std::int16_t>(2 + 1 + 1 + dims.size() + data.size() + 1), &text_);
    Put(type, &text_);
    Put(static_cast<std::uint8_t>(dims.size()), &text_);
    for (std::size_t d : dims) Put(static_cast<std::uint8_t>(d), &text_);
    text_ += data;
    Put(std::uint8_t{0}, &text_);
  }

  std::string text_;
  int group_ = 0;
};

[[noreturn]] void Bad(const std::string& path, const std::string& what) {
  throw Error(what, path, "export it again");
}

// Reads with every place checked.
class Bytes {
 public:
  Bytes(const std::string& path, const std::string& text) : path_(path), text_(text) {}
  template <typename T>
  T At(std::size_t at) const {
    if (text_.size() < sizeof(T) || at > text_.size() - sizeof(T)) Bad(path_, "is cut off");
    T value;
    std::memcpy(&value, text_.data() + at, sizeof(T));
    return value;
  }
  std::string Text(std::size_t at, std::size_t size) const {
    if (at > text_.size() || size > text_.size() - at) Bad(path_, "is cut off");
    return text_.substr(at, size);
  }

 private:
  const std::string& path_;
  const std::string& text_;
};

struct Value {
  int type = 0;
  std::vector<std::size_t> dims;
  std::string data;

  std::vector<std::string> Strings() const {
    std::vector<std::string> out;
    const std::size_t width = dims.empty() ? data.size() : dims[0];
    for (std::size_t at = 0; width > 0 && at + width <= data.size(); at += width) {
      out.emplace_back(Trim(std::string_view(data).substr(at, width)));
    }
    return out;
  }
  double Number() const {
    if (type == 4 && data.size() >= 4) {
      float v = 0.0F;
      std::memcpy(&v, data.data(), 4);
      return static_cast<double>(v);
    }
    if (type == 2 && data.size() >= 2) {
      std::uint16_t v = 0;
      std::memcpy(&v, data.data(), 2);
      return v;
    }
    return 0.0;
  }
};

std::map<std::string, Value> ReadParameters(const std::string& path, const Bytes& bytes,
                                            std::size_t first) {
  const std::size_t end = first + kBlock * bytes.At<std::uint8_t>(first + 2);
  if (bytes.At<std::uint8_t>(first + 3) != 84) {
    Bad(path, "is in the number format of another processor than Intel's");
  }
  std::map<int, std::string> groups;
  std::vector<std::pair<int, std::pair<std::string, Value>>> found;
  for (std::size_t at = first + 4; at + 2 < end;) {
    const int length = std::abs(bytes.At<std::int8_t>(at));
    const int id = bytes.At<std::int8_t>(at + 1);
    if (length == 0) break;
    const std::string name = bytes.Text(at + 2, static_cast<std::size_t>(length));
    const std::size_t body = at + 2 + static_cast<std::size_t>(length);
    const std::size_t next = bytes.At<std::uint16_t>(body);
    if (id < 0) {
      groups[-id] = name;
    } else {
      Value value;
      value.type = bytes.At<std::int8_t>(body + 2);
      const std::size_t dims = bytes.At<std::uint8_t>(body + 3);
      std::size_t size = static_cast<std::size_t>(std::abs(value.type));
      for (std::size_t d = 0; d < dims; ++d) {
        value.dims.push_back(bytes.At<std::uint8_t>(body + 4 + d));
        size *= value.dims.back();
        if (size > kMostParameter) Bad(path, fmt::format("{} is too large to be there", name));
      }
      value.data = bytes.Text(body + 4 + dims, size);
      found.emplace_back(id, std::make_pair(name, value));
    }
    if (next == 0) break;
    at = body + next;
  }
  std::map<std::string, Value> out;
  for (auto& [group, entry] : found) out[groups[group] + ":" + entry.first] = entry.second;
  return out;
}

// A parameter as a count from `low` to `high`.
std::size_t CountOf(const std::string& path, const std::map<std::string, Value>& parameters,
                    const std::string& name, double low, double high) {
  const auto found = parameters.find(name);
  if (found == parameters.end()) Bad(path, fmt::format("has no {}", name));
  const double value = found->second.Number();
  if (!(value >= low && value <= high) || value != std::floor(value)) {
    Bad(path, fmt::format("{} is {}, and not a count from {:g} to {:g}", name, value, low, high));
  }
  return static_cast<std::size_t>(value);
}

// The number that a text holds, finite, or `fallback` where there is none.
double RealOf(const std::string& path, const std::string& name, const std::string& text,
              double fallback) {
  double value = fallback;
  ParseDouble(Trim(text), &value);
  if (!std::isfinite(value)) Bad(path, fmt::format("{} is {}", name, value));
  return value;
}

// Where the points lie, all of it inside the file.
struct Layout {
  std::size_t marks = 0, frames = 0, analogue = 0, start = 0;
  bool real = false;
  double scale = 0.0, rate = 0.0;
  std::size_t word() const { return real ? 4 : 2; }
  std::size_t frame_words() const { return 4 * marks + analogue; }
};

Layout LayoutOf(const std::string& path, const Bytes& bytes, std::size_t size,
                const std::map<std::string, Value>& p) {
  Layout l;
  l.marks = CountOf(path, p, "POINT:USED", 1.0, kMostPoints);
  l.start = kBlock * (CountOf(path, p, "POINT:DATA_START", 2.0, kMostFrames) - 1);
  for (const char* name : {"POINT:SCALE", "POINT:RATE"}) {
    if (!p.contains(name)) Bad(path, fmt::format("has no {}", name));
  }
  l.scale = p.at("POINT:SCALE").Number();
  l.rate = p.at("POINT:RATE").Number();
  if (!(l.rate > 0.0) || !std::isfinite(l.rate) || l.scale == 0.0 || !std::isfinite(l.scale)) {
    Bad(path, "has no points, rate or scale");
  }
  l.real = l.scale < 0.0;
  l.analogue = bytes.At<std::uint16_t>(4);
  const int first = bytes.At<std::uint16_t>(6), last = bytes.At<std::uint16_t>(8);
  if (last < first) Bad(path, fmt::format("its frames run from {} to {}", first, last));
  l.frames = static_cast<std::size_t>(last - first) + 1;
  const std::size_t room = size > l.start ? (size - l.start) / l.word() : 0;
  if (l.frame_words() > room || l.frames > room / l.frame_words()) {
    Bad(path, fmt::format("is cut off: {} frames of {} points do not fit into its {} bytes",
                          l.frames, l.marks, size));
  }
  return l;
}

}  // namespace

void WriteTracksC3d(const std::string& path, const Tracks& tracks) {
  const TracksGrid grid = GridOf(tracks);
  const std::size_t marks = tracks.marks.size();
  if (!grid.regular || grid.frames == 0) {
    throw Error("C3D holds frames of one rate, and these stamps do not lie on a grid", path,
                "write .uff or .csv");
  }
  if (grid.frames > kMostFrames || marks > 255) {
    throw Error(
        fmt::format("{} frames of {} marks are more than C3D can count", grid.frames, marks), path,
        "write .uff or .csv");
  }
  std::vector<std::string> delays, names;
  for (std::size_t m = 0; m < marks; ++m) delays.push_back(fmt::format("{}", grid.delay[m]));
  for (const std::string& name : tracks.cameras) names.push_back(name);
  const auto section = [&](std::size_t data_start) {
    Parameters p;
    p.Group("POINT");
    p.Integer("USED", static_cast<std::uint16_t>(marks));
    p.Integer("FRAMES", static_cast<std::uint16_t>(grid.frames));
    p.Real("SCALE", -kResidualUnit);
    p.Real("RATE", static_cast<float>(1.0 / grid.step));
    p.Integer("DATA_START", static_cast<std::uint16_t>(data_start));
    p.Word("UNITS", "mm");
    p.Words("LABELS", tracks.marks);
    p.Words("DESCRIPTIONS", tracks.marks);
    p.Group("ANALOG");
    p.Integer("USED", 0);
    p.Real("GEN_SCALE", 1.0F);
    p.Real("RATE", 0.0F);
    p.Group("UNFURL");
    p.Word("START", fmt::format("{}", grid.start));
    p.Word("STEP", fmt::format("{}", grid.step));
    p.Words("DELAYS", delays);
    p.Word("FRAME", tracks.frame);
    p.Word("SMOOTHED", tracks.smoothed ? "yes" : "no");
    if (!names.empty()) p.Words("CAMERAS", names);
    return p.Section();
  };
  const std::size_t start = 2 + section(0).size() / kBlock;  // blocks count from 1
  std::string text;
  Put(std::uint8_t{2}, &text);
  Put(std::uint8_t{0x50}, &text);
  Put(static_cast<std::uint16_t>(marks), &text);
  Put(std::uint16_t{0}, &text);  // analogue values per frame
  Put(std::uint16_t{1}, &text);
  Put(static_cast<std::uint16_t>(grid.frames), &text);
  Put(std::uint16_t{0}, &text);  // no gap was filled
  Put(-kResidualUnit, &text);
  Put(static_cast<std::uint16_t>(start), &text);
  Put(std::uint16_t{0}, &text);
  Put(static_cast<float>(1.0 / grid.step), &text);
  text.resize(kBlock, '\0');
  text += section(start);
  for (std::size_t f = 0; f < grid.frames; ++f) {
    for (std::size_t m = 0; m < marks; ++m) {
      const std::ptrdiff_t i = grid.sample[m][f];
      if (i < 0 || !Usable(tracks.status[static_cast<std::size_t>(i)])) {
        for (int k = 0; k < 3; ++k) Put(0.0F, &text);
        Put(-1.0F, &text);
        continue;
      }
      const auto sample = static_cast<std::size_t>(i);
      for (Eigen::Index k = 0; k < 3; ++k) Put(static_cast<float>(kMilli * tracks.p(k, i)), &text);
      const double sigma = kMilli * std::sqrt(tracks.Covariance(sample).trace() / 3.0);
      const int residual = std::clamp(
          static_cast<int>(std::ceil(sigma / static_cast<double>(kResidualUnit))), 0, 255);
      const int mask = tracks.used.empty()
                           ? 0
                           : static_cast<int>(tracks.used[sample] & ((1U << kMaskCameras) - 1U));
      Put(static_cast<float>(256 * mask + residual), &text);
    }
  }
  text.resize((text.size() + kBlock - 1) / kBlock * kBlock, '\0');
  WriteTextFile(path, text);
}

Tracks ReadTracksC3d(const std::string& path, double sigma) {
  const std::string text = ReadTextFile(path);
  const Bytes bytes(path, text);
  if (text.size() < 2 * kBlock || bytes.At<std::uint8_t>(1) != 0x50) Bad(path, "is no C3D file");
  const std::size_t block = bytes.At<std::uint8_t>(0);
  if (block < 2) Bad(path, "has no section of parameters");
  std::map<std::string, Value> p = ReadParameters(path, bytes, kBlock * (block - 1));
  const Layout layout = LayoutOf(path, bytes, text.size(), p);
  const std::size_t marks = layout.marks, frames = layout.frames;
  const double scale = layout.scale;
  const bool real = layout.real;
  std::string units = p["POINT:UNITS"].data;
  units = std::string(Trim(units));
  if (units != "m" && units != "mm") {
    throw Error(fmt::format("its points are in '{}'", units), path + ":POINT:UNITS",
                "write them in m or mm");
  }
  const double unit = units == "m" ? 1.0 : 1e-3;
  Tracks tracks;
  tracks.marks = p["POINT:LABELS"].Strings();
  tracks.marks.resize(std::min(tracks.marks.size(), marks));
  for (std::size_t m = 0; m < marks; ++m) {
    if (m >= tracks.marks.size()) tracks.marks.push_back(fmt::format("point{}", m + 1));
    if (tracks.marks[m].empty()) tracks.marks[m] = fmt::format("point{}", m + 1);
  }
  tracks.frame = p.contains("UNFURL:FRAME") ? p["UNFURL:FRAME"].data : "rig";
  tracks.smoothed = p["UNFURL:SMOOTHED"].data == "yes";
  const double step = RealOf(path, "UNFURL:STEP", p["UNFURL:STEP"].data, 1.0 / layout.rate);
  const double begin = RealOf(path, "UNFURL:START", p["UNFURL:START"].data, 0.0);
  if (!(step > 0.0)) Bad(path, "its frames do not follow each other in time");
  std::vector<double> delay(marks, 0.0);
  const std::vector<std::string> delays = p["UNFURL:DELAYS"].Strings();
  for (std::size_t m = 0; m < std::min(marks, delays.size()); ++m) {
    delay[m] = RealOf(path, "UNFURL:DELAYS", delays[m], 0.0);
  }
  tracks.cameras = p["UNFURL:CAMERAS"].Strings();
  const bool detailed = !tracks.cameras.empty();

  // Marks of a frame in order of their delays, so that times ascend.
  std::vector<std::size_t> order(marks);
  for (std::size_t m = 0; m < marks; ++m) order[m] = m;
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return delay[a] < delay[b]; });
  const auto n = static_cast<Eigen::Index>(frames * marks);
  const std::size_t word = layout.word();
  tracks.p.setConstant(3, n, std::numeric_limits<double>::quiet_NaN());
  tracks.cov.setConstant(6, n, std::numeric_limits<double>::quiet_NaN());
  tracks.shared.resize(3, 0);
  Eigen::Index col = 0;
  for (std::size_t f = 0; f < frames; ++f) {
    for (std::size_t m : order) {
      const std::size_t at = layout.start + word * (f * layout.frame_words() + 4 * m);
      double v[4];
      for (std::size_t k = 0; k < 4; ++k) {
        v[k] = real ? static_cast<double>(bytes.At<float>(at + 4 * k))
                    : static_cast<double>(bytes.At<std::int16_t>(at + 2 * k));
        if (!std::isfinite(v[k])) Bad(path, fmt::format("frame {} is not finite", f + 1));
      }
      // A 16-bit word, also where it is kept as a float.
      if (v[3] < -32768.0 || v[3] > 32767.0) {
        Bad(path, fmt::format("frame {} has a residual of {}", f + 1, v[3]));
      }
      const int last = static_cast<int>(v[3]);
      const bool seen = last >= 0;
      tracks.t.push_back(begin + step * static_cast<double>(f) + delay[m]);
      tracks.mark.push_back(static_cast<std::int32_t>(m));
      const std::uint32_t mask = seen ? static_cast<std::uint32_t>(last / 256) : 0U;
      const bool three = std::popcount(mask) == 3;
      tracks.status.push_back(!seen   ? SampleStatus::kUnsolvable
                              : three ? SampleStatus::kThreeCameras
                                      : SampleStatus::kGood);
      if (detailed) {
        tracks.used.push_back(mask);
        tracks.left_out.push_back(0);
        tracks.reason.push_back(seen ? SampleReason::kNone : SampleReason::kTooFew);
      }
      if (seen) {
        double s = static_cast<double>(last % 256) * std::abs(scale) * unit;
        if (!(s > 0.0)) s = sigma;
        if (!(s > 0.0)) {
          throw Error(fmt::format("point {} of frame {} has no residual to take as its sigma",
                                  tracks.marks[m], f + 1),
                      path, "say what sigma the points have, as in --sigma 0.0005");
        }
        for (Eigen::Index k = 0; k < 3; ++k) {
          tracks.p(k, col) = v[k] * unit * (real ? 1.0 : scale);
        }
        tracks.cov.col(col) << s * s, 0.0, 0.0, s * s, 0.0, s * s;
      }
      ++col;
    }
  }
  return tracks;
}

}  // namespace unfurl::data
