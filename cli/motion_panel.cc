#include "cli/motion_panel.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <span>

namespace unfurl::cli {

namespace {

constexpr std::size_t kMostFrames = 2000;             // forty seconds of pictures at the usual rate
constexpr std::size_t kMotionPanelBlockRows = 65536;  // of a column, read at once
constexpr std::size_t kMostSamples = 1500;  // of a mark's path: as many as a screen has columns

// A quantity, or the time (-1), at these rising places, read block by block.
std::vector<double> ReadChosen(const data::RunReader& run, int quantity,
                               const std::vector<std::size_t>& rows) {
  std::vector<double> out, block(kMotionPanelBlockRows);
  out.reserve(rows.size());
  for (std::size_t k = 0; k < rows.size();) {
    const std::size_t first = rows[k],
                      count = std::min(kMotionPanelBlockRows, rows.back() + 1 - first);
    const std::span<double> values(block.data(), count);
    if (quantity < 0) {
      run.file().ReadRows("/t", first, count, values);
    } else {
      run.ReadColumn(quantity, first, values);
    }
    for (; k < rows.size() && rows[k] < first + count; ++k) out.push_back(values[rows[k] - first]);
  }
  return out;
}

// Shapes of these times alone.
std::vector<data::BeamMotion> ReadChosenShapes(const data::RunReader& run,
                                               const std::vector<std::size_t>& frames) {
  std::vector<data::BeamMotion> out;
  for (const data::BeamShape& shape : run.shapes()) {
    out.push_back({shape.name, shape.at, {}, shape.kind});
  }
  std::vector<double> xy;
  for (const std::size_t frame : frames) {
    run.ReadShapes(frame, 1, &xy);
    auto from = xy.begin();
    for (data::BeamMotion& shape : out) {
      const auto to = from + static_cast<std::ptrdiff_t>(2 * shape.at.size());
      shape.xy.insert(shape.xy.end(), from, to);
      from = to;
    }
  }
  return out;
}

std::vector<data::RunEvent> ReadEvents(const data::H5Reader& file) {
  const std::vector<double> t = file.ReadDoubles("/events/t", "s");
  const std::vector<std::string> kinds = file.ReadStrings("/events/kind");
  const std::vector<std::string> places = file.ReadStrings("/events/where");
  std::vector<data::RunEvent> out;
  for (std::size_t i = 0; i < std::min({t.size(), kinds.size(), places.size()}); ++i) {
    out.push_back({t[i], kinds[i], places[i], {}});
  }
  return out;
}

// What a picture shows of a run, in memory: thinned, of a run of any length.
data::Run Thinned(const data::RunReader& run, const std::vector<std::string>& marks) {
  data::Run out;
  const std::vector<std::size_t> samples = report::EvenlyChosen(run.samples(), kMostSamples);
  out.t = ReadChosen(run, -1, samples);
  for (const std::string& mark : marks) {
    for (const char* axis : {".x", ".y"}) {
      const int column = run.Find(mark + axis);
      if (column < 0) continue;
      out.quantities.push_back(run.quantities()[static_cast<std::size_t>(column)]);
      out.columns.push_back(ReadChosen(run, column, samples));
    }
  }
  const std::vector<double>& t = run.shape_times();
  const std::vector<std::size_t> frames = report::EvenlyChosen(t.size(), kMostFrames);
  for (const std::size_t f : frames) out.shape_t.push_back(t[f]);
  out.shapes = ReadChosenShapes(run, frames);
  out.events = ReadEvents(run.file());
  return out;
}

void AddShapes(const data::Run& run, report::Motion* motion) {
  using Kind = report::MovingLine::Kind;
  // Bodies lie under beams.
  for (const data::ShapeKind kind :
       {data::ShapeKind::kBody, data::ShapeKind::kBeam, data::ShapeKind::kPin}) {
    for (const data::BeamMotion& shape : run.shapes) {
      if (shape.kind != kind) continue;
      if (kind == data::ShapeKind::kPin) {
        report::MovingPin pin;
        pin.name = shape.name;
        pin.xy = shape.xy;
        motion->pins.push_back(std::move(pin));
        continue;
      }
      report::MovingLine line;
      line.name = shape.name;
      line.kind = kind == data::ShapeKind::kBeam ? Kind::kBeam : Kind::kBody;
      line.points = shape.at.size();
      line.xy = shape.xy;
      motion->lines.push_back(std::move(line));
    }
  }
}

// Latches and contacts into the joints' pins, and all as events.
void AddEvents(const std::vector<data::RunEvent>& events, double end, double offset,
               report::Motion* motion) {
  std::map<std::string, report::MovingPin*> pins;
  for (report::MovingPin& pin : motion->pins) pins[pin.name] = &pin;
  for (const data::RunEvent& event : events) {
    const double at = event.t + offset;
    motion->events.push_back({at, event.kind + " " + event.where, -1});
    const auto pin = pins.find(event.where);
    if (pin == pins.end()) continue;
    auto& contacts = pin->second->contacts;
    if (event.kind == "latch") pin->second->latched = at;
    if (event.kind == "contact_start") contacts.emplace_back(at, end + offset);
    if (event.kind == "contact_end" && !contacts.empty()) contacts.back().second = at;
  }
}

void AddMarks(const data::Run& run, const std::vector<std::string>& marks, double offset,
              report::Motion* motion) {
  std::vector<double> t = run.t;
  for (double& time : t) time += offset;
  for (std::size_t m = 0; m < marks.size(); ++m) {
    const int x = run.Find(marks[m] + ".x"), y = run.Find(marks[m] + ".y");
    if (x < 0 || y < 0) continue;
    report::MovingMark mark;
    mark.name = marks[m];
    mark.t = t;
    mark.x = run.columns[static_cast<std::size_t>(x)];
    mark.y = run.columns[static_cast<std::size_t>(y)];
    mark.color = static_cast<int>(m);
    motion->marks.push_back(std::move(mark));
  }
}

}  // namespace

std::optional<report::Motion> MotionOfRun(const data::Run& run,
                                          const std::vector<std::string>& marks, double offset) {
  if (run.shape_t.size() < 2) return std::nullopt;
  report::Motion motion;
  motion.title = "The motion";
  motion.x = {"x", "m", false};
  motion.y = {"y", "m", false};
  for (const double t : run.shape_t) motion.t.push_back(t + offset);
  AddShapes(run, &motion);
  AddEvents(run.events, run.shape_t.back(), offset, &motion);
  AddMarks(run, marks, offset, &motion);
  return motion;
}

std::optional<report::Motion> MotionOfRun(const data::RunReader& run,
                                          const std::vector<std::string>& marks, double offset) {
  if (run.shape_times().size() < 2) return std::nullopt;
  return MotionOfRun(Thinned(run, marks), marks, offset);
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

std::optional<report::Motion> MotionOfMarks(const correlate::Comparison& c) {
  report::Motion motion;
  motion.title = "Both in motion";
  motion.note =
      "Discs are computed, rings measured, in the model's plane; between two samples they go "
      "straight.";
  motion.x = {"x", "m", false};
  motion.y = {"y", "m", false};
  AddCompared(c, false, &motion);
  AddCompared(c, true, &motion);
  for (const correlate::ModelEvent& latch : c.latches) {
    motion.events.push_back({latch.t + c.alignment.at.offset, "latch " + latch.where, -1});
  }
  if (!SpanFrames(&motion)) return std::nullopt;
  return motion;
}

std::optional<report::Motion> MotionOfBoth(const correlate::Comparison& c,
                                           std::optional<report::Motion> model) {
  if (!model) return MotionOfMarks(c);
  model->title = "Both in motion";
  model->note =
      "Lines and discs are simulated, rings measured, in the model's plane; between two measured "
      "samples a ring goes straight.";
  AddCompared(c, true, &*model);
  return model;
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
  // Strobed marks flash one after another: all that do within a frame are in the first.
  const double within = low + (high - low) / (kFrames - 1);
  for (const report::MovingMark& mark : motion->marks) {
    if (!mark.t.empty() && mark.t.front() < within) low = std::max(low, mark.t.front());
  }
  for (int f = 0; f < kFrames; ++f) motion->t.push_back(low + (high - low) * f / (kFrames - 1));
  return true;
}

}  // namespace unfurl::cli
