#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>

#include "base/error.h"
#include "base/text.h"
#include "data/atomic_file.h"
#include "data/tracks_exchange.h"
#include "data/tracks_grid.h"

namespace unfurl::data {

namespace {

constexpr int kTimeResponse = 1, kGeneral = 0;             // function types
constexpr int kTime = 17, kDisplacement = 8, kNoUnit = 0;  // data types
constexpr std::array<const char*, 10> kFunctions = {"x",   "y",   "z",   "cxx", "cxy",
                                                    "cxz", "cyy", "cyz", "czz", "status"};
constexpr const char* kIdentity = "unfurl tracks";

// One line of the file's fixed columns, cut to 80.
std::string Line(std::string text) {
  text.resize(std::min<std::size_t>(text.size(), 80));
  return text + "\n";
}

std::string AxisLine(int type, const char* label, const char* units) {
  return Line(fmt::format("{:10d}{:5d}{:5d}{:5d} {:<20} {:<20}", type,
                          type == kDisplacement ? 1 : 0, 0, 0, label, units));
}

double ValueOf(const Tracks& tracks, std::size_t function, Eigen::Index i) {
  if (function < 3) return tracks.p(static_cast<Eigen::Index>(function), i);
  if (function < 9) return tracks.cov(static_cast<Eigen::Index>(function) - 3, i);
  return static_cast<double>(tracks.status[static_cast<std::size_t>(i)]);
}

struct Function {
  std::array<std::string, 5> id;
  int node = 0, direction = 0;
  std::vector<double> t, y;
};

class Reader {
 public:
  Reader(const std::string& path, const std::string& text) : path_(path) {
    for (std::string& line : Split(text, '\n')) {
      if (!line.empty() && line.back() == '\r') line.pop_back();
      lines_.push_back(std::move(line));
    }
  }
  bool Next(std::string* line) {
    if (at_ >= lines_.size()) return false;
    *line = lines_[at_++];
    return true;
  }
  std::string Need() {
    std::string line;
    if (!Next(&line)) Fail("is cut off");
    return line;
  }
  [[noreturn]] void Fail(const std::string& what) const {
    throw Error(what, fmt::format("{}:{}", path_, at_), "export it again");
  }
  // The number in columns [first, first + width).
  double Number(const std::string& line, std::size_t first, std::size_t width) const {
    double value = 0.0;
    const std::string_view field =
        first < line.size() ? Trim(std::string_view(line).substr(first, width)) : "";
    if (!ParseDouble(field, &value)) Fail(fmt::format("'{}' is no number", field));
    return value;
  }

 private:
  std::string path_;
  std::vector<std::string> lines_;
  std::size_t at_ = 0;
};

// A dataset 58 after its number; the lines up to and with its closing -1.
Function ReadFunction(Reader& in) {
  Function f;
  for (std::string& id : f.id) id = std::string(Trim(in.Need()));
  const std::string entity = in.Need();
  f.node = static_cast<int>(in.Number(entity, 41, 10));
  f.direction = static_cast<int>(in.Number(entity, 51, 4));
  const std::string form = in.Need();
  const int type = static_cast<int>(in.Number(form, 0, 10));
  const auto count = static_cast<std::size_t>(std::max(0.0, in.Number(form, 10, 10)));
  const bool even = static_cast<int>(in.Number(form, 20, 10)) == 1;
  const double start = in.Number(form, 30, 13), step = in.Number(form, 43, 13);
  if (type != 2 && type != 4) in.Fail("holds complex values: no displacements in time");
  for (int i = 0; i < 4; ++i) in.Need();  // the axes
  std::vector<double> values;
  const bool wide = type == 4;
  const std::size_t need = even ? count : 2 * count;
  std::string line;
  while (values.size() < need) {
    line = in.Need();
    if (Trim(line) == "-1") in.Fail(fmt::format("has {} of {} values", values.size(), need));
    for (std::size_t at = 0; at < line.size() && values.size() < need;) {
      const std::size_t width = wide && (even || values.size() % 2 == 1) ? 20 : 13;
      if (Trim(std::string_view(line).substr(at)).empty()) break;
      values.push_back(in.Number(line, at, width));
      at += width;
    }
  }
  if (Trim(in.Need()) != "-1") in.Fail("a dataset does not end where it should");
  for (std::size_t i = 0; i < count; ++i) {
    f.t.push_back(even ? start + step * static_cast<double>(i) : values[2 * i]);
    f.y.push_back(even ? values[i] : values[2 * i + 1]);
  }
  return f;
}

// The functions of one node, and which of them the file holds.
struct NodeFunctions {
  std::string name;
  std::array<Function, kFunctions.size()> f;
  std::array<bool, kFunctions.size()> has{};
};

// Which of kFunctions a dataset holds, by its direction, or by its own words where we wrote it;
// those also give the mark's name, the stamps' lost digits, and what holds for all tracks.
// kFunctions.size() for another.
std::size_t Identify(Function* f, NodeFunctions* node, Tracks* tracks) {
  const std::string head = std::string(kIdentity) + ": ";
  if (!f->id[1].starts_with(head)) {
    const bool displacement = f->direction >= 1 && f->direction <= 3;
    return displacement ? static_cast<std::size_t>(f->direction) - 1 : kFunctions.size();
  }
  node->name = f->id[0];
  // The grid gives the stamps back their digits.
  const std::vector<std::string> words = Split(f->id[3], ' ');
  double start = 0.0, step = 0.0;
  if (words.size() == 3 && words[0] == "grid" && ParseDouble(words[1], &start) &&
      ParseDouble(words[2], &step) && step > 0.0) {
    for (double& t : f->t) t = start + step * std::round((t - start) / step);
  }
  if (f->id[4].find("smoothed yes") != std::string::npos) tracks->smoothed = true;
  const std::vector<std::string> about = Split(f->id[4], ' ');
  if (about.size() > 1 && about[0] == "frame") tracks->frame = about[1];
  const auto* const which =
      std::find(kFunctions.begin(), kFunctions.end(), f->id[1].substr(head.size()));
  return static_cast<std::size_t>(which - kFunctions.begin());
}

// Every dataset 58 of the file, by node.
std::map<int, NodeFunctions> ReadNodes(Reader& in, Tracks* tracks) {
  std::map<int, NodeFunctions> nodes;
  std::string line;
  while (in.Next(&line)) {
    if (Trim(line) != "-1") continue;
    if (!in.Next(&line)) break;
    if (Trim(line) != "58") {
      while (in.Next(&line) && Trim(line) != "-1") {
      }
      continue;
    }
    Function f = ReadFunction(in);
    NodeFunctions& node = nodes[f.node];
    const std::size_t which = Identify(&f, &node, tracks);
    if (which >= kFunctions.size()) continue;
    node.f[which] = std::move(f);
    node.has[which] = true;
  }
  return nodes;
}

// Whether a node is a mark: displacements along x, y and z at the same times. Makes has[3] say
// whether there are covariances, has[9] whether there is a status.
bool CompleteNode(int number, double sigma, const std::string& path, NodeFunctions* node) {
  if (!node->has[0] || !node->has[1] || !node->has[2]) return false;
  if (node->f[1].t != node->f[0].t || node->f[2].t != node->f[0].t) {
    throw Error(fmt::format("node {} has other times along y or z than along x", number), path,
                "export the three directions of a node with the same times");
  }
  if (node->name.empty()) node->name = fmt::format("node{}", number);
  bool covariances = true;
  for (std::size_t f = 3; f < 9; ++f) {
    covariances = covariances && node->has[f] && node->f[f].t.size() == node->f[0].t.size();
  }
  if (!covariances && !(sigma > 0.0)) {
    throw Error(fmt::format("node {} comes without a sigma", number), path,
                "say what sigma the points have, as in --sigma 0.0005");
  }
  node->has[3] = covariances;
  node->has[9] = node->has[9] && node->f[9].t.size() == node->f[0].t.size();
  return true;
}

// Sample `index` of a node to column i of `tracks`. `sigma` [m] where there are no covariances.
void FillSample(const NodeFunctions& node, std::size_t index, double sigma, Eigen::Index i,
                Tracks* tracks) {
  const double status = node.has[9] ? node.f[9].y[index] : 0.0;
  tracks->status.push_back(static_cast<SampleStatus>(std::clamp(std::lround(status), 0L, 2L)));
  for (std::size_t k = 0; k < 3; ++k) {
    tracks->p(static_cast<Eigen::Index>(k), i) = node.f[k].y[index];
  }
  for (std::size_t k = 0; k < 6; ++k) {
    const bool diagonal = k == 0 || k == 3 || k == 5;
    tracks->cov(static_cast<Eigen::Index>(k), i) = node.has[3] ? node.f[3 + k].y[index]
                                                   : diagonal  ? sigma * sigma
                                                               : 0.0;
  }
}

}  // namespace

void WriteTracksUff(const std::string& path, const Tracks& tracks) {
  const TracksGrid grid = GridOf(tracks);
  TextFileWriter file(path);
  for (std::size_t m = 0; m < tracks.marks.size(); ++m) {
    std::vector<Eigen::Index> samples;
    bool gaps = false;
    for (std::size_t i = 0; i < tracks.size(); ++i) {
      if (tracks.mark[i] != static_cast<std::int32_t>(m)) continue;
      if (Usable(tracks.status[i])) {
        samples.push_back(static_cast<Eigen::Index>(i));
      } else {
        gaps = true;
      }
    }
    if (samples.empty()) continue;
    const bool even = grid.regular && !gaps && samples.size() == grid.frames;
    for (std::size_t f = 0; f < kFunctions.size(); ++f) {
      std::string text = "    -1\n    58\n";
      text += Line(tracks.marks[m]);
      text += Line(fmt::format("{}: {}", kIdentity, kFunctions[f]));
      text += Line("NONE");
      // Abscissae have few digits in this format; the grid restores the others.
      text += Line(grid.regular ? fmt::format("grid {} {}", grid.start + grid.delay[m], grid.step)
                                : "NONE");
      text +=
          Line(fmt::format("frame {} smoothed {}", tracks.frame, tracks.smoothed ? "yes" : "no"));
      text +=
          Line(fmt::format("{:5d}{:10d}{:5d}{:10d} {:<10}{:10d}{:4d} {:<10}{:10d}{:4d}",
                           f < 3 ? kTimeResponse : kGeneral, 0, 0, 0, tracks.marks[m].substr(0, 10),
                           m + 1, f < 3 ? f + 1 : 0, "NONE", 0, 0));
      text += Line(fmt::format("{:10d}{:10d}{:10d}{:13.5E}{:13.5E}{:13.5E}", 4, samples.size(),
                               even ? 1 : 0, grid.regular ? grid.start + grid.delay[m] : 0.0,
                               even ? grid.step : 0.0, 0.0));
      text += AxisLine(kTime, "Time", "s");
      text += f < 3 ? AxisLine(kDisplacement, "Displacement", "m")
                    : AxisLine(kNoUnit, kFunctions[f], f < 9 ? "m^2" : "NONE");
      text += AxisLine(kNoUnit, "NONE", "NONE");
      text += AxisLine(kNoUnit, "NONE", "NONE");
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
  const std::string text = ReadTextFile(path);
  Reader in(path, text);
  Tracks tracks;
  tracks.frame = "rig";
  std::map<int, NodeFunctions> nodes = ReadNodes(in, &tracks);

  struct Sample {
    double t;
    std::int32_t mark;
    std::size_t index;
  };
  std::vector<Sample> samples;
  std::vector<const NodeFunctions*> kept;
  for (auto& [number, node] : nodes) {
    if (!CompleteNode(number, sigma, path, &node)) continue;
    for (std::size_t i = 0; i < node.f[0].t.size(); ++i) {
      samples.push_back({node.f[0].t[i], static_cast<std::int32_t>(kept.size()), i});
    }
    tracks.marks.push_back(node.name);
    kept.push_back(&node);
  }
  if (samples.empty()) {
    throw Error("holds no node with displacements along x, y and z", path,
                "export time responses (dataset 58) of all three directions");
  }
  std::stable_sort(samples.begin(), samples.end(),
                   [](const Sample& a, const Sample& b) { return a.t < b.t; });

  const auto n = static_cast<Eigen::Index>(samples.size());
  tracks.p.resize(3, n);
  tracks.cov.resize(6, n);
  tracks.shared.resize(3, 0);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Sample& s = samples[static_cast<std::size_t>(i)];
    const NodeFunctions& node = *kept[static_cast<std::size_t>(s.mark)];
    tracks.t.push_back(s.t);
    tracks.mark.push_back(s.mark);
    FillSample(node, s.index, sigma, i, &tracks);
    if (!tracks.p.col(i).allFinite() || !tracks.cov.col(i).allFinite()) {
      throw Error(fmt::format("mark {} is not finite at {} s", node.name, s.t), path,
                  "export it again");
    }
  }
  return tracks;
}

}  // namespace unfurl::data
