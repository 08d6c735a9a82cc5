#pragma once

#include "sim/model/rigid_bodies.h"

namespace unfurl::sim {

// A point that a force may act on: fixed in one body, or, where two segments of a beam meet, the
// mean of the places that both give. Forces act by the gradient of the position.
struct LoadPoint {
  int body = -1;
  double px = 0.0, py = 0.0;  // in the body's frame [m]
  int other = -1;             // the second body; -1: none
  double other_px = 0.0;      // [m]

  struct At {
    double x, y, vx, vy;  // [m], [m/s]
  };
  At Place(const Motion& m) const {
    At a = OnBody(m, body, px, py);
    if (other < 0) return a;
    const At b = OnBody(m, other, other_px, 0.0);
    return {0.5 * (a.x + b.x), 0.5 * (a.y + b.y), 0.5 * (a.vx + b.vx), 0.5 * (a.vy + b.vy)};
  }
  // The bodies that carry the point, with their share and the offset in the world; returns how
  // many.
  struct Part {
    int body;
    double share, ox, oy;  // [-], [m]
  };
  int Parts(const Motion& m, Part out[2]) const {
    const double share = other < 0 ? 1.0 : 0.5;
    const double c = m.c[body], s = m.s[body];
    out[0] = {body, share, c * px - s * py, s * px + c * py};
    if (other < 0) return 1;
    out[1] = {other, share, m.c[other] * other_px, m.s[other] * other_px};
    return 2;
  }
  void Apply(const Motion& m, double fx, double fy, Load load) const {
    if (other < 0) return ApplyTo(m, body, px, py, fx, fy, load);
    ApplyTo(m, body, px, py, 0.5 * fx, 0.5 * fy, load);
    ApplyTo(m, other, other_px, 0.0, 0.5 * fx, 0.5 * fy, load);
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
