#include "correlate/align/body_angle.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "correlate/compare/metrics.h"

namespace unfurl::correlate {

namespace {

// The branch of `angle` nearest to `near`.
double Branch(double angle, double near) {
  constexpr double kTurn = 2.0 * std::numbers::pi;  // [rad]
  return angle - kTurn * std::round((angle - near) / kTurn);
}

bool IsKnown(const MarkMotion& mark, std::size_t i) { return mark.known.empty() || mark.known[i]; }

// Whether stamp `t` falls between two samples that are further apart than `widest`.
bool IsInGap(const std::vector<double>& stamps, double t, double widest) {
  const auto after = std::upper_bound(stamps.begin(), stamps.end(), t);
  return after != stamps.end() && *after - *(after - 1) > widest;
}

// A place by the cubic's weights; adds its covariance to `cov`.
template <typename Places, typename Covariances>
Eigen::Vector3d Interpolate(const LocalCubic& c, const Places& p, const Covariances& covariances,
                            Eigen::Matrix3d* cov) {
  Eigen::Vector3d at = Eigen::Vector3d::Zero();
  for (int j = 0; j < c.count; ++j) {
    const auto from = static_cast<Eigen::Index>(c.first) + j;
    at += c.value[j] * p.col(from);
    *cov += c.value[j] * c.value[j] * Symmetric(covariances.col(from));
  }
  return at;
}

}  // namespace

std::vector<std::pair<std::string, std::string>> RigidPairs(const Prediction& prediction,
                                                            const std::vector<std::string>& marks) {
  constexpr double kConstant = 1e-4;  // change of a distance over itself that counts as none [-]
  constexpr double kNoise = 10.0;     // sigmas between the ends of thousands of normal draws
  std::vector<std::pair<std::string, std::string>> out;
  std::vector<bool> used(marks.size(), false);
  for (std::size_t a = 0; a < marks.size(); ++a) {
    for (std::size_t b = a + 1; b < marks.size() && !used[a]; ++b) {
      const MarkMotion& A = prediction.marks[a];
      const MarkMotion& B = prediction.marks[b];
      const Eigen::Index n = std::min(A.p.cols(), B.p.cols());
      double low = std::numeric_limits<double>::infinity(), high = 0.0, sigma = 0.0;
      for (Eigen::Index i = 0; i < n; ++i) {
        const auto k = static_cast<std::size_t>(i);
        if (!IsKnown(A, k) || !IsKnown(B, k)) continue;
        const double d = (A.p.col(i) - B.p.col(i)).norm();
        low = std::min(low, d);
        high = std::max(high, d);
        if (A.cov.cols() > i && B.cov.cols() > i) {  // a reference that was measured
          const Eigen::Matrix<double, 6, 1> cov = A.cov.col(i) + B.cov.col(i);
          sigma = std::max(sigma, std::sqrt(std::max({cov(0), cov(3), cov(5)})));
        }
      }
      if (used[b] || high <= 0.0 || high - low > kConstant * high + kNoise * sigma) continue;
      out.emplace_back(marks[a], marks[b]);
      used[a] = used[b] = true;
    }
  }
  return out;
}

BodyAngle MeasureBodyAngle(const Observations& observations, const Model& model,
                           std::span<const double> theta, const Registration& at,
                           const std::string& first, const std::string& second) {
  BodyAngle out;
  out.first = first;
  out.second = second;
  const int ia = observations.FindMark(first), ib = observations.FindMark(second);
  if (ia < 0 || ib < 0) return out;
  const auto a = static_cast<std::size_t>(ia), b = static_cast<std::size_t>(ib);
  const MarkSeries& A = observations.marks[a];
  const MarkSeries& B = observations.marks[b];
  if (B.size() < 4) return out;
  const auto p = InModelFrame(observations, at);
  const Eigen::Matrix3d R_MW = at.X_WM.linear().transpose();
  const double widest = SampledModel::kMaxGap * MedianStep(B.t);

  Stamps stamps;
  stamps.marks = {first, second};
  stamps.t.assign(2, A.t);
  for (auto& list : stamps.t) {
    for (double& t : list) t -= at.offset;
  }
  const Prediction prediction = model.Evaluate(theta, stamps);
  if (prediction.status != ModelStatus::kGood) return out;
  const MarkMotion& MA = prediction.marks[0];
  const MarkMotion& MB = prediction.marks[1];

  for (std::size_t i = 0; i < A.size(); ++i) {
    const double t = A.t[i];
    if (t < B.t.front() || t > B.t.back()) continue;
    if (!IsKnown(MA, i) || !IsKnown(MB, i)) continue;
    if (IsInGap(B.t, t, widest)) continue;
    const LocalCubic c = CubicAt(B.t, t);
    Eigen::Matrix3d cov = Symmetric(A.cov.col(static_cast<Eigen::Index>(i)));
    const Eigen::Vector3d pb = Interpolate(c, p[b], B.cov, &cov);
    const auto column = static_cast<Eigen::Index>(i);
    const Eigen::Vector3d d = pb - p[a].col(column);
    const Eigen::Vector3d s = MB.p.col(column) - MA.p.col(column);
    const double simulated = std::atan2(s.y(), s.x());
    out.simulated.push_back(out.simulated.empty() ? simulated
                                                  : Branch(simulated, out.simulated.back()));
    out.measured.push_back(Branch(std::atan2(d.y(), d.x()), out.simulated.back()));
    const double length2 = d.head<2>().squaredNorm();
    const Eigen::Vector3d across = R_MW.transpose() * Eigen::Vector3d(-d.y(), d.x(), 0.0);
    out.sigma.push_back(observations.has_sigma ? std::sqrt(across.dot(cov * across)) / length2
                                               : 0.0);
    out.t.push_back(t);
  }
  return out;
}

}  // namespace unfurl::correlate
