#include "calib/model_order.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>

#include "base/dense.h"
#include "base/statistics.h"
#include "base/worker_pool.h"
#include "calib/common_error.h"
#include "calib/parameters.h"
#include "measure/camera_model.h"

namespace unfurl::calib {
namespace {

double Now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// The cameras alone, at the points where the full model has them: their lens error is in the scale
// of the loss at first, as in the search for a first guess.
double Resect(const Observations& data, const CameraPrior& prior, const Weighting& weighting,
              int camera, const Eigen::Matrix3Xd& points, data::RigCamera* out) {
  Observations own = SelectCamera(data, camera);
  own.p = points;
  Weighting mine = EqualWeighting(own, 0.0);
  for (std::size_t k = 0; k < data.readings.size(); ++k) {
    if (data.readings[k].camera == camera) mine.use_reading.push_back(weighting.Uses(k) ? 1 : 0);
  }
  BundleOptions options;
  options.fix_points = true;
  options.function_tolerance = 1e-7;
  double scale = out->pixels;  // the whole row: plain least squares first
  for (int pass = 0; pass < 3; ++pass) {
    mine.floor_px[0] = scale;
    BundleState state{{*out}, points};
    const BundleSummary summary = SolveBundle(own, {prior}, mine, options, &state);
    *out = state.cameras[0];
    std::vector<double> residuals;
    for (std::size_t k = 0; k < summary.residual_px.size(); ++k) {
      if (mine.Uses(k) && std::isfinite(summary.residual_px[k])) {
        residuals.push_back(summary.residual_px[k]);
      }
    }
    scale = std::max(1e-12 * out->pixels, RobustSigma(residuals));  // not 0 without noise
  }
  return scale;
}

struct FoldResult {
  double loss = 0.0;
  double squares = 0.0, found = 0.0;           // of found points [m^2], and how many
  double contradiction = 0.0, to_spare = 0.0;  // [px^2], and readings to spare
};

// -log likelihood of a left-out point's readings, given its survey and the cameras.
double PointLoss(const Observations& data, const Weighting& weighting,
                 const std::vector<data::RigCamera>& cameras, const Eigen::MatrixXd& covariance,
                 const Eigen::VectorXd& common, const std::vector<std::size_t>& readings) {
  const auto m = static_cast<Eigen::Index>(readings.size());
  Eigen::VectorXd innovation(m);
  Eigen::MatrixXd H(m, 3), G = Eigen::MatrixXd::Zero(m, covariance.rows());
  Eigen::VectorXd variance(m);
  const auto point = data.readings[readings[0]].point;
  const Eigen::Vector3d p = data.p.col(point) - CommonShift(data, common, point);
  for (Eigen::Index k = 0; k < m; ++k) {
    const Reading& r = data.readings[readings[static_cast<std::size_t>(k)]];
    measure::Projection h;
    if (!measure::Project(cameras[static_cast<std::size_t>(r.camera)], p, &h)) {
      return std::numeric_limits<double>::infinity();
    }
    innovation(k) = r.u_px - h.u_px;
    H.row(k) = h.du_dp;
    G.block(k, kParameters * r.camera, 1, kParameters) = h.du_dc;
    variance(k) = weighting.Variance(r);
  }
  for (Eigen::Index q = 0; q < common.size(); ++q) {
    G.col(covariance.rows() - common.size() + q) =
        -H * data.common[static_cast<std::size_t>(q)].shift.col(point);
  }
  const double factor = weighting.survey_factor;
  Eigen::MatrixXd S =
      H * data.cov[static_cast<std::size_t>(point)] * H.transpose() * (factor * factor) +
      G * covariance * G.transpose();
  S += variance.asDiagonal();
  const Eigen::LLT<Eigen::MatrixXd> root(S);
  const Eigen::VectorXd white = root.matrixL().solve(innovation);
  double log_det = 0.0;
  for (Eigen::Index k = 0; k < m; ++k) log_det += std::log(root.matrixL()(k, k));
  return 0.5 * white.squaredNorm() + log_det +
         0.5 * static_cast<double>(m) * std::log(2.0 * std::numbers::pi);
}

FoldResult CheckFold(const Observations& data, const OrderTrial& trial, int folds, int fold) {
  std::vector<int> keep;
  for (int i = 0; i < data.points(); ++i) {
    if (i % folds != fold) keep.push_back(i);
  }
  const Observations kept = SelectPoints(data, keep);
  const Weighting& all = trial.bundle.weighting;
  BundleState state{trial.bundle.state.cameras, trial.bundle.state.points(Eigen::all, keep),
                    trial.bundle.state.common};
  BundleOptions options;
  options.loss_width = std::numeric_limits<double>::infinity();
  options.function_tolerance = 1e-7;  // less than a hundredth of one sigma in all
  const BundleSummary summary =
      SolveBundle(kept, trial.priors, SelectPoints(all, data, keep), options, &state);
  Eigen::MatrixXd covariance = CameraCovariance(summary.information);
  ClearFixed(trial.priors, &covariance);

  FoldResult out;
  std::size_t k = 0;
  std::vector<std::size_t> used;
  for (int i = 0; i < data.points(); ++i) {
    used.clear();
    unsigned bits = 0;
    const std::size_t first = k;
    for (; k < data.readings.size() && data.readings[k].point == i; ++k) {
      if (!all.Uses(k)) continue;
      used.push_back(k);
      if (k - first < 32) bits |= 1U << (k - first);
    }
    const auto point = static_cast<std::size_t>(i);
    if (i % folds != fold || !all.UsesSurvey(point) || used.empty()) continue;
    out.loss += PointLoss(data, all, state.cameras, covariance, state.common, used);
    const Eigen::Vector3d surveyed = data.p.col(i) - CommonShift(data, state.common, i);
    PointFit found;
    if (FitPoint(data, all, state.cameras, first, bits, false, surveyed, &found)) {
      out.squares += (found.p - surveyed).squaredNorm();
      out.found += 1.0;
      out.to_spare += static_cast<double>(used.size()) - 3.0;
      for (const std::size_t r : used) {
        double u = 0.0;
        const Reading& reading = data.readings[r];
        if (!measure::Project(state.cameras[static_cast<std::size_t>(reading.camera)], found.p,
                              &u)) {
          continue;
        }
        out.contradiction += (reading.u_px - u) * (reading.u_px - u);
      }
    }
  }
  return out;
}

void CrossValidate(const Observations& data, int folds, OrderTrial* trial) {
  FoldResult sum;
  for (int fold = 0; fold < folds; ++fold) {
    const FoldResult one = CheckFold(data, *trial, folds, fold);
    sum.loss += one.loss;
    sum.squares += one.squares;
    sum.found += one.found;
    sum.contradiction += one.contradiction;
    sum.to_spare += one.to_spare;
  }
  trial->loss = std::isfinite(sum.loss) ? sum.loss : std::numeric_limits<double>::infinity();
  trial->held_out_rms = std::sqrt(sum.squares / std::max(1.0, sum.found));
  trial->contradiction_px = std::sqrt(sum.contradiction / std::max(1.0, sum.to_spare));
}

}  // namespace

std::vector<CameraPrior> WithOrders(std::vector<CameraPrior> priors,
                                    const std::vector<int>& by_camera) {
  for (std::size_t j = 0; j < priors.size(); ++j) {
    const std::span<const measure::LensOrder> orders = measure::OrdersOf(priors[j].lens);
    const std::size_t order = static_cast<std::size_t>(
        by_camera[j] == kFullOrder ? measure::UsualOrderOf(priors[j].lens) : by_camera[j]);
    for (std::size_t k = 0; k < priors[j].term_sigma_px.size(); ++k) {
      if (!orders[order].terms[k]) priors[j].term_sigma_px[k] = 0.0;
    }
  }
  return priors;
}

std::vector<CameraPrior> WithOrder(std::vector<CameraPrior> priors, int order) {
  const std::vector<int> all(priors.size(), order);
  return WithOrders(std::move(priors), all);
}

std::string OrderName(const OrderTrial& trial) {
  const std::span<const measure::LensOrder> orders = measure::OrdersOf(trial.priors[0].lens);
  if (trial.order != kOrderByCamera) return orders[static_cast<std::size_t>(trial.order)].name;
  std::string name;
  for (const int order : trial.by_camera) {
    name += (name.empty() ? "" : ", ") + std::string(orders[static_cast<std::size_t>(order)].name);
  }
  return name;
}

std::vector<int> OrdersByCamera(const RefinedBundle& full, int whole_order, double gain) {
  const Eigen::MatrixXd covariance = CameraCovariance(full.summary.information);
  std::vector<int> out;
  for (std::size_t j = 0; j < full.state.cameras.size(); ++j) {
    const std::span<const measure::LensOrder> orders =
        measure::OrdersOf(full.state.cameras[j].lens)
            .first(static_cast<std::size_t>(whole_order) + 1);
    const auto& whole = orders.back().terms;
    std::vector<double> price(orders.size());
    for (std::size_t order = 0; order < orders.size(); ++order) {
      std::vector<Eigen::Index> at;
      std::vector<double> values;
      for (std::size_t k = 0; k < whole.size(); ++k) {
        if (!whole[k]) continue;
        if (orders[order].terms[k]) {
          price[order] += 2.0;  // Akaike's charge for a term that is kept
          continue;
        }
        at.push_back(kParameters * static_cast<Eigen::Index>(j) + data::kFirstTerm +
                     static_cast<Eigen::Index>(k));
        values.push_back(full.state.cameras[j].terms_px[k]);
      }
      if (at.empty()) continue;
      // In units of their own sigmas: the terms differ by orders of magnitude.
      const Eigen::MatrixXd C = covariance(at, at);
      const Eigen::VectorXd sigma = C.diagonal().cwiseSqrt();
      const Eigen::MatrixXd R = C.cwiseQuotient(sigma * sigma.transpose());
      const Eigen::VectorXd t =
          Eigen::VectorXd::Map(values.data(), static_cast<Eigen::Index>(values.size()))
              .cwiseQuotient(sigma);
      price[order] += t.dot(R.ldlt().solve(t));
    }
    const double best = *std::min_element(price.begin(), price.end());
    int order = 0;
    while (price[static_cast<std::size_t>(order)] > best + 2.0 * gain) ++order;
    out.push_back(order);
  }
  return out;
}

RefinedBundle FitOrder(const Observations& data, const std::vector<CameraPrior>& priors,
                       const RefinedBundle& full) {
  BundleState state = full.state;
  Weighting weighting = full.weighting;
  for (std::size_t j = 0; j < priors.size(); ++j) {
    for (int k = 0; k < static_cast<int>(data::kLensTerms); ++k) {
      if (priors[j].Fixed(k)) state.cameras[j].terms_px[static_cast<std::size_t>(k)] = 0.0;
    }
    weighting.floor_px[j] = Resect(data, priors[j], weighting, static_cast<int>(j),
                                   full.state.points, &state.cameras[j]);
  }
  RefineOptions options;
  options.choose_gross = false;
  return Refine(data, priors, weighting, options, std::move(state));
}

OrderChoice ChooseOrder(const Observations& data, const std::vector<CameraPrior>& full_priors,
                        const RefinedBundle& full, int whole_order, const OrderOptions& options) {
  const auto orders = static_cast<std::size_t>(whole_order) + 1;
  OrderChoice out;
  out.trials.resize(orders);
  const int folds = std::min(options.folds, data.points());
  const auto run = [&](OrderTrial& trial) {
    const double start = Now();
    trial.priors = WithOrders(full_priors, trial.by_camera);
    const bool whole = trial.order == whole_order;
    trial.bundle = whole ? full : FitOrder(data, trial.priors, full);
    const auto& floors = trial.bundle.weighting.floor_px;
    trial.largest_floor_px = *std::max_element(floors.begin(), floors.end());
    CrossValidate(data, folds, &trial);
    trial.seconds = Now() - start;
  };
  OrderTrial own;
  own.order = kOrderByCamera;
  own.by_camera = OrdersByCamera(full, whole_order, options.gain);
  const bool differ = std::adjacent_find(own.by_camera.begin(), own.by_camera.end(),
                                         std::not_equal_to<>()) != own.by_camera.end();
  if (differ) out.trials.push_back(own);
  ParallelFor(out.trials.size(), options.workers, [&](std::size_t k) {
    OrderTrial& trial = out.trials[k];
    if (trial.by_camera.empty()) {
      trial.order = static_cast<int>(k);
      trial.by_camera.assign(full_priors.size(), trial.order);
    }
    run(trial);
  });
  double best = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < orders; ++k) best = std::min(best, out.trials[k].loss);
  for (std::size_t k = orders; k-- > 0;) {
    if (out.trials[k].loss <= best + options.gain) out.taken = static_cast<int>(k);
  }
  if (differ && out.trials.back().loss <
                    out.trials[static_cast<std::size_t>(out.taken)].loss - options.gain) {
    out.taken = static_cast<int>(orders);
  }
  for (const OrderTrial& trial : out.trials) best = std::min(best, trial.loss);
  for (OrderTrial& trial : out.trials) trial.loss -= best;
  return out;
}

}  // namespace unfurl::calib
