#include <fmt/format.h>

#include <Eigen/Core>
#include <cmath>

#include "base/statistics.h"
#include "calib/explain_parts.h"
#include "measure/camera_model.h"

namespace unfurl::calib {
namespace {

constexpr double kSameReading = 5.0;  // sigmas
constexpr int kFewestAlike = 4;       // readings with one offset

class ReadingExplainer {
 public:
  explicit ReadingExplainer(Findings* findings)
      : findings_(*findings), data_(findings->data()), bundle_(findings->bundle()) {}

  // Readings that were left out: swapped, counted from the other end, off together, or wild.
  void Run() {
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

 private:
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
        std::sqrt((h.du_dp * findings_.SurveyCov(point) * h.du_dp.transpose()).value() +
                  std::pow(bundle_.weighting.floor_px[static_cast<std::size_t>(camera)], 2));
    return out;
  }
  bool Fits(const Reading& r, const Expected& e, double value) const {
    return std::abs(value - e.u) < kSameReading * std::hypot(e.sigma, r.s_px);
  }

  // A reading that was left out, and what it should have been.
  struct LeftOut {
    Reading reading;
    Expected expected;
    bool explained = false;
    double Offset() const { return reading.u_px - expected.u; }
  };

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
        findings_.Add(GrossKind::kSwappedReadings, {ra.point, rb.point}, ra.camera, size,
                      fmt::format("camera {}: the readings of points {} and {} are swapped",
                                  findings_.CameraName(ra.camera), findings_.Id(ra.point),
                                  findings_.Id(rb.point)));
      } else {
        findings_.Add(GrossKind::kSwappedCameras, {ra.point}, ra.camera, size,
                      fmt::format("point {}: the readings of cameras {} and {} are swapped",
                                  findings_.Id(ra.point), findings_.CameraName(ra.camera),
                                  findings_.CameraName(rb.camera)));
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
    findings_.Add(
        GrossKind::kMirroredReading, {r.point}, r.camera, std::abs(one->Offset()),
        fmt::format("camera {}: the reading of point {} is mirrored, counted from the sensor's "
                    "other end",
                    findings_.CameraName(r.camera), findings_.Id(r.point)));
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
    findings_.Add(
        GrossKind::kSameOffset, points, camera, std::abs(offset),
        fmt::format("camera {}: the readings of {} points ({}) are off by the same {:+.2f} px",
                    findings_.CameraName(camera), points.size(), findings_.Ids(points),
                    Median(offsets)));
  }

  void Wild(const LeftOut& one) {
    if (one.explained) return;
    const Reading& r = one.reading;
    const double size = std::isfinite(one.expected.u) ? one.Offset() : 0.0;
    findings_.Add(GrossKind::kWildReading, {r.point}, r.camera, std::abs(size),
                  fmt::format("camera {}: the reading of point {} is off by {:+.2f} px",
                              findings_.CameraName(r.camera), findings_.Id(r.point), size));
  }

  Findings& findings_;
  const Observations& data_;
  const RefinedBundle& bundle_;
  std::vector<LeftOut> left_out_;
};

}  // namespace

void ExplainReadings(Findings* findings) { ReadingExplainer(findings).Run(); }

}  // namespace unfurl::calib
