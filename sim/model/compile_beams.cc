// Elements and stations of the beams, and the fields that act on all masses.
#include <cmath>

#include "sim/model/compiler.h"

namespace unfurl::sim {

void Compiler::FillBending() {
  RigidBodies& bodies = model_.rigid_bodies;
  model_.bending = Bending(bodies.beam_count);
  longitudinal_.assign(bodies.beam_count, {});
  element_names_.assign(bodies.beam_count, "");
  for (std::size_t b = 0; b < scene_.beams.size(); ++b) {
    const data::SceneBeam& beam = scene_.beams[b];
    if (IsSmooth(static_cast<int>(b))) continue;
    const double l = beam.length / beam.segments;
    // `at`: its middle. Of a section that changes, the stiffness there stands for the element's.
    const auto add = [&](int e, double length, double at) {
      const double EA = beam.axial_elastic ? beam.EA * beam.section.Area(at) : 0.0;
      model_.bending.Set(
          e, {length, beam.EI * beam.section.Bending(at), EA, beam.damping, beam.gradient_form});
      if (!beam.axial_elastic) longitudinal_[e] = {length, beam.along_chord};
      element_names_[e] = beam.name;
    };
    const int first = first_segment_[b], last = first + beam.segments - 1;
    for (int k = 0; k < 2; ++k) {
      const BeamEnd& end = beam_ends_[b][k];
      if (end.weld == nullptr) continue;
      const double quarter = 0.25 / beam.segments;
      add(k == 0 ? end.station : last, 0.5 * l, k == 0 ? quarter : 1.0 - quarter);
      AddStation(end, static_cast<int>(b));
    }
    for (int e = first; e < last; ++e) {
      add(e, l, static_cast<double>(e - first + 1) / beam.segments);
    }
  }
}

void Compiler::AddStation(const BeamEnd& end, int beam) {
  const data::SceneEnd& body_end = BodySide(*end.weld);
  const PlanePose in = InNode(body_end);
  Station s;
  s.index = end.station;
  s.body = body_of_composite_[NodeOf(body_end)];
  s.px = in.x;
  s.py = in.y;
  s.angle = in.angle + BeamAgainstBody(*end.weld);
  // Whole turns between body and beam are no bending.
  const double turned =
      start_.node[NodeOfBeam(beam)].angle - start_.node[NodeOf(body_end)].angle - s.angle;
  s.angle += 2.0 * M_PI * std::round(turned / (2.0 * M_PI));
  model_.rigid_bodies.stations.push_back(s);
}

void Compiler::FillFields() {
  if (scene_.gravity) {
    model_.gravity = Gravity(model_.rigid_bodies.mass, scene_.gravity->acceleration[0],
                             scene_.gravity->acceleration[1]);
  }
  if (!scene_.suspension) return;
  const double per_mass = scene_.suspension->gravity / scene_.suspension->length;
  model_.suspension = Suspension(model_.rigid_bodies.count);
  for (std::size_t b = 0; b < scene_.beams.size(); ++b) {
    const data::SceneBeam& beam = scene_.beams[b];
    // Of a smooth beam the centre here; how the strings turn and bend it is the beam's own.
    const int segments = IsSmooth(static_cast<int>(b)) ? 1 : beam.segments;
    const PlanePose& at = hang_.node[NodeOfBeam(static_cast<int>(b))];
    for (int k = 0; k < segments; ++k) {
      const PlanePose centre = at * PlanePose{CentreOfBody(static_cast<int>(b), k), 0.0, 0.0};
      const int body = first_segment_[b] + k;
      model_.suspension.Set(body, per_mass * model_.rigid_bodies.mass[body], centre.x, centre.y,
                            0.0, 0.0);
    }
  }
  for (std::size_t c = 1; c < merged_.list.size(); ++c) {
    double kappa = 0.0;
    for (const int b : merged_.list[c].members) {
      const PlanePose& in = merged_.body_in[b];
      kappa += per_mass * scene_.bodies[b].mass * (in.x * in.x + in.y * in.y);
    }
    const int body = body_of_composite_[c];
    const PlanePose& at = hang_.node[c];
    model_.suspension.Set(body, per_mass * model_.rigid_bodies.mass[body], at.x, at.y, kappa,
                          at.angle);
  }
}

}  // namespace unfurl::sim
