// Three flashes of a mark in a row: what is left of their readings once the mark may be anywhere.
#include "measure/flash_triples.h"

#include <algorithm>
#include <map>
#include <utility>

#include "base/dense.h"
#include "base/statistics.h"
#include "measure/camera_model.h"

namespace unfurl::measure {

namespace {

// Of a mark's usual time between flashes: a longer gap within three of them is no row.
constexpr double kLongestGap = 1.5;

// A weighted sum over flashes of each camera's residual, with its stated variance.
struct Numbers {
  explicit Numbers(Eigen::Index cameras)
      : r(Eigen::VectorXd::Zero(cameras)), v(Eigen::VectorXd::Zero(cameras)) {}
  void Add(Eigen::Index c, double weight, double residual, double sigma) {
    r(c) += weight * residual;
    v(c) += weight * weight * sigma * sigma;
  }
  Eigen::VectorXd r, v;  // [px], [px^2]
};

class Triples {
 public:
  Triples(const HealthEvidence& evidence, const Triangulator& triangulator)
      : evidence_(evidence), triangulator_(triangulator), cameras_(triangulator.cameras()) {}

  std::vector<FlashTriple> All(std::size_t most) const {
    std::map<int, std::vector<std::size_t>> flashes;  // by mark
    std::size_t lit = 0;
    for (std::size_t i = 0; i < evidence_.size(); ++i) {
      if (evidence_.mark(i) < 0) continue;
      flashes[evidence_.mark(i)].push_back(i);
      ++lit;
    }
    // Rows that share no flash, so that triples are independent; of long records fewer.
    const std::size_t stride = 3 * std::max<std::size_t>(1, lit / (3 * most));
    std::vector<FlashTriple> out;
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
        FlashTriple triple;
        triple.differs.mark = triple.mean.mark = static_cast<std::size_t>(mark);
        triple.line = lines[k];
        if (TripleOf({lines[k - 1], lines[k], lines[k + 1]}, &last, &triple)) {
          out.push_back(std::move(triple));
        }
      }
    }
    return out;
  }

 private:
  using Lanes = std::array<double, CameraBank::kMaxCameras>;

  bool TripleOf(const std::array<std::size_t, 3>& lines, Eigen::Vector3d* last,
                FlashTriple* out) const {
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
    Numbers differs(C), mean(C);
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
        differs.Add(c, weight[k], residual[j], s[j]);
        mean.Add(c, 1.0 / 3.0, residual[j], s[j]);
      }
    }
    out->p = middle.p;
    out->cameras = middle.cameras;
    if (!FindLeft(middle, &out->left)) return false;
    return Reduce(out->left, use, differs, &out->differs) &&
           Reduce(out->left, use, mean, &out->mean);
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

  // What no place explains: the left null space of the derivatives by place.
  bool FindLeft(const PointSolution& point, Eigen::MatrixXd* left) const {
    const Eigen::Index n = point.readings;
    Eigen::MatrixXd J(n, 3);
    std::vector<Eigen::Index> seen;
    for (std::size_t c = 0; c < cameras_; ++c) {
      Projection here;
      if ((point.cameras >> c & 1U) == 0) continue;
      if (!Project(triangulator_.rig().cameras[c], point.p, &here)) return false;
      J.row(static_cast<Eigen::Index>(seen.size())) = here.du_dp;
      seen.push_back(static_cast<Eigen::Index>(c));
    }
    const Eigen::HouseholderQR<Eigen::MatrixXd> qr(J);
    const Eigen::MatrixXd Q = qr.householderQ() * Eigen::MatrixXd::Identity(n, n);
    *left = Eigen::MatrixXd::Zero(n - 3, static_cast<Eigen::Index>(cameras_));
    for (Eigen::Index k = 0; k < n; ++k) {
      left->col(seen[static_cast<std::size_t>(k)]) = Q.row(k).tail(n - 3).transpose();
    }
    return true;
  }

  static bool Reduce(const Eigen::MatrixXd& left, std::uint32_t use, const Numbers& of,
                     Triple* out) {
    out->y = left * of.r;
    out->part = left * of.v.cwiseSqrt().asDiagonal();
    for (Eigen::Index c = 0; c < of.v.size(); ++c) {
      if ((use >> c & 1U) != 0 && !(of.v(c) > 0.0)) return false;
    }
    return true;
  }

  const HealthEvidence& evidence_;
  const Triangulator& triangulator_;
  std::size_t cameras_;
};

}  // namespace

std::vector<FlashTriple> TriplesOf(const HealthEvidence& evidence, const Triangulator& triangulator,
                                   std::size_t most) {
  return Triples(evidence, triangulator).All(most);
}

}  // namespace unfurl::measure
