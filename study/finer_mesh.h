#pragma once

#include <string>
#include <vector>

#include "data/scene.h"
#include "data/study.h"

namespace unfurl::study {

/// A scene's mesh made finer, so that a fit can tell what the mesh's own error does to it.
struct FinerMesh {
  std::vector<std::string> set;  ///< overrides "beam.NAME.segments=12"; empty: there is none
  /// (finer - coarse) times this is the estimate of the coarse mesh's error [-]. Richardson: with r
  /// the ratio of segment lengths and q the order, r^q / (r^q - 1).
  double factor = 1.0;
};

/// As the study says. Where it names no keys: half as many segments again on every beam, rounded
/// up, and two modes more on every smooth (Kirchhoff) beam, all as far as a scene allows. The
/// factor is then that of the beam whose error falls least.
FinerMesh FinerMeshOf(const data::StudyMeshCheck& check, const std::vector<data::SceneBeam>& beams);

}  // namespace unfurl::study
