#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <limits>
#include <map>

#include "base/error.h"
#include "base/text.h"
#include "data/atomic_file.h"
#include "data/tracks_exchange.h"
#include "data/tracks_grid.h"
#include "data/uff.h"
#include "data/units.h"

namespace unfurl::data {

namespace {

constexpr int kTimeResponse = 1, kGeneral = 0;             // function types
constexpr int kTime = 17, kDisplacement = 8, kNoUnit = 0;  // data types
constexpr std::array<const char*, 10> kTracksUffFunctions = {"x",   "y",   "z",   "cxx", "cxy",
                                                             "cxz", "cyy", "cyz", "czz", "status"};
constexpr const char* kIdentity = "unfurl tracks";

// Dataset 164: SI, all factors 1, temperatures in kelvin.
constexpr const char* kUnits =
    "    -1\n   164\n         1SI: Meter (newton)            2\n"
    "  1.0000000000000000D+00  1.0000000000000000D+00  1.0000000000000000D+00\n"
    "  0.0000000000000000D+00\n    -1\n";

// One line of the file's fixed columns, cut to 80.
std::string TracksUffLine(std::string text) {
  text.resize(std::min<std::size_t>(text.size(), 80));
  return text + "\n";
}

std::string AxisLine(int type, const char* label, const char* units) {
  return TracksUffLine(fmt::format("{:10d}{:5d}{:5d}{:5d} {:<20} {:<20}", type,
                                   type == kDisplacement ? 1 : 0, 0, 0, label, units));
}

double ValueOf(const Tracks& tracks, std::size_t function, Eigen::Index i) {
  if (function < 3) return tracks.p(static_cast<Eigen::Index>(function), i);
  if (function < 9) return tracks.cov(static_cast<Eigen::Index>(function) - 3, i);
  return static_cast<double>(tracks.status[static_cast<std::size_t>(i)]);
}

// What each mark is made of.
struct Mark {
  std::string name;
  std::array<UffFunction, kTracksUffFunctions.size()> f;
  std::array<bool, kTracksUffFunctions.size()> has{};
};

// Metres in the unit of a displacement; refuses what is not stated, and what is stated twice and
// differs.
double MetresPerUnit(const UffFile& file, const UffFunction& f) {
  std::string unit = f.ordinate.units;
  std::transform(unit.begin(), unit.end(), unit.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  const auto named = UnitsPer("m", unit);
  const bool silent = unit.empty() || unit == "none";
  if (!named && !silent) {
    throw Error(fmt::format("its displacements are in '{}'", f.ordinate.units), f.where,
                "export them in m or mm");
  }
  if (file.length_factor == 0.0) {
    if (silent) {
      throw Error("names no unit of its displacements", f.where,
                  "export it with its units (dataset 164, or the label of the axis)");
    }
    return *named;
  }
  const double metres = 1.0 / file.length_factor;
  if (!silent && std::abs(*named / metres - 1.0) > 1e-3) {
    throw Error(fmt::format("the axis is in '{}', and dataset 164 says {:g} to the metre",
                            f.ordinate.units, file.length_factor),
                f.where, "export it again with one unit");
  }
  return metres;
}

double SecondsPerUnit(const UffFunction& f) {
  const std::string& unit = f.abscissa.units;
  if (unit.empty() || unit == "NONE" || unit == "s" || unit == "sec" || unit == "S") return 1.0;
  if (unit == "ms") return 1e-3;
  throw Error(fmt::format("its times are in '{}'", unit), f.where, "export them in s");
}

// One of our own functions: which, and the mark's name, frame and exact stamps. Nothing for those
// of other programs.
std::size_t OwnFunction(const UffFile& file, UffFunction* f, Mark* mark, Tracks* tracks) {
  const std::string head = std::string(kIdentity) + ": ";
  if (!f->id[1].starts_with(head)) return kTracksUffFunctions.size();
  if (file.length_factor != 0.0 && file.length_factor != 1.0) {
    throw Error("dataset 164 does not say SI, and these functions are", f->where,
                "export it again");
  }
  mark->name = f->id[0];
  // The grid gives the stamps back their digits.
  const std::vector<std::string> words = Split(f->id[3], ' ');
  double start = 0.0, step = 0.0;
  if (words.size() == 3 && words[0] == "grid" && ParseDouble(words[1], &start) &&
      ParseDouble(words[2], &step) && step > 0.0 && std::isfinite(step) && std::isfinite(start)) {
    for (double& t : f->t) t = start + step * std::round((t - start) / step);
  }
  if (f->id[4].find("smoothed yes") != std::string::npos) tracks->smoothed = true;
  const std::vector<std::string> about = Split(f->id[4], ' ');
  if (about.size() > 1 && about[0] == "frame") tracks->frame = about[1];
  const std::string name = f->id[1].substr(head.size());
  return static_cast<std::size_t>(
      std::find(kTracksUffFunctions.begin(), kTracksUffFunctions.end(), name) -
      kTracksUffFunctions.begin());
}

// Which direction's displacement over time it is, in SI after this; or why it is none.
std::size_t ForeignFunction(const UffFile& file, UffFunction* f, std::string* other) {
  const int direction = std::abs(f->direction);
  if (direction < 1 || direction > 3) return kTracksUffFunctions.size();
  const bool response = f->type == kTimeResponse || f->type == kGeneral;
  if (f->complex || !response || f->abscissa.type != kTime || f->ordinate.type != kDisplacement ||
      f->denominator.type != kNoUnit) {
    *other = fmt::format("node {} has a {} ({} over {})", f->node, UffFunctionType(f->type),
                         UffDataType(f->ordinate.type), UffDataType(f->abscissa.type));
    return kTracksUffFunctions.size();
  }
  const double metres = MetresPerUnit(file, *f) * (f->direction < 0 ? -1.0 : 1.0);
  const double seconds = SecondsPerUnit(*f);
  for (double& t : f->t) t *= seconds;
  for (double& y : f->y) y *= metres;
  return static_cast<std::size_t>(direction) - 1;
}

// The usable samples of a mark, and whether there are others between them.
std::vector<Eigen::Index> UsableSamples(const Tracks& tracks, std::size_t mark, bool* gaps) {
  std::vector<Eigen::Index> samples;
  *gaps = false;
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    if (tracks.mark[i] != static_cast<std::int32_t>(mark)) continue;
    if (Usable(tracks.status[i])) {
      samples.push_back(static_cast<Eigen::Index>(i));
    } else {
      *gaps = true;
    }
  }
  return samples;
}

// The head of dataset 58: five lines of identity, then records 6 to 11.
std::string FunctionHead(const Tracks& tracks, const TracksGrid& grid, std::size_t m, std::size_t f,
                         std::size_t samples, bool even) {
  std::string text = "    -1\n    58\n";
  text += TracksUffLine(tracks.marks[m]);
  text += TracksUffLine(fmt::format("{}: {}", kIdentity, kTracksUffFunctions[f]));
  text += TracksUffLine("NONE");
  // Abscissae have few digits in this format; the grid restores the others.
  text += TracksUffLine(
      grid.regular ? fmt::format("grid {} {}", grid.start + grid.delay[m], grid.step) : "NONE");
  text += TracksUffLine(
      fmt::format("frame {} smoothed {}", tracks.frame, tracks.smoothed ? "yes" : "no"));
  text += TracksUffLine(fmt::format("{:5d}{:10d}{:5d}{:10d} {:<10}{:10d}{:4d} {:<10}{:10d}{:4d}",
                                    f < 3 ? kTimeResponse : kGeneral, 0, 0, 0,
                                    tracks.marks[m].substr(0, 10), m + 1, f < 3 ? f + 1 : 0, "NONE",
                                    0, 0));
  text += TracksUffLine(fmt::format("{:10d}{:10d}{:10d}{:13.5E}{:13.5E}{:13.5E}", 4, samples,
                                    even ? 1 : 0, grid.regular ? grid.start + grid.delay[m] : 0.0,
                                    even ? grid.step : 0.0, 0.0));
  text += AxisLine(kTime, "Time", "s");
  text += f < 3 ? AxisLine(kDisplacement, "Displacement", "m")
                : AxisLine(kNoUnit, kTracksUffFunctions[f], f < 9 ? "m^2" : "NONE");
  text += AxisLine(kNoUnit, "NONE", "NONE");
  text += AxisLine(kNoUnit, "NONE", "NONE");
  return text;
}

// Gathers the functions of the file by node; `other` says what was passed over, and why.
std::map<int, Mark> MarksOf(UffFile* file, Tracks* tracks, std::string* other) {
  std::map<int, Mark> marks;
  for (UffFunction& f : file->functions) {
    Mark& mark = marks[f.node];
    std::size_t which = OwnFunction(*file, &f, &mark, tracks);
    if (which >= kTracksUffFunctions.size()) which = ForeignFunction(*file, &f, other);
    if (which >= kTracksUffFunctions.size()) continue;
    if (mark.has[which]) {
      throw Error(
          fmt::format("node {} has two functions of {}", f.node, kTracksUffFunctions[which]),
          f.where, "export each once");
    }
    mark.f[which] = std::move(f);
    mark.has[which] = true;
  }
  return marks;
}

// Whether a mark has displacements in all three directions. Checks that they belong together, and
// leaves has[3] to say whether there are covariances, has[9] whether there is a status.
bool IsWhole(const std::string& path, int node, double sigma, Mark* mark) {
  if (!mark->has[0] || !mark->has[1] || !mark->has[2]) return false;
  const std::vector<double>& t = mark->f[0].t;
  if (mark->f[1].t != t || mark->f[2].t != t) {
    throw Error(fmt::format("node {} has other times along y or z than along x", node), path,
                "export the three directions of a node with the same times");
  }
  if (mark->name.empty()) mark->name = fmt::format("node{}", node);
  bool covariances = true;
  for (std::size_t f = 3; f < 9; ++f) {
    covariances = covariances && mark->has[f] && mark->f[f].t.size() == t.size();
  }
  if (!covariances && !(sigma > 0.0)) {
    throw Error(fmt::format("node {} comes without a sigma", node), path,
                "say what sigma the points have, as in --sigma 0.0005");
  }
  mark->has[3] = covariances;
  mark->has[9] = mark->has[9] && mark->f[9].t.size() == t.size();
  return true;
}

// Place, covariance and status of one sample, as column i.
void FillSample(const Mark& mark, std::size_t index, double sigma, Eigen::Index i, Tracks* tracks) {
  const double status = mark.has[9] ? mark.f[9].y[index] : 0.0;
  tracks->status.push_back(static_cast<SampleStatus>(std::lround(std::clamp(status, 0.0, 2.0))));
  for (std::size_t k = 0; k < 3; ++k) {
    tracks->p(static_cast<Eigen::Index>(k), i) = mark.f[k].y[index];
  }
  if (!mark.has[3]) {
    tracks->cov.col(i) << sigma * sigma, 0.0, 0.0, sigma * sigma, 0.0, sigma * sigma;
    return;
  }
  for (std::size_t k = 0; k < 6; ++k) {
    tracks->cov(static_cast<Eigen::Index>(k), i) = mark.f[3 + k].y[index];
  }
}

}  // namespace

void WriteTracksUff(const std::string& path, const Tracks& tracks) {
  const TracksGrid grid = GridOf(tracks);
  TextFileWriter file(path);
  file.Append(kUnits);
  for (std::size_t m = 0; m < tracks.marks.size(); ++m) {
    bool gaps = false;
    const std::vector<Eigen::Index> samples = UsableSamples(tracks, m, &gaps);
    if (samples.empty()) continue;
    const bool even = grid.regular && !gaps && samples.size() == grid.frames;
    for (std::size_t f = 0; f < kTracksUffFunctions.size(); ++f) {
      std::string text = FunctionHead(tracks, grid, m, f, samples.size(), even);
      const std::size_t row = even ? 4 : 2;
      for (std::size_t k = 0; k < samples.size(); ++k) {
        // Seven digits fit into the columns of six.
        if (!even) text += fmt::format("{:13.6E}", tracks.t[static_cast<std::size_t>(samples[k])]);
        text += fmt::format("{:20.12E}", ValueOf(tracks, f, samples[k]));
        if (k % row == row - 1 || k + 1 == samples.size()) text += "\n";
      }
      text += "    -1\n";
      file.Append(text);
    }
  }
  file.Commit();
}

Tracks ReadTracksUff(const std::string& path, double sigma) {
  UffFile file = ReadUff(path);
  Tracks tracks;
  tracks.frame = "rig";
  std::string other;
  std::map<int, Mark> marks = MarksOf(&file, &tracks, &other);
  struct Sample {
    double t;
    std::int32_t mark;
    std::size_t index;
  };
  std::vector<Sample> samples;
  std::vector<const Mark*> kept;
  for (auto& [node, mark] : marks) {
    if (!IsWhole(path, node, sigma, &mark)) continue;
    for (std::size_t i = 0; i < mark.f[0].t.size(); ++i) {
      samples.push_back({mark.f[0].t[i], static_cast<std::int32_t>(kept.size()), i});
    }
    tracks.marks.push_back(mark.name);
    kept.push_back(&mark);
  }
  if (samples.empty()) {
    throw Error("holds no node with displacements over time along x, y and z" +
                    (other.empty() ? "" : "; " + other),
                path, "export time responses (dataset 58) of all three directions");
  }
  std::stable_sort(samples.begin(), samples.end(),
                   [](const Sample& a, const Sample& b) { return a.t < b.t; });
  const auto n = static_cast<Eigen::Index>(samples.size());
  tracks.p.resize(3, n);
  tracks.cov.resize(6, n);
  tracks.shared.resize(3, 0);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Sample& s = samples[static_cast<std::size_t>(i)];
    const Mark& mark = *kept[static_cast<std::size_t>(s.mark)];
    tracks.t.push_back(s.t);
    tracks.mark.push_back(s.mark);
    FillSample(mark, s.index, sigma, i, &tracks);
    if (!tracks.p.col(i).allFinite() || !tracks.cov.col(i).allFinite()) {
      throw Error(fmt::format("mark {} is not finite at {} s", mark.name, s.t), path,
                  "export it again");
    }
  }
  return tracks;
}

}  // namespace unfurl::data
