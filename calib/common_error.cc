#include "calib/common_error.h"

#include <cmath>

#include "base/dense.h"
#include "base/error.h"
#include "data/survey_points.h"

namespace unfurl::calib {

std::vector<CommonError> StationErrorsOf(const data::Survey& survey, const std::string& where) {
  const data::StationErrors& stated = survey.station_errors;
  std::vector<CommonError> out;
  if (!(stated.distance_offset > 0.0 || stated.distance_scale > 0.0 || stated.zenith > 0.0)) {
    return out;
  }
  if (!survey.station.allFinite()) {
    throw Error("an error that the station's distances or angles share, without its place", where,
                "add a comment '# station: E, N, H', or give --station");
  }
  const Eigen::Matrix3Xd way = survey.p.colwise() - survey.station;
  const Eigen::RowVectorXd distance = way.colwise().norm();
  const auto add = [&](const char* name, const char* unit, double sigma, auto&& one) {
    if (!(sigma > 0.0)) return;
    Eigen::Matrix3Xd shift(3, way.cols());
    for (Eigen::Index i = 0; i < way.cols(); ++i) {
      if (!(distance(i) > 0.0)) {
        throw Error("point \"" + survey.id[static_cast<std::size_t>(i)] +
                        "\" lies where the station stands",
                    where, "correct the station's place");
      }
      shift.col(i) = sigma * one(i);
    }
    out.push_back({name, unit, sigma, WithoutRigidMotion(survey.p, shift)});
  };
  add("distance offset", "m", stated.distance_offset,
      [&](Eigen::Index i) -> Eigen::Vector3d { return way.col(i) / distance(i); });
  add("distance scale", "1", stated.distance_scale,
      [&](Eigen::Index i) -> Eigen::Vector3d { return way.col(i); });
  add("zenith angle", "rad", stated.zenith, [&](Eigen::Index i) -> Eigen::Vector3d {
    Eigen::Matrix3d J;
    const double hz = std::atan2(way(0, i), way(1, i));
    data::FromPolar(hz, std::acos(way(2, i) / distance(i)), distance(i), &J);
    return J.col(1);
  });
  return out;
}

Eigen::Matrix3Xd WithoutRigidMotion(const Eigen::Matrix3Xd& p, const Eigen::Matrix3Xd& shift) {
  const Eigen::Matrix3Xd centred = p.colwise() - p.rowwise().mean();
  // shift_i = t + w x centred_i, in normal equations; a layout of points on one line has no turn
  // about it, and none is taken off.
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();
  Eigen::Vector3d moment = Eigen::Vector3d::Zero();
  for (Eigen::Index i = 0; i < p.cols(); ++i) {
    const Eigen::Vector3d r = centred.col(i);
    inertia += r.squaredNorm() * Eigen::Matrix3d::Identity() - r * r.transpose();
    moment += r.cross(Eigen::Vector3d(shift.col(i)));
  }
  const Eigen::Vector3d t = shift.rowwise().mean();
  const Eigen::Vector3d w =
      Eigen::MatrixXd(inertia).completeOrthogonalDecomposition().solve(Eigen::VectorXd(moment));
  Eigen::Matrix3Xd out(3, p.cols());
  for (Eigen::Index i = 0; i < p.cols(); ++i) {
    out.col(i) = shift.col(i) - t - w.cross(Eigen::Vector3d(centred.col(i)));
  }
  return out;
}

Eigen::Vector3d CommonShift(const Observations& data, const Eigen::VectorXd& q, Eigen::Index i) {
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();
  for (Eigen::Index m = 0; m < q.size(); ++m) {
    shift += q(m) * data.common[static_cast<std::size_t>(m)].shift.col(i);
  }
  return shift;
}

Observations Corrected(Observations data, const Eigen::VectorXd& q) {
  for (Eigen::Index i = 0; q.size() > 0 && i < data.p.cols(); ++i) {
    data.p.col(i) -= CommonShift(data, q, i);
  }
  return data;
}

std::vector<CommonEstimate> EstimatesOf(const Observations& data, const Eigen::VectorXd& q,
                                        const Eigen::MatrixXd& covariance) {
  std::vector<CommonEstimate> out;
  const Eigen::Index first = covariance.rows() - q.size();
  for (Eigen::Index m = 0; m < q.size(); ++m) {
    const CommonError& error = data.common[static_cast<std::size_t>(m)];
    out.push_back(
        {error.name, error.unit, error.sigma, q(m) * error.sigma,
         error.sigma * std::sqrt(covariance(first + m, first + m)),
         error.set_up < 0 ? "" : data.set_ups[static_cast<std::size_t>(error.set_up)].name});
  }
  return out;
}

}  // namespace unfurl::calib
