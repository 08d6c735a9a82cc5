#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "base/pose.h"
#include "base/random.h"
#include "base/statistics.h"
#include "calib/set_up.h"

// Surveys of which a part is measured from another set-up of the station, moved by a whole rotation
// matrix: what the fit takes to first order.
namespace unfurl::calib::testing {

using Vector6 = Eigen::Matrix<double, 6, 1>;

// The survey's places with the names of their set-ups.
inline data::Survey Named(const Observations& data, const std::vector<std::string>& set_up) {
  data::Survey survey;
  survey.id = data.ids;
  survey.p = data.p;
  survey.set_up = set_up;
  return survey;
}

// The two fifths of the points that lie furthest in direction `towards` are measured from "B",
// which is off by `motion`: shift [m], turn [rad] about their middle.
struct TwoSetUps {
  std::vector<std::string> names;
  std::vector<int> of_b;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  double arm = 0.0;  // RMS [m]

  TwoSetUps(const Eigen::Matrix3Xd& places, const Eigen::Vector3d& towards) {
    std::vector<double> way;
    for (Eigen::Index i = 0; i < places.cols(); ++i) way.push_back(places.col(i).dot(towards));
    const double from = Quantile(way, 0.6);
    for (std::size_t i = 0; i < way.size(); ++i) {
      names.emplace_back(way[i] > from ? "B" : "A");
      if (way[i] > from) of_b.push_back(static_cast<int>(i));
    }
    const Eigen::Matrix3Xd p = places(Eigen::all, of_b);
    middle = p.rowwise().mean();
    arm = std::sqrt((p.colwise() - middle).squaredNorm() / static_cast<double>(of_b.size()));
  }
  void Move(const Vector6& motion, Eigen::Matrix3Xd* p) const {
    const Eigen::Matrix3d R = RotationFromVector(motion.tail<3>());
    for (const int i : of_b) {
      p->col(i) = R * (p->col(i) - middle) + middle + motion.head<3>();
    }
  }
};

// Off by `sigmas` of a point: as a shift, and again as a turn at the points' RMS distance.
inline Vector6 MotionOf(double sigmas, double sigma, double arm, Rng rng) {
  Vector6 out;
  for (int k = 0; k < 6; ++k) out(k) = rng.Normal();
  out.head<3>() *= sigmas * sigma / out.head<3>().norm();
  out.tail<3>() *= sigmas * sigma / arm / out.tail<3>().norm();
  return out;
}

inline Eigen::Vector3d Towards(Rng rng) {
  Eigen::Vector3d out;
  for (int k = 0; k < 3; ++k) out(k) = rng.Normal();
  return out.normalized();
}

}  // namespace unfurl::calib::testing
