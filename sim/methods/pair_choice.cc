#include "sim/methods/pair_choice.h"

#include <algorithm>

namespace unfurl::sim {

bool PairChoice::Note(double h_lambda, double cost) {
  ++steps_;
  since_ += cost;
  told_ += (at_edge_ ? h_lambda < kNearNone : h_lambda > kNearEdge) ? 1 : 0;
  if (steps_ < kWindow) return false;
  const bool change = 2 * told_ > steps_ && (!at_edge_ || since_ > wait_);
  steps_ = told_ = 0;
  if (!change) return false;
  if (at_edge_) wait_ = std::min(2.0 * wait_, kLongestWait);
  at_edge_ = !at_edge_;
  since_ = 0.0;
  return true;
}

void PairChoice::TakeAtEdge() {
  at_edge_ = true;
  steps_ = told_ = 0;
  since_ = 0.0;
}

}  // namespace unfurl::sim
