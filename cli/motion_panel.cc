#include "cli/motion_panel.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace unfurl::cli {

namespace {

constexpr std::size_t kMostFrames = 2000;   // forty seconds of pictures at the usual rate
constexpr std::size_t kMostSamples = 1500;  // of a mark's path: as many as a screen has columns

// x, y of all points of a shape in the chosen frames.
std::vector<double> ReadFrames(const data::H5Reader& file, const std::string& at,
                               const std::vector<std::size_t>& frames, std::size_t points) {
  std::vector<double> xy(2 * points * frames.size());
  for (std::size_t f = 0; f < frames.size(); ++f) {
    file.ReadRows(at, frames[f], 1, std::span<double>(xy).subspan(2 * points * f, 2 * points));
  }
  return xy;
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
      line.points = file.Dims(group + "/" + name).at(1);
      line.xy = ReadFrames(file, group + "/" + name, frames, line.points);
      motion->lines.push_back(std::move(line));
    }
  }
  const std::string group = data::ShapeGroup(data::ShapeKind::kPin);
  if (!file.Has(group)) return;
  for (const std::string& name : file.Children(group)) {
    report::MovingPin pin;
    pin.name = name;
    pin.xy = ReadFrames(file, group + "/" + name, frames, 1);
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
  const auto read = [&](const std::string& at) {
    std::vector<double> values(samples.size());
    for (std::size_t i = 0; i < samples.size(); ++i) {
      file.ReadRows(at, samples[i], 1, std::span<double>(values).subspan(i, 1));
    }
    return values;
  };
  std::vector<double> t = read("/t");
  for (double& time : t) time += offset;
  for (std::size_t m = 0; m < marks.size(); ++m) {
    const std::string x = "/series/" + marks[m] + ".x", y = "/series/" + marks[m] + ".y";
    if (!file.Has(x) || !file.Has(y)) continue;
    report::MovingMark mark;
    mark.name = marks[m];
    mark.t = t;
    mark.x = read(x);
    mark.y = read(y);
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

void AddMeasured(const correlate::Comparison& c, report::Motion* motion) {
  for (std::size_t m = 0; m < c.marks.size(); ++m) {
    const correlate::ComparedSignal *x = correlate::FindCoordinate(c, m, 0),
                                    *y = correlate::FindCoordinate(c, m, 1);
    if (x == nullptr || y == nullptr || x->t != y->t) continue;
    motion->marks.push_back(
        {c.marks[m] + ", measured", true, x->t, x->measured, y->measured, static_cast<int>(m)});
  }
}

std::optional<report::Motion> MotionOfMarks(const correlate::Comparison& c) {
  report::Motion motion;
  motion.title = "Both in motion";
  motion.note =
      "Discs are computed, rings measured, in the model's plane; between two samples they go "
      "straight.";
  motion.x = {"x", "m", false};
  motion.y = {"y", "m", false};
  for (std::size_t m = 0; m < c.marks.size(); ++m) {
    const correlate::ComparedSignal *x = correlate::FindCoordinate(c, m, 0),
                                    *y = correlate::FindCoordinate(c, m, 1);
    if (x == nullptr || y == nullptr || x->t != y->t) continue;
    motion.marks.push_back(
        {c.marks[m], false, x->t, x->reference, y->reference, static_cast<int>(m)});
  }
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
