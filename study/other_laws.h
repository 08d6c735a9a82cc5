#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "data/scene.h"
#include "study/scene_model.h"

namespace unfurl::study {

/// A law of loss that a joint lacks beside one that it has, and how a scene gets some of it.
struct OtherLaw {
  std::string name;              ///< "dry friction in hinge"
  std::string unit;              ///< of `amount`
  double amount = 0.0;           ///< how much of it the scene gets [unit]
  std::vector<std::string> set;  ///< overrides that do it
};

/// Which law of loss a joint has, a fit of another one hardly shows: viscous damping in place of
/// dry friction is less where the swings are large and more where they are small. For each joint
/// that has one of viscous damping, quadratic damping and dry friction (pins in slots and driven
/// ones left out), those that it lacks, of as much as takes a hundredth of the motion's energy
/// over the record: seen by any record, and hardly more than its first order.
///
/// `model`: of the scene, run once at `theta` for `duration` [s]. One that does not run, or in
/// which a joint does not move, has no other laws.
std::vector<OtherLaw> OtherLawsOf(const std::vector<data::SceneJoint>& joints,
                                  const SceneModel& model, std::span<const double> theta,
                                  double duration);

}  // namespace unfurl::study
