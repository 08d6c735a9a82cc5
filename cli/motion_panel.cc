#include "cli/motion_panel.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

namespace unfurl::cli {

namespace {

constexpr std::size_t kMostFrames = 2000;   // forty seconds of pictures at the usual rate
constexpr std::size_t kMostSamples = 1500;  // of a mark's path: as many as a screen has columns

// Rows of `width` numbers at these rising places: at one go where they are most of all rows, else
// one by one.
std::vector<double> ReadChosen(const data::H5Reader& file, const std::string& at,
                               const std::vector<std::size_t>& rows, std::size_t width) {
  constexpr std::size_t kMost = 4;  // times as much as is kept: a call reads a whole chunk anyway
  std::vector<double> out(width * rows.size());
  const std::size_t all = rows.empty() ? 0 : rows.back() + 1;
  if (all == rows.size()) {
    file.ReadRows(at, 0, all, std::span<double>(out));
    return out;
  }
  std::vector<double> whole(all <= kMost * rows.size() ? width * all : 0);
  if (!whole.empty()) file.ReadRows(at, 0, all, std::span<double>(whole));
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const std::span<double> row = std::span<double>(out).subspan(width * i, width);
    if (whole.empty()) {
      file.ReadRows(at, rows[i], 1, row);
    } else {
      std::copy_n(whole.begin() + static_cast<std::ptrdiff_t>(width * rows[i]), width, row.begin());
    }
  }
  return out;
}

void AddShapes(const data::H5Reader& file, const std::vector<std::size_t>& frames,
               report::Motion* motion) {
  using Kind = report::MovingLine::Kind;
  for (const data::ShapeKind kind : {data::ShapeKind::kBody, data::ShapeKind::kBeam}) {
    const std::string group = data::ShapeGroup(kind);
    if (!file.Has(group)) continue;
    for (const std::string& name : file.Children(group)) {
      report::MovingLine line;
      line.name = name;
      line.kind = kind == data::ShapeKind::kBeam ? Kind::kBeam : Kind::kBody;
      const std::string path = fmt::format("{}/{}", group, name);
      line.points = file.Dims(path).at(1);
      line.xy = ReadChosen(file, path, frames, 2 * line.points);
      motion->lines.push_back(std::move(line));
    }
  }
  const std::string group = data::ShapeGroup(data::ShapeKind::kPin);
  if (!file.Has(group)) return;
  for (const std::string& name : file.Children(group)) {
    report::MovingPin pin;
    pin.name = name;
    pin.xy = ReadChosen(file, fmt::format("{}/{}", group, name), frames, 2);
    motion->pins.push_back(std::move(pin));
  }
}

// Latches and contacts into the joints' pins, and all as events.
void AddEvents(const data::H5Reader& file, double end, double offset, report::Motion* motion) {
  const std::vector<double> t = file.ReadDoubles("/events/t", "s");
  const std::vector<std::string> kinds = file.ReadStrings("/events/kind");
  const std::vector<std::string> places = file.ReadStrings("/events/where");
  std::map<std::string, report::MovingPin*> pins;
  for (report::MovingPin& pin : motion->pins) pins[pin.name] = &pin;
  const std::size_t count = std::min({t.size(), kinds.size(), places.size()});
  for (std::size_t i = 0; i < count; ++i) {
    const double at = t[i] + offset;
    motion->events.push_back({at, kinds[i] + " " + places[i], -1});
    const auto pin = pins.find(places[i]);
    if (pin == pins.end()) continue;
    auto& contacts = pin->second->contacts;
    if (kinds[i] == "latch") pin->second->latched = at;
    if (kinds[i] == "contact_start") contacts.emplace_back(at, end + offset);
    if (kinds[i] == "contact_end" && !contacts.empty()) contacts.back().second = at;
  }
}

void AddMarks(const data::RunReader& run, const std::vector<std::string>& marks, double offset,
              report::Motion* motion) {
  const data::H5Reader& file = run.file();
  const std::vector<std::size_t> samples = report::EvenlyChosen(run.samples(), kMostSamples);
  std::vector<double> t = ReadChosen(file, "/t", samples, 1);
  for (double& time : t) time += offset;
  for (std::size_t m = 0; m < marks.size(); ++m) {
    const std::string x = "/series/" + marks[m] + ".x", y = "/series/" + marks[m] + ".y";
    if (!file.Has(x) || !file.Has(y)) continue;
    report::MovingMark mark;
    mark.name = marks[m];
    mark.t = t;
    mark.x = ReadChosen(file, x, samples, 1);
    mark.y = ReadChosen(file, y, samples, 1);
    mark.color = static_cast<int>(m);
    motion->marks.push_back(std::move(mark));
  }
}

}  // namespace

std::optional<report::Motion> MotionOfRun(const data::RunReader& run,
                                          const std::vector<std::string>& marks, double offset) {
  const data::H5Reader& file = run.file();
  if (!file.Has(data::kShapeTime)) return std::nullopt;
  const std::vector<double> t = file.ReadDoubles(data::kShapeTime, "s");
  if (t.size() < 2) return std::nullopt;
  report::Motion motion;
  motion.title = "The motion";
  motion.x = {"x", "m", false};
  motion.y = {"y", "m", false};
  const std::vector<std::size_t> frames = report::EvenlyChosen(t.size(), kMostFrames);
  for (const std::size_t f : frames) motion.t.push_back(t[f] + offset);
  AddShapes(file, frames, &motion);
  AddEvents(file, t.back(), offset, &motion);
  AddMarks(run, marks, offset, &motion);
  return motion;
}

namespace {

// Marks whose x and y have common stamps, from one side of a comparison.
void AddCompared(const correlate::Comparison& c, bool measured, report::Motion* motion) {
  const auto side =
      measured ? &correlate::ComparedSignal::measured : &correlate::ComparedSignal::reference;
  for (std::size_t m = 0; m < c.marks.size(); ++m) {
    const correlate::ComparedSignal *x = correlate::FindCoordinate(c, m, 0),
                                    *y = correlate::FindCoordinate(c, m, 1);
    if (x == nullptr || y == nullptr || x->t != y->t) continue;
    motion->marks.push_back({c.marks[m] + (measured ? ", measured" : ""), measured, x->t, x->*side,
                             y->*side, static_cast<int>(m)});
  }
}

}  // namespace

void AddMeasured(const correlate::Comparison& c, report::Motion* motion) {
  AddCompared(c, true, motion);
}

std::optional<report::Motion> MotionOfMarks(const correlate::Comparison& c) {
  report::Motion motion;
  motion.title = "Both in motion";
  motion.note =
      "Discs are computed, rings measured, in the model's plane; between two samples they go "
      "straight.";
  motion.x = {"x", "m", false};
  motion.y = {"y", "m", false};
  AddCompared(c, false, &motion);
  AddMeasured(c, &motion);
  for (const correlate::ModelEvent& latch : c.latches) {
    motion.events.push_back({latch.t + c.alignment.at.offset, "latch " + latch.where, -1});
  }
  if (!SpanFrames(&motion)) return std::nullopt;
  return motion;
}

bool SpanFrames(report::Motion* motion) {
  constexpr int kFrames = 500;  // for the keyboard's steps: marks have stamps of their own
  double low = HUGE_VAL, high = -HUGE_VAL;
  for (const report::MovingMark& mark : motion->marks) {
    if (mark.t.empty()) continue;
    low = std::min(low, mark.t.front());
    high = std::max(high, mark.t.back());
  }
  if (!(high > low)) return false;
  for (int f = 0; f < kFrames; ++f) motion->t.push_back(low + (high - low) * f / (kFrames - 1));
  return true;
}

}  // namespace unfurl::cli
