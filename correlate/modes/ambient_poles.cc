#include "correlate/modes/ambient_poles.h"

#include <algorithm>
#include <cmath>

#include "correlate/modes/modal_id.h"
#include "correlate/modes/turn.h"

namespace unfurl::correlate {

namespace {

StabilisationPole Seen(const SubspacePole& p) {
  StabilisationPole out;
  out.order = p.order;
  out.frequency = std::abs(p.pole) / kTau;
  out.damping = -p.pole.real() / std::abs(p.pole);
  return out;
}

// Half-widths of a mode's peak within which two poles are one: what they add to a spectrum differs
// by less than a part of as much. Heavily damped poles scatter by several per cent between orders.
constexpr double kSameWidth = 0.25;

// By how much frequencies of one pole may differ [Hz].
double Same(const StabilisationPole& p, const AmbientOptions& options) {
  return std::max(options.frequency_tolerance, kSameWidth * std::abs(p.damping)) * p.frequency;
}

// Whether the poles of the order before know this one.
void Compare(const std::vector<StableMode>& before, const AmbientOptions& options, StableMode* c) {
  constexpr double kSameDamping = 0.005;  // absolute: light dampings scatter by more than a part
  const StableMode* nearest = nullptr;
  for (const StableMode& b : before) {
    const bool alike = ModalAssurance(b.pole.shape, c->pole.shape) >= 1.0 - options.shape_tolerance;
    const double off = std::abs(b.seen.frequency - c->seen.frequency);
    if (off > Same(c->seen, options) || !alike) continue;
    if (nearest != nullptr && off >= std::abs(nearest->seen.frequency - c->seen.frequency))
      continue;
    nearest = &b;
  }
  if (nearest == nullptr) return;
  c->seen.stable_frequency = c->seen.stable_shape = true;
  c->seen.stable_damping = std::abs(nearest->seen.damping - c->seen.damping) <=
                           std::max(kSameDamping, std::max(options.damping_tolerance, kSameWidth) *
                                                      std::abs(c->seen.damping));
}

}  // namespace

PoleDiagram DiagramOf(const Subspace& subspace, double low, double high,
                      const AmbientOptions& options) {
  constexpr double kEdge = 0.1;  // of a part's ends: a mode there may scatter to either side
  PoleDiagram out;
  const auto most = std::min<Eigen::Index>(2 * (options.max_order / 2), subspace.most());
  for (Eigen::Index order = 2; order <= most; order += 2) {
    std::vector<StableMode> row;
    for (SubspacePole& p : subspace.Poles(order)) {
      StableMode c;
      c.seen = Seen(p);
      c.pole = std::move(p);
      const double f = c.seen.frequency;
      if (f < (1.0 - kEdge) * low || f > (1.0 + kEdge) * high ||
          std::abs(c.seen.damping) > options.max_damping) {
        continue;
      }
      if (!out.empty()) Compare(out.back(), options, &c);
      row.push_back(std::move(c));
    }
    out.push_back(std::move(row));
  }
  return out;
}

std::vector<PoleCluster> Clusters(const PoleDiagram& diagram, const AmbientOptions& options) {
  constexpr std::size_t kFewest = 4;  // stable poles
  std::vector<PoleCluster> clusters;
  for (const auto& row : diagram) {
    for (const StableMode& c : row) {
      if (!c.seen.stable()) continue;
      PoleCluster* home = nullptr;
      double nearest = Same(c.seen, options);
      for (PoleCluster& cluster : clusters) {
        const StableMode& last = *cluster.back();
        const double off = std::abs(last.seen.frequency - c.seen.frequency);
        if (last.seen.order == c.seen.order || off > nearest ||
            ModalAssurance(last.pole.shape, c.pole.shape) < 1.0 - options.shape_tolerance) {
          continue;
        }
        nearest = off;
        home = &cluster;
      }
      if (home == nullptr) home = &clusters.emplace_back();
      home->push_back(&c);
    }
  }
  const int last_order = 2 * static_cast<int>(diagram.size());
  std::erase_if(clusters, [&](const PoleCluster& c) {
    const double orders = 0.5 * (last_order - c.front()->seen.order) + 1.0;
    return c.size() < kFewest || static_cast<double>(c.size()) < options.persistence * orders;
  });
  return clusters;
}

}  // namespace unfurl::correlate
