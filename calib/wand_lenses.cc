#include "calib/wand_lenses.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/error.h"
#include "calib/wand_search.h"

namespace unfurl::calib {

data::LensModel RequireLenses(const std::vector<KnownLens>& known, const std::string& where,
                              WandData* data) {
  const data::LensModel model = known.front().camera.lens;
  data->pixels.resize(data->cameras.size(), 0);
  for (std::size_t j = 0; j < data->cameras.size(); ++j) {
    const KnownLens& lens = RequireLens(known, data->cameras[j], data->pixels[j], where);
    data->pixels[j] = lens.camera.pixels;
    if (lens.camera.lens == model) continue;
    throw Error(fmt::format("the lenses of cameras \"{}\" and \"{}\" are of two models",
                            known.front().camera.name, data->cameras[j]),
                where, "calibrate by a bar without --lenses, or by a survey with them");
  }
  return model;
}

double TakeLenses(const std::vector<KnownLens>& known, const BundleOptions& options, WandFit* fit) {
  WandFit mirror = *fit;
  MoveWand(Pose::Identity(), true, &mirror);
  double scale[2] = {}, cost[2] = {};
  WandFit* hands[2] = {fit, &mirror};
  for (int k = 0; k < 2; ++k) {
    hands[k]->richest.clear();
    for (std::size_t j = 0; j < hands[k]->priors.size(); ++j) {
      KnowLens(*FindLens(known, hands[k]->data.cameras[j]), &hands[k]->priors[j]);
    }
    scale[k] = RobustWand(options, hands[k]);
  }
  if (!std::isfinite(scale[0]) || !std::isfinite(scale[1])) {
    if (std::isfinite(scale[1])) std::swap(*fit, mirror);
    return std::min(scale[0], scale[1]);
  }
  // With the smaller floor: what the worse one needs a larger for is what tells them apart.
  const double floor = std::min(fit->weighting.floor_px[0], mirror.weighting.floor_px[0]);
  for (int k = 0; k < 2; ++k) {
    WandFit& hand = *hands[k];
    hand.weighting.floor_px.assign(hand.data.cameras.size(), floor);
    hand.summary =
        SolveWandBundle(hand.data, hand.priors, hand.weighting, options, &hand.state, &hand.system);
    cost[k] = hand.summary.cost;
  }
  fit->handed = mirror.handed = 2.0 * std::abs(cost[1] - cost[0]) > kPreferred;
  if (cost[1] < cost[0]) std::swap(*fit, mirror);
  return scale[cost[1] < cost[0] ? 1 : 0];
}

}  // namespace unfurl::calib
