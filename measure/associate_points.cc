#include <algorithm>
#include <cmath>
#include <limits>

#include "base/dense.h"
#include "measure/associate.h"
#include "measure/camera_model.h"

// The possible points of one mark.
namespace unfurl::measure {

namespace {

constexpr double kAssociatePointsNone = std::numeric_limits<double>::quiet_NaN();
// For what a linear forecast of a reading leaves out, over the row: a pixel of 2000 [-].
constexpr double kSlack = 5e-4;

}  // namespace

// What the readings say of a point, as if each that was not claimed were clutter: relative to all
// being clutter.
void Associator::Push(const PointSolution& point, std::span<const double> miss,
                      std::vector<Hypothesis>* out) const {
  if (point.outcome != PointOutcome::kSolved) return;
  if (mark_ != nullptr && mark_->lost && point.readings < 4) return;
  Hypothesis h;
  h.point = point;
  h.chosen = chosen_;
  // The readings' densities, integrated over where the point may be.
  h.score = 1.5 * std::log(2.0 * M_PI) + 0.5 * std::log(point.cov.determinant()) -
            0.5 * point.chi_square + Unclaimed(point.p, point.cameras, miss);
  for (std::size_t c = 0; c < u_.size(); ++c) {
    if ((point.cameras >> c & 1U) == 0) continue;
    const double m = miss.empty() ? options_.miss : miss[c];
    const double sigma = std::hypot(s_[c], data::FloorOf(triangulator_.rig(), c));
    h.score += std::log(1.0 - m) - 0.5 * std::log(2.0 * M_PI) - std::log(sigma) - LogClutter(c);
  }
  out->push_back(h);
}

// What the cameras that do not enter say of a point at p.
double Associator::Unclaimed(const Eigen::Vector3d& p, std::uint32_t claimed,
                             std::span<const double> miss) const {
  const std::uint32_t all = u_.size() < 32 ? (1U << u_.size()) - 1 : ~0U;
  const std::uint32_t open = all & ~claimed & (mark_ == nullptr ? all : ~mark_->hidden);
  if (open == 0) return 0.0;
  double score = 0.0;
  std::array<double, CameraBank::kMaxCameras> at;
  if (!lone_.empty()) triangulator_.bank().Readings(p.data(), at.data());
  for (std::size_t c = 0; c < u_.size(); ++c) {
    if ((open >> c & 1U) == 0) continue;
    score += std::log(miss.empty() ? options_.miss : miss[c]);
    if (lone_.empty() || lone_[c].empty() || std::isnan(at[c])) continue;
    double density = 0.0;
    for (const Candidate& spot : lone_[c]) {
      const double least = options_.displaced_sigmas * spot.s_px;
      density += 0.5 / (std::log1p(row_px_[c] / least) * (std::abs(spot.u_px - at[c]) + least));
    }
    score += std::log(density) - LogClutter(c);
  }
  return score;
}

// One reading or two, the ones that are chosen: their density, given where the mark is expected.
void Associator::PushFew(std::span<const double> miss, std::vector<Hypothesis>* out) const {
  Hypothesis h;
  h.chosen = chosen_;
  std::array<std::size_t, 2> used{};
  std::array<double, 2> variance{};
  for (std::size_t c = 0; c < u_.size(); ++c) {
    if (std::isnan(u_[c])) continue;
    const double m = miss.empty() ? options_.miss : miss[c];
    const double floor = data::FloorOf(triangulator_.rig(), c);
    h.score += std::log(1.0 - m) - 0.5 * std::log(2.0 * M_PI) - LogClutter(c);
    variance[static_cast<std::size_t>(h.point.readings)] = s_[c] * s_[c] + floor * floor;
    used[static_cast<std::size_t>(h.point.readings++)] = c;
    h.point.cameras |= 1U << c;
  }
  const auto n = static_cast<std::size_t>(h.point.readings);
  const Motion::Prediction& at = mark_->expected;
  std::array<double, Motion::Prediction::kMost> terms;
  double best = -std::numeric_limits<double>::infinity();
  for (std::size_t j = 0; j < at.count; ++j) {
    terms[j] = -1e300;
    // In order: the second given the first.
    Eigen::Vector3d p = at.mean[j];
    Eigen::Matrix3d P = at.variance[j] * Eigen::Matrix3d::Identity();
    double term = std::log(std::max(at.weight[j], 1e-300));
    bool in_front = true;
    for (std::size_t k = 0; k < n; ++k) {
      const Seen& seen = seen_[used[k] * Motion::Prediction::kMost + j];
      in_front = in_front && seen.in_front;
      const double left = u_[used[k]] - seen.u_px - seen.du_dp * (p - at.mean[j]);
      const Eigen::Vector3d Pj = P * seen.du_dp.transpose();
      const double S = seen.du_dp * Pj + variance[k];
      term -= 0.5 * (std::log(S) + left * left / S);
      p += Pj * (left / S);
      P -= Pj * Pj.transpose() / S;
    }
    if (!in_front) continue;
    terms[j] = term;
    if (term <= best) continue;
    best = term;
    h.point.p = p;
    h.point.cov = P;
  }
  h.score += Unclaimed(h.point.p, h.point.cameras, miss);
  h.weighed = h.score + LogSum({terms.data(), at.count});
  out->push_back(h);
}

std::size_t Associator::Choices(std::span<const std::span<const Candidate>> cameras,
                                std::size_t camera) const {
  if (mark_ != nullptr && (mark_->hidden >> camera & 1U) != 0) return 1;
  return std::min(cameras[camera].size(), kMostCandidates);
}

bool Associator::Choose(std::span<const std::span<const Candidate>> cameras, std::size_t camera,
                        std::size_t k) {
  if (mark_ != nullptr && (mark_->hidden >> camera & 1U) != 0) {
    if (std::isnan(mark_->merged[camera].u_px)) return false;
    u_[camera] = mark_->merged[camera].u_px;
    s_[camera] = mark_->merged[camera].s_px;
    chosen_[camera] = kMerged;
    return true;
  }
  if ((near_[camera] >> k & 1U) == 0) return false;
  u_[camera] = cameras[camera][k].u_px;
  s_[camera] = cameras[camera][k].s_px;
  chosen_[camera] = static_cast<std::int8_t>(k);
  return true;
}

void Associator::Unchoose(std::size_t camera) {
  u_[camera] = kAssociatePointsNone;
  chosen_[camera] = -1;
}

// A point from three readings or more, with and without those of the cameras that come after.
void Associator::Extend(std::span<const std::span<const Candidate>> cameras, std::size_t camera,
                        const PointSolution& from, std::span<const double> miss, int readings,
                        std::vector<Hypothesis>* out) {
  if (camera == cameras.size()) {
    Push(from, miss, out);
    PointSolution twin;
    if (readings == 3 && triangulator_.SecondSolution(u_, s_, from, &twin)) Push(twin, miss, out);
    return;
  }
  Extend(cameras, camera + 1, from, miss, readings, out);
  // Only spots that the point so far can reach: its own error, as the camera sees it at most.
  Projection seen;
  const bool in_front = Project(triangulator_.rig().cameras[camera], from.p, &seen);
  const double reach = kSlack * row_px_[camera] +
                       options_.gate_sigmas * seen.du_dp.norm() * std::sqrt(from.cov.trace());
  for (std::size_t k = 0; in_front && k < Choices(cameras, camera); ++k) {
    if (!Choose(cameras, camera, k)) continue;
    if (std::abs(u_[camera] - seen.u_px) < reach + options_.gate_sigmas * s_[camera]) {
      const PointSolution wider = triangulator_.Solve(u_, s_, from.p);
      if (wider.outcome == PointOutcome::kSolved) {
        Extend(cameras, camera + 1, wider, miss, readings + 1, out);
      }
    }
    Unchoose(camera);
  }
}

// The spots of each camera within reach of any place where the mark is expected.
void Associator::FindNear(std::span<const std::span<const Candidate>> cameras, const Mark& mark) {
  near_.fill(0);
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    for (std::size_t j = 0; j < mark.expected.count; ++j) {
      Seen& seen = seen_[c * Motion::Prediction::kMost + j];
      Projection here;
      seen.in_front = Project(triangulator_.rig().cameras[c], mark.expected.mean[j], &here);
      if (!seen.in_front) continue;
      seen.u_px = here.u_px;
      seen.du_dp = here.du_dp;
      if ((mark.hidden >> c & 1U) != 0) continue;
      const double reach =
          options_.gate_sigmas * here.du_dp.norm() * std::sqrt(mark.expected.variance[j]);
      for (std::size_t k = 0; k < std::min(cameras[c].size(), kMostCandidates); ++k) {
        const Candidate& candidate = cameras[c][k];
        if (std::abs(candidate.u_px - here.u_px) <
            reach + kSlack * row_px_[c] + options_.gate_sigmas * candidate.s_px) {
          near_[c] |= static_cast<std::uint8_t>(1U << k);
        }
      }
    }
  }
}

void Associator::Enumerate(std::span<const std::span<const Candidate>> cameras, const Mark* mark,
                           std::span<const double> miss, std::vector<Hypothesis>* out) {
  out->clear();
  std::fill(u_.begin(), u_.end(), kAssociatePointsNone);
  chosen_.fill(-1);
  const std::size_t n = cameras.size();
  // Spots near where the mark is expected, or all of them.
  near_.fill(0xFF);
  mark_ = mark;
  Eigen::Vector3d start = triangulator_.centre();
  if (mark != nullptr) {
    start = mark->expected.Likeliest();
    FindNear(cameras, *mark);
  }
  const auto each = [&](std::size_t c, const auto& then) {
    for (std::size_t k = 0; k < Choices(cameras, c); ++k) {
      if (!Choose(cameras, c, k)) continue;
      then();
      Unchoose(c);
    }
  };
  if (mark != nullptr && (mark->followed || !lone_.empty())) {
    for (std::size_t i = 0; i < n; ++i) {
      each(i, [&] {
        PushFew(miss, out);
        for (std::size_t j = i + 1; j < n; ++j) each(j, [&] { PushFew(miss, out); });
      });
    }
  }
  // Every set of readings is named by its first three.
  for (std::size_t i = 0; i + 2 < n; ++i) {
    for (std::size_t j = i + 1; j + 1 < n; ++j) {
      for (std::size_t k = j + 1; k < n; ++k) {
        each(i, [&] {
          each(j, [&] {
            each(k, [&] {
              const PointSolution three = triangulator_.Solve(u_, s_, start);
              if (three.outcome == PointOutcome::kSolved) {
                Extend(cameras, k + 1, three, miss, 3, out);
              }
            });
          });
        });
      }
    }
  }
}

}  // namespace unfurl::measure
