#include "calib/explain.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>

#include "base/length.h"
#include "base/statistics.h"
#include "base/text.h"
#include "measure/camera_model.h"

namespace unfurl::calib {
namespace {

constexpr double kSamePlace = 1e-4;     // chance that a true match is missed
constexpr double kPerCoordinate = 4.5;  // sigmas, of one coordinate
constexpr double kSameReading = 5.0;    // sigmas
constexpr int kFewestAlike = 4;         // readings with one offset

// A surveyed point that was left out, and where its readings have it.
struct Displaced {
  int point = 0;
  bool placed = false;
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  Eigen::Matrix3d cov = Eigen::Matrix3d::Zero();
  bool explained = false;
};

class Explainer {
 public:
  Explainer(const Observations& data, const RefinedBundle& bundle, const ExplainOptions& options)
      : data_(data), bundle_(bundle), options_(options) {
    limit_ = ChiSquareQuantile(1.0 - kSamePlace, 3.0);
  }

  std::vector<GrossFinding> Run() {
    FindDisplaced();
    Labels();
    RangeOffsets();
    Axes();
    for (const Displaced& d : displaced_) {
      if (d.explained) continue;
      const double size = d.placed ? (d.p - data_.p.col(d.point)).norm() : 0.0;
      Add(GrossKind::kDisplacedPoint, {d.point}, -1, size,
          d.placed ? fmt::format("point {} is {} from where it was surveyed", Id(d.point),
                                 LengthText(size))
                   : fmt::format("point {}: neither its survey nor enough of its readings fit",
                                 Id(d.point)));
    }
    Readings();
    return std::move(findings_);
  }

 private:
  std::string Id(int point) const {
    return "\"" + data_.ids[static_cast<std::size_t>(point)] + "\"";
  }
  std::string Ids(const std::vector<int>& points) const {
    std::vector<std::string> names;
    for (std::size_t k = 0; k < points.size() && k < 8; ++k) names.push_back(Id(points[k]));
    if (points.size() > 8) names.push_back(fmt::format("{} more", points.size() - 8));
    return JoinWords(names);
  }

  void Add(GrossKind kind, std::vector<int> points, int camera, double size, std::string text) {
    GrossFinding finding{kind, std::move(points), camera, size, std::move(text), true};
    for (const int point : finding.points) {
      const auto& unsure = bundle_.ambiguous;
      if (std::find(unsure.begin(), unsure.end(), point) != unsure.end()) finding.sure = false;
    }
    if (!finding.sure) finding.text += " (or another of its data is wrong)";
    findings_.push_back(std::move(finding));
  }

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

  Eigen::Matrix3d SurveyCov(int point) const {
    const double factor = bundle_.weighting.survey_factor;
    return factor * factor * data_.cov[static_cast<std::size_t>(point)];
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
        if (i != d.point && Same(d, data_.p.col(i), SurveyCov(i))) target[k] = i;
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
      Add(GrossKind::kMislabelled, {displaced_[k].point, target[k]}, -1, size,
          fmt::format("mislabelled: the readings of point {} were taken where point {} was "
                      "surveyed",
                      Id(displaced_[k].point), Id(target[k])));
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
                                           Id(points[0]), Id(points[1]));
      Add(GrossKind::kSwappedPoints, points, -1, size, text);
      return;
    }
    const std::string text = fmt::format(
        "labels shifted: of points {}, each one's place stands under the next", Ids(points));
    Add(GrossKind::kShiftedLabels, points, -1, size, text);
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
        cov.emplace_back(d.cov + SurveyCov(d.point));
      }
      const RangeOffset found = FindRangeOffset(p, shift, cov, options_.station);
      if (!found.found) return;
      std::vector<int> points;
      for (const int m : found.members) {
        Displaced& d = displaced_[open[static_cast<std::size_t>(m)]];
        d.explained = true;
        points.push_back(d.point);
      }
      Add(GrossKind::kPrismConstant, points, -1, std::abs(found.offset),
          fmt::format("prism constant: {} points ({}) were measured {:.1f} +- {:.1f} mm too {}, as "
                      "seen from a station at ({:.2f}, {:.2f}, {:.2f}){}",
                      points.size(), Ids(points), 1e3 * std::abs(found.offset), 1e3 * found.sigma,
                      found.offset > 0.0 ? "short" : "long", found.station.x(), found.station.y(),
                      found.station.z(), PrismsThatDiffer(found)));
    }
  }

  void Axes() {
    constexpr const char* kAxis = "xyz";
    for (Displaced& d : displaced_) {
      if (d.explained || !d.placed) continue;
      const Eigen::Vector3d p = data_.p.col(d.point);
      const Eigen::Matrix3d cov = SurveyCov(d.point);
      const double size = (d.p - p).norm();
      for (int a = 0; a < 3 && !d.explained; ++a) {
        const int b = (a + 1) % 3;
        Eigen::Matrix3d exchange = Eigen::Matrix3d::Identity();
        exchange.col(a).swap(exchange.col(b));
        if (Same(d, exchange * p, exchange * cov * exchange.transpose())) {
          d.explained = true;
          Add(GrossKind::kExchangedAxes, {d.point}, -1, size,
              fmt::format("point {}: {} and {} are exchanged", Id(d.point), kAxis[std::min(a, b)],
                          kAxis[std::max(a, b)]));
        }
      }
      for (int a = 0; a < 3 && !d.explained; ++a) {
        Eigen::Vector3d mirrored = p;
        mirrored(a) = -p(a);
        if (Same(d, mirrored, cov)) {
          d.explained = true;
          Add(GrossKind::kMirroredAxis, {d.point}, -1, size,
              fmt::format("point {}: {} has the wrong sign", Id(d.point), kAxis[a]));
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
        Add(GrossKind::kAlongOneAxis, {d.point}, -1, size,
            fmt::format(
                "point {}: {} alone is off, by {:+.1f} mm (a typing error, or a wrong height)",
                Id(d.point), kAxis[a], -1e3 * e(a)));
      }
    }
  }

  // What a reading should have been, and how surely, given the point.
  struct Expected {
    double u = NAN, sigma = 0.0;
  };
  Expected Expect(int point, int camera) const {
    Expected out;
    measure::Projection h;
    if (!measure::Project(bundle_.state.cameras[static_cast<std::size_t>(camera)],
                          bundle_.state.points.col(point), &h)) {
      return out;
    }
    // The adjusted point is no worse than its survey, where that counts.
    out.u = h.u_px;
    out.sigma =
        std::sqrt((h.du_dp * SurveyCov(point) * h.du_dp.transpose()).value() +
                  std::pow(bundle_.weighting.floor_px[static_cast<std::size_t>(camera)], 2));
    return out;
  }
  bool Fits(const Reading& r, const Expected& e, double value) const {
    return std::abs(value - e.u) < kSameReading * std::hypot(e.sigma, r.s_px);
  }

  // Readings that were left out: swapped, counted from the other end, off together, or wild.
  void Readings() {
    for (std::size_t k = 0; k < data_.readings.size(); ++k) {
      if (bundle_.weighting.Uses(k)) continue;
      const Reading& r = data_.readings[k];
      left_out_.push_back({r, Expect(r.point, r.camera)});
    }
    for (std::size_t a = 0; a < left_out_.size(); ++a) Swapped(a);
    for (LeftOut& one : left_out_) Mirrored(&one);
    for (std::size_t a = 0; a < left_out_.size(); ++a) SameOffset(a);
    for (const LeftOut& one : left_out_) Wild(one);
  }

  // A reading that was left out, and what it should have been.
  struct LeftOut {
    Reading reading;
    Expected expected;
    bool explained = false;
    double Offset() const { return reading.u_px - expected.u; }
  };

  std::string CameraName(int camera) const {
    return "\"" + data_.cameras[static_cast<std::size_t>(camera)] + "\"";
  }

  // Two readings of one camera, or of one point, each of which fits in the other's place.
  void Swapped(std::size_t first) {
    LeftOut& a = left_out_[first];
    for (std::size_t k = first + 1; k < left_out_.size() && !a.explained; ++k) {
      LeftOut& b = left_out_[k];
      const Reading &ra = a.reading, &rb = b.reading;
      if (b.explained || (ra.camera == rb.camera) == (ra.point == rb.point)) continue;
      if (!Fits(ra, b.expected, ra.u_px) || !Fits(rb, a.expected, rb.u_px)) continue;
      a.explained = b.explained = true;
      const double size = std::abs(a.Offset());
      if (ra.camera == rb.camera) {
        Add(GrossKind::kSwappedReadings, {ra.point, rb.point}, ra.camera, size,
            fmt::format("camera {}: the readings of points {} and {} are swapped",
                        CameraName(ra.camera), Id(ra.point), Id(rb.point)));
      } else {
        Add(GrossKind::kSwappedCameras, {ra.point}, ra.camera, size,
            fmt::format("point {}: the readings of cameras {} and {} are swapped", Id(ra.point),
                        CameraName(ra.camera), CameraName(rb.camera)));
      }
    }
  }

  // Only where the row's length was stated: a guess at it would be a pixel or two off.
  void Mirrored(LeftOut* one) {
    const Reading& r = one->reading;
    const auto camera = static_cast<std::size_t>(r.camera);
    if (one->explained || camera >= data_.pixels.size() || data_.pixels[camera] == 0) return;
    if (!Fits(r, one->expected, data_.pixels[camera] - 1.0 - r.u_px)) return;
    one->explained = true;
    Add(GrossKind::kMirroredReading, {r.point}, r.camera, std::abs(one->Offset()),
        fmt::format("camera {}: the reading of point {} is mirrored, counted from the sensor's "
                    "other end",
                    CameraName(r.camera), Id(r.point)));
  }

  void SameOffset(std::size_t first) {
    const LeftOut& a = left_out_[first];
    if (a.explained || !std::isfinite(a.expected.u)) return;
    const int camera = a.reading.camera;
    const double offset = a.Offset();
    std::vector<LeftOut*> alike;
    for (std::size_t k = first; k < left_out_.size(); ++k) {
      LeftOut& b = left_out_[k];
      if (!b.explained && b.reading.camera == camera &&
          Fits(b.reading, b.expected, b.reading.u_px - offset)) {
        alike.push_back(&b);
      }
    }
    if (static_cast<int>(alike.size()) < kFewestAlike) return;
    std::vector<int> points;
    std::vector<double> offsets;
    for (LeftOut* b : alike) {
      b->explained = true;
      points.push_back(b->reading.point);
      offsets.push_back(b->Offset());
    }
    Add(GrossKind::kSameOffset, points, camera, std::abs(offset),
        fmt::format("camera {}: the readings of {} points ({}) are off by the same {:+.2f} px",
                    CameraName(camera), points.size(), Ids(points), Median(offsets)));
  }

  void Wild(const LeftOut& one) {
    if (one.explained) return;
    const Reading& r = one.reading;
    const double size = std::isfinite(one.expected.u) ? one.Offset() : 0.0;
    Add(GrossKind::kWildReading, {r.point}, r.camera, std::abs(size),
        fmt::format("camera {}: the reading of point {} is off by {:+.2f} px", CameraName(r.camera),
                    Id(r.point), size));
  }

  const Observations& data_;
  const RefinedBundle& bundle_;
  const ExplainOptions& options_;
  double limit_ = 0.0;
  std::vector<Displaced> displaced_;
  std::vector<LeftOut> left_out_;
  std::vector<GrossFinding> findings_;
};

}  // namespace

const char* Name(GrossKind kind) {
  switch (kind) {
    case GrossKind::kSwappedPoints:
      return "swapped points";
    case GrossKind::kShiftedLabels:
      return "shifted labels";
    case GrossKind::kMislabelled:
      return "mislabelled";
    case GrossKind::kExchangedAxes:
      return "exchanged axes";
    case GrossKind::kMirroredAxis:
      return "wrong sign";
    case GrossKind::kAlongOneAxis:
      return "one coordinate";
    case GrossKind::kPrismConstant:
      return "prism constant";
    case GrossKind::kDisplacedPoint:
      return "displaced point";
    case GrossKind::kSwappedReadings:
      return "swapped readings";
    case GrossKind::kSwappedCameras:
      return "swapped cameras";
    case GrossKind::kMirroredReading:
      return "mirrored reading";
    case GrossKind::kSameOffset:
      return "same offset";
    case GrossKind::kWildReading:
      return "wild reading";
  }
  return "";
}

std::vector<GrossFinding> ExplainGross(const Observations& data, const RefinedBundle& bundle,
                                       const ExplainOptions& options) {
  return Explainer(data, bundle, options).Run();
}

}  // namespace unfurl::calib
