#include "report/motion.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "report/chart.h"
#include "report/escape.h"

namespace unfurl::report {
namespace {

using Json = nlohmann::ordered_json;

// Numbers of all lines together: 1.2 MB, 1.6 MB as text.
constexpr std::size_t kMostNumbers = 300'000;
constexpr std::size_t kFewestPoints = 9;    // of a line: it still shows three half waves
constexpr std::size_t kMostSamples = 1500;  // of a mark: as many as a screen has columns

// `points` of each of `frames`.
std::vector<double> Thinned(const std::vector<double>& xy, std::size_t points_before,
                            const std::vector<std::size_t>& frames,
                            const std::vector<std::size_t>& points) {
  std::vector<double> out;
  out.reserve(2 * frames.size() * points.size());
  for (const std::size_t f : frames) {
    for (const std::size_t p : points) {
      const std::size_t at = 2 * (f * points_before + p);
      out.push_back(xy[at]);
      out.push_back(xy[at + 1]);
    }
  }
  return out;
}

void Check(const Motion& motion) {
  const auto fail = [&](const std::string& what, const std::string& name) {
    throw Error(what, "report: motion \"" + motion.title + "\", " + name,
                "give x and y of every point for every frame");
  };
  if (motion.t.size() < 2) fail("fewer than two frames", "t");
  for (const MovingLine& line : motion.lines) {
    if (line.xy.size() != 2 * line.points * motion.t.size()) fail("wrong length", line.name);
  }
  for (const MovingPin& pin : motion.pins) {
    if (pin.xy.size() != 2 * motion.t.size()) fail("wrong length", pin.name);
  }
  for (const MovingMark& mark : motion.marks) {
    if (mark.x.size() != mark.t.size() || mark.y.size() != mark.t.size()) {
      fail("wrong length", mark.name);
    }
  }
}

// Smallest and largest x and y of everything, with a margin; never empty.
struct Box {
  double low[2] = {HUGE_VAL, HUGE_VAL}, high[2] = {-HUGE_VAL, -HUGE_VAL};
  void Add(int axis, double value) {
    if (!std::isfinite(value)) return;
    low[axis] = std::min(low[axis], value);
    high[axis] = std::max(high[axis], value);
  }
  void Add(const std::vector<double>& xy) {
    for (std::size_t i = 0; i < xy.size(); ++i) Add(static_cast<int>(i % 2), xy[i]);
  }
  Json Margined() const {
    constexpr double kMargin = 0.06;  // of the longer side: marks' discs and contact rings fit in
    const double side = std::max({high[0] - low[0], high[1] - low[1], 1e-9 * std::abs(high[0])});
    const double pad = side > 0.0 ? kMargin * side : 1.0;
    return {low[0] - pad, high[0] + pad, low[1] - pad, high[1] + pad};
  }
};

Json MarkJson(const MovingMark& mark) {
  std::vector<double> t, xy, steps;
  for (const std::size_t i : EvenlyChosen(mark.t.size(), kMostSamples)) {
    if (!std::isfinite(mark.x[i]) || !std::isfinite(mark.y[i])) continue;
    if (!t.empty()) steps.push_back(mark.t[i] - t.back());
    t.push_back(mark.t[i]);
    xy.push_back(mark.x[i]);
    xy.push_back(mark.y[i]);
  }
  std::nth_element(steps.begin(), steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2),
                   steps.end());
  return {{"name", mark.name},
          {"measured", mark.measured},
          {"color", PaletteColor(mark.color)},
          {"step", steps.empty() ? 0.0 : steps[steps.size() / 2]},
          {"t", Floats(t)},
          {"xy", Floats(xy)}};
}

// How many points of a line and how many frames are kept.
struct Budget {
  std::size_t points = 0, frames = 0;
};

Budget BudgetFor(const Motion& motion) {
  std::size_t all = motion.pins.size();
  for (const MovingLine& line : motion.lines) all += line.points;
  Budget budget{kMostNumbers, motion.t.size()};
  if (2 * all * budget.frames <= kMostNumbers) return budget;
  const std::size_t lines = std::max<std::size_t>(1, motion.lines.size());
  budget.points = std::max(kFewestPoints, kMostNumbers / (2 * budget.frames * lines));
  all = motion.pins.size();
  for (const MovingLine& line : motion.lines) all += std::min(line.points, budget.points);
  budget.frames = std::clamp<std::size_t>(kMostNumbers / (2 * std::max<std::size_t>(1, all)), 2,
                                          motion.t.size());
  return budget;
}

std::string MotionJson(const Motion& motion) {
  Box box;
  for (const MovingLine& line : motion.lines) box.Add(line.xy);
  for (const MovingPin& pin : motion.pins) box.Add(pin.xy);
  for (const MovingMark& mark : motion.marks) {
    for (const double x : mark.x) box.Add(0, x);
    for (const double y : mark.y) box.Add(1, y);
  }
  const Budget budget = BudgetFor(motion);
  const std::vector<std::size_t> frames = EvenlyChosen(motion.t.size(), budget.frames);
  std::vector<double> t;
  t.reserve(frames.size());
  for (const std::size_t f : frames) t.push_back(motion.t[f]);
  Json json = {{"x", AxisTitle(motion.x)}, {"y", AxisTitle(motion.y)}, {"group", "time"},
               {"loops", motion.loops},    {"box", box.Margined()},    {"t", Floats(t)}};
  for (const char* list : {"lines", "pins", "marks", "events"}) json[list] = Json::array();
  for (const MovingLine& line : motion.lines) {
    // The star of a body goes to its centre and back: no point of it may be left out.
    const bool beam = line.kind == MovingLine::Kind::kBeam;
    const auto points = EvenlyChosen(line.points, beam ? budget.points : line.points);
    json["lines"].push_back({{"name", line.name},
                             {"beam", beam},
                             {"points", points.size()},
                             {"xy", Floats(Thinned(line.xy, line.points, frames, points))}});
  }
  for (const MovingPin& pin : motion.pins) {
    Json contacts = Json::array();
    for (const auto& [from, to] : pin.contacts) contacts.push_back({from, to});
    json["pins"].push_back({{"name", pin.name},
                            {"latched", pin.latched},  // NaN is written as null
                            {"contacts", std::move(contacts)},
                            {"xy", Floats(Thinned(pin.xy, 1, frames, {0}))}});
  }
  for (const MovingMark& mark : motion.marks) json["marks"].push_back(MarkJson(mark));
  for (const Marker& event : motion.events) {
    json["events"].push_back({{"x", event.x}, {"label", event.label}});
  }
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::string Legend(const Motion& motion) {
  if (!motion.legend) return {};
  std::string html = "<div class=\"legend\">";
  // Of more marks a colour tells no longer which it is; the pointer does.
  constexpr std::size_t kMostKeys = 16;  // each of eight colours as a ring and a disc
  if (motion.marks.size() > kMostKeys) {
    html += fmt::format("<span class=\"key\">{} marks; the pointer names them</span>",
                        motion.marks.size());
  }
  for (const MovingMark& mark : motion.marks) {
    if (motion.marks.size() > kMostKeys) break;
    html += fmt::format(
        "<span class=\"key\"><svg class=\"swatch\" width=\"14\" height=\"14\" "
        "aria-hidden=\"true\"><circle cx=\"7\" cy=\"7\" r=\"{}\" fill=\"{}\" stroke=\"{}\" "
        "stroke-width=\"2\"/></svg>{}</span>",
        mark.measured ? 5 : 4, mark.measured ? "none" : PaletteColor(mark.color),
        PaletteColor(mark.color), EscapeHtml(mark.name));
  }
  if (!motion.pins.empty()) {
    html +=
        "<span class=\"key\">joint: open \u25cb, latched \u25cf, a ring while its stop touches"
        "</span>";
  }
  return html + "</div>\n";
}

}  // namespace

std::vector<std::size_t> EvenlyChosen(std::size_t count, std::size_t most) {
  std::vector<std::size_t> out;
  const std::size_t kept = std::min(count, std::max<std::size_t>(most, 2));
  for (std::size_t k = 0; k < kept; ++k) {
    out.push_back(kept > 1 ? k * (count - 1) / (kept - 1) : 0);
  }
  return out;
}

std::string MotionHtml(const Motion& motion, const std::string& id) {
  Check(motion);
  std::string html = fmt::format("<figure class=\"panel motion\" id=\"{}\">\n", id);
  html += "<h3>" + EscapeHtml(motion.title) + "</h3>\n";
  if (!motion.note.empty()) html += "<p class=\"note\">" + EscapeHtml(motion.note) + "</p>\n";
  html += Legend(motion);
  html += fmt::format(
      "<canvas tabindex=\"0\" role=\"img\" aria-label=\"{}; space plays, arrows step, n and p go "
      "to the next and previous event\"></canvas>\n",
      EscapeHtml(motion.title));
  const char* steps = motion.events.empty() ? " hidden" : "";
  html += fmt::format(
      "<div class=\"controls\"><button type=\"button\" class=\"play\">\u25b6 Play</button>"
      "<button type=\"button\" class=\"previous\"{0}>\u25c2 event</button>"
      "<button type=\"button\" class=\"next\"{0}>event \u25b8</button>"
      "<input type=\"range\" class=\"scrub\" min=\"0\" max=\"1\" step=\"any\" value=\"0\" "
      "aria-label=\"time\"><output class=\"clock\"></output>"
      "<label>speed <select class=\"speed\"></select></label>",
      steps);
  const bool bends = std::any_of(motion.lines.begin(), motion.lines.end(), [](const auto& line) {
    return line.kind == MovingLine::Kind::kBeam;
  });
  html += fmt::format("<label{}>bending <select class=\"bending\">", bends ? "" : " hidden");
  for (const int scale : {1, 2, 5, 10, 20, 50, 100}) {
    html += fmt::format("<option value=\"{}\">\u00d7{}</option>", scale, scale);
  }
  html +=
      "</select></label><label><input type=\"checkbox\" class=\"trails\" checked> trails</label>"
      "<button type=\"button\" class=\"still\">Still</button>"
      "<button type=\"button\" class=\"film\">Film</button></div>\n";
  html +=
      fmt::format("<script type=\"application/json\" class=\"motion-data\" data-plot=\"{}\">", id);
  html += EscapeJsonForScript(MotionJson(motion)) + "</script>\n</figure>\n";
  return html;
}

}  // namespace unfurl::report
