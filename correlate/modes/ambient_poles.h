#pragma once

#include <vector>

#include "correlate/modes/ambient.h"
#include "correlate/modes/subspace.h"

namespace unfurl::correlate {

struct StableMode {
  SubspacePole pole;
  StabilisationPole seen;
};

/// Poles by order, each with what the order before knows of it.
using PoleDiagram = std::vector<std::vector<StableMode>>;
/// Orders from 2 on; poles within the band [Hz] and a little beyond, of no more damping than
/// options.max_damping.
PoleDiagram DiagramOf(const Subspace& subspace, double low, double high,
                      const AmbientOptions& options);

/// Poles that stand for one mode, by rising order, one of an order at most.
using PoleCluster = std::vector<const StableMode*>;
std::vector<PoleCluster> Clusters(const PoleDiagram& diagram, const AmbientOptions& options);

}  // namespace unfurl::correlate
