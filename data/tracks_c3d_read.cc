#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <map>
#include <numeric>

#include "base/error.h"
#include "base/text.h"
#include "data/atomic_file.h"
#include "data/c3d.h"
#include "data/tracks_exchange.h"
#include "data/units.h"

namespace unfurl::data {

namespace {

constexpr std::size_t kMostParameter = 255 * kC3dBlock;  // bytes: the whole section
constexpr double kMostPoints = 1 << 20;                  // of a frame: more is damage

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

struct TracksC3dReadValue {
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

std::map<std::string, TracksC3dReadValue> ReadParameters(const std::string& path,
                                                         const Bytes& bytes, std::size_t first) {
  const std::size_t end = first + kC3dBlock * bytes.At<std::uint8_t>(first + 2);
  if (bytes.At<std::uint8_t>(first + 3) != 84) {
    Bad(path, "is in the number format of another processor than Intel's");
  }
  std::map<int, std::string> groups;
  std::vector<std::pair<int, std::pair<std::string, TracksC3dReadValue>>> found;
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
      TracksC3dReadValue value;
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
  std::map<std::string, TracksC3dReadValue> out;
  for (auto& [group, entry] : found) out[groups[group] + ":" + entry.first] = entry.second;
  return out;
}

// A parameter as a count from `low` to `high`.
std::size_t CountOf(const std::string& path,
                    const std::map<std::string, TracksC3dReadValue>& parameters,
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
                const std::map<std::string, TracksC3dReadValue>& p) {
  Layout l;
  l.marks = CountOf(path, p, "POINT:USED", 1.0, kMostPoints);
  l.start = kC3dBlock * (CountOf(path, p, "POINT:DATA_START", 2.0, kC3dMostFrames) - 1);
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

double MetresPerUnit(const std::string& path, const std::string& units) {
  if (const auto metres = UnitsPer("m", units)) return *metres;
  throw Error(fmt::format("its points are in '{}'", units), path + ":POINT:UNITS",
              "write them in m or mm");
}

// One label a point; those without get their number.
std::vector<std::string> LabelsOf(const TracksC3dReadValue& labels, std::size_t marks) {
  std::vector<std::string> names = labels.Strings();
  names.resize(marks);
  for (std::size_t m = 0; m < marks; ++m) {
    if (names[m].empty()) names[m] = fmt::format("point{}", m + 1);
  }
  return names;
}

// When each point of each frame was measured; of files of our own, to the digit.
class Clock {
 public:
  Clock(const std::string& path, std::map<std::string, TracksC3dReadValue>* p, const Layout& layout)
      : step_(RealOf(path, "UNFURL:STEP", (*p)["UNFURL:STEP"].data, 1.0 / layout.rate)),
        start_(RealOf(path, "UNFURL:START", (*p)["UNFURL:START"].data, 0.0)),
        delay_(layout.marks, 0.0) {
    if (!(step_ > 0.0)) Bad(path, "its frames do not follow each other in time");
    const std::vector<std::string> delays = (*p)["UNFURL:DELAYS"].Strings();
    for (std::size_t m = 0; m < std::min(layout.marks, delays.size()); ++m) {
      delay_[m] = RealOf(path, "UNFURL:DELAYS", delays[m], 0.0);
    }
  }

  double At(std::size_t frame, std::size_t mark) const {
    return start_ + step_ * static_cast<double>(frame) + delay_[mark];
  }
  // Marks of a frame in order of their delays, so that times ascend.
  std::vector<std::size_t> Order() const {
    std::vector<std::size_t> order(delay_.size());
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(),
                     [&](std::size_t a, std::size_t b) { return delay_[a] < delay_[b]; });
    return order;
  }

 private:
  double step_, start_;  // [s]
  std::vector<double> delay_;
};

// The four words of a point: x, y, z, and the residual with the mask of cameras, -1 where the point
// was not seen.
std::array<double, 4> ReadPoint(const std::string& path, const Bytes& bytes, const Layout& layout,
                                std::size_t frame, std::size_t mark) {
  const std::size_t at = layout.start + layout.word() * (frame * layout.frame_words() + 4 * mark);
  std::array<double, 4> v;
  for (std::size_t k = 0; k < 4; ++k) {
    v[k] = layout.real ? static_cast<double>(bytes.At<float>(at + 4 * k))
                       : static_cast<double>(bytes.At<std::int16_t>(at + 2 * k));
    if (!std::isfinite(v[k])) Bad(path, fmt::format("frame {} is not finite", frame + 1));
  }
  // A 16-bit word, also where it is kept as a float.
  if (v[3] < -32768.0 || v[3] > 32767.0) {
    Bad(path, fmt::format("frame {} has a residual of {}", frame + 1, v[3]));
  }
  return v;
}

// Status and cameras of a sample, from the last word of its point.
void AddStatus(int last, Tracks* tracks) {
  const bool seen = last >= 0;
  const std::uint32_t mask = seen ? static_cast<std::uint32_t>(last / 256) : 0U;
  const bool three = std::popcount(mask) == 3;
  tracks->status.push_back(!seen   ? SampleStatus::kUnsolvable
                           : three ? SampleStatus::kThreeCameras
                                   : SampleStatus::kGood);
  if (tracks->cameras.empty()) return;
  tracks->used.push_back(mask);
  tracks->left_out.push_back(0);
  tracks->reason.push_back(seen ? SampleReason::kNone : SampleReason::kTooFew);
}

}  // namespace

Tracks ReadTracksC3d(const std::string& path, double sigma) {
  const std::string text = ReadTextFile(path);
  const Bytes bytes(path, text);
  if (text.size() < 2 * kC3dBlock || bytes.At<std::uint8_t>(1) != 0x50) Bad(path, "is no C3D file");
  const std::size_t block = bytes.At<std::uint8_t>(0);
  if (block < 2) Bad(path, "has no section of parameters");
  std::map<std::string, TracksC3dReadValue> p =
      ReadParameters(path, bytes, kC3dBlock * (block - 1));
  const Layout layout = LayoutOf(path, bytes, text.size(), p);
  const double unit = MetresPerUnit(path, std::string(Trim(p["POINT:UNITS"].data)));
  Tracks tracks;
  tracks.marks = LabelsOf(p["POINT:LABELS"], layout.marks);
  tracks.frame = p.contains("UNFURL:FRAME") ? p["UNFURL:FRAME"].data : "rig";
  tracks.smoothed = p["UNFURL:SMOOTHED"].data == "yes";
  const Clock clock(path, &p, layout);
  tracks.cameras = p["UNFURL:CAMERAS"].Strings();

  const std::vector<std::size_t> order = clock.Order();
  const auto n = static_cast<Eigen::Index>(layout.frames * layout.marks);
  tracks.p.setConstant(3, n, std::numeric_limits<double>::quiet_NaN());
  tracks.cov.setConstant(6, n, std::numeric_limits<double>::quiet_NaN());
  tracks.shared.resize(3, 0);
  Eigen::Index col = 0;
  for (std::size_t f = 0; f < layout.frames; ++f) {
    for (std::size_t m : order) {
      const std::array<double, 4> v = ReadPoint(path, bytes, layout, f, m);
      const int last = static_cast<int>(v[3]);
      tracks.t.push_back(clock.At(f, m));
      tracks.mark.push_back(static_cast<std::int32_t>(m));
      AddStatus(last, &tracks);
      const Eigen::Index i = col++;
      if (last < 0) continue;
      double s = static_cast<double>(last % 256) * std::abs(layout.scale) * unit;
      if (!(s > 0.0)) s = sigma;
      if (!(s > 0.0)) {
        throw Error(fmt::format("point {} of frame {} has no residual to take as its sigma",
                                tracks.marks[m], f + 1),
                    path, "say what sigma the points have, as in --sigma 0.0005");
      }
      for (Eigen::Index k = 0; k < 3; ++k) {
        tracks.p(k, i) = v[static_cast<std::size_t>(k)] * unit * (layout.real ? 1.0 : layout.scale);
      }
      tracks.cov.col(i) << s * s, 0.0, 0.0, s * s, 0.0, s * s;
    }
  }
  return tracks;
}

}  // namespace unfurl::data
