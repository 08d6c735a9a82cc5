#include "calib/bundle.h"

#include <ceres/ceres.h>
#include <ceres/normal_prior.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include "base/log_silence.h"
#include "base/pose.h"
#include "base/progress.h"
#include "base/statistics.h"
#include "calib/common_error.h"
#include "calib/covariance.h"
#include "measure/camera_model.h"

namespace unfurl::calib {
namespace {

// A camera as Ceres stores it: R_CW row by row, then p_WC, f, u0, e and the terms.
constexpr int kTail = data::kCameraParameters - 3;  // what follows the rotation
constexpr int kAmbient = 9 + kTail;                 // numbers of a camera so stored
constexpr int kTerms = static_cast<int>(data::kLensTerms);
constexpr int kFirst = kAmbient - kTerms;  // of the terms
using CameraBlock = std::array<double, kAmbient>;

// Lengths are solved for over the survey's size and pixels over the row's length, so that the
// solver's own constants mean the same to a hinge and to a wing.
struct BundleUnits {
  double length = 1.0;  // [m]
  double row = 1.0;     // [px]

  // Of what follows the rotation, by its place in a camera's block.
  double Of(int at) const { return at < 12 || at == 14 ? length : row; }
};

BundleUnits UnitsOf(const Observations& data, const BundleState& state) {
  const Eigen::Matrix3Xd centred = data.p.colwise() - data.p.rowwise().mean();
  BundleUnits units;
  const double size = std::sqrt(centred.squaredNorm() / static_cast<double>(data.points()));
  if (size > 0.0) units.length = size;
  for (const data::RigCamera& camera : state.cameras) {
    units.row = std::max(units.row, static_cast<double>(camera.pixels));
  }
  return units;
}

CameraBlock Pack(const data::RigCamera& camera, const BundleUnits& units) {
  CameraBlock x;
  for (int k = 0; k < 9; ++k) x[static_cast<std::size_t>(k)] = camera.R_CW(k / 3, k % 3);
  for (int k = 0; k < 3; ++k) x[static_cast<std::size_t>(9 + k)] = camera.p_WC(k);
  x[12] = camera.f_px;
  x[13] = camera.u0_px;
  x[14] = camera.e;
  std::copy(camera.terms_px.begin(), camera.terms_px.end(), x.begin() + kFirst);
  for (int k = 9; k < kAmbient; ++k) x[static_cast<std::size_t>(k)] /= units.Of(k);
  return x;
}

void Unpack(const double* x, const BundleUnits& units, data::RigCamera* camera) {
  camera->R_CW = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(x);
  camera->p_WC = units.length * Eigen::Map<const Eigen::Vector3d>(x + 9);
  camera->f_px = units.row * x[12];
  camera->u0_px = units.row * x[13];
  camera->e = units.length * x[14];
  for (std::size_t k = 0; k < data::kLensTerms; ++k) {
    camera->terms_px[k] = units.row * x[kFirst + static_cast<int>(k)];
  }
}

// Rotation by a small vector, R <- Exp(w) R; the rest by addition, but for terms that are held. The
// cost functions below give their derivatives by the tangent in the first 3 and last columns of the
// ambient ones, so PlusJacobian only picks those.
class CameraManifold : public ceres::Manifold {
 public:
  explicit CameraManifold(const CameraPrior& prior) {
    for (int k = 9; k < kAmbient; ++k) {
      if (k < kFirst || !prior.Fixed(k - kFirst)) free_.push_back(k);
    }
  }
  int AmbientSize() const override { return kAmbient; }
  int TangentSize() const override { return 3 + static_cast<int>(free_.size()); }

  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override {
    using Rotation = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
    const Eigen::Vector3d w(delta[0], delta[1], delta[2]);
    const Rotation turned = RotationFromVector(w) * Eigen::Map<const Rotation>(x);
    std::copy(turned.data(), turned.data() + 9, x_plus_delta);
    std::copy(x + 9, x + kAmbient, x_plus_delta + 9);
    for (std::size_t k = 0; k < free_.size(); ++k) x_plus_delta[free_[k]] += delta[3 + k];
    return true;
  }

  bool PlusJacobian(const double*, double* jacobian) const override {
    RowMajor J(jacobian, kAmbient, TangentSize());
    J.setZero();
    J.topLeftCorner<3, 3>().setIdentity();
    for (std::size_t k = 0; k < free_.size(); ++k) J(free_[k], Column(k)) = 1.0;
    return true;
  }

  bool Minus(const double* y, const double* x, double* y_minus_x) const override {
    using Rotation = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
    const Eigen::Matrix3d R =
        Eigen::Map<const Rotation>(y) * Eigen::Map<const Rotation>(x).transpose();
    const Eigen::Vector3d w = VectorFromRotation(R);
    std::copy(w.data(), w.data() + 3, y_minus_x);
    for (std::size_t k = 0; k < free_.size(); ++k) y_minus_x[3 + k] = y[free_[k]] - x[free_[k]];
    return true;
  }

  bool MinusJacobian(const double*, double* jacobian) const override {
    RowMajor J(jacobian, TangentSize(), kAmbient);
    J.setZero();
    J.topLeftCorner<3, 3>().setIdentity();
    for (std::size_t k = 0; k < free_.size(); ++k) J(Column(k), free_[k]) = 1.0;
    return true;
  }

 private:
  using RowMajor =
      Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>;
  static Eigen::Index Column(std::size_t k) { return 3 + static_cast<Eigen::Index>(k); }
  std::vector<int> free_;  // ambient indices
};

class ReadingCost : public ceres::SizedCostFunction<1, kAmbient, 3> {
 public:
  ReadingCost(double u_px, double sigma_px, const CameraPrior& prior, const BundleUnits& units)
      : u_px_(u_px), weight_(1.0 / sigma_px), prior_(prior), units_(units) {}

  bool Evaluate(double const* const* x, double* residual, double** jacobians) const override {
    data::RigCamera camera;
    camera.lens = prior_.lens;
    Unpack(x[0], units_, &camera);
    const Eigen::Vector3d p = units_.length * Eigen::Map<const Eigen::Vector3d>(x[1]);
    if (!jacobians) {
      double u = 0.0;
      if (!measure::Project(camera, p, &u)) return false;
      residual[0] = weight_ * (u - u_px_);
      return true;
    }
    measure::Projection projection;
    if (!measure::Project(camera, p, &projection)) return false;
    residual[0] = weight_ * (projection.u_px - u_px_);
    if (jacobians[0]) {
      Eigen::Map<Eigen::Matrix<double, 1, kAmbient>> J(jacobians[0]);
      J.setZero();
      J.head<3>() = weight_ * projection.du_dc.head<3>();
      J.tail<kTail>() = weight_ * projection.du_dc.tail<kTail>();
      for (int k = 9; k < kAmbient; ++k) J(k) *= units_.Of(k);
      for (int k = 0; k < kTerms; ++k) {
        if (prior_.Fixed(k)) J(kFirst + k) = 0.0;
      }
    }
    if (jacobians[1]) {
      Eigen::Map<Eigen::RowVector3d>(jacobians[1], 3) = weight_ * units_.length * projection.du_dp;
    }
    return true;
  }

 private:
  double u_px_, weight_;
  const CameraPrior& prior_;  // outlives the problem
  const BundleUnits& units_;
};

// Whitened difference between a point and the survey's: L^-1 (P + B q - p) with L L^T the
// covariance and B the shifts by the common errors, where there are any.
class SurveyCost : public ceres::CostFunction {
 public:
  SurveyCost(const Observations& data, Eigen::Index i, double information_scale,
             const BundleUnits& units)
      : p_(data.p.col(i) / units.length), shift_(3, static_cast<Eigen::Index>(data.common.size())) {
    whiten_ = Eigen::LLT<Eigen::Matrix3d>(data.cov[static_cast<std::size_t>(i)])
                  .matrixL()
                  .solve(Eigen::Matrix3d::Identity());
    whiten_ *= std::sqrt(information_scale) * units.length;
    for (Eigen::Index m = 0; m < shift_.cols(); ++m) {
      shift_.col(m) = data.common[static_cast<std::size_t>(m)].shift.col(i) / units.length;
    }
    set_num_residuals(3);
    mutable_parameter_block_sizes()->push_back(3);
    if (shift_.cols() > 0) {
      mutable_parameter_block_sizes()->push_back(static_cast<int>(shift_.cols()));
    }
  }

  bool Evaluate(double const* const* x, double* residual, double** jacobians) const override {
    Eigen::Vector3d difference(x[0][0] - p_(0), x[0][1] - p_(1), x[0][2] - p_(2));
    for (Eigen::Index m = 0; m < shift_.cols(); ++m) difference += x[1][m] * shift_.col(m);
    Eigen::Map<Eigen::Vector3d>(residual, 3) = whiten_ * difference;
    if (jacobians && jacobians[0]) {
      Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(jacobians[0], 3, 3) = whiten_;
    }
    if (jacobians && shift_.cols() > 0 && jacobians[1]) {
      Eigen::Map<Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::RowMajor>>(
          jacobians[1], 3, shift_.cols()) = whiten_ * shift_;
    }
    return true;
  }

 private:
  Eigen::Vector3d p_;
  Eigen::Matrix3Xd shift_;
  Eigen::Matrix3d whiten_;
};

// The optical axis meets the row near its middle: sensors are mounted so to within a few per cent.
// Over the row [-]. With a wide-angle lens a shift of the image is a turn of the camera, and
// nothing else tells them apart; with others the readings do, a hundred times better than this.
constexpr double kOffsetShare = 0.1;

constexpr int kPriorRows = 3 + kTerms;  // e, position along the lens axis, u0, the terms

class PriorCost : public ceres::SizedCostFunction<kPriorRows, kAmbient> {
 public:
  PriorCost(const CameraPrior& prior, int pixels, const BundleUnits& units)
      : prior_(prior), pixels_(std::max(1, pixels)), units_(units) {}

  bool Evaluate(double const* const* x, double* residual, double** jacobians) const override {
    const double* p = x[0] + 9;
    const double along = prior_.axis(0) * p[0] + prior_.axis(1) * p[1] + prior_.axis(2) * p[2];
    residual[0] = (units_.length * x[0][14] - prior_.e_mean) / prior_.e_sigma;
    residual[1] = (units_.length * along - prior_.along) / prior_.along_sigma;
    residual[2] = (units_.row * x[0][13] - 0.5 * (pixels_ - 1)) / (kOffsetShare * pixels_);
    for (int k = 0; k < kTerms; ++k) residual[3 + k] = x[0][kFirst + k] / Sigma(k);
    if (!jacobians || !jacobians[0]) return true;
    Eigen::Map<Eigen::Matrix<double, kPriorRows, kAmbient, Eigen::RowMajor>> J(jacobians[0]);
    J.setZero();
    J(0, 14) = units_.length / prior_.e_sigma;
    for (int k = 0; k < 3; ++k) {
      J(1, 9 + k) = units_.length * prior_.axis(k) / prior_.along_sigma;
    }
    J(2, 13) = units_.row / (kOffsetShare * pixels_);
    for (int k = 0; k < kTerms; ++k) J(3 + k, kFirst + k) = 1.0 / Sigma(k);
    return true;
  }

 private:
  // Over the row. A term held at zero has a row of its own that keeps it there and moves nothing
  // else.
  double Sigma(int k) const {
    return prior_.Fixed(k) ? 1.0 : prior_.term_sigma_px[static_cast<std::size_t>(k)] / units_.row;
  }
  CameraPrior prior_;
  double pixels_;
  BundleUnits units_;
};

class CoreLoss : public ceres::LossFunction {
 public:
  explicit CoreLoss(double width) : width_(width) {}
  void Evaluate(double s, double rho[3]) const override {
    rho[0] = Loss(s, width_);
    rho[1] = LossWeight(s, width_);
    rho[2] = rho[1] < 1.0 ? -rho[1] / s : 0.0;
  }

 private:
  double width_;
};

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

namespace {

class StopOnInterrupt : public ceres::IterationCallback {
 public:
  ceres::CallbackReturnType operator()(const ceres::IterationSummary&) override {
    return InterruptRequested() ? ceres::SOLVER_ABORT : ceres::SOLVER_CONTINUE;
  }
};

}  // namespace

BundleSummary SolveBundle(const Observations& data, const std::vector<CameraPrior>& priors,
                          const Weighting& weighting, const BundleOptions& options,
                          BundleState* state) {
  ceres::Problem::Options ownership;
  ownership.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ownership.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  CoreLoss reading_loss(options.loss_width), survey_loss(SurveyLossWidth(options.loss_width));
  std::vector<CameraManifold> manifolds;
  for (const CameraPrior& prior : priors) manifolds.emplace_back(prior);
  ceres::Problem problem(ownership);

  const BundleUnits units = UnitsOf(data, *state);
  std::vector<CameraBlock> blocks;
  for (const data::RigCamera& camera : state->cameras) blocks.push_back(Pack(camera, units));
  Eigen::Matrix3Xd points = state->points / units.length;
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  for (std::size_t j = 0; j < blocks.size(); ++j) {
    problem.AddParameterBlock(blocks[j].data(), kAmbient, &manifolds[j]);
    problem.AddResidualBlock(new PriorCost(priors[j], state->cameras[j].pixels, units), nullptr,
                             blocks[j].data());
    ordering->AddElementToGroup(blocks[j].data(), 1);
  }
  state->common.conservativeResizeLike(
      Eigen::VectorXd::Zero(static_cast<Eigen::Index>(data.common.size())));
  double* common = state->common.data();
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
        new SurveyCost(data, i, weighting.SurveyInformationScale(index), units), &survey_loss,
        blocks_of_point);
    ordering->AddElementToGroup(point, 0);
  }
  for (std::size_t k = 0; k < data.readings.size(); ++k) {
    if (!weighting.Uses(k)) continue;
    const Reading& r = data.readings[k];
    const auto j = static_cast<std::size_t>(r.camera);
    double u = 0.0;
    if (!measure::Project(state->cameras[j], state->points.col(r.point), &u)) continue;
    problem.AddResidualBlock(
        new ReadingCost(r.u_px, std::sqrt(weighting.Variance(r)), priors[j], units), &reading_loss,
        blocks[j].data(), points.col(r.point).data());
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
  StopOnInterrupt stop;
  solver.callbacks.push_back(&stop);
  ceres::Solver::Summary report;
  const LogSilence silence;
  ceres::Solve(solver, &problem, &report);
  ThrowIfInterrupted();

  for (std::size_t j = 0; j < blocks.size(); ++j) {
    Unpack(blocks[j].data(), units, &state->cameras[j]);
  }
  if (!options.fix_points) state->points = units.length * points;
  BundleSummary summary;
  summary.converged = report.termination_type == ceres::CONVERGENCE;
  summary.iterations = static_cast<int>(report.iterations.size());
  Summarise(data, priors, weighting, options, *state, &summary);
  return summary;
}

}  // namespace unfurl::calib
