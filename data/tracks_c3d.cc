#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>

#include "base/error.h"
#include "base/text.h"
#include "data/atomic_file.h"
#include "data/c3d.h"
#include "data/tracks_exchange.h"
#include "data/tracks_grid.h"

namespace unfurl::data {

namespace {

constexpr double kMilli = 1e3;          // the file's lengths are in mm
constexpr double kResidualUnit = 0.01;  // of a residual, the least [mm]
constexpr int kMostResidual = 255;      // units of it
constexpr int kMaskCameras = 7;         // that the format's mask has bits for

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
    const std::size_t blocks = (out.size() + 4 + kC3dBlock - 1) / kC3dBlock;
    std::string head;
    Put(std::uint8_t{1}, &head);
    Put(std::uint8_t{0x50}, &head);
    Put(static_cast<std::uint8_t>(blocks), &head);
    Put(std::uint8_t{84}, &head);  // little-endian
    out = head + out;
    out.resize(blocks * kC3dBlock, '\0');
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

void PutMissing(std::string* text) {
  for (int k = 0; k < 3; ++k) Put(0.0F, text);
  Put(-1.0F, text);
}

// Standard deviation of what 32 bits leave of the farthest coordinate of a sample [mm].
double Rounding(const Tracks& tracks, std::size_t sample) {
  const Eigen::Vector3d p = tracks.p.col(static_cast<Eigen::Index>(sample));
  const auto far = static_cast<float>(kMilli * p.cwiseAbs().maxCoeff());
  return static_cast<double>(std::nextafter(far, HUGE_VALF) - far) / std::sqrt(12.0);
}

// Of one axis, with the rounding [mm].
double SigmaOf(const Tracks& tracks, std::size_t sample) {
  return std::hypot(kMilli * std::sqrt(tracks.Covariance(sample).trace() / 3.0),
                    Rounding(tracks, sample));
}

// Coordinates that 32 bits would round by more than they are known are refused. Returns the unit
// of residuals in which the largest one has a number [mm].
double ResidualUnit(const std::string& path, const Tracks& tracks) {
  double largest = 0.0;
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    if (!Usable(tracks.status[i])) continue;
    const double rounding = Rounding(tracks, i), sigma = SigmaOf(tracks, i);
    if (2.0 * rounding * rounding > sigma * sigma) {
      throw Error(
          fmt::format("C3D keeps 32 bits of a coordinate: at {:.6g} m they round to {:.2g} mm, and "
                      "the sample at {:.6g} s is known better",
                      tracks.p.col(static_cast<Eigen::Index>(i)).cwiseAbs().maxCoeff(),
                      rounding * std::sqrt(12.0), tracks.t[i]),
          path, "write .uff or .csv, or take a frame with its origin at the structure");
    }
    largest = std::max(largest, sigma);
  }
  constexpr double kRoundedUp = 1.0 + 1e-6;  // of a 32-bit number
  return std::max(kResidualUnit, kRoundedUp * largest / kMostResidual);
}

// x, y, z, and a word of the residual with the mask of the first seven cameras.
void PutPoint(const Tracks& tracks, std::ptrdiff_t i, double unit, std::string* text) {
  const auto sample = static_cast<std::size_t>(i);
  for (Eigen::Index k = 0; k < 3; ++k) Put(static_cast<float>(kMilli * tracks.p(k, i)), text);
  const int residual =
      std::clamp(static_cast<int>(std::ceil(SigmaOf(tracks, sample) / unit)), 0, kMostResidual);
  const int mask =
      tracks.used.empty() ? 0 : static_cast<int>(tracks.used[sample] & ((1U << kMaskCameras) - 1U));
  Put(static_cast<float>(256 * mask + residual), text);
}

}  // namespace

void WriteTracksC3d(const std::string& path, const Tracks& tracks) {
  const TracksGrid grid = GridOf(tracks);
  const std::size_t marks = tracks.marks.size();
  if (!grid.regular || grid.frames == 0) {
    throw Error("C3D holds frames of one rate, and these stamps do not lie on a grid", path,
                "write .uff or .csv");
  }
  if (grid.frames > kC3dMostFrames || marks > 255) {
    throw Error(
        fmt::format("{} frames of {} marks are more than C3D can count", grid.frames, marks), path,
        "write .uff or .csv");
  }
  const double unit = ResidualUnit(path, tracks);
  std::vector<std::string> delays, names;
  for (std::size_t m = 0; m < marks; ++m) delays.push_back(fmt::format("{}", grid.delay[m]));
  for (const std::string& name : tracks.cameras) names.push_back(name);
  const auto section = [&](std::size_t data_start) {
    Parameters p;
    p.Group("POINT");
    p.Integer("USED", static_cast<std::uint16_t>(marks));
    p.Integer("FRAMES", static_cast<std::uint16_t>(grid.frames));
    p.Real("SCALE", -static_cast<float>(unit));
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
  const std::size_t start = 2 + section(0).size() / kC3dBlock;  // blocks count from 1
  std::string text;
  Put(std::uint8_t{2}, &text);
  Put(std::uint8_t{0x50}, &text);
  Put(static_cast<std::uint16_t>(marks), &text);
  Put(std::uint16_t{0}, &text);  // analogue values per frame
  Put(std::uint16_t{1}, &text);
  Put(static_cast<std::uint16_t>(grid.frames), &text);
  Put(std::uint16_t{0}, &text);  // no gap was filled
  Put(-static_cast<float>(unit), &text);
  Put(static_cast<std::uint16_t>(start), &text);
  Put(std::uint16_t{0}, &text);
  Put(static_cast<float>(1.0 / grid.step), &text);
  text.resize(kC3dBlock, '\0');
  text += section(start);
  for (std::size_t f = 0; f < grid.frames; ++f) {
    for (std::size_t m = 0; m < marks; ++m) {
      const std::ptrdiff_t i = grid.sample[m][f];
      const bool usable = i >= 0 && Usable(tracks.status[static_cast<std::size_t>(i)]);
      if (usable) {
        PutPoint(tracks, i, unit, &text);
      } else {
        PutMissing(&text);
      }
    }
  }
  text.resize((text.size() + kC3dBlock - 1) / kC3dBlock * kC3dBlock, '\0');
  WriteTextFile(path, text);
}

}  // namespace unfurl::data
