#include "calib/bundle.h"

#include <ceres/ceres.h>
#include <ceres/normal_prior.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>

#include "base/dense.h"
#include "base/log_silence.h"
#include "base/progress.h"
#include "base/statistics.h"
#include "calib/block_store.h"
#include "calib/bundle_camera.h"
#include "calib/bundle_costs.h"
#include "calib/common_error.h"
#include "calib/covariance.h"
#include "calib/near_minimum.h"
#include "calib/stop_on_interrupt.h"
#include "measure/camera_model.h"

namespace unfurl::calib {
namespace {

double WhitenedSquare(const Observations& data, const BundleState& state, Eigen::Index i) {
  const Eigen::Vector3d d =
      state.points.col(i) + CommonShift(data, state.common, i) - data.p.col(i);
  return d.dot(data.cov[static_cast<std::size_t>(i)].llt().solve(d));
}

void Summarise(const Observations& data, const std::vector<CameraPrior>& priors,
               const Weighting& weighting, const BundleOptions& options, const BundleState& state,
               BundleSummary* summary) {
  double chi_square = 0.0, dof = 0.0;
  for (std::size_t k = 0; k < data.readings.size(); ++k) {
    const Reading& r = data.readings[k];
    double u = 0.0;
    const data::RigCamera& camera = state.cameras[static_cast<std::size_t>(r.camera)];
    if (!measure::Project(camera, state.points.col(r.point), &u)) {
      summary->residual_px.push_back(std::numeric_limits<double>::quiet_NaN());
      summary->reading_weight.push_back(0.0);
      continue;
    }
    const double residual = r.u_px - u;
    const double s = residual * residual / weighting.Variance(r);
    summary->residual_px.push_back(residual);
    summary->reading_weight.push_back(weighting.Uses(k) ? LossWeight(s, options.loss_width) : 0.0);
    if (summary->reading_weight.back() < 1.0) continue;
    chi_square += s;
    dof += 1.0;
  }
  const double survey_width = SurveyLossWidth(options.loss_width);
  for (Eigen::Index i = 0; i < data.p.cols(); ++i) {
    const auto point = static_cast<std::size_t>(i);
    const double scale = weighting.SurveyInformationScale(point);
    const double s = options.fix_points ? 0.0 : scale * WhitenedSquare(data, state, i);
    const double loss = LossWeight(s, survey_width);
    summary->survey_weight.push_back(weighting.UsesSurvey(point) ? loss : Weighting::kLeftOut);
    if (summary->survey_weight.back() < 1.0) {
      dof -= 3.0;
    } else {
      chi_square += s;
    }
  }
  Eigen::MatrixXd prior = PriorInformation(priors, options.fix_points ? 0 : data.common.size());
  for (std::size_t j = 0; j < state.cameras.size(); ++j) {
    if (priors[j].KnowsLens()) continue;
    const auto u0 = data::kCameraParameters * static_cast<Eigen::Index>(j) + 7;
    prior(u0, u0) += std::pow(kOffsetShare * std::max(1, state.cameras[j].pixels), -2);
  }
  summary->information = prior + DataInformation(data, priors, weighting, options.fix_points, state,
                                                 summary->reading_weight, summary->survey_weight);
  // What the data determine: the number of parameters, less each one's share that is the prior's.
  const double from_prior = (CameraCovariance(summary->information).cwiseProduct(prior)).sum();
  dof -= static_cast<double>(prior.rows()) - from_prior;
  summary->chi_square = chi_square;
  summary->degrees_of_freedom = dof;
}

}  // namespace

double Loss(double s, double width) {
  const double square = width * width;
  return s <= square ? s : square * (1.0 + std::log(s / square));
}

double LossWeight(double s, double width) {
  const double square = width * width;
  return s <= square ? 1.0 : square / s;
}

double SurveyLossWidth(double width) {
  if (width > 8.0) return width;  // beyond what the tail's quantile can be computed of
  return std::sqrt(ChiSquareQuantile(1.0 - ChiSquareTail(width * width, 1.0), 3.0));
}

int BundleSummary::gross_readings() const {
  return static_cast<int>(std::count_if(reading_weight.begin(), reading_weight.end(),
                                        [](double w) { return w < 1.0; }));
}

int BundleSummary::gross_points() const {
  return static_cast<int>(
      std::count_if(survey_weight.begin(), survey_weight.end(), [](double w) { return w < 1.0; }));
}

BundleSummary SolveBundle(const Observations& data, const std::vector<CameraPrior>& priors,
                          const Weighting& weighting, const BundleOptions& options,
                          BundleState* state) {
  ceres::Problem::Options ownership;
  ownership.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ownership.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  const auto reading_loss = MakeCoreLoss(options.loss_width);
  const auto survey_loss = MakeCoreLoss(SurveyLossWidth(options.loss_width));
  std::vector<std::unique_ptr<ceres::Manifold>> manifolds;
  manifolds.reserve(priors.size());
  for (const CameraPrior& prior : priors) manifolds.push_back(MakeCameraManifold(prior));
  ceres::Problem problem(ownership);

  const BundleUnits units = UnitsOf(data, *state);
  BlockStore store(kAmbient * state->cameras.size() + data.common.size());
  std::vector<double*> blocks;
  for (const data::RigCamera& camera : state->cameras) {
    blocks.push_back(store.Add(Pack(camera, units).data(), kAmbient));
  }
  Eigen::Matrix3Xd points = state->points / units.length;
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  for (std::size_t j = 0; j < blocks.size(); ++j) {
    problem.AddParameterBlock(blocks[j], kAmbient, manifolds[j].get());
    problem.AddResidualBlock(MakePriorCost(priors[j], state->cameras[j].pixels, units).release(),
                             nullptr, blocks[j]);
    ordering->AddElementToGroup(blocks[j], 1);
  }
  state->common.conservativeResizeLike(
      Eigen::VectorXd::Zero(static_cast<Eigen::Index>(data.common.size())));
  double* common = store.Add(state->common.data(), data.common.size());
  if (!options.fix_points && !data.common.empty()) {
    const auto m = static_cast<int>(data.common.size());
    problem.AddParameterBlock(common, m);
    problem.AddResidualBlock(
        new ceres::NormalPrior(ceres::Matrix::Identity(m, m), ceres::Vector::Zero(m)), nullptr,
        common);
    ordering->AddElementToGroup(common, 1);
  }
  for (Eigen::Index i = 0; i < data.p.cols(); ++i) {
    double* point = points.col(i).data();
    problem.AddParameterBlock(point, 3);
    if (options.fix_points) {
      problem.SetParameterBlockConstant(point);
      continue;
    }
    const auto index = static_cast<std::size_t>(i);
    std::vector<double*> blocks_of_point = {point};
    if (!data.common.empty()) blocks_of_point.push_back(common);
    problem.AddResidualBlock(
        MakeSurveyCost(data, i, weighting.SurveyInformationScale(index), units).release(),
        survey_loss.get(), blocks_of_point);
    ordering->AddElementToGroup(point, 0);
  }
  for (std::size_t k = 0; k < data.readings.size(); ++k) {
    if (!weighting.Uses(k)) continue;
    const Reading& r = data.readings[k];
    const auto j = static_cast<std::size_t>(r.camera);
    double u = 0.0;
    if (!measure::Project(state->cameras[j], state->points.col(r.point), &u)) continue;
    problem.AddResidualBlock(
        MakeReadingCost(r.u_px, std::sqrt(weighting.Variance(r)), priors[j], units).release(),
        reading_loss.get(), blocks[j], points.col(r.point).data());
  }

  ceres::Solver::Options solver;
  solver.linear_solver_type = options.fix_points ? ceres::DENSE_QR : ceres::DENSE_SCHUR;
  if (!options.fix_points) solver.linear_solver_ordering = ordering;
  solver.max_num_iterations = options.max_iterations;
  solver.function_tolerance = options.function_tolerance;
  solver.gradient_tolerance = 1e-14;
  solver.parameter_tolerance = 1e-12;
  solver.num_threads = 1;
  solver.logging_type = ceres::SILENT;
  const std::unique_ptr<ceres::IterationCallback> stop = StopOnInterrupt();
  solver.callbacks.push_back(stop.get());
  ceres::Solver::Summary report;
  const LogSilence silence;
  ceres::Solve(solver, &problem, &report);
  ThrowIfInterrupted();
  BundleSummary summary;
  summary.converged = NearMinimum(report, std::move(solver), &problem);
  ThrowIfInterrupted();

  for (std::size_t j = 0; j < blocks.size(); ++j) {
    Unpack(blocks[j], units, &state->cameras[j]);
  }
  state->common = Eigen::VectorXd::Map(common, state->common.size());
  if (!options.fix_points) state->points = units.length * points;
  summary.iterations = static_cast<int>(report.iterations.size());
  Summarise(data, priors, weighting, options, *state, &summary);
  return summary;
}

}  // namespace unfurl::calib
