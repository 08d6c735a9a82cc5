#include "calib/wand_bundle.h"

#include <ceres/ceres.h>
#include <ceres/normal_prior.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>

#include "base/log_silence.h"
#include "base/progress.h"
#include "calib/block_store.h"
#include "calib/bundle_costs.h"
#include "calib/near_minimum.h"
#include "calib/serial_openmp.h"
#include "calib/stop_on_interrupt.h"
#include "calib/wand_costs.h"
#include "calib/wand_system.h"
#include "measure/camera_model.h"

namespace unfurl::calib {
namespace {

// Where the search trusts its linear model first, in units of the columns: views and the volume's
// shape depend on each other along long valleys, which smaller steps creep through.
constexpr double kRadius = 1e6;

ceres::Problem::Options Ownership() {
  ceres::Problem::Options out;
  out.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  out.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  return out;
}

BundleUnits UnitsOf(const WandState& state) {
  const Eigen::Matrix3Xd centred = state.middle.colwise() - state.middle.rowwise().mean();
  BundleUnits units;
  const double size =
      std::sqrt(centred.squaredNorm() / std::max<double>(1.0, static_cast<double>(centred.cols())));
  if (size > 0.0) units.length = size;
  for (const data::RigCamera& camera : state.cameras) {
    units.row = std::max(units.row, static_cast<double>(camera.pixels));
  }
  return units;
}

// The problem, its blocks in the solver's units, and what its rows are.
class WandProblem {
 public:
  WandProblem(const WandData& data, const std::vector<CameraPrior>& priors,
              const WandWeighting& weighting, const BundleOptions& options, const WandState& state)
      : data_(data),
        priors_(priors),
        weighting_(weighting),
        moving_(data.Moves() && weighting.unrest > 0.0),
        units_(UnitsOf(state)),
        reading_loss_(MakeCoreLoss(options.loss_width)),
        survey_loss_(MakeCoreLoss(SurveyLossWidth(options.loss_width))),
        pose_manifold_(MakePoseManifold(moving_)),
        place_count_(data.place.size() - 1),
        common_count_(state.common.size()),
        blocks_(kAmbient * state.cameras.size() +
                static_cast<std::size_t>(place_count_ + common_count_ + 3 * state.points.cols() +
                                         kPoseAmbient * data.pose_count())),
        problem_(Ownership()) {
    AddCameras(state);
    AddPlaces(state);
    AddPoses(state);
    AddMotion();
    AddPoints(state);
    AddReadings(state);
  }

  // `near`: whether it ended at its minimum.
  ceres::Solver::Summary Solve(const BundleOptions& options, bool* near) {
    ceres::Solver::Options solver;
    // Poses that are not linked are eliminated one by one; a chain of them by their pattern.
    solver.linear_solver_type = moving_ ? ceres::SPARSE_NORMAL_CHOLESKY : ceres::DENSE_SCHUR;
    if (!moving_) {
      auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
      for (double* block : Shared()) ordering->AddElementToGroup(block, 1);
      for (double* block : Own()) ordering->AddElementToGroup(block, 0);
      solver.linear_solver_ordering = ordering;
    }
    solver.max_num_iterations = options.max_iterations;
    solver.function_tolerance = options.function_tolerance;
    solver.gradient_tolerance = 1e-14;
    solver.parameter_tolerance = 1e-12;
    solver.initial_trust_region_radius = kRadius;
    solver.num_threads = 1;
    solver.logging_type = ceres::SILENT;
    const std::unique_ptr<ceres::IterationCallback> stop = StopOnInterrupt();
    solver.callbacks.push_back(stop.get());
    ceres::Solver::Summary report;
    const LogSilence silence;
    const SerialOpenMp serial;
    ceres::Solve(solver, &problem_, &report);
    ThrowIfInterrupted();
    *near = NearMinimum(report, std::move(solver), &problem_);
    ThrowIfInterrupted();
    return report;
  }

  void Store(WandState* state) const {
    for (std::size_t j = 0; j < camera_.size(); ++j) {
      Unpack(camera_[j], units_, &state->cameras[j]);
    }
    state->place.tail(place_count_) = units_.length * Eigen::VectorXd::Map(places_, place_count_);
    for (std::size_t k = 0; k < pose_.size(); ++k) {
      UnpackPose(pose_[k], static_cast<int>(k), units_, state);
    }
    for (std::size_t i = 0; i < point_.size(); ++i) {
      state->points.col(static_cast<Eigen::Index>(i)) =
          units_.length * Eigen::Vector3d::Map(point_[i]);
    }
    state->common = Eigen::VectorXd::Map(common_, common_count_);
  }

  // The whitened derivatives at the solution, of all rows that take part.
  WandRows Rows() {
    WandRows out;
    out.row = kinds_;
    out.cameras = static_cast<int>(camera_.size());
    out.poses = static_cast<int>(pose_.size());
    out.points = static_cast<int>(point_.size());
    out.pose_size = pose_manifold_->TangentSize();
    for (std::size_t j = 0; j < camera_.size(); ++j) {
      const int first = data::kCameraParameters * static_cast<int>(j);
      for (int k = 0; k < 3; ++k) out.shared.push_back({first + k, 1.0});
      for (int k = 9; k < kAmbient; ++k) {
        if (k >= kFirst && priors_[j].Fixed(k - kFirst)) {
          out.fixed.push_back(first + k - 6);
        } else {
          out.shared.push_back({first + k - 6, units_.Of(k)});
        }
      }
    }
    const int after = data::kCameraParameters * out.cameras;
    const auto places = static_cast<int>(place_count_);
    for (int m = 0; m < places; ++m) out.shared.push_back({after + m, units_.length});
    for (int m = 0; m < static_cast<int>(common_count_); ++m) {
      out.shared.push_back({after + places + m, 1.0});
    }
    out.size = after + places + static_cast<int>(common_count_);
    ceres::Problem::EvaluateOptions evaluate;
    evaluate.apply_loss_function = false;
    evaluate.parameter_blocks = Shared();
    for (double* block : Own()) evaluate.parameter_blocks.push_back(block);
    evaluate.residual_blocks = residuals_;
    ceres::CRSMatrix jacobian;
    const LogSilence silence;
    problem_.Evaluate(evaluate, nullptr, &out.residual, nullptr, &jacobian);
    out.first = std::move(jacobian.rows);
    out.column = std::move(jacobian.cols);
    out.value = std::move(jacobian.values);
    out.length = units_.length;
    return out;
  }

 private:
  std::vector<double*> Shared() {
    std::vector<double*> out = camera_;
    out.push_back(places_);
    if (common_count_ > 0) out.push_back(common_);
    return out;
  }
  std::vector<double*> Own() {
    std::vector<double*> out = pose_;
    out.insert(out.end(), point_.begin(), point_.end());
    return out;
  }

  void Add(std::unique_ptr<ceres::CostFunction> cost, ceres::LossFunction* loss,
           const std::vector<double*>& blocks, WandRow row) {
    const int rows = cost->num_residuals();
    residuals_.push_back(problem_.AddResidualBlock(cost.release(), loss, blocks));
    kinds_.insert(kinds_.end(), static_cast<std::size_t>(rows), row);
  }

  void AddCameras(const WandState& state) {
    for (const data::RigCamera& camera : state.cameras) {
      camera_.push_back(blocks_.Add(Pack(camera, units_).data(), kAmbient));
    }
    for (std::size_t j = 0; j < camera_.size(); ++j) {
      manifolds_.push_back(MakeCameraManifold(priors_[j]));
      problem_.AddParameterBlock(camera_[j], kAmbient, manifolds_.back().get());
      Add(MakePriorCost(priors_[j], state.cameras[j].pixels, units_), nullptr, {camera_[j]},
          {WandRow::kPrior, 0});
    }
    if (!weighting_.hold_frame) return;
    Add(MakeFrameCost(state.cameras, units_), nullptr, camera_, {WandRow::kPrior, 0});
  }

  void AddPlaces(const WandState& state) {
    const Eigen::Index m = place_count_;
    const Eigen::VectorXd places = state.place.tail(m) / units_.length;
    places_ = blocks_.Add(places.data(), static_cast<std::size_t>(m));
    problem_.AddParameterBlock(places_, static_cast<int>(m));
    const double middle = 0.5 * (data_.place.maxCoeff() + data_.place.minCoeff());
    const ceres::Vector stated = (data_.place.tail(m).array() - middle) / units_.length;
    const ceres::Matrix weight =
        ceres::Matrix::Identity(m, m) * (units_.length / data_.place_sigma);
    Add(std::make_unique<ceres::NormalPrior>(weight, stated), nullptr, {places_},
        {WandRow::kPrior, 0});
  }

  void AddPoses(const WandState& state) {
    for (int k = 0; k < data_.pose_count(); ++k) {
      pose_.push_back(blocks_.Add(PackPose(state, k, units_).data(), kPoseAmbient));
      problem_.AddParameterBlock(pose_.back(), kPoseAmbient, pose_manifold_.get());
    }
  }

  void AddMotion() {
    if (!moving_) return;
    const double arm = 0.5 * data_.Length();
    for (std::size_t k = 0; k + 1 < pose_.size(); ++k) {
      const double interval = data_.time[k + 1] - data_.time[k];
      Add(MakeMotionCost(interval, weighting_.unrest, arm, units_), nullptr,
          {pose_[k], pose_[k + 1]}, {WandRow::kMotion, static_cast<int>(k)});
    }
  }

  void AddPoints(const WandState& state) {
    const Observations& survey = data_.points;
    if (common_count_ > 0) {
      const auto m = static_cast<int>(common_count_);
      common_ = blocks_.Add(state.common.data(), static_cast<std::size_t>(m));
      problem_.AddParameterBlock(common_, m);
      Add(std::make_unique<ceres::NormalPrior>(ceres::Matrix::Identity(m, m),
                                               ceres::Vector::Zero(m)),
          nullptr, {common_}, {WandRow::kPrior, 0});
    }
    for (Eigen::Index i = 0; i < state.points.cols(); ++i) {
      const Eigen::Vector3d p = state.points.col(i) / units_.length;
      point_.push_back(blocks_.Add(p.data(), 3));
      problem_.AddParameterBlock(point_.back(), 3);
      std::vector<double*> blocks = {point_.back()};
      if (common_count_ > 0) blocks.push_back(common_);
      const bool used = weighting_.use_survey[static_cast<std::size_t>(i)] != 0;
      Add(MakeSurveyCost(survey, i, used ? 1.0 : Weighting::kLeftOut, units_), survey_loss_.get(),
          blocks, {used ? WandRow::kSurvey : WandRow::kPrior, static_cast<int>(i)});
    }
    for (std::size_t k = 0; k < survey.readings.size(); ++k) {
      const Reading& r = survey.readings[k];
      const auto j = static_cast<std::size_t>(r.camera);
      double u = 0.0;
      if (weighting_.use_point_reading[k] == 0 ||
          !measure::Project(state.cameras[j], state.points.col(r.point), &u)) {
        continue;
      }
      Add(MakeReadingCost(r.u_px, std::sqrt(weighting_.Variance(r.camera, r.s_px)), priors_[j],
                          units_),
          reading_loss_.get(), {camera_[j], point_[static_cast<std::size_t>(r.point)]},
          {WandRow::kPointReading, static_cast<int>(k)});
    }
  }

  void AddReadings(const WandState& state) {
    for (std::size_t k = 0; k < data_.readings.size(); ++k) {
      const WandReading& r = data_.readings[k];
      const auto j = static_cast<std::size_t>(r.camera);
      double u = 0.0;
      if (weighting_.use_reading[k] == 0 ||
          !measure::Project(state.cameras[j], state.Mark(r.pose, r.mark, r.after), &u)) {
        continue;
      }
      const MarkFlash flash = {r.mark, data_.mark_count(), state.place(0), r.after};
      Add(MakeMarkCost(r.u_px, std::sqrt(weighting_.Variance(r.camera, r.s_px)), flash, priors_[j],
                       units_),
          reading_loss_.get(), {camera_[j], pose_[static_cast<std::size_t>(r.pose)], places_},
          {WandRow::kReading, static_cast<int>(k)});
    }
  }

  const WandData& data_;
  const std::vector<CameraPrior>& priors_;
  const WandWeighting& weighting_;
  bool moving_;
  BundleUnits units_;
  std::unique_ptr<ceres::LossFunction> reading_loss_, survey_loss_;
  std::unique_ptr<ceres::Manifold> pose_manifold_;
  std::vector<std::unique_ptr<ceres::Manifold>> manifolds_;
  Eigen::Index place_count_;   // marks but the first
  Eigen::Index common_count_;  // of what a station does to all points
  BlockStore blocks_;
  std::vector<double*> camera_, pose_, point_;
  double *places_ = nullptr, *common_ = nullptr;
  std::vector<ceres::ResidualBlockId> residuals_;
  std::vector<WandRow> kinds_;
  ceres::Problem problem_;  // last: it refers to the others
};

}  // namespace

Eigen::Vector3d WandState::Mark(int pose, int mark, double after) const {
  const Eigen::Vector3d turned = direction.col(pose) + after * turning.col(pose);
  return middle.col(pose) + after * velocity.col(pose) + place(mark) * turned.normalized();
}

Eigen::Matrix3Xd WandState::Ends() const {
  Eigen::Matrix3Xd out(3, 2 * middle.cols());
  out.leftCols(middle.cols()) = middle + place.minCoeff() * direction;
  out.rightCols(middle.cols()) = middle + place.maxCoeff() * direction;
  return out;
}

WandSummary SolveWandBundle(const WandData& data, const std::vector<CameraPrior>& priors,
                            const WandWeighting& weighting, const BundleOptions& options,
                            WandState* state, WandSystem* system) {
  WandProblem problem(data, priors, weighting, options, *state);
  WandSummary out;
  const ceres::Solver::Summary report = problem.Solve(options, &out.converged);
  problem.Store(state);
  out.iterations = static_cast<int>(report.iterations.size());
  out.cost = report.final_cost;
  const auto residual = [&](int camera, const Eigen::Vector3d& p, double u_px) {
    double u = 0.0;
    const bool seen = measure::Project(state->cameras[static_cast<std::size_t>(camera)], p, &u);
    return seen ? u_px - u : std::numeric_limits<double>::quiet_NaN();
  };
  for (const WandReading& r : data.readings) {
    out.residual_px.push_back(residual(r.camera, state->Mark(r.pose, r.mark, r.after), r.u_px));
  }
  for (const Reading& r : data.points.readings) {
    out.point_residual_px.push_back(residual(r.camera, state->points.col(r.point), r.u_px));
  }
  if (system != nullptr) *system = SystemOf(problem.Rows(), data, *state);
  return out;
}

}  // namespace unfurl::calib
