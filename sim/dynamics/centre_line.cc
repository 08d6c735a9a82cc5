#include "sim/dynamics/centre_line.h"

#include <algorithm>
#include <cmath>

namespace unfurl::sim {
namespace {

constexpr double kAtBoundary = 1e-9;  // of a segment: places this near an end of one are the end

PlanePoint OnSegment(const Motion& m, int body, double along) {
  return {m.x[body] + m.c[body] * along, m.y[body] + m.s[body] * along};
}

}  // namespace

CentreLine::CentreLine(const Model& model, const Model::Beam& beam)
    : first_(beam.first),
      segments_(beam.segments),
      start_station_(beam.stations[0]),
      end_station_(beam.stations[1]),
      segment_length_(beam.segment_length),
      length_(beam.segments * beam.segment_length),
      smooth_beams_(&model.kirchhoff),
      bending_(&model.bending),
      smooth_(beam.smooth) {}

KirchhoffRod::Frame CentreLine::SmoothAt(const Motion& m, double place) const {
  auto table = tables_.find(place);
  if (table == tables_.end()) {
    const KirchhoffRod& rod = smooth_beams_->beam(smooth_).rod;
    table = tables_.emplace(place, rod.PlaceAt(place / length_)).first;
  }
  return smooth_beams_->FrameAt(smooth_, table->second, m);
}

PlanePoint CentreLine::At(const Motion& m, double place) const {
  if (smooth_ >= 0) {
    const KirchhoffRod::Frame f = SmoothAt(m, place);
    return {f.x, f.y};
  }
  const double count = place / segment_length_;
  const int boundary = static_cast<int>(std::lround(count));
  const double half = 0.5 * segment_length_;
  if (std::fabs(count - boundary) > kAtBoundary) {
    const int k = std::clamp(static_cast<int>(count), 0, segments_ - 1);
    return OnSegment(m, first_ + k, (count - k - 0.5) * segment_length_);
  }
  if (boundary <= 0) {
    if (start_station_ >= 0) return {m.x[start_station_], m.y[start_station_]};
    return OnSegment(m, first_, -half);
  }
  if (boundary >= segments_) {
    if (end_station_ >= 0) return {m.x[end_station_], m.y[end_station_]};
    return OnSegment(m, first_ + segments_ - 1, half);
  }
  const PlanePoint a = OnSegment(m, first_ + boundary - 1, half);
  const PlanePoint b = OnSegment(m, first_ + boundary, -half);
  return {0.5 * (a.x + b.x), 0.5 * (a.y + b.y)};
}

double CentreLine::MidDeflection(const Motion& m) const {
  const PlanePoint a = At(m, 0.0), b = At(m, length_), middle = At(m, 0.5 * length_);
  const double cx = b.x - a.x, cy = b.y - a.y;
  return (cx * (middle.y - a.y) - cy * (middle.x - a.x)) / std::hypot(cx, cy);
}

double CentreLine::TipDeflection(const Motion& m) const {
  const PlanePoint a = At(m, 0.0), b = At(m, length_);
  if (smooth_ >= 0) {
    const double angle = SmoothAt(m, 0.0).theta;
    return std::cos(angle) * (b.y - a.y) - std::sin(angle) * (b.x - a.x);
  }
  // Without a station, the tangent at the end is continued from the first two segments' angles.
  double angle = m.theta[start_station_ >= 0 ? start_station_ : first_];
  if (start_station_ < 0 && segments_ > 1) angle += 0.5 * (angle - m.theta[first_ + 1]);
  return std::cos(angle) * (b.y - a.y) - std::sin(angle) * (b.x - a.x);
}

double CentreLine::Curvature(const Motion& m, double place) const {
  if (smooth_ >= 0) {
    const double step = 1e-3 * length_;  // shapes bend over a tenth of the length and more
    const double middle = std::clamp(place, step, length_ - step);
    const double low = SmoothAt(m, middle - step).theta, high = SmoothAt(m, middle + step).theta;
    const double curvature = (high - low) / (2.0 * step);
    if (middle == place) return curvature;
    // Near an end it goes on as a straight line.
    const double slope = (high - 2.0 * SmoothAt(m, middle).theta + low) / (step * step);
    return curvature + slope * (place - middle);
  }
  // At the station that holds an end: that of the half element's cubic there, whose moment is what
  // the end bears. In the middle of it, where its angles' difference stands, it may be far less.
  const auto at_end = [&](int i, int j, double side) {
    const double length = 0.5 * segment_length_, angle = 0.5 * (m.theta[i] + m.theta[j]);
    const double across = std::cos(angle) * (m.y[j] - m.y[i]) - std::sin(angle) * (m.x[j] - m.x[i]);
    return (m.theta[j] - m.theta[i] + side * 6.0 * across / length) / length;
  };
  const auto node = [&](int k) {  // between segments k - 1 and k
    if (k == 0) return start_station_ < 0 ? 0.0 : at_end(start_station_, first_, 1.0);
    const int last = first_ + segments_ - 1;
    if (k == segments_) return end_station_ < 0 ? 0.0 : at_end(last, end_station_, -1.0);
    return (m.theta[first_ + k] - m.theta[first_ + k - 1]) / segment_length_;
  };
  const double count = place / segment_length_;
  const int k = std::clamp(static_cast<int>(count), 0, segments_ - 1);
  const double part = count - k;
  return (1.0 - part) * node(k) + part * node(k + 1);
}

double CentreLine::Between(const double* values, double place) const {
  const double at = place / segment_length_ - 0.5;  // in segments, from the first one's middle
  const int last = first_ + segments_ - 1;
  const auto mean = [](double a, double b, double part) { return a + part * (b - a); };
  if (at < 0.0 && start_station_ >= 0) {
    return mean(values[first_], values[start_station_], -2.0 * at);
  }
  const double beyond = at - (segments_ - 1);
  if (beyond > 0.0 && end_station_ >= 0) {
    return mean(values[last], values[end_station_], 2.0 * beyond);
  }
  if (segments_ == 1) return values[first_];
  const int k = std::clamp(static_cast<int>(std::floor(at)), 0, segments_ - 2);
  return mean(values[first_ + k], values[first_ + k + 1], at - k);
}

double CentreLine::Strain(const Motion& m, double place) const {
  if (smooth_ >= 0) return smooth_beams_->StrainAt(smooth_, place / length_, m);
  // Half elements at welded ends have their middles a quarter of a segment in.
  const int first = start_station_ >= 0 ? start_station_ : first_;
  const int last = first_ + segments_ - (end_station_ >= 0 ? 1 : 2);  // elements
  if (last < first) return 0.0;
  const auto middle = [&](int e) {
    if (e == start_station_) return 0.25 * segment_length_;
    const int k = e - first_ + 1;
    return (k == segments_ ? k - 0.25 : k) * segment_length_;
  };
  const auto next = [&](int e) { return e == start_station_ ? first_ : e + 1; };
  int a = first;
  while (next(a) < last && middle(next(a)) < place) a = next(a);
  const double at = bending_->Strain(m, a);
  if (a == last) return at;
  const int b = next(a);
  const double part = (place - middle(a)) / (middle(b) - middle(a));
  return at + part * (bending_->Strain(m, b) - at);
}

std::vector<double> ShapePlaces(const Model::Beam& beam) {
  std::vector<double> places;
  if (beam.smooth >= 0) {
    for (int k = 0; k < kSmoothPoints; ++k) {
      places.push_back(beam.segment_length * k / (kSmoothPoints - 1));
    }
    return places;
  }
  const int points = std::min(beam.segments + 1, kMostShapePoints);
  for (int k = 0; k < points; ++k) {
    const long boundary = std::lround(static_cast<double>(k) * beam.segments / (points - 1));
    places.push_back(static_cast<double>(boundary) * beam.segment_length);
  }
  return places;
}

}  // namespace unfurl::sim
