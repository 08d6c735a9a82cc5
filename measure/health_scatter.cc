// How readings scatter over what is stated. Of three flashes of a mark in a row the middle one's
// readings less the line through the others': a smooth way, the calibration's errors along it and
// what a camera does that moved all leave nothing, white noise leaves its own. What a place
// explains is taken out; what is left has covariance sum_c k_c^2 v_c n_c n_c^T, with v_c the stated
// variance and n_c camera c's part in what places cannot explain. The k_c^2 are found by maximum
// likelihood (variance components, by Fisher's scoring), with what is beyond chance of any left
// out.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "base/dense.h"
#include "base/statistics.h"
#include "base/text.h"
#include "measure/camera_model.h"
#include "measure/health.h"
#include "measure/scatter_components.h"

namespace unfurl::measure {

namespace {

constexpr std::size_t kMostTriples = 3000;  // the factor's error is then below 2%
// Of a mark's usual time between flashes: a longer gap within three of them is no row.
constexpr double kLongestGap = 1.5;
constexpr std::size_t kFewestNumbers = 8;  // redundant ones: of fewer a median is no scale

class Triples {
 public:
  Triples(const HealthEvidence& evidence, const Triangulator& triangulator)
      : evidence_(evidence), triangulator_(triangulator), cameras_(triangulator.cameras()) {}

  std::vector<Triple> All() const {
    std::map<int, std::vector<std::size_t>> flashes;  // by mark
    std::size_t lit = 0;
    for (std::size_t i = 0; i < evidence_.size(); ++i) {
      if (evidence_.mark(i) < 0) continue;
      flashes[evidence_.mark(i)].push_back(i);
      ++lit;
    }
    // Rows that share no flash, so that triples are independent; of long records fewer.
    const std::size_t stride = 3 * std::max<std::size_t>(1, lit / (3 * kMostTriples));
    std::vector<Triple> out;
    for (const auto& [mark, lines] : flashes) {
      if (lines.size() < 3) continue;
      std::vector<double> gaps;
      for (std::size_t k = 1; k < lines.size(); ++k) {
        gaps.push_back(evidence_.t(lines[k]) - evidence_.t(lines[k - 1]));
      }
      const double longest = kLongestGap * Median(gaps);
      Eigen::Vector3d last = triangulator_.centre();
      for (std::size_t k = 1; k + 1 < lines.size(); k += stride) {
        if (gaps[k - 1] > longest || gaps[k] > longest) continue;
        Triple triple;
        if (TripleOf({lines[k - 1], lines[k], lines[k + 1]}, &last, &triple)) {
          out.push_back(std::move(triple));
        }
      }
    }
    return out;
  }

 private:
  using Lanes = std::array<double, CameraBank::kMaxCameras>;

  bool TripleOf(const std::array<std::size_t, 3>& lines, Eigen::Vector3d* last, Triple* out) const {
    const double span = evidence_.t(lines[2]) - evidence_.t(lines[0]);
    if (!(span > 0.0)) return false;
    const double share = (evidence_.t(lines[1]) - evidence_.t(lines[0])) / span;
    const std::array<double, 3> weight = {share - 1.0, 1.0, -share};
    std::uint32_t use = 0;
    for (std::size_t c = 0; c < cameras_; ++c) {
      bool seen = true;
      for (const std::size_t i : lines) seen = seen && !std::isnan(evidence_.At(i, c).u_px);
      if (seen) use |= 1U << c;
    }
    const auto C = static_cast<Eigen::Index>(cameras_);
    Eigen::VectorXd r = Eigen::VectorXd::Zero(C), v = Eigen::VectorXd::Zero(C);
    PointSolution middle;
    for (std::size_t k = 0; k < 3; ++k) {
      Lanes u{}, s{}, residual{};
      for (std::size_t c = 0; c < cameras_; ++c) {
        u[c] = evidence_.At(lines[k], c).u_px;
        s[c] = evidence_.At(lines[k], c).s_px;
      }
      PointSolution point;
      if (!Solve({u.data(), cameras_}, {s.data(), cameras_}, use, *last, &point)) return false;
      *last = point.p;
      if (k == 1) middle = point;
      triangulator_.Residuals({u.data(), cameras_}, point, {residual.data(), cameras_});
      for (Eigen::Index c = 0; c < C; ++c) {
        const auto j = static_cast<std::size_t>(c);
        if ((use >> j & 1U) == 0) continue;
        r(c) += weight[k] * residual[j];
        v(c) += weight[k] * weight[k] * s[j] * s[j];
      }
    }
    return Reduce(middle, r, v, out);
  }

  bool Solve(std::span<const double> u, std::span<const double> s, std::uint32_t use,
             const Eigen::Vector3d& last, PointSolution* point) const {
    for (const Eigen::Vector3d& start : {last, triangulator_.centre()}) {
      *point = triangulator_.Solve(u, s, start, use);
      if (point->readings < 4) return false;
      if (point->outcome == PointOutcome::kSolved || point->outcome == PointOutcome::kDisagree) {
        return true;
      }
    }
    return false;
  }

  // What no place explains: along the left null space of the derivatives by place.
  bool Reduce(const PointSolution& point, const Eigen::VectorXd& r, const Eigen::VectorXd& v,
              Triple* out) const {
    const Eigen::Index n = point.readings, C = r.size();
    Eigen::MatrixXd J(n, 3);
    std::vector<Eigen::Index> seen;
    for (Eigen::Index c = 0; c < C; ++c) {
      Projection here;
      if ((point.cameras >> c & 1U) == 0) continue;
      const auto k = static_cast<std::size_t>(c);
      if (!Project(triangulator_.rig().cameras[k], point.p, &here)) return false;
      J.row(static_cast<Eigen::Index>(seen.size())) = here.du_dp;
      seen.push_back(c);
    }
    const Eigen::HouseholderQR<Eigen::MatrixXd> qr(J);
    const Eigen::MatrixXd Q = qr.householderQ() * Eigen::MatrixXd::Identity(n, n);
    const Eigen::MatrixXd N = Q.rightCols(n - 3);
    out->y = Eigen::VectorXd::Zero(n - 3);
    out->part = Eigen::MatrixXd::Zero(n - 3, C);
    for (Eigen::Index k = 0; k < n; ++k) {
      const Eigen::Index c = seen[static_cast<std::size_t>(k)];
      out->y += N.row(k).transpose() * r(c);
      out->part.col(c) = N.row(k).transpose() * std::sqrt(v(c));
      if (!(v(c) > 0.0)) return false;
    }
    return true;
  }

  const HealthEvidence& evidence_;
  const Triangulator& triangulator_;
  std::size_t cameras_;
};

// The chance that readings which scatter as stated scatter so much, of all together or of any one
// camera; each sum as the chi-square of the same mean and variance.
double ChanceOfScatter(const Components& components, double common, Eigen::Index cameras) {
  const Eigen::VectorXd one = Eigen::VectorXd::Ones(cameras);
  const Sums sums = components.Collect(common * one, one);
  double least = ChiSquareTail(sums.chi_square, sums.numbers);
  for (Eigen::Index c = 0; c < cameras; ++c) {
    // The covariances' sum is the stated one: tr(S^-1 A_c) = sum over d of tr(S^-1 A_c S^-1 A_d).
    const double mean = sums.fisher.row(c).sum(), variance = 2.0 * sums.fisher(c, c);
    if (!(mean > 0.0) || !(variance > 0.0)) continue;
    const double numbers = 2.0 * mean * mean / variance;
    least = std::min(least, ChiSquareTail(sums.along(c) / mean * numbers, numbers));
  }
  return ChanceOfAny(std::min(least, 1.0), static_cast<double>(cameras + 1));
}

// Of a square with its standard deviation.
Scatter RootOf(double square, double sigma) {
  const double factor = std::sqrt(square);
  return {factor, 0.5 * sigma / factor};
}

}  // namespace

ScatterReport FindScatter(const HealthEvidence& evidence, const Triangulator& triangulator,
                          const HealthOptions& options) {
  ScatterReport out;
  const std::size_t cameras = triangulator.cameras();
  const auto C = static_cast<Eigen::Index>(cameras);
  out.cameras.resize(cameras);
  if (cameras < 4) {
    out.unknown = "three cameras leave no reading over";
    return out;
  }
  const std::vector<Triple> triples = Triples(evidence, triangulator).All();
  for (const Triple& triple : triples) out.redundant += static_cast<std::size_t>(triple.y.size());
  if (out.redundant < kFewestNumbers) {
    out.unknown =
        "too few marks are seen by four cameras at once in three of their flashes in a row";
    return out;
  }
  const Components components(triples, cameras);
  const double common = components.Common();
  const double of_common = common * std::sqrt(2.0 / static_cast<double>(out.redundant));
  out.all = RootOf(common, of_common);
  if (!(ChanceOfScatter(components, common, C) < options.scatter_alarm)) return out;
  Eigen::MatrixXd covariance;
  const Eigen::VectorXd each = components.Each(common, 1.0, &covariance);
  const double harm = 1.0 + options.scatter_harmless;
  out.wide = common > harm || each.maxCoeff() > harm;
  for (Eigen::Index c = 0; out.wide && c < C; ++c) {
    out.cameras[static_cast<std::size_t>(c)] = RootOf(each(c), std::sqrt(covariance(c, c)));
  }
  return out;
}

std::vector<double> WideningsOf(const ScatterReport& scatter, std::size_t cameras) {
  std::vector<double> out(cameras, 1.0);
  for (std::size_t c = 0; scatter.wide && c < cameras; ++c) out[c] = scatter.cameras[c].factor;
  return out;
}

void AddWidenings(const ScatterReport& scatter, std::size_t cameras,
                  std::vector<Correction>* corrections) {
  const std::vector<double> factors = WideningsOf(scatter, cameras);
  for (std::size_t c = 0; c < cameras; ++c) {
    if (factors[c] == 1.0) continue;
    corrections->push_back({.camera = static_cast<int>(c), .widen = factors[c]});
  }
}

std::string Describe(const ScatterReport& scatter, std::span<const std::string> cameras) {
  const auto with_sigma = [](const Scatter& one) {
    return fmt::format("{:.2f} +- {:.2f} times what is stated", one.factor, one.sigma);
  };
  if (!scatter.unknown.empty()) {
    return "whether readings scatter as stated cannot be told: " + scatter.unknown;
  }
  if (!scatter.wide) return "readings scatter " + with_sigma(scatter.all);
  std::vector<std::string> named, all;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    constexpr double kSure = 3.0;  // sigmas
    const Scatter& one = scatter.cameras[c];
    const std::string words = fmt::format("camera {} scatter {}", cameras[c], with_sigma(one));
    if (one.factor - 1.0 > kSure * one.sigma) named.push_back(words);
  }
  if (named.size() == cameras.size()) return "readings scatter " + with_sigma(scatter.all);
  if (named.empty()) {
    return "readings scatter " + with_sigma(scatter.all) + "; of which camera cannot be told";
  }
  return "readings of " + JoinWords(named);
}

}  // namespace unfurl::measure
