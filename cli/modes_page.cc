#include "cli/modes_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "base/fixed_number.h"
#include "report/motion.h"
#include "report/page.h"

namespace unfurl::cli {

namespace {

using Mode = data::ModesRecord::Mode;
using Pose = data::ModesRecord::Pose;

constexpr std::size_t kMostMoving = 12;  // modes drawn: a page of some megabytes
constexpr int kFrames = 60;              // of a period: at 30 a second, two seconds
constexpr double kAmplitude = 0.08;      // drawn, of the structure's size

// Segments of a beam by its name, places of bodies and marks by their own.
struct Skeleton {
  std::vector<std::pair<std::string, std::vector<std::size_t>>> beams;
  std::vector<std::size_t> others;
};

Skeleton SkeletonOf(const data::ModesRecord& record) {
  Skeleton out;
  std::map<std::string, std::size_t> beam_of;
  for (std::size_t i = 0; i < record.places.size(); ++i) {
    const std::string& place = record.places[i];
    const std::size_t slash = place.find('/');
    if (slash == std::string::npos) {
      out.others.push_back(i);
      continue;
    }
    const std::string beam = place.substr(0, slash);
    const auto [found, fresh] = beam_of.try_emplace(beam, out.beams.size());
    if (fresh) out.beams.push_back({beam, {}});
    out.beams[found->second].second.push_back(i);
  }
  return out;
}

// Of all places at rest, the longer side of their box [m].
double SizeOf(const data::ModesRecord& record) {
  double size = 0.0;
  for (int k = 0; k < 2; ++k) {
    const auto less = [k](const Pose& a, const Pose& b) { return a[k] < b[k]; };
    const auto [low, high] = std::minmax_element(record.rest.begin(), record.rest.end(), less);
    if (low != record.rest.end()) size = std::max(size, (*high)[k] - (*low)[k]);
  }
  return size > 0.0 ? size : 1.0;
}

// The ends of segments, from their middles: half a segment along its own angle to either side.
void AddBeam(const std::vector<Pose>& poses, double half, std::vector<double>* xy) {
  for (std::size_t i = 0; i <= poses.size(); ++i) {
    double x = 0.0, y = 0.0, n = 0.0;
    const auto add = [&](const Pose& pose, double side) {
      x += pose[0] + side * half * std::cos(pose[2]);
      y += pose[1] + side * half * std::sin(pose[2]);
      n += 1.0;
    };
    if (i > 0) add(poses[i - 1], 1.0);
    if (i < poses.size()) add(poses[i], -1.0);
    xy->push_back(x / n);
    xy->push_back(y / n);
  }
}

double HalfSegment(const data::ModesRecord& record, const std::vector<std::size_t>& places,
                   double size) {
  if (places.size() < 2) return 0.02 * size;  // alone it has no neighbour to tell its length
  const Pose &a = record.rest[places[0]], &b = record.rest[places[1]];
  return 0.5 * std::hypot(b[0] - a[0], b[1] - a[1]);
}

std::string DampingWords(double damping) {
  constexpr double kNone = 1e-6;  // of critical: rounding of the eigenvalues has such
  return damping < kNone ? "undamped" : fmt::format("damping {:.3g}%", 100.0 * damping);
}

report::Motion MotionOf(const data::ModesRecord& record, const Mode& mode, std::size_t number) {
  const Skeleton skeleton = SkeletonOf(record);
  const double size = SizeOf(record), amplitude = kAmplitude * size;
  const double period = mode.frequency > 0.0 ? 1.0 / mode.frequency : 1.0;
  report::Motion motion;
  motion.title = mode.growth > 0.0
                     ? fmt::format("Mode {}: unstable, {:.4g} 1/s", number, mode.growth)
                     : fmt::format("Mode {}: {:.5g} Hz, {}", number, mode.frequency,
                                   DampingWords(mode.damping));
  motion.note = fmt::format(
      "Moves {} most. Drawn without its damping, and larger than it is; at the start it is bent as "
      "far as it goes. The pointer names a place.",
      record.places[record.MovesMost(mode)]);
  motion.legend = false;
  motion.x = {"x", "m", false};
  motion.y = {"y", "m", false};
  motion.loops = true;
  motion.lines.resize(skeleton.beams.size());
  for (const std::size_t place : skeleton.others) {
    report::MovingMark mark;
    mark.name = record.places[place];
    motion.marks.push_back(std::move(mark));
  }
  for (int f = 0; f <= kFrames; ++f) {
    const double at = period * f / kFrames;
    const double swing = amplitude * std::cos(2.0 * M_PI * f / kFrames);
    motion.t.push_back(at);
    const auto pose = [&](std::size_t place) {
      Pose out = record.rest[place];
      for (int k = 0; k < 3; ++k) out[k] += swing * mode.shape[place][k];
      return out;
    };
    for (std::size_t b = 0; b < skeleton.beams.size(); ++b) {
      const auto& [name, places] = skeleton.beams[b];
      std::vector<Pose> poses;
      for (const std::size_t place : places) poses.push_back(pose(place));
      report::MovingLine& line = motion.lines[b];
      line.name = name;
      line.points = places.size() + 1;
      AddBeam(poses, HalfSegment(record, places, size), &line.xy);
    }
    for (std::size_t m = 0; m < skeleton.others.size(); ++m) {
      const Pose here = pose(skeleton.others[m]);
      motion.marks[m].t.push_back(at);
      motion.marks[m].x.push_back(here[0]);
      motion.marks[m].y.push_back(here[1]);
    }
  }
  return motion;
}

}  // namespace

std::vector<std::vector<std::string>> ModeRows(const data::ModesRecord& record) {
  std::vector<std::vector<std::string>> rows = {
      {"mode", "frequency [Hz]", "of the mesh", "damping ratio [%]", "moves most"}};
  for (std::size_t m = 0; m < record.modes.size(); ++m) {
    const Mode& mode = record.modes[m];
    rows.push_back({std::to_string(m + 1),
                    mode.growth > 0.0 ? fmt::format("unstable, {:.4g} 1/s", mode.growth)
                                      : FixedNumber(mode.frequency, 5),
                    std::isfinite(mode.error) ? fmt::format("+-{:.2g}", mode.error) : "?",
                    fmt::format("{:.4f}", 100.0 * mode.damping),
                    record.places[record.MovesMost(mode)]});
  }
  return rows;
}

void WriteModesPage(const std::string& path, const ModesPageInput& in,
                    const data::Provenance& provenance) {
  report::Page page("Natural modes", in.scene);
  page.AddWords(in.usable ? report::Level::kNeutral : report::Level::kBad, in.words.front(),
                {in.words.begin() + 1, in.words.end()});
  std::vector<std::vector<std::string>> rows = ModeRows(in.record);
  report::Table table;
  table.title = "Modes";
  table.header = std::move(rows.front());
  table.rows.assign(rows.begin() + 1, rows.end());
  table.text_columns = {4};
  page.AddTable(table);
  const std::size_t shown = std::min(kMostMoving, in.record.modes.size());
  page.AddSection("Shapes in motion",
                  shown < in.record.modes.size()
                      ? fmt::format("The first {} of {}.", shown, in.record.modes.size())
                      : "");
  for (std::size_t m = 0; m < shown; ++m) {
    page.AddMotion(MotionOf(in.record, in.record.modes[m], m + 1));
  }
  page.AddOrigin(provenance);
  page.Write(path);
}

}  // namespace unfurl::cli
