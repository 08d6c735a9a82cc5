#pragma once

#include <vector>

#include "sim/model/model.h"

namespace unfurl::sim {

// The times at which a function of the model (a drive, motor or force) may jump or kink, in order:
// steps end there. Edges within some roundings of one another are one.
class Edges {
 public:
  Edges(const Model& model, double duration);

  // The next one; `duration` when there is none left [s].
  double next() const { return at_ < edges_.size() ? edges_[at_].first : duration_; }
  std::size_t count() const { return edges_.size(); }
  bool none_left() const { return at_ >= edges_.size(); }
  void Pass() { ++at_; }
  // Between the edge passed last and the next one, both left out. The end of the run is such: what
  // jumps there jumps after it.
  double after() const;
  double before() const;

 private:
  struct Edge {
    double first, last;  // of those that are one [s]
  };
  std::vector<Edge> edges_;
  std::size_t at_ = 0;
  double duration_;  // [s]
};

}  // namespace unfurl::sim
