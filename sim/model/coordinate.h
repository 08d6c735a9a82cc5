#pragma once

#include "sim/model/hinge.h"
#include "sim/model/rigid_bodies.h"

namespace unfurl::sim {

// The coordinate of a joint on which springs, dampers, motors and drives act: the angle of a
// revolute joint, or the travel of outer's point from inner's along the slot's axis,
//   travel = sign (r_o - r_i) . e,   e fixed in the inner body.
struct Coordinate {
  Hinge hinge;                // bodies and sign; `zero` only for the angle
  bool travel = false;        // else the angle
  double ix = 0.0, iy = 0.0;  // inner's point in its body's frame [m]
  double ox = 0.0, oy = 0.0;  // outer's [m]
  double ax = 1.0, ay = 0.0;  // the axis in the inner body's frame, of length 1 [-]

  // Geometry of the travel: e, the offsets of both points and their distance, in the world.
  struct Along {
    double ex, ey, px, py, qx, qy, dx, dy;  // [-], [m]
  };
  Along AlongAt(const Motion& m) const {
    const double ci = m.c[hinge.inner], si = m.s[hinge.inner];
    const double co = m.c[hinge.outer], so = m.s[hinge.outer];
    Along a;
    a.ex = ci * ax - si * ay;
    a.ey = si * ax + ci * ay;
    a.px = ci * ix - si * iy;
    a.py = si * ix + ci * iy;
    a.qx = co * ox - so * oy;
    a.qy = so * ox + co * oy;
    a.dx = m.x[hinge.outer] + a.qx - m.x[hinge.inner] - a.px;
    a.dy = m.y[hinge.outer] + a.qy - m.y[hinge.inner] - a.py;
    return a;
  }

  double Value(const Motion& m) const {
    if (!travel) return hinge.Theta(m);
    const Along a = AlongAt(m);
    return hinge.sign * (a.ex * a.dx + a.ey * a.dy);
  }
  double Rate(const Motion& m) const {
    if (!travel) return hinge.Rate(m);
    const Along a = AlongAt(m);
    const double wi = m.omega[hinge.inner], wo = m.omega[hinge.outer];
    const double vx = m.vx[hinge.outer] - wo * a.qy - m.vx[hinge.inner] + wi * a.py;
    const double vy = m.vy[hinge.outer] + wo * a.qx - m.vy[hinge.inner] - wi * a.px;
    return hinge.sign * (a.ex * vx + a.ey * vy + wi * (a.ex * a.dy - a.ey * a.dx));
  }
  struct State {
    double value, rate;  // [rad], [rad/s]; of a travel [m], [m/s]
  };
  State At(const Motion& m) const { return {Value(m), Rate(m)}; }
  // A moment on the angle [N m] or a force on the travel [N], as loads on the two bodies: the
  // gradient of the coordinate times it.
  void Apply(const Motion& m, double moment, Load load) const {
    if (!travel) return hinge.Apply(moment, load);
    const Along a = AlongAt(m);
    const double f = hinge.sign * moment, fx = f * a.ex, fy = f * a.ey;
    load.fx[hinge.outer] += fx;
    load.fy[hinge.outer] += fy;
    load.m[hinge.outer] += a.qx * fy - a.qy * fx;
    load.fx[hinge.inner] -= fx;
    load.fy[hinge.inner] -= fy;
    load.m[hinge.inner] -= (a.px + a.dx) * fy - (a.py + a.dy) * fx;
  }
};

}  // namespace unfurl::sim
