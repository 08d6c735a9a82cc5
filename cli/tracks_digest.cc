#include "cli/tracks_digest.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "report/far_origin.h"

namespace unfurl::cli {

namespace {

constexpr std::size_t kTracksDigestMostDots = 1200;  // per mark
constexpr std::size_t kMostIncidents = 200;  // rows of the table; the others are counted below it
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

}  // namespace

TracksDigest::TracksDigest(const data::Tracks& layout, double from, double duration,
                           std::size_t samples)
    : marks(layout.marks),
      cameras(layout.cameras),
      start(from),
      slice(std::max(duration, 1e-9) / static_cast<double>(kSlices)),
      dots(marks.size()),
      slices(marks.size()),
      residual_t(cameras.size()),
      residual(cameras.size()),
      residual_squared(cameras.size(), 0.0),
      residual_count(cameras.size(), 0),
      reasons(marks.size()),
      every_(std::max<std::size_t>(
          1, samples / std::max<std::size_t>(1, marks.size()) / kTracksDigestMostDots)),
      seen_(marks.size(), 0),
      last_(marks.size()) {}

void TracksDigest::Add(const data::Tracks& block, std::span<const float> residuals) {
  for (std::size_t i = 0; i < block.size(); ++i) {
    const auto m = static_cast<std::size_t>(block.mark[i]);
    const double at =
        std::clamp((block.t[i] - start) / slice, 0.0, static_cast<double>(kSlices) - 1.0);
    ++slices[m][static_cast<std::size_t>(at)].status[static_cast<std::size_t>(block.status[i])];
    AddIncident(block, i);
    const bool shown = seen_[m]++ % every_ == 0;
    if (data::Usable(block.status[i])) AddResiduals(block.t[i], shown, i, residuals);
    if (shown) AddDot(block, i);
  }
}

// A sample that is not as good as it may be, where it differs from the one before.
void TracksDigest::AddIncident(const data::Tracks& block, std::size_t i) {
  const auto m = static_cast<std::size_t>(block.mark[i]);
  const Incident now{block.t[i], block.mark[i], block.status[i],
                     block.reason.empty() ? data::SampleReason::kNone : block.reason[i],
                     block.left_out.empty() ? 0U : block.left_out[i]};
  ++reasons[m][static_cast<std::size_t>(now.reason)];
  const Incident before = last_[m];
  last_[m] = now;
  const bool plain = now.status == data::SampleStatus::kGood && now.left_out == 0;
  const bool alike = before.status == now.status && before.reason == now.reason &&
                     before.left_out == now.left_out && seen_[m] > 0;
  if (plain || alike) return;
  if (incidents.size() < kMostIncidents) {
    incidents.push_back(now);
  } else {
    ++more_incidents;
  }
}

void TracksDigest::AddResiduals(double t, bool shown, std::size_t i,
                                std::span<const float> residuals) {
  if (residuals.empty()) return;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const auto r = static_cast<double>(residuals[i * cameras.size() + c]);
    if (std::isnan(r)) continue;
    residual_squared[c] += r * r;
    ++residual_count[c];
    if (!shown) continue;
    residual_t[c].push_back(t);
    residual[c].push_back(r);
  }
}

void TracksDigest::AddDot(const data::Tracks& block, std::size_t i) {
  const auto col = static_cast<Eigen::Index>(i);
  const bool usable = data::Usable(block.status[i]);
  const Eigen::Index rank = block.shared_rank;
  Dots& to = dots[static_cast<std::size_t>(block.mark[i])];
  to.t.push_back(block.t[i]);
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  if (usable) {
    covariance = block.Covariance(i);
    const Eigen::Matrix3Xd shared = block.shared.middleCols(col * rank, rank);
    covariance += shared * shared.transpose();
  }
  for (Eigen::Index k = 0; k < 3; ++k) {
    const auto axis = static_cast<std::size_t>(k);
    to.p[axis].push_back(usable ? block.p(k, col) : kNone);
    to.axis[axis].push_back(usable ? std::sqrt(covariance(k, k)) : kNone);
  }
  to.covariance.push_back(covariance);
  to.used.push_back(block.used.empty() ? 0U : block.used[i]);
  to.left_out.push_back(block.left_out.empty() ? 0U : block.left_out[i]);
  to.sigma.push_back(usable ? std::sqrt(covariance.trace()) : kNone);
}

std::pair<double, double> TracksDigest::Extent(std::size_t axis) const {
  double low = HUGE_VAL, high = -HUGE_VAL;
  for (const Dots& of : dots) {
    for (const double p : of.p[axis]) {
      if (!std::isfinite(p)) continue;
      low = std::min(low, p);
      high = std::max(high, p);
    }
  }
  return {low, high};
}

std::array<double, 3> TracksDigest::FarOrigins() const {
  std::array<double, 3> origin{};
  for (std::size_t k = 0; k < 3; ++k) {
    const auto [low, high] = Extent(k);
    // Of marks that do not move, a metre.
    if (low <= high) origin[k] = report::FarOrigin(low, std::max(high, low + 1.0));
  }
  return origin;
}

}  // namespace unfurl::cli
