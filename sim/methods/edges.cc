#include "sim/methods/edges.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace unfurl::sim {
namespace {

constexpr std::size_t kMostLikely = 256;  // edges of a run: room made at once
// Equal times by different expressions differ by that much.
constexpr double kSame = 4.0 * std::numeric_limits<double>::epsilon();

}  // namespace

Edges::Edges(const Model& model, double duration) : duration_(duration) {
  std::vector<double> all;
  all.reserve(kMostLikely);
  for (const Model::Function& f : model.functions) {
    const std::vector<double> some = f.function.Edges(duration);
    all.insert(all.end(), some.begin(), some.end());
  }
  std::sort(all.begin(), all.end());
  edges_.reserve(std::max(all.size(), kMostLikely));
  for (const double t : all) {
    if (!edges_.empty() && t - edges_.back().last <= kSame * t) {
      edges_.back().last = t;
    } else {
      edges_.push_back({t, t});
    }
  }
}

double Edges::after() const {
  return at_ == 0 ? -HUGE_VAL : std::nextafter(edges_[at_ - 1].last, HUGE_VAL);
}

double Edges::before() const { return std::nextafter(next(), -HUGE_VAL); }

}  // namespace unfurl::sim
