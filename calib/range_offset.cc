#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "base/dense.h"
#include "calib/explain.h"

namespace unfurl::calib {
namespace {

constexpr double kGate = 4.0;  // sigmas per coordinate
// Points that must share an offset: one determines it where the station is known, two where it is
// not (four unknowns, three coordinates each). The others are the check.
constexpr int kFewestWithStation = 3, kFewestWithout = 5;
constexpr int kOffsetRounds = 10;  // ends a cycle between two sets of members

// How far a shift is from `offset` along the line from the station, in its own sigmas.
double Misfit(const Eigen::Vector3d& p, const Eigen::Vector3d& shift, const Eigen::Matrix3d& cov,
              const Eigen::Vector3d& station, double offset) {
  const Eigen::Vector3d d = shift - offset * (p - station).normalized();
  return std::sqrt(d.dot(cov.llt().solve(d)) / 3.0);
}

// Members of a station and offset, and both again from the members, until they stay.
RangeOffset Grow(const Eigen::Matrix3Xd& p, const Eigen::Matrix3Xd& shift,
                 const std::vector<Eigen::Matrix3d>& cov, Eigen::Vector3d station, double offset,
                 bool free_station, double gate) {
  RangeOffset out;
  for (int round = 0; round < kOffsetRounds; ++round) {
    std::vector<int> members;
    for (int i = 0; i < p.cols(); ++i) {
      if (Misfit(p.col(i), shift.col(i), cov[static_cast<std::size_t>(i)], station, offset) <
          gate) {
        members.push_back(i);
      }
    }
    if (members == out.members && round > 0) break;
    out.members = members;
    if (members.size() < 3) break;
    // Gauss-Newton in offset and station, weighted by the shifts' own covariances.
    Eigen::Matrix4d A = Eigen::Matrix4d::Zero();
    Eigen::Vector4d b = Eigen::Vector4d::Zero();
    for (const int i : members) {
      const Eigen::Vector3d way = p.col(i) - station;
      const double distance = way.norm();
      const Eigen::Vector3d r = way / distance;
      Eigen::Matrix<double, 3, 4> J;
      J << r, -offset / distance * (Eigen::Matrix3d::Identity() - r * r.transpose());
      const Eigen::Matrix3d W = cov[static_cast<std::size_t>(i)].inverse();
      A += J.transpose() * W * J;
      b += J.transpose() * W * (shift.col(i) - offset * r);
    }
    if (free_station) {
      A.bottomRightCorner<3, 3>() += Eigen::Matrix3d::Identity() * 1e-4;  // 100 m
      const Eigen::Vector4d step = Eigen::MatrixXd(A).ldlt().solve(Eigen::VectorXd(b));
      offset += step(0);
      Eigen::Vector3d move = step.tail<3>();
      if (move.norm() > 3.0) move *= 3.0 / move.norm();
      station += move;
    } else {
      offset += b(0) / A(0, 0);
    }
    out.sigma = std::sqrt(free_station ? A.inverse()(0, 0) : 1.0 / A(0, 0));
  }
  out.offset = offset;
  out.station = station;
  return out;
}

}  // namespace

RangeOffset FindRangeOffset(const Eigen::Matrix3Xd& p, const Eigen::Matrix3Xd& shift,
                            const std::vector<Eigen::Matrix3d>& cov,
                            const Eigen::Vector3d& station) {
  RangeOffset best;
  const auto n = static_cast<int>(p.cols());
  const bool known = station.allFinite();
  const auto take = [&](RangeOffset found) {
    if (found.members.size() > best.members.size()) best = std::move(found);
  };
  if (known) {
    for (int i = 0; i < n; ++i) {
      const double offset = shift.col(i).dot((p.col(i) - station).normalized());
      take(Grow(p, shift, cov, station, offset, false, kGate));
    }
  } else {
    // Each pair of shifts of one length meets, or nearly, in a station; either sign of the offset.
    for (int i = 0; i < n; ++i) {
      for (int k = i + 1; k < n; ++k) {
        const double a = shift.col(i).norm(), b = shift.col(k).norm();
        const double sigma = std::sqrt(cov[static_cast<std::size_t>(i)].trace() +
                                       cov[static_cast<std::size_t>(k)].trace());
        if (std::abs(a - b) > kGate * sigma || std::min(a, b) < kGate * sigma) continue;
        const Eigen::Vector3d da = shift.col(i) / a, db = shift.col(k) / b;
        const double cosine = da.dot(db), sine2 = 1.0 - cosine * cosine;
        if (sine2 < 1e-3) continue;
        const Eigen::Vector3d between = p.col(k) - p.col(i);
        const double along_a = (between.dot(da) - cosine * between.dot(db)) / sine2;
        const double along_b = (cosine * between.dot(da) - between.dot(db)) / sine2;
        if (along_a * along_b <= 0.0) continue;  // both towards it, or both away
        const Eigen::Vector3d meet = 0.5 * (p.col(i) + along_a * da + p.col(k) + along_b * db);
        const double offset = along_a > 0.0 ? -0.5 * (a + b) : 0.5 * (a + b);
        // A pair's directions are rough: a wide gate first, then the proper one.
        const RangeOffset rough = Grow(p, shift, cov, meet, offset, true, 5.0 * kGate);
        take(Grow(p, shift, cov, rough.station, rough.offset, true, kGate));
      }
    }
  }
  best.found =
      static_cast<int>(best.members.size()) >= (known ? kFewestWithStation : kFewestWithout) &&
      std::abs(best.offset) > kGate * best.sigma;
  return best;
}

std::string PrismsThatDiffer(const RangeOffset& found) {
  // Of one widespread maker: round 0, mini 17.5, 360-degree 23.1, reflectorless and tape 34.4 mm.
  constexpr std::array<std::pair<double, const char*>, 5> kKnown = {
      {{34.4e-3, "a round prism and none (or tape)"},
       {17.5e-3, "a round prism and a mini prism"},
       {16.9e-3, "a mini prism and none (or tape)"},
       {23.1e-3, "a round prism and a 360-degree prism"},
       {11.3e-3, "a 360-degree prism and none (or tape)"}}};
  for (const auto& [size, what] : kKnown) {
    if (std::abs(std::abs(found.offset) - size) < std::min(4.0 * found.sigma, 0.5e-3)) {
      return fmt::format("; the difference of {:.1f} mm is that between {}", 1e3 * size, what);
    }
  }
  return {};
}

}  // namespace unfurl::calib
