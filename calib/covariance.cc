#include "calib/covariance.h"

#include <Eigen/Dense>

#include "measure/camera_model.h"

namespace unfurl::calib {
namespace {

constexpr Eigen::Index kParameters = data::kCameraParameters;
using CameraColumns = Eigen::Matrix<double, data::kCameraParameters, 3>;

void AddPrior(const CameraPrior& prior, Eigen::Ref<Eigen::MatrixXd> block) {
  block(8, 8) += 1.0 / (prior.e_sigma * prior.e_sigma);
  block.block<3, 3>(3, 3) +=
      prior.axis * prior.axis.transpose() / (prior.along_sigma * prior.along_sigma);
  for (Eigen::Index k = 0; k < 10; ++k) {
    const double sigma = prior.term_sigma_px[static_cast<std::size_t>(k)];
    block(9 + k, 9 + k) += 1.0 / (sigma * sigma);
  }
}

}  // namespace

Eigen::MatrixXd PriorInformation(const std::vector<CameraPrior>& priors) {
  const Eigen::Index size = kParameters * static_cast<Eigen::Index>(priors.size());
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(size, size);
  for (std::size_t j = 0; j < priors.size(); ++j) {
    const Eigen::Index first = kParameters * static_cast<Eigen::Index>(j);
    AddPrior(priors[j], information.block(first, first, kParameters, kParameters));
  }
  return information;
}

Eigen::MatrixXd DataInformation(const Observations& data, double floor_px, bool fixed_points,
                                const BundleState& state, const std::vector<double>& reading_weight,
                                const std::vector<double>& survey_weight) {
  const auto c = static_cast<Eigen::Index>(state.cameras.size());
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(kParameters * c, kParameters * c);
  std::vector<CameraColumns> mixed(static_cast<std::size_t>(c));  // H_cP of the point at hand
  std::vector<Eigen::Index> seen_by;
  std::size_t k = 0;
  for (Eigen::Index i = 0; i < data.p.cols(); ++i) {
    const auto point = static_cast<std::size_t>(i);
    Eigen::Matrix3d H_PP = survey_weight[point] * data.cov[point].inverse();
    seen_by.clear();
    for (; k < data.readings.size() && data.readings[k].point == i; ++k) {
      const Reading& r = data.readings[k];
      measure::Projection projection;
      if (reading_weight[k] <= 0.0 ||
          !measure::Project(state.cameras[static_cast<std::size_t>(r.camera)], state.points.col(i),
                            &projection)) {
        continue;
      }
      const double w = reading_weight[k] / (r.s_px * r.s_px + floor_px * floor_px);
      const Eigen::Index j = r.camera;
      H_PP += w * projection.du_dp.transpose() * projection.du_dp;
      information.block<kParameters, kParameters>(kParameters * j, kParameters * j) +=
          w * projection.du_dc.transpose() * projection.du_dc;
      mixed[static_cast<std::size_t>(j)] = w * projection.du_dc.transpose() * projection.du_dp;
      seen_by.push_back(j);
    }
    if (fixed_points) continue;
    const Eigen::Matrix3d inverse = H_PP.inverse();
    for (const Eigen::Index a : seen_by) {
      const CameraColumns left = mixed[static_cast<std::size_t>(a)] * inverse;
      for (const Eigen::Index b : seen_by) {
        if (b > a) continue;  // the lower triangle; mirrored at the end
        information.block<kParameters, kParameters>(kParameters * a, kParameters * b) -=
            left * mixed[static_cast<std::size_t>(b)].transpose();
      }
    }
  }
  information.triangularView<Eigen::StrictlyUpper>() = information.transpose();
  return information;
}

Eigen::MatrixXd CameraCovariance(const Eigen::MatrixXd& information) {
  const Eigen::VectorXd scale = information.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * information * scale.asDiagonal();
  // By eigenvalues: what round-off leaves below zero is cut off, and the inverse stays
  // semidefinite.
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scaled);
  const double least = 1e-14 * eigen.eigenvalues().maxCoeff();
  const Eigen::VectorXd inverse = eigen.eigenvalues().cwiseMax(least).cwiseInverse();
  const Eigen::MatrixXd half =
      scale.asDiagonal() * eigen.eigenvectors() * inverse.cwiseSqrt().asDiagonal();
  return half * half.transpose();
}

}  // namespace unfurl::calib
