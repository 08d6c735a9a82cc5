#pragma once

#include <string>
#include <vector>

#include "data/provenance.h"
#include "study/scene_cost.h"

namespace unfurl::cli {

/// Text of `unfurl cost SCENE`: the cheapest settings for every line, advice, every setting.
std::string CostText(const std::string& path, const std::string& name,
                     const study::SceneCost& cost);

/// Its page: the same with error against CPU time, a chart for each line.
void WriteCostPage(const std::string& path, const std::string& scene, const study::SceneCost& cost,
                   const data::Provenance& provenance);

}  // namespace unfurl::cli
