#include "calib/covariance.h"

#include <algorithm>
#include <cmath>

#include "base/dense.h"
#include "calib/known_lens.h"
#include "calib/parameters.h"
#include "measure/camera_model.h"

namespace unfurl::calib {
namespace {

using CameraColumns = Eigen::Matrix<double, data::kCameraParameters, 3>;

void AddPrior(const CameraPrior& prior, Eigen::Ref<Eigen::MatrixXd> block) {
  block.block<3, 3>(3, 3) +=
      prior.axis * prior.axis.transpose() / (prior.along_sigma * prior.along_sigma);
  if (prior.KnowsLens()) {
    block.bottomRightCorner(kLensParameters, kLensParameters) +=
        prior.lens_root.transpose() * prior.lens_root;
    return;
  }
  block(8, 8) += 1.0 / (prior.e_sigma * prior.e_sigma);
  for (Eigen::Index k = 0; k < kTerms; ++k) {
    const double sigma =
        prior.Fixed(static_cast<int>(k)) ? 1.0 : prior.term_sigma_px[static_cast<std::size_t>(k)];
    block(data::kFirstTerm + k, data::kFirstTerm + k) += 1.0 / (sigma * sigma);
  }
}

// 3 x m, of one point by each common error.
Eigen::Matrix3Xd ShiftsOf(const Observations& data, Eigen::Index i) {
  Eigen::Matrix3Xd out(3, static_cast<Eigen::Index>(data.common.size()));
  for (Eigen::Index m = 0; m < out.cols(); ++m) {
    out.col(m) = data.common[static_cast<std::size_t>(m)].shift.col(i);
  }
  return out;
}

bool ProjectFree(const data::RigCamera& camera, const CameraPrior& prior, const Eigen::Vector3d& p,
                 measure::Projection* out) {
  if (!measure::Project(camera, p, out)) return false;
  for (int k = 0; k < kTerms; ++k) {
    if (prior.Fixed(k)) out->du_dc(data::kFirstTerm + k) = 0.0;
  }
  return true;
}

}  // namespace

Eigen::MatrixXd PriorInformation(const std::vector<CameraPrior>& priors, std::size_t common) {
  const auto errors = static_cast<Eigen::Index>(common);
  const Eigen::Index size = kParameters * static_cast<Eigen::Index>(priors.size()) + errors;
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(size, size);
  information.bottomRightCorner(errors, errors).setIdentity();
  for (std::size_t j = 0; j < priors.size(); ++j) {
    const Eigen::Index first = kParameters * static_cast<Eigen::Index>(j);
    AddPrior(priors[j], information.block(first, first, kParameters, kParameters));
  }
  return information;
}

Eigen::MatrixXd DataInformation(const Observations& data, const std::vector<CameraPrior>& priors,
                                const Weighting& weighting, bool fixed_points,
                                const BundleState& state, const std::vector<double>& reading_weight,
                                const std::vector<double>& survey_weight) {
  const auto c = static_cast<Eigen::Index>(state.cameras.size());
  const auto common = fixed_points ? 0 : static_cast<Eigen::Index>(data.common.size());
  const Eigen::Index size = kParameters * c + common;
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(size, size);
  std::vector<CameraColumns> mixed(static_cast<std::size_t>(c));  // H_cP of the point at hand
  std::vector<Eigen::Index> seen_by;
  std::size_t k = 0;
  for (Eigen::Index i = 0; i < data.p.cols(); ++i) {
    const auto point = static_cast<std::size_t>(i);
    const Eigen::Matrix3d S = survey_weight[point] * data.cov[point].inverse() /
                              (weighting.survey_factor * weighting.survey_factor);
    Eigen::Matrix3d H_PP = S;
    seen_by.clear();
    for (; k < data.readings.size() && data.readings[k].point == i; ++k) {
      const Reading& r = data.readings[k];
      measure::Projection projection;
      if (reading_weight[k] <= 0.0 ||
          !ProjectFree(state.cameras[static_cast<std::size_t>(r.camera)],
                       priors[static_cast<std::size_t>(r.camera)], state.points.col(i),
                       &projection)) {
        continue;
      }
      const double w = reading_weight[k] / weighting.Variance(r);
      const Eigen::Index j = r.camera;
      H_PP += w * projection.du_dp.transpose() * projection.du_dp;
      information.block<kParameters, kParameters>(kParameters * j, kParameters * j) +=
          w * projection.du_dc.transpose() * projection.du_dc;
      mixed[static_cast<std::size_t>(j)] = w * projection.du_dc.transpose() * projection.du_dp;
      seen_by.push_back(j);
    }
    if (fixed_points) continue;
    const Eigen::Matrix3d inverse = H_PP.inverse();
    const Eigen::Matrix3Xd B = common > 0 ? ShiftsOf(data, i) : Eigen::Matrix3Xd(3, 0);
    information.bottomRightCorner(common, common) += B.transpose() * (S - S * inverse * S) * B;
    for (const Eigen::Index a : seen_by) {
      const CameraColumns left = mixed[static_cast<std::size_t>(a)] * inverse;
      information.block(kParameters * c, kParameters * a, common, kParameters) -=
          (left * S * B).transpose();
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

Eigen::MatrixXd CameraCovariance(const Eigen::MatrixXd& all) {
  // What stands alone, as terms that are held do, is inverted by itself.
  std::vector<Eigen::Index> together;
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(all.rows(), all.cols());
  for (Eigen::Index k = 0; k < all.rows(); ++k) {
    if (all.col(k).cwiseAbs().sum() > std::abs(all(k, k))) {
      together.push_back(k);
    } else {
      out(k, k) = 1.0 / all(k, k);
    }
  }
  if (together.empty()) return out;
  const Eigen::MatrixXd information = all(together, together);
  const Eigen::VectorXd scale = information.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * information * scale.asDiagonal();
  // By eigenvalues: what round-off leaves below zero is cut off, and the inverse stays
  // semidefinite.
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scaled);
  const double least = 1e-14 * eigen.eigenvalues().maxCoeff();
  const Eigen::VectorXd inverse = eigen.eigenvalues().cwiseMax(least).cwiseInverse();
  const Eigen::MatrixXd half =
      scale.asDiagonal() * eigen.eigenvectors() * inverse.cwiseSqrt().asDiagonal();
  out(together, together) = half * half.transpose();
  return out;
}

double SigmaAlong(const Eigen::Matrix3d& covariance, const Eigen::Vector3d& v) {
  const double length = v.norm();
  if (!(length > 0.0)) return std::sqrt(covariance.diagonal().maxCoeff());
  return std::sqrt((v / length).dot(covariance * (v / length)));
}

void ClearFixed(const std::vector<CameraPrior>& priors, Eigen::MatrixXd* covariance) {
  for (std::size_t j = 0; j < priors.size(); ++j) {
    for (int k = 0; k < kTerms; ++k) {
      if (!priors[j].Fixed(k)) continue;
      const Eigen::Index at = kParameters * static_cast<Eigen::Index>(j) + data::kFirstTerm + k;
      covariance->row(at).setZero();
      covariance->col(at).setZero();
    }
  }
}

Redundancy RedundancyOf(const Observations& data, const std::vector<CameraPrior>& priors,
                        const Weighting& weighting, const BundleState& state,
                        const Eigen::MatrixXd& covariance) {
  Redundancy out;
  out.reading.assign(data.readings.size(), 0.0);
  out.survey.assign(static_cast<std::size_t>(data.points()), 0.0);
  out.by_rig.assign(data.readings.size(), 0.0);
  const Eigen::Index size = covariance.rows();
  std::vector<measure::Projection> seen;
  std::vector<std::size_t> which;
  const auto common = static_cast<Eigen::Index>(data.common.size());
  Eigen::MatrixXd H_Pc(3, size), moved(3, size);  // of cameras and common errors
  std::size_t k = 0;
  for (int i = 0; i < data.points(); ++i) {
    const auto point = static_cast<std::size_t>(i);
    const Eigen::Matrix3d S = data.cov[point].inverse() * weighting.SurveyInformationScale(point);
    Eigen::Matrix3d H_PP = S;
    H_Pc.setZero();
    seen.clear();
    which.clear();
    for (; k < data.readings.size() && data.readings[k].point == i; ++k) {
      const Reading& r = data.readings[k];
      const auto j = static_cast<std::size_t>(r.camera);
      measure::Projection h;
      if (!ProjectFree(state.cameras[j], priors[j], state.points.col(i), &h)) continue;
      seen.push_back(h);
      which.push_back(k);
      if (!weighting.Uses(k)) continue;
      const double w = 1.0 / weighting.Variance(r);
      H_PP += w * h.du_dp.transpose() * h.du_dp;
      H_Pc.middleCols(kParameters * r.camera, kParameters) += w * h.du_dp.transpose() * h.du_dc;
    }
    const Eigen::Matrix3Xd B = ShiftsOf(data, i);
    H_Pc.rightCols(common) = S * B;
    const Eigen::Matrix3d inverse = H_PP.inverse();
    moved = -inverse * H_Pc;  // of the point, with the cameras
    const Eigen::MatrixXd spread = moved * covariance;
    const Eigen::Matrix3d of_point = inverse + spread * moved.transpose();
    if (weighting.UsesSurvey(point)) {
      // Of P + B q, which the survey measured.
      const Eigen::Matrix3d mixed_part = spread.rightCols(common) * B.transpose();
      const Eigen::Matrix3d of_survey =
          of_point + mixed_part + mixed_part.transpose() +
          B * covariance.bottomRightCorner(common, common) * B.transpose();
      out.survey[point] = 3.0 - (S * of_survey).trace();
    }
    for (std::size_t m = 0; m < which.size(); ++m) {
      const Reading& r = data.readings[which[m]];
      const Eigen::Index first = kParameters * r.camera;
      const auto& h = seen[m];
      // Of J_c c + J_P P, with P = moved c + its own part.
      const double variance =
          (h.du_dp * of_point * h.du_dp.transpose()).value() +
          2.0 * (h.du_dp * spread.middleCols(first, kParameters) * h.du_dc.transpose()).value() +
          (h.du_dc * covariance.block(first, first, kParameters, kParameters) * h.du_dc.transpose())
              .value();
      if (weighting.Uses(which[m])) {
        out.reading[which[m]] = std::max(0.0, 1.0 - variance / weighting.Variance(r));
      } else {
        const double own = (h.du_dp * inverse * h.du_dp.transpose()).value();
        out.by_rig[which[m]] = (variance - own) / (own + weighting.Variance(r));
      }
    }
  }
  return out;
}

}  // namespace unfurl::calib
