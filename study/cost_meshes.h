#pragma once

#include <string>
#include <vector>

#include "data/scene.h"

namespace unfurl::study {

/// How all beams of a scene are made.
struct CostMesh {
  /// Of one beam.
  struct Beam {
    data::BeamModel model = data::BeamModel::kSegments;
    int size = 0;  ///< segments, or shapes
  };
  std::vector<Beam> beams;       ///< by beam of the scene
  std::string words;             ///< "8 segments", "smooth, order 2"; empty: there is no beam
  int segments = 0;              ///< of every beam alike; 0: they differ, or are smooth
  int order = 0;                 ///< likewise
  std::vector<std::string> set;  ///< overrides that make it of the scene

  /// The scene with its beams so.
  data::Scene Of(data::Scene scene) const;
};

/// What a scene's beams can be made of.
struct CostMeshes {
  std::vector<CostMesh> asked;  ///< to be compared; one without words where there is no beam
  /// Meshes that go on to finer ones, coarsest first, whose limits are the continuum: segments,
  /// each twice as many; smooth beams, each two shapes more. Empty: there is no such model of the
  /// scene.
  std::vector<CostMesh> segments, smooth;
  std::string no_smooth;  ///< why there are no smooth beams
};

/// `segments` and `orders` of every beam; both empty: half of the scene's segments, as many, and
/// twice as many, and smooth beams of order 1 to 4. Throws Error for numbers out of their range, a
/// scene without beams where there are any, and orders of beams that cannot be smooth.
CostMeshes MeshesOf(const data::Scene& scene, const std::vector<int>& segments,
                    const std::vector<int>& orders);

/// Every beam's size times `factor`, of segments; more shapes by `factor`, of smooth beams.
CostMesh FinerMesh(const data::Scene& scene, const CostMesh& mesh);
/// Whether FinerMesh gives one that can be made.
bool HasFinerMesh(const CostMesh& mesh);

}  // namespace unfurl::study
