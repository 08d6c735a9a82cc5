#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/dense.h"
#include "base/length.h"
#include "base/statistics.h"
#include "calib/explain_parts.h"

namespace unfurl::calib {
namespace {

constexpr double kSamePlace = 1e-4;     // chance that a true match is missed
constexpr double kPerCoordinate = 4.5;  // sigmas, of one coordinate

// A surveyed point that was left out, and where its readings have it.
struct Displaced {
  int point = 0;
  bool placed = false;
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  Eigen::Matrix3d cov = Eigen::Matrix3d::Zero();
  bool explained = false;
};

class PointExplainer {
 public:
  PointExplainer(const ExplainOptions& options, Findings* findings)
      : findings_(*findings),
        data_(findings->data()),
        bundle_(findings->bundle()),
        options_(options),
        limit_(ChiSquareQuantile(1.0 - kSamePlace, 3.0)) {}

  void Run() {
    FindDisplaced();
    Labels();
    RangeOffsets();
    Axes();
    for (const Displaced& d : displaced_) {
      if (d.explained) continue;
      const double size = d.placed ? (d.p - data_.p.col(d.point)).norm() : 0.0;
      findings_.Add(GrossKind::kDisplacedPoint, {d.point}, -1, size,
                    d.placed
                        ? fmt::format("point {} is {} from where it was surveyed",
                                      findings_.Id(d.point), LengthText(size))
                        : fmt::format("point {}: neither its survey nor enough of its readings fit",
                                      findings_.Id(d.point)));
    }
  }

 private:
  void FindDisplaced() {
    std::size_t first = 0;
    for (int i = 0; i < data_.points(); ++i) {
      std::size_t end = first;
      unsigned use = 0;
      while (end < data_.readings.size() && data_.readings[end].point == i) {
        if (bundle_.weighting.Uses(end) && end - first < 32) use |= 1U << (end - first);
        ++end;
      }
      if (!bundle_.weighting.UsesSurvey(static_cast<std::size_t>(i))) {
        Displaced d;
        d.point = i;
        PointFit fit;
        d.placed = end > first && FitPoint(data_, bundle_.weighting, bundle_.state.cameras, first,
                                           use, false, bundle_.state.points.col(i), &fit);
        if (d.placed) {
          d.p = fit.p;
          d.cov = fit.cov;
        }
        displaced_.push_back(d);
      }
      first = end;
    }
  }

  bool Same(const Displaced& d, const Eigen::Vector3d& place, const Eigen::Matrix3d& cov) const {
    const Eigen::Vector3d e = d.p - place;
    return e.dot((d.cov + cov).llt().solve(e)) < limit_;
  }

  // Places of other points: swapped, shifted in a ring, or simply another's.
  void Labels() {
    const std::size_t n = displaced_.size();
    std::vector<int> target(n, -1);  // the point at whose surveyed place a displaced one is
    for (std::size_t k = 0; k < n; ++k) {
      const Displaced& d = displaced_[k];
      for (int i = 0; d.placed && i < data_.points(); ++i) {
        if (i != d.point && Same(d, data_.p.col(i), findings_.SurveyCov(i))) target[k] = i;
      }
    }
    for (std::size_t k = 0; k < n; ++k) {
      if (target[k] < 0 || displaced_[k].explained) continue;
      const std::vector<int> ring = RingFrom(static_cast<int>(k), target);
      const bool closed =
          ring.size() > 1 && target[static_cast<std::size_t>(ring.back())] ==
                                 displaced_[static_cast<std::size_t>(ring.front())].point;
      if (closed) {
        AddRing(ring);
        continue;
      }
      displaced_[k].explained = true;
      const double size = (displaced_[k].p - data_.p.col(displaced_[k].point)).norm();
      findings_.Add(
          GrossKind::kMislabelled, {displaced_[k].point, target[k]}, -1, size,
          fmt::format("mislabelled: the readings of point {} were taken where point {} was "
                      "surveyed",
                      findings_.Id(displaced_[k].point), findings_.Id(target[k])));
    }
  }

  // Displaced points, each at the place of the next one, from `first` until that leads to no
  // further one; indices into displaced_.
  std::vector<int> RingFrom(int first, const std::vector<int>& target) const {
    std::vector<int> ring = {first};
    while (ring.size() <= displaced_.size()) {
      const int point = target[static_cast<std::size_t>(ring.back())];
      const auto at = std::find_if(displaced_.begin(), displaced_.end(),
                                   [&](const Displaced& d) { return d.point == point; });
      const auto next = static_cast<int>(at - displaced_.begin());
      if (at == displaced_.end() || target[static_cast<std::size_t>(next)] < 0 ||
          std::find(ring.begin(), ring.end(), next) != ring.end()) {
        break;
      }
      ring.push_back(next);
    }
    return ring;
  }

  void AddRing(const std::vector<int>& ring) {
    const Displaced& front = displaced_[static_cast<std::size_t>(ring.front())];
    const double size = (front.p - data_.p.col(front.point)).norm();
    std::vector<int> points;
    for (const int r : ring) {
      displaced_[static_cast<std::size_t>(r)].explained = true;
      points.push_back(displaced_[static_cast<std::size_t>(r)].point);
    }
    if (points.size() == 2) {
      const std::string text = fmt::format("swapped: points {} and {} have each other's place",
                                           findings_.Id(points[0]), findings_.Id(points[1]));
      findings_.Add(GrossKind::kSwappedPoints, points, -1, size, text);
      return;
    }
    const std::string text =
        fmt::format("labels shifted: of points {}, each one's place stands under the next",
                    findings_.Ids(points));
    findings_.Add(GrossKind::kShiftedLabels, points, -1, size, text);
  }

  void RangeOffsets() {
    while (true) {
      std::vector<std::size_t> open;
      for (std::size_t k = 0; k < displaced_.size(); ++k) {
        if (displaced_[k].placed && !displaced_[k].explained) open.push_back(k);
      }
      const auto n = static_cast<Eigen::Index>(open.size());
      Eigen::Matrix3Xd p(3, n), shift(3, n);
      std::vector<Eigen::Matrix3d> cov;
      for (Eigen::Index k = 0; k < n; ++k) {
        const Displaced& d = displaced_[open[static_cast<std::size_t>(k)]];
        p.col(k) = data_.p.col(d.point);
        shift.col(k) = d.p - p.col(k);
        cov.emplace_back(d.cov + findings_.SurveyCov(d.point));
      }
      const RangeOffset found = FindRangeOffset(p, shift, cov, options_.station);
      if (!found.found) return;
      const Eigen::Vector3d station = found.station + options_.origin;
      std::vector<int> points;
      for (const int m : found.members) {
        Displaced& d = displaced_[open[static_cast<std::size_t>(m)]];
        d.explained = true;
        points.push_back(d.point);
      }
      findings_.Add(
          GrossKind::kPrismConstant, points, -1, std::abs(found.offset),
          fmt::format("prism constant: {} points ({}) were measured {:.1f} +- {:.1f} mm too {}, as "
                      "seen from a station at ({:.2f}, {:.2f}, {:.2f}){}",
                      points.size(), findings_.Ids(points), 1e3 * std::abs(found.offset),
                      1e3 * found.sigma, found.offset > 0.0 ? "short" : "long", station.x(),
                      station.y(), station.z(), PrismsThatDiffer(found)));
    }
  }

  void Axes() {
    constexpr const char* kAxis = "xyz";
    for (Displaced& d : displaced_) {
      if (d.explained || !d.placed) continue;
      const Eigen::Vector3d p = data_.p.col(d.point);
      const Eigen::Matrix3d cov = findings_.SurveyCov(d.point);
      const double size = (d.p - p).norm();
      for (int a = 0; a < 3 && !d.explained; ++a) {
        const int b = (a + 1) % 3;
        Eigen::Matrix3d exchange = Eigen::Matrix3d::Identity();
        exchange.col(a).swap(exchange.col(b));
        if (Same(d, exchange * p, exchange * cov * exchange.transpose())) {
          d.explained = true;
          findings_.Add(GrossKind::kExchangedAxes, {d.point}, -1, size,
                        fmt::format("point {}: {} and {} are exchanged", findings_.Id(d.point),
                                    kAxis[std::min(a, b)], kAxis[std::max(a, b)]));
        }
      }
      for (int a = 0; a < 3 && !d.explained; ++a) {
        Eigen::Vector3d mirrored = p;
        mirrored(a) = -p(a);
        if (Same(d, mirrored, cov)) {
          d.explained = true;
          findings_.Add(
              GrossKind::kMirroredAxis, {d.point}, -1, size,
              fmt::format("point {}: {} has the wrong sign", findings_.Id(d.point), kAxis[a]));
        }
      }
      for (int a = 0; a < 3 && !d.explained; ++a) {
        const Eigen::Vector3d e = d.p - p;
        const Eigen::Matrix3d sum = d.cov + cov;
        const int b = (a + 1) % 3, c = (a + 2) % 3;
        if (std::abs(e(b)) > kPerCoordinate * std::sqrt(sum(b, b)) ||
            std::abs(e(c)) > kPerCoordinate * std::sqrt(sum(c, c)) ||
            std::abs(e(a)) < 2.0 * kPerCoordinate * std::sqrt(sum(a, a))) {
          continue;
        }
        d.explained = true;
        findings_.Add(
            GrossKind::kAlongOneAxis, {d.point}, -1, size,
            fmt::format(
                "point {}: {} alone is off, by {:+.1f} mm (a typing error, or a wrong height)",
                findings_.Id(d.point), kAxis[a], -1e3 * e(a)));
      }
    }
  }

  Findings& findings_;
  const Observations& data_;
  const RefinedBundle& bundle_;
  const ExplainOptions& options_;
  double limit_;  // of squared distances between places, whitened
  std::vector<Displaced> displaced_;
};

}  // namespace

void ExplainPoints(const ExplainOptions& options, Findings* findings) {
  PointExplainer(options, findings).Run();
}

}  // namespace unfurl::calib
