#include "sim/effects/forces.h"

#include <algorithm>
#include <cmath>

#include "sim/implicit/tangent.h"

namespace unfurl::sim {

void Forces::AddForce(const LoadPoint& point, const Pair& force, bool follows, double angle) {
  forces_.push_back({point, force, follows, std::cos(angle), std::sin(angle)});
}

void Forces::AddTorque(const LoadPoint& point, const data::TimeFunction& torque) {
  torques_.push_back(
      {point.body, point.other < 0 ? point.body : point.other, point.other_share, torque});
}

void Forces::AddPerLength(int first, int segments, double length, const Pair& per_length,
                          bool follows) {
  lines_.push_back({first, segments, length, per_length, follows});
}

void Forces::AddLoad(const Motion& m, Load load, double* work) const {
  double power = 0.0;
  for (const Force& f : forces_) {
    double fx = f.force[0].Value(m.t), fy = f.force[1].Value(m.t);
    if (f.follows) {
      const auto [bc, bs] = f.point.Axis(m);
      const double c = bc * f.c - bs * f.s, s = bs * f.c + bc * f.s;
      const double along = fx;
      fx = c * along - s * fy;
      fy = s * along + c * fy;
    }
    f.point.Apply(m, fx, fy, load);
    const LoadPoint::At at = f.point.Place(m);
    power += fx * at.vx + fy * at.vy;
  }
  for (const Torque& t : torques_) {
    const double torque = t.torque.Value(m.t), w = t.other_share;
    load.m[t.body] += (1.0 - w) * torque;
    load.m[t.other] += w * torque;
    power += torque * ((1.0 - w) * m.omega[t.body] + w * m.omega[t.other]);
  }
  for (const Line& line : lines_) {
    const double qx = line.per_length[0].Value(m.t) * line.length;
    const double qy = line.per_length[1].Value(m.t) * line.length;
    for (int k = line.first; k < line.first + line.segments; ++k) {
      const double c = line.follows ? m.c[k] : 1.0, s = line.follows ? m.s[k] : 0.0;
      const double fx = c * qx - s * qy, fy = s * qx + c * qy;
      load.fx[k] += fx;
      load.fy[k] += fy;
      power += fx * m.vx[k] + fy * m.vy[k];
    }
  }
  if (work != nullptr) *work += power;
}

bool Forces::AnyFollows(double t) const {
  const auto acts = [t](const auto& force, const Pair& value) {
    return force.follows && (value[0].Value(t) != 0.0 || value[1].Value(t) != 0.0);
  };
  return std::any_of(forces_.begin(), forces_.end(),
                     [&](const Force& f) { return acts(f, f.force); }) ||
         std::any_of(lines_.begin(), lines_.end(),
                     [&](const Line& line) { return acts(line, line.per_length); });
}

void Forces::AddTangent(const Motion& motion, Tangent* tangent) const {
  for (const Force& f : forces_) {
    if (f.follows) continue;
    LoadPoint::Part parts[2];
    const int count = f.point.Parts(motion, parts);
    const double fx = f.force[0].Value(motion.t), fy = f.force[1].Value(motion.t);
    for (int i = 0; i < count; ++i) {
      tangent->DiagonalK(parts[i].body)[8] +=
          parts[i].share * (fx * parts[i].ox + fy * parts[i].oy);
    }
  }
}

}  // namespace unfurl::sim
