#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "data/scene.h"
#include "sim/model/coordinate.h"
#include "sim/model/rigid_bodies.h"

namespace unfurl::sim {

struct Model;

// What a scene asks to be located in time: a quantity crosses a level. Quantities are those of the
// run's columns that follow from the state: JOINT.theta, .theta_rate, .travel, .travel_rate, .x,
// .y; BODY.x, .y, .theta, .vx, .vy, .omega; the same of a beam (means of its segments); MARK.x, .y,
// .vx, .vy.
class Watches {
 public:
  struct Point {
    int body;
    double px, py;  // [m]
    double weight;  // [-]
    int axis;       // 0 x, 1 y
    bool velocity;
  };
  struct Watch {
    std::string name, quantity;
    double level = 0.0;                  // [of the quantity]
    bool rising = true, falling = true;  // which crossings count
    bool stop = false;                   // the run ends there
    // The value is constant + sum of weight * entry of the state + sum of weight * a coordinate (or
    // velocity) of a point that moves with a body.
    double constant = 0.0;  // [of the quantity]
    std::vector<std::pair<int, double>> terms;
    std::vector<Point> points;
    std::optional<Coordinate> travel;  // plus the travel of a joint, or its rate
    bool travel_rate = false;
    std::vector<int> entries;  // of the state that it takes
    bool Linear() const { return points.empty() && !travel; }
  };

  Watches() = default;
  // Throws Error naming the nearest quantity for one that the model does not have.
  Watches(const data::Scene& scene, const Model& model);

  int count() const { return static_cast<int>(watches_.size()); }
  const Watch& at(int k) const { return watches_[k]; }
  // Value less level. Reads the watch's entries of `y` only.
  double Beyond(int k, const StateIndex& index, const double* y) const;

 private:
  std::vector<Watch> watches_;
};

}  // namespace unfurl::sim
