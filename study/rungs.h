#pragma once

#include <string>
#include <vector>

#include "data/scene.h"
#include "data/study.h"

namespace unfurl::study {

/// One version of a scene on the ladder that a fit climbs.
struct SceneRung {
  std::string name;              ///< "16 segments"
  std::vector<std::string> set;  ///< overrides "beam.NAME.segments=16"
  double error = 0.0;            ///< relative to the first rung's, as theory has it [-]; 0: unknown
};

/// The rungs, coarse to fine, as the study says; one or none: there is no ladder. Where it names
/// none: the scene as it is, half as many segments again on every beam, and twice as many, rounded
/// up; smooth (Kirchhoff) beams take one mode more on each rung; all as far as a scene allows.
std::vector<SceneRung> RungsOf(const data::StudyFidelity& fidelity,
                               const std::vector<data::SceneBeam>& beams);

}  // namespace unfurl::study
