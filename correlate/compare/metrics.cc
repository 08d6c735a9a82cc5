#include "correlate/compare/metrics.h"

#include <cmath>

#include "base/length.h"

namespace unfurl::correlate {

namespace {

// Sums of one mark, or of all.
struct Sums {
  std::size_t n = 0;
  double xy = 0.0, zz = 0.0, z = 0.0, white = 0.0;
  MarkError worst;

  void Add(const Eigen::Vector3d& e, const Eigen::Vector3d& r, double t) {
    ++n;
    xy += e.head<2>().squaredNorm();
    zz += e.z() * e.z();
    z += e.z();
    white += r.squaredNorm();
    if (e.norm() > worst.largest) {
      worst.largest = e.norm();
      worst.largest_at = t;
    }
    worst.largest_sigmas = std::max(worst.largest_sigmas, r.cwiseAbs().maxCoeff());
  }

  MarkError Result(const std::string& name, bool has_sigma) const {
    MarkError out = worst;
    out.mark = name;
    out.samples = n;
    if (n == 0) return out;
    const auto count = static_cast<double>(n);
    out.rmse = std::sqrt((xy + zz) / count);
    out.rmse_in_plane = std::sqrt(xy / count);
    out.rmse_across = std::sqrt(zz / count);
    out.bias_across = z / count;
    out.sigmas = has_sigma ? std::sqrt(white / (3.0 * count)) : 0.0;
    if (!has_sigma) out.largest_sigmas = 0.0;
    return out;
  }
};

}  // namespace

std::vector<MarkError> Errors(const Observations& observations, const Prediction& prediction,
                              const Clock& reference, const RegistrationFit& fit) {
  const auto residuals = ResidualsInModelFrame(observations, prediction, reference, fit.at);
  std::vector<MarkError> out;
  Sums all;
  Eigen::Index row = 0;
  for (std::size_t m = 0; m < observations.marks.size(); ++m) {
    Sums one;
    const auto& known = prediction.marks[m].known;
    for (Eigen::Index i = 0; i < residuals[m].cols(); ++i, row += 3) {
      const auto k = static_cast<std::size_t>(i);
      if (!known.empty() && !known[k]) continue;
      const Eigen::Vector3d e = residuals[m].col(i);
      const Eigen::Vector3d r = fit.residual.segment<3>(row);
      one.Add(e, r, observations.marks[m].t[k]);
      all.Add(e, r, observations.marks[m].t[k]);
    }
    out.push_back(one.Result(observations.marks[m].name, observations.has_sigma));
  }
  out.push_back(all.Result("all", observations.has_sigma));
  return out;
}

std::vector<Eigen::Matrix3Xd> InModelFrame(const Observations& observations,
                                           const Registration& at) {
  const Pose X_MW = at.X_WM.inverse();
  const int k = observations.shared_rank;
  std::vector<Eigen::Matrix3Xd> out;
  for (const MarkSeries& series : observations.marks) {
    Eigen::Matrix3Xd p(3, series.p.cols());
    for (Eigen::Index i = 0; i < p.cols(); ++i) {
      Eigen::Vector3d w = series.p.col(i);
      if (k > 0 && at.z.size() == k) w -= series.shared.middleCols(i * k, k) * at.z;
      p.col(i) = X_MW * w;
    }
    out.push_back(std::move(p));
  }
  return out;
}

std::vector<Eigen::Matrix3Xd> SigmasInModelFrame(const Observations& observations,
                                                 const Registration& at) {
  const Eigen::Matrix3d R_MW = at.X_WM.linear().transpose();
  const int k = observations.shared_rank;
  std::vector<Eigen::Matrix3Xd> out;
  for (const MarkSeries& series : observations.marks) {
    Eigen::Matrix3Xd s(3, series.p.cols());
    for (Eigen::Index i = 0; i < s.cols(); ++i) {
      Eigen::Matrix3d cov = Symmetric(series.cov.col(i));
      if (k > 0) {
        const auto F = series.shared.middleCols(i * k, k);
        cov += F * F.transpose();
      }
      s.col(i) = (R_MW * cov * R_MW.transpose()).diagonal().cwiseSqrt();
    }
    out.push_back(std::move(s));
  }
  return out;
}

std::string MeanText(double mean, double rms) {
  constexpr double kNothing = 1e-3;  // of the root mean square: three digits of it show no less
  return std::abs(mean) < kNothing * rms ? "0" : LengthText(mean);
}

}  // namespace unfurl::correlate
