#include "report/space.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/statistics.h"
#include "report/chart.h"
#include "report/color_scale.h"
#include "report/escape.h"
#include "report/far_origin.h"
#include "report/space_parts.h"

namespace unfurl::report {

double Length(const Place& v) { return std::hypot(v[0], v[1], v[2]); }

ColorScale ScaleFor(const SpaceCloud& cloud) {
  std::vector<double> values;
  values.reserve(cloud.points.size());
  for (const SpacePoint& point : cloud.points) values.push_back(point.value);
  return ScaleOf(values, cloud.value.log, cloud.range.low, cloud.range.high);
}

ColorScale ScaleFor(const SpaceEllipsoids& set) {
  std::vector<double> values;
  values.reserve(set.ellipsoids.size());
  for (const SpaceEllipsoid& one : set.ellipsoids) values.push_back(one.value);
  return ScaleOf(values, set.value.log, set.range.low, set.range.high);
}

void CheckSpace(const Space& space) {
  const auto fail = [&](const std::string& what, const char* remedy) {
    throw Error(what, "report: space \"" + space.title + "\"", remedy);
  };
  const auto finite = [&](const Place& at) {
    if (!std::isfinite(Length(at))) fail("a place that is not finite", "leave it out");
  };
  finite(space.low);
  finite(space.high);
  for (std::size_t k = 0; k < 3; ++k) {
    if (!(space.low[k] < space.high[k])) fail("a box without extent", "give low below high");
  }
  constexpr std::size_t kMostEyes = 32;  // bits of SpacePoint::seen
  if (space.eyes.size() > kMostEyes) fail("more than 32 eyes", "leave some out");
  for (const SpaceEye& eye : space.eyes) {
    finite(eye.at);
    finite(eye.across);
    for (const Place& corner : eye.field) finite(corner);
    if (!eye.field.empty() && eye.field.size() < 3) {
      fail("a field of fewer than three corners", "give its outline, or none");
    }
  }
  for (const SpaceCloud& cloud : space.clouds) {
    if (cloud.points.size() > kMostSpacePoints) {
      fail(fmt::format("{} points in \"{}\"", cloud.points.size(), cloud.name), "choose fewer");
    }
    for (const SpacePoint& point : cloud.points) finite(point.at);
  }
  for (const SpaceEllipsoids& set : space.ellipsoids) {
    for (const SpaceEllipsoid& one : set.ellipsoids) {
      finite(one.at);
      for (const Place& axis : one.axes) finite(axis);
    }
  }
}

double Magnification(const Space& space) {
  constexpr double kSpan = 0.3;  // of the distance to the next: neighbours do not touch
  std::vector<double> longest;
  std::size_t most = 0;
  for (const SpaceEllipsoids& set : space.ellipsoids) {
    most = std::max(most, set.ellipsoids.size());
    for (const SpaceEllipsoid& one : set.ellipsoids) {
      longest.push_back(std::max({Length(one.axes[0]), Length(one.axes[1]), Length(one.axes[2])}));
    }
  }
  if (most == 0) return 1.0;
  double volume = 1.0;
  for (std::size_t k = 0; k < 3; ++k) volume *= space.high[k] - space.low[k];
  const double wanted =
      kSpan * std::cbrt(volume / static_cast<double>(most)) / Quantile(longest, 0.5);
  if (!std::isfinite(wanted) || wanted <= 1.0) return 1.0;
  const double decade = std::pow(10.0, std::floor(std::log10(wanted)));
  for (const double factor : {5.0, 2.0}) {
    if (factor * decade <= wanted) return factor * decade;
  }
  return decade;
}

namespace {

using Json = nlohmann::ordered_json;

void Put(const Place& at, std::vector<double>* to) { to->insert(to->end(), at.begin(), at.end()); }

Json ScaleJson(const Axis& axis, const ColorScale& scale) {
  return {{"title", AxisTitle(axis)},
          {"unit", axis.unit == "1" ? "" : axis.unit},
          {"low", scale.low},
          {"high", scale.high},
          {"log", scale.log}};
}

Json CloudJson(const SpaceCloud& cloud) {
  std::vector<double> at, values;
  Json labels = Json::array(), seen = Json::array(), refused = Json::array();
  for (const SpacePoint& point : cloud.points) {
    Put(point.at, &at);
    values.push_back(point.value);
    labels.push_back(point.label);
    seen.push_back(point.seen);
    refused.push_back(point.refused);
  }
  return {{"name", cloud.name},
          {"scale", ScaleJson(cloud.value, ScaleFor(cloud))},
          {"at", Floats(at)},
          {"values", Floats(values)},
          {"labels", std::move(labels)},
          {"seen", std::move(seen)},
          {"refused", std::move(refused)}};
}

Json EllipsoidsJson(const SpaceEllipsoids& set) {
  std::vector<double> at, axes, values;
  for (const SpaceEllipsoid& one : set.ellipsoids) {
    Put(one.at, &at);
    for (const Place& axis : one.axes) Put(axis, &axes);
    values.push_back(one.value);
  }
  return {{"name", set.name},
          {"scale", ScaleJson(set.value, ScaleFor(set))},
          {"at", Floats(at)},
          {"axes", Floats(axes)},
          {"values", Floats(values)}};
}

std::string SpaceJson(const Space& space) {
  Json json = {{"unit", space.unit},
               {"low", space.low},
               {"high", space.high},
               {"magnification", Magnification(space)}};
  json["colors"] = Json::array();
  constexpr int kColors = 32;  // of the scale, between which the view goes straight
  for (int k = 0; k <= kColors; ++k) {
    json["colors"].push_back(ScaleColor(static_cast<double>(k) / kColors));
  }
  for (const char* list : {"eyes", "clouds", "ellipsoids", "lines"}) json[list] = Json::array();
  for (const SpaceEye& eye : space.eyes) {
    json["eyes"].push_back(
        {{"name", eye.name}, {"at", eye.at}, {"field", eye.field}, {"across", eye.across}});
  }
  for (const SpaceCloud& cloud : space.clouds) json["clouds"].push_back(CloudJson(cloud));
  for (const SpaceEllipsoids& set : space.ellipsoids) {
    json["ellipsoids"].push_back(EllipsoidsJson(set));
  }
  for (const SpaceLine& line : space.lines) {
    std::vector<double> at;
    for (const Place& point : line.points) Put(point, &at);
    json["lines"].push_back(
        {{"name", line.name}, {"color", PaletteColor(line.color)}, {"at", Floats(at)}});
  }
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

template <typename Sets>
std::string Choice(const char* label, const char* part, const Sets& sets) {
  if (sets.empty()) return {};
  std::string html = fmt::format("<label>{} <select class=\"{}\">", label, part);
  for (std::size_t k = 0; k < sets.size(); ++k) {
    html += fmt::format("<option value=\"{}\">{}</option>", k, EscapeHtml(sets[k].name));
  }
  return html + "<option value=\"-1\">none</option></select></label>";
}

// What is shown, above the view.
std::string Layers(const Space& space) {
  std::string html = "<div class=\"controls\">" + Choice("points", "clouds", space.clouds) +
                     Choice("ellipsoids", "sets", space.ellipsoids);
  if (!space.ellipsoids.empty()) {
    html += "<label>one sigma, drawn <select class=\"magnify\"></select></label>";
  }
  const auto check = [&](const char* part, const char* words) {
    html += fmt::format("<label><input type=\"checkbox\" class=\"{}\" checked> {}</label>", part,
                        words);
  };
  const bool fields = std::any_of(space.eyes.begin(), space.eyes.end(),
                                  [](const SpaceEye& eye) { return !eye.field.empty(); });
  if (fields) check("fields", "fields of view");
  if (!space.lines.empty()) check("curves", "lines");
  return html + "</div>\n";
}

// Seen from a place of its own, which the note tells, where it is far from the frame's.
Space AboutItself(Space space) {
  Place origin{};
  for (std::size_t k = 0; k < 3; ++k) origin[k] = FarOrigin(space.low[k], space.high[k]);
  if (Length(origin) == 0.0) return space;
  const auto move = [&](Place* at) {
    for (std::size_t k = 0; k < 3; ++k) (*at)[k] -= origin[k];
  };
  move(&space.low);
  move(&space.high);
  for (SpaceEye& eye : space.eyes) {
    move(&eye.at);
    for (Place& corner : eye.field) move(&corner);
  }
  for (SpaceCloud& cloud : space.clouds) {
    for (SpacePoint& point : cloud.points) move(&point.at);
  }
  for (SpaceEllipsoids& set : space.ellipsoids) {
    for (SpaceEllipsoid& one : set.ellipsoids) move(&one.at);
  }
  for (SpaceLine& line : space.lines) {
    for (Place& point : line.points) move(&point);
  }
  space.note +=
      fmt::format("{}Axes count from ({:.0f}, {:.0f}, {:.0f}) {}.", space.note.empty() ? "" : " ",
                  origin[0], origin[1], origin[2], space.unit);
  return space;
}

}  // namespace

std::string SpaceHtml(const Space& of, const std::string& id) {
  CheckSpace(of);
  const Space space = AboutItself(of);
  std::string html = fmt::format("<figure class=\"panel space\" id=\"{}\">\n", id);
  html += "<h3>" + EscapeHtml(space.title) + "</h3>\n";
  if (!space.note.empty()) html += "<p class=\"note\">" + EscapeHtml(space.note) + "</p>\n";
  html += Layers(space);
  html += fmt::format(
      "<div class=\"view\"><canvas tabindex=\"0\" role=\"img\" aria-label=\"{}; arrows turn, plus "
      "and minus zoom, n and p go to the next and previous point, Home goes back\"></canvas>"
      "<div class=\"tags\" aria-hidden=\"true\"></div></div>\n<div class=\"scales\"></div>\n",
      EscapeHtml(space.title));
  html += "<div class=\"controls\">";
  if (!space.clouds.empty()) {
    html +=
        "<label class=\"wide\">point <input type=\"range\" class=\"scrub\" min=\"0\" max=\"0\" "
        "step=\"1\" value=\"0\"></label>";
  }
  html +=
      "<button type=\"button\" class=\"home\">Turn back</button>"
      "<button type=\"button\" class=\"still-button\">Still</button></div>\n"
      "<output class=\"chosen\"></output>\n";
  html += "<div class=\"paths still\">" + SpaceSvg(space) + "</div>\n";
  html +=
      fmt::format("<script type=\"application/json\" class=\"space-data\" data-plot=\"{}\">", id);
  return html + EscapeJsonForScript(SpaceJson(space)) + "</script>\n</figure>\n";
}

}  // namespace unfurl::report
