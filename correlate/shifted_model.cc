#include "correlate/shifted_model.h"

#include <cmath>
#include <map>
#include <string>
#include <tuple>
#include <utility>

namespace unfurl::correlate {

namespace {

using Key = std::tuple<std::string, std::string, int>;  // kind, where, count

std::map<Key, double> TimesOf(const std::vector<ModelEvent>& events) {
  std::map<Key, double> out;
  std::map<std::pair<std::string, std::string>, int> count;
  for (const ModelEvent& e : events) out[{e.kind, e.where, ++count[{e.kind, e.where}]}] = e.t;
  return out;
}

bool KnownAt(const MarkMotion& motion, Eigen::Index i) {
  return motion.known.empty() || motion.known[static_cast<std::size_t>(i)] != 0;
}

}  // namespace

Prediction ShiftedModel::Evaluate(std::span<const double> theta, const Stamps& stamps) const {
  Prediction out = base_.Evaluate(theta, stamps);
  if (out.status != ModelStatus::kGood) return out;
  const Prediction from = from_->Evaluate({}, stamps), to = to_->Evaluate({}, stamps);
  for (std::size_t m = 0; m < out.marks.size(); ++m) {
    for (Eigen::Index i = 0; i < out.marks[m].p.cols(); ++i) {
      if (!KnownAt(from.marks[m], i) || !KnownAt(to.marks[m], i)) continue;
      out.marks[m].p.col(i) += to.marks[m].p.col(i) - from.marks[m].p.col(i);
      out.marks[m].v.col(i) += to.marks[m].v.col(i) - from.marks[m].v.col(i);
    }
  }
  for (std::size_t q = 0; q < out.quantities.size(); ++q) {
    Eigen::VectorXd& values = out.quantities[q].values;
    for (Eigen::Index i = 0; i < values.size(); ++i) {
      const double more = to.quantities[q].values(i) - from.quantities[q].values(i);
      if (std::isfinite(more)) values(i) += more;
    }
  }
  const std::map<Key, double> before = TimesOf(from_->events()), after = TimesOf(to_->events());
  std::map<std::pair<std::string, std::string>, int> count;
  for (ModelEvent& e : out.events) {
    const Key key{e.kind, e.where, ++count[{e.kind, e.where}]};
    const auto a = before.find(key), b = after.find(key);
    if (a != before.end() && b != after.end()) e.t += b->second - a->second;
  }
  return out;
}

}  // namespace unfurl::correlate
