#include "sim/effects/linear_springs.h"

#include <algorithm>
#include <cmath>

#include "sim/implicit/tangent.h"

namespace unfurl::sim {

void LinearSprings::Add(const LoadPoint& a, const LoadPoint& b, double stiffness, double damping,
                        double free_length) {
  springs_.push_back({a, b, stiffness, damping, free_length});
  damped_ |= damping > 0.0;
}

LinearSprings::State LinearSprings::At(int k, const Motion& motion) const {
  const Spring& s = springs_[k];
  const LoadPoint::At a = s.a.Place(motion), b = s.b.Place(motion);
  const double dx = b.x - a.x, dy = b.y - a.y, length = std::sqrt(dx * dx + dy * dy);
  const double inverse = length > 0.0 ? 1.0 / length : 0.0;
  State state{length, 0.0, 0.0, dx * inverse, dy * inverse};
  state.rate = state.ex * (b.vx - a.vx) + state.ey * (b.vy - a.vy);
  state.tension = s.stiffness * (length - s.free_length) + s.damping * state.rate;
  return state;
}

double LinearSprings::LongestStep(const Motion& motion, double least) const {
  constexpr double kTurn = 0.5;       // [rad]; far more than a step that error limits takes
  constexpr double kAtRest = 1e-100;  // [m/s]; so that nothing overflows
  double longest = HUGE_VAL;
  for (const Spring& s : springs_) {
    // Without a length of its own the force is linear in the points' distance, and does not jump.
    if (!(s.free_length > 0.0 && s.stiffness > 0.0)) continue;
    const LoadPoint::At a = s.a.Place(motion), b = s.b.Place(motion);
    const double speed = std::max(std::hypot(b.vx - a.vx, b.vy - a.vy), kAtRest);
    const double reach = std::max(kTurn * std::hypot(b.x - a.x, b.y - a.y), least);
    longest = std::min(longest, reach / speed);
  }
  return longest;
}

void LinearSprings::AddLoad(const Motion& motion, Load load, double* lost) const {
  for (int k = 0; k < count(); ++k) {
    const State s = At(k, motion);
    const double fx = s.tension * s.ex, fy = s.tension * s.ey;
    springs_[k].a.Apply(motion, fx, fy, load);
    springs_[k].b.Apply(motion, -fx, -fy, load);
    if (lost != nullptr) *lost += springs_[k].damping * s.rate * s.rate;
  }
}

double LinearSprings::Energy(const Motion& motion) const {
  double sum = 0.0;
  for (int k = 0; k < count(); ++k) {
    const double stretch = At(k, motion).length - springs_[k].free_length;
    sum += 0.5 * springs_[k].stiffness * stretch * stretch;
  }
  return sum;
}

// With e along the line, T the tension and d the distance, H = k e e^T + T / d (1 - e e^T) between
// the two points, spread over the bodies by d(point) = share [1 0 -oy; 0 1 ox] dq.
void LinearSprings::AddTangent(const Motion& motion, Tangent* tangent) const {
  for (int k = 0; k < count(); ++k) {
    const Spring& spring = springs_[k];
    const State s = At(k, motion);
    const double across = s.length > 0.0 ? s.tension / s.length : 0.0;
    LoadPoint::Part parts[4];
    const int of_a = spring.a.Parts(motion, parts);
    const int count = of_a + spring.b.Parts(motion, parts + of_a);
    double along[4][3], normal[4][3];  // e.d(point), n.d(point), n = (-ey, ex)
    for (int i = 0; i < count; ++i) {
      const LoadPoint::Part& p = parts[i];
      const double w = i < of_a ? -p.share : p.share;
      const double e[3] = {w * s.ex, w * s.ey, w * (p.ox * s.ey - p.oy * s.ex)};
      const double n[3] = {-w * s.ey, w * s.ex, w * (p.ox * s.ex + p.oy * s.ey)};
      std::copy_n(e, 3, along[i]);
      std::copy_n(n, 3, normal[i]);
      // The offset turns: its second derivative is minus itself.
      tangent->DiagonalK(p.body)[8] -= s.tension * w * (s.ex * p.ox + s.ey * p.oy);
    }
    for (int i = 0; i < count; ++i) {
      for (int j = i; j < count; ++j) {
        Tangent::Block stiff{}, damp{};
        for (int r = 0; r < 3; ++r) {
          for (int c = 0; c < 3; ++c) {
            const double ee = along[i][r] * along[j][c];
            stiff[3 * r + c] = spring.stiffness * ee + across * normal[i][r] * normal[j][c];
            damp[3 * r + c] = spring.damping * ee;
          }
        }
        if (i != j && parts[i].body == parts[j].body) {
          for (Tangent::Block* block : {&stiff, &damp}) {
            const Tangent::Block once = *block;
            for (int m = 0; m < 9; ++m) (*block)[m] += once[m % 3 * 3 + m / 3];
          }
        }
        tangent->AddPair(parts[i].body, parts[j].body, stiff, &damp);
      }
    }
  }
}

}  // namespace unfurl::sim
