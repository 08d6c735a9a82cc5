#pragma once

#include <map>
#include <vector>

#include "sim/model/model.h"

namespace unfurl::sim {

struct PlanePoint {
  double x, y;  // [m]
};

// The centre line of a beam as a curve in the plane, for pictures and deflections. Where a segment
// ends, the line goes through the middle between its end and the next one's start; at a welded end,
// through the weld's point.
class CentreLine {
 public:
  // Keeps a reference to the model.
  CentreLine(const Model& model, const Model::Beam& beam);

  double length() const { return length_; }  // [m]
  bool HasSegment(int body) const {
    return smooth_ < 0 && body >= first_ && body < first_ + segments_;
  }
  PlanePoint At(const Motion& motion, double place) const;  // from the start, at rest [m]
  // Distance of the middle from the chord between the ends, positive to the left of it, [m]
  // (docs/physics-simulator.md, "Slider-crank": beta is this over the length).
  double MidDeflection(const Motion& motion) const;
  // Of the line, positive to its left [1/m]. Of segments: from the angles between them, linear in
  // between; 0 at an end that is not welded. Of a smooth beam by a difference of its angle.
  double Curvature(const Motion& motion, double place) const;
  // Of the line: of segments that of the elements between them, linear in between and beyond the
  // outermost; 0 where it does not stretch.
  double Strain(const Motion& motion, double place) const;
  // Of segments, a value by body (angle, rate of turning) at a place: linear between the middles of
  // the segments and the stations of welded ends, on beyond the last middles: second order.
  double Between(const double* values, double place) const;
  // Distance of the end from the tangent at the start, positive to its left [m].
  double TipDeflection(const Motion& motion) const;

 private:
  KirchhoffRod::Frame SmoothAt(const Motion& motion, double place) const;

  int first_ = 0, segments_ = 0;                // bodies of the segments
  int start_station_ = -1, end_station_ = -1;   // bodies, where welded
  double segment_length_ = 0.0, length_ = 0.0;  // [m]
  // Of a smooth beam: tables of the places that are asked for.
  const KirchhoffBeams* smooth_beams_ = nullptr;
  const Bending* bending_ = nullptr;
  int smooth_ = -1;
  mutable std::map<double, KirchhoffRod::Place> tables_;
};

// Where a beam's shape is kept: at every end of a segment, or at kMostShapePoints evenly chosen
// ones of them; smooth beams at kSmoothPoints.
inline constexpr int kMostShapePoints = 65, kSmoothPoints = 33;
std::vector<double> ShapePlaces(const Model::Beam& beam);

}  // namespace unfurl::sim
