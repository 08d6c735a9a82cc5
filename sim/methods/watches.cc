#include "sim/methods/watches.h"

#include <fmt/format.h>

#include <cmath>
#include <map>

#include "base/error.h"
#include "base/text.h"
#include "sim/model/model.h"

namespace unfurl::sim {
namespace {

using Watch = Watches::Watch;

Watch PointWatch(const StateIndex& i, const MovingPoint& point, int axis, bool velocity) {
  Watch w;
  const bool two = point.other_body >= 0;
  const double share = point.other_share;
  w.points.push_back({point.body, point.px, point.py, 1.0 - share, axis, velocity});
  if (two) w.points.push_back({point.other_body, point.other_px, 0.0, share, axis, velocity});
  for (const Watches::Point& p : w.points) {
    w.entries.push_back((velocity ? 3 * i.n : 0) + (axis == 0 ? i.x(p.body) : i.y(p.body)));
    w.entries.push_back(i.theta(p.body));
    if (velocity) w.entries.push_back(i.omega(p.body));
  }
  return w;
}

Watch TravelWatch(const StateIndex& i, const Coordinate& coordinate, bool rate) {
  Watch w;
  w.travel = coordinate;
  w.travel_rate = rate;
  for (const int body : {coordinate.hinge.inner, coordinate.hinge.outer}) {
    for (int block = 0; block < (rate ? 6 : 3); ++block) w.entries.push_back(block * i.n + body);
  }
  return w;
}

Watch LinearWatch(std::vector<std::pair<int, double>> terms, double constant = 0.0) {
  Watch w;
  w.terms = std::move(terms);
  w.constant = constant;
  for (const auto& term : w.terms) w.entries.push_back(term.first);
  return w;
}

// Everything that can be watched, by name.
std::map<std::string, Watch> Quantities(const Model& model) {
  const StateIndex& i = model.index;
  std::map<std::string, Watch> known;
  const auto add_point = [&](const std::string& name, const MovingPoint& point, bool rates) {
    known[name + ".x"] = PointWatch(i, point, 0, false);
    known[name + ".y"] = PointWatch(i, point, 1, false);
    if (!rates) return;
    known[name + ".vx"] = PointWatch(i, point, 0, true);
    known[name + ".vy"] = PointWatch(i, point, 1, true);
  };
  for (const Model::Joint& joint : model.joints) {
    const Hinge& h = joint.coordinate.hinge;
    if (joint.coordinate.travel) {
      known[joint.name + ".travel"] = TravelWatch(i, joint.coordinate, false);
      known[joint.name + ".travel_rate"] = TravelWatch(i, joint.coordinate, true);
    }
    known[joint.name + ".theta"] =
        LinearWatch({{i.theta(h.outer), h.sign}, {i.theta(h.inner), -h.sign}}, -h.sign * h.zero);
    known[joint.name + ".theta_rate"] =
        LinearWatch({{i.omega(h.outer), h.sign}, {i.omega(h.inner), -h.sign}});
    add_point(joint.name, joint.pin, false);
  }
  for (const Model::Mark& mark : model.marks) add_point(mark.name, mark.point, true);
  for (const Model::Body& body : model.bodies) {
    add_point(body.name, body.centre, true);
    known[body.name + ".theta"] = LinearWatch({{i.theta(body.centre.body), 1.0}}, body.angle);
    known[body.name + ".omega"] = LinearWatch({{i.omega(body.centre.body), 1.0}});
  }
  for (const Model::Beam& beam : model.beams) {
    constexpr const char* kColumns[6] = {".x", ".y", ".theta", ".vx", ".vy", ".omega"};
    for (int block = 0; block < 6; ++block) {
      std::vector<std::pair<int, double>> terms;
      terms.reserve(static_cast<std::size_t>(beam.segments));
      for (int k = 0; k < beam.segments; ++k) {
        terms.emplace_back(block * i.n + beam.first + k, 1.0 / beam.segments);
      }
      known[beam.name + kColumns[block]] = LinearWatch(std::move(terms));
    }
  }
  return known;
}

}  // namespace

Watches::Watches(const data::Scene& scene, const Model& model) {
  if (scene.watches.empty()) return;
  const std::map<std::string, Watch> known = Quantities(model);
  for (const data::SceneWatch& asked : scene.watches) {
    const auto found = known.find(asked.quantity);
    if (found == known.end()) {
      std::vector<std::string> names;
      names.reserve(known.size());
      for (const auto& [name, watch] : known) names.push_back(name);
      const std::string nearest = NearestName(asked.quantity, names);
      throw Error(fmt::format("there is no quantity \"{}\" to watch", asked.quantity),
                  asked.where + ".when",
                  nearest.empty() ? "use JOINT.theta, BODY.x, MARK.y or the like"
                                  : "did you mean \"" + nearest + "\"?");
    }
    Watch watch = found->second;
    watch.name = asked.name;
    watch.quantity = asked.quantity;
    watch.level = asked.level;
    watch.rising = asked.direction != data::SceneWatch::Direction::kFalling;
    watch.falling = asked.direction != data::SceneWatch::Direction::kRising;
    watch.stop = asked.stop;
    watches_.push_back(std::move(watch));
  }
}

namespace {

// The travel or its rate, from the two bodies' entries alone.
double TravelOf(Coordinate c, bool rate, const StateIndex& i, const double* y) {
  const int bodies[2] = {c.hinge.inner, c.hinge.outer};
  double block[6][2], cosine[2], sine[2];
  for (int side = 0; side < 2; ++side) {
    for (int b = 0; b < (rate ? 6 : 3); ++b) block[b][side] = y[b * i.n + bodies[side]];
    cosine[side] = std::cos(block[2][side]);
    sine[side] = std::sin(block[2][side]);
  }
  c.hinge.inner = 0;
  c.hinge.outer = 1;
  const Motion m{0.0, block[0], block[1], block[2], block[3], block[4], block[5], cosine, sine};
  return rate ? c.Rate(m) : c.Value(m);
}

}  // namespace

double Watches::Beyond(int k, const StateIndex& i, const double* y) const {
  const Watch& w = watches_[k];
  double value = w.constant - w.level;
  for (const auto& [entry, weight] : w.terms) value += weight * y[entry];
  if (w.travel) value += TravelOf(*w.travel, w.travel_rate, i, y);
  for (const Point& p : w.points) {
    const double c = std::cos(y[i.theta(p.body)]), s = std::sin(y[i.theta(p.body)]);
    const double x = c * p.px - s * p.py, yy = s * p.px + c * p.py;  // of the point from the centre
    if (p.velocity) {
      const double omega = y[i.omega(p.body)];
      value +=
          p.weight * (p.axis == 0 ? y[i.vx(p.body)] - omega * yy : y[i.vy(p.body)] + omega * x);
    } else {
      value += p.weight * (p.axis == 0 ? y[i.x(p.body)] + x : y[i.y(p.body)] + yy);
    }
  }
  return value;
}

}  // namespace unfurl::sim
