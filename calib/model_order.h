#pragma once

#include <string>
#include <vector>

#include "calib/bundle.h"
#include "calib/observations.h"
#include "calib/refine.h"
#include "measure/lens/lens.h"

namespace unfurl::calib {

// Which of a lens model's sets of terms (measure::OrdersOf): an index into them, or
inline constexpr int kAutomaticOrder = -1;  // by cross-validation
inline constexpr int kFullOrder = -2;       // the one that fits start from (UsualOrderOf)
inline constexpr int kOrderByCamera = -3;   // each camera its own

// The priors with the terms that the order lacks held at zero; of each camera its own.
std::vector<CameraPrior> WithOrder(std::vector<CameraPrior> priors, int order);
std::vector<CameraPrior> WithOrders(std::vector<CameraPrior> priors,
                                    const std::vector<int>& by_camera);

// One order, fitted to all points and then without each part of them in turn.
struct OrderTrial {
  int order = 0;               // kOrderByCamera: see by_camera
  std::vector<int> by_camera;  // index into the orders of each
  // -log of how likely the left-out points' survey and readings were, less the same of the best
  // order; nats. It punishes error bars that are too narrow as it does those that are too wide.
  double loss = 0.0;  // [nat]
  // Left-out points, found from their readings, from the survey (RMS), and by how much their
  // readings contradict each other, in quadrature per reading to spare [m], [px].
  double held_out_rms = 0.0;
  double contradiction_px = 0.0;
  double largest_floor_px = 0.0;
  double seconds = 0.0;  // of the fit and its parts
  std::vector<CameraPrior> priors;
  RefinedBundle bundle;
};

/// Of the comparison of orders.
struct OrderOptions {
  int folds = 5;
  std::size_t workers = 0;  // 0: all cores; changes no result but `seconds`
  // What a richer model must gain to be taken [nats]: e^2 in likelihood.
  double gain = 2.0;
};

// Fits every order up to `whole`, that of the full fit, from its solution, whose gross errors stay
// left out, and says which to take: the simplest whose loss is within `gain` of the best. `trials`
// are in the order of measure::OrdersOf. Where the full fit says that cameras need different ones
// (OrdersByCamera), that is tried too, last, and taken where it gains `gain` over what all share.
struct OrderChoice {
  int taken = 0;  // index into trials
  std::vector<OrderTrial> trials;
};
OrderChoice ChooseOrder(const Observations& data, const std::vector<CameraPrior>& full_priors,
                        const RefinedBundle& full, int whole, const OrderOptions& options);

// For each camera the simplest order whose left-out terms the full fit does not miss: t^T C^-1 t of
// the terms, C their covariance, charged with 2 for each that is kept (Akaike), within 2 `gain` of
// the least.
std::vector<int> OrdersByCamera(const RefinedBundle& full, int whole, double gain);

// "cubic", or "pinhole, pinhole, cubic, pinhole".
std::string OrderName(const OrderTrial& trial);

// A fit of one order from the solution of the full one.
RefinedBundle FitOrder(const Observations& data, const std::vector<CameraPrior>& priors,
                       const RefinedBundle& full);

}  // namespace unfurl::calib
