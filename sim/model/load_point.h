#pragma once

#include <cmath>

#include "sim/model/rigid_bodies.h"

namespace unfurl::sim {

// A point that a force may act on: fixed in one body, or between the places that two segments of a
// beam give. Forces act by the gradient of the position.
struct LoadPoint {
  int body = -1;
  double px = 0.0, py = 0.0;  // in the body's frame [m]
  int other = -1;             // the second body; -1: none
  double other_px = 0.0;      // [m]
  double other_share = 0.0;   // [-]

  struct At {
    double x, y, vx, vy;  // [m], [m/s]
  };
  At Place(const Motion& m) const {
    At a = OnBody(m, body, px, py);
    if (other < 0) return a;
    const At b = OnBody(m, other, other_px, 0.0);
    const double w = other_share, v = 1.0 - w;
    return {v * a.x + w * b.x, v * a.y + w * b.y, v * a.vx + w * b.vx, v * a.vy + w * b.vy};
  }
  struct Direction {
    double c, s;
  };
  // Of its x axis: of two segments' between theirs.
  Direction Axis(const Motion& m) const {
    if (other < 0) return {m.c[body], m.s[body]};
    const double w = other_share, c = (1.0 - w) * m.c[body] + w * m.c[other],
                 s = (1.0 - w) * m.s[body] + w * m.s[other], length = std::hypot(c, s);
    return {c / length, s / length};
  }
  // The bodies that carry the point, with their share and the offset in the world; returns how
  // many.
  struct Part {
    int body;
    double share, ox, oy;  // [-], [m]
  };
  int Parts(const Motion& m, Part out[2]) const {
    const double c = m.c[body], s = m.s[body];
    out[0] = {body, 1.0 - other_share, c * px - s * py, s * px + c * py};
    if (other < 0) return 1;
    out[1] = {other, other_share, m.c[other] * other_px, m.s[other] * other_px};
    return 2;
  }
  void Apply(const Motion& m, double fx, double fy, Load load) const {
    if (other < 0) return ApplyTo(m, body, px, py, fx, fy, load);
    const double w = other_share, v = 1.0 - w;
    ApplyTo(m, body, px, py, v * fx, v * fy, load);
    ApplyTo(m, other, other_px, 0.0, w * fx, w * fy, load);
  }

 private:
  static At OnBody(const Motion& m, int s, double px, double py) {
    const double ox = m.c[s] * px - m.s[s] * py, oy = m.s[s] * px + m.c[s] * py;
    return {m.x[s] + ox, m.y[s] + oy, m.vx[s] - m.omega[s] * oy, m.vy[s] + m.omega[s] * ox};
  }
  static void ApplyTo(const Motion& m, int s, double px, double py, double fx, double fy,
                      Load load) {
    const double ox = m.c[s] * px - m.s[s] * py, oy = m.s[s] * px + m.c[s] * py;
    load.fx[s] += fx;
    load.fy[s] += fy;
    load.m[s] += ox * fy - oy * fx;
  }
};

}  // namespace unfurl::sim
