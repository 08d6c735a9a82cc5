#include "sim/implicit/tangent.h"

#include <algorithm>

#include "base/loop.h"

namespace unfurl::sim {

Tangent::Tangent(const RigidBodies& bodies)
    : n_(bodies.count),
      stations_(bodies.stations),
      body_of_(bodies.count),
      is_dynamic_(bodies.count),
      pairs_(bodies.beam_count, Pair{-1, -1}),
      k_(bodies.count + bodies.beam_count, Block{}),
      d_(bodies.count + bodies.beam_count, Block{}),
      damped_(bodies.count + bodies.beam_count, 0) {
  for (int s = 0; s < n_; ++s) {
    body_of_[s] = s;
    is_dynamic_[s] = bodies.IsDynamic(s) ? 1 : 0;
  }
  // Those attached to a smooth beam move with it (SmoothSaddle).
  for (const std::vector<int>& attached : bodies.attached) {
    for (const int s : attached) is_dynamic_[s] = 1;
  }
  for (const Station& s : stations_) body_of_[s.index] = s.body;
}

void Tangent::Begin(bool note) {
  note_ = note;
  next_ = 0;
  std::fill(k_.begin(), k_.end(), Block{});
  for (const int s : damped_bodies_) d_[s] = Block{};
  for (const int p : damped_pairs_) d_[n_ + p] = Block{};
}

void Tangent::NoteDamped(int body) {
  if (!note_ || damped_[body]) return;
  damped_[body] = 1;
  damped_bodies_.push_back(body);
}

void Tangent::NoteDampedPair(int p) {
  if (!note_ || damped_[n_ + p]) return;
  damped_[n_ + p] = 1;
  damped_pairs_.push_back(p);
}

void Tangent::NoteElement(int e, bool damps) {
  if (!note_) return;
  const int a = body_of_[e], b = body_of_[e + 1];
  if (is_dynamic_[a] && is_dynamic_[b]) pairs_[e] = {a, b};
  if (!damps) return;
  for (const int body : {e, e + 1, a, b}) NoteDamped(body);
  NoteDampedPair(e);
}

int Tangent::PlaceOf(int a, int b) {
  if (!note_) return visits_[next_++];
  const auto [found, added] = place_of_.emplace(std::pair{a, b}, static_cast<int>(pairs_.size()));
  if (added) {
    const bool both = is_dynamic_[a] != 0 && is_dynamic_[b] != 0;
    pairs_.push_back(both ? Pair{a, b} : Pair{-1, -1});
    k_.emplace_back();
    d_.emplace_back();
    damped_.push_back(0);
  }
  visits_.push_back(found->second);
  return found->second;
}

void Tangent::AddPair(int a, int b, const Block& k, const Block* d) {
  if (a == b) {  // the body with itself
    if (d != nullptr) NoteDamped(a);
    for (int i = 0; i < 9; ++i) {
      k_[a][i] += k[i];
      if (d != nullptr) d_[a][i] += (*d)[i];
    }
    return;
  }
  const int place = PlaceOf(a, b);
  for (int i = 0; i < 9; ++i) k_[n_ + place][i] += k[i];
  if (d == nullptr) return;
  NoteDampedPair(place);
  for (int i = 0; i < 9; ++i) d_[n_ + place][i] += (*d)[i];
}

void Tangent::AddHinge(const Hinge& hinge, double stiffness, double damping) {
  const int place = PlaceOf(hinge.inner, hinge.outer);
  NoteDamped(hinge.inner);
  NoteDamped(hinge.outer);
  NoteDampedPair(place);
  k_[hinge.inner][8] += stiffness;
  k_[hinge.outer][8] += stiffness;
  k_[n_ + place][8] -= stiffness;
  d_[hinge.inner][8] += damping;
  d_[hinge.outer][8] += damping;
  d_[n_ + place][8] -= damping;
}

// K = k g g^T - moment (second derivatives of the travel), D = d g g^T with g its gradient; the
// derivatives are those of sign e.(r_o + q - r_i - p), e and p turning with inner, q with outer.
void Tangent::AddCoordinate(const Motion& motion, const Coordinate& coordinate, double stiffness,
                            double damping, double moment) {
  const Hinge& hinge = coordinate.hinge;
  if (!coordinate.travel) return AddHinge(hinge, stiffness, damping);
  const Coordinate::Along a = coordinate.AlongAt(motion);
  const double sign = hinge.sign, rx = a.px + a.dx, ry = a.py + a.dy;
  const double inner[3] = {-sign * a.ex, -sign * a.ey, -sign * (rx * a.ey - ry * a.ex)};
  const double outer[3] = {sign * a.ex, sign * a.ey, sign * (a.qx * a.ey - a.qy * a.ex)};
  Block& ii = k_[hinge.inner];
  Block& oo = k_[hinge.outer];
  NoteDamped(hinge.inner);
  NoteDamped(hinge.outer);
  Block k{}, d{};
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) {
      ii[3 * r + c] += stiffness * inner[r] * inner[c];
      oo[3 * r + c] += stiffness * outer[r] * outer[c];
      d_[hinge.inner][3 * r + c] += damping * inner[r] * inner[c];
      d_[hinge.outer][3 * r + c] += damping * outer[r] * outer[c];
      k[3 * r + c] = stiffness * inner[r] * outer[c];
      d[3 * r + c] = damping * inner[r] * outer[c];
    }
  }
  const double f = moment * sign, nx = -a.ey, ny = a.ex;
  const double along = a.ex * a.qx + a.ey * a.qy;
  ii[2] += f * nx, ii[6] += f * nx;
  ii[5] += f * ny, ii[7] += f * ny;
  ii[8] += f * (a.ex * rx + a.ey * ry);
  oo[8] += f * along;
  k[6] -= f * nx, k[7] -= f * ny, k[8] -= f * along;
  AddPair(hinge.inner, hinge.outer, k, &d);
}

namespace {

// With the station's offset o, dr_s = dr + dtheta (-o_y, o_x): B := T^T B (rows) or B T (columns),
// T = [1 0 -o_y; 0 1 o_x; 0 0 1].
void FoldRows(Tangent::Block& b, double ox, double oy) {
  for (int c = 0; c < 3; ++c) b[6 + c] += ox * b[3 + c] - oy * b[c];
}
void FoldColumns(Tangent::Block& b, double ox, double oy) {
  for (int r = 0; r < 9; r += 3) b[r + 2] += ox * b[r + 1] - oy * b[r];
}

}  // namespace

void Tangent::FoldStations(const double* load_x, const double* load_y, const double* reaction_x,
                           const double* reaction_y, const double* offset) {
  for (const Station& s : stations_) {
    const double ox = offset[0], oy = offset[1];
    offset += 2;
    const auto fold = [&](std::vector<Block>& blocks) {
      // The station stands at the start of its own element or at the end of the one before; the
      // other of the two is empty.
      if (s.index > 0) FoldColumns(blocks[n_ + s.index - 1], ox, oy);
      FoldRows(blocks[n_ + s.index], ox, oy);
      Block at = blocks[s.index];
      FoldRows(at, ox, oy);
      FoldColumns(at, ox, oy);
      for (int i = 0; i < 9; ++i) blocks[s.body][i] += at[i];
    };
    fold(k_);
    if (damped_[s.index]) fold(d_);
    // A force whose point turns with the body.
    const double fx = load_x[s.index] + reaction_x[s.index];
    const double fy = load_y[s.index] + reaction_y[s.index];
    k_[s.body][8] += fx * ox + fy * oy;
  }
  FillChains();
}

void Tangent::FillChains() {
  const auto beside = [&](int p) { return pairs_[p].a == p && pairs_[p].b == p + 1; };
  if (note_) {
    for (Array& entry : own_d_) entry.assign(n_ + kBlock, 0.0);
    for (Array& entry : next_d_) entry.assign(n_ + kBlock, 0.0);
    other_pairs_.clear();
    for (const int p : damped_pairs_) {
      if (pairs_[p].a >= 0 && !beside(p)) other_pairs_.push_back(p);
    }
  }
  for (const int s : damped_bodies_) {
    // A station's have gone to its body.
    if (body_of_[s] != s) continue;
    for (int i = 0; i < 9; ++i) own_d_[i][s] = d_[s][i];
  }
  for (const int p : damped_pairs_) {
    if (!beside(p)) continue;
    for (int i = 0; i < 9; ++i) next_d_[i][p] = d_[n_ + p][i];
  }
}

namespace {

inline void Multiply(const Tangent::Block& b, double f, const double* v, int from, double* out,
                     int to, int n) {
  const double x = f * v[from], y = f * v[n + from], t = f * v[2 * n + from];
  out[to] += b[0] * x + b[1] * y + b[2] * t;
  out[n + to] += b[3] * x + b[4] * y + b[5] * t;
  out[2 * n + to] += b[6] * x + b[7] * y + b[8] * t;
}

inline void MultiplyTransposed(const Tangent::Block& b, double f, const double* v, int from,
                               double* out, int to, int n) {
  const double x = f * v[from], y = f * v[n + from], t = f * v[2 * n + from];
  out[to] += b[0] * x + b[3] * y + b[6] * t;
  out[n + to] += b[1] * x + b[4] * y + b[7] * t;
  out[2 * n + to] += b[2] * x + b[5] * y + b[8] * t;
}

}  // namespace

void Tangent::AddDamping(double factor, const double* v, double* out) const {
  const int n = n_;
  const double* __restrict vx = v;
  const double* __restrict vy = v + n;
  const double* __restrict vt = v + 2 * n;
  for (int row = 0; row < 3; ++row) {
    double* __restrict to = out + row * n;
    const double* __restrict ox = own_d_[3 * row].data();
    const double* __restrict oy = own_d_[3 * row + 1].data();
    const double* __restrict ot = own_d_[3 * row + 2].data();
    const double* __restrict nx = next_d_[3 * row].data();
    const double* __restrict ny = next_d_[3 * row + 1].data();
    const double* __restrict nt = next_d_[3 * row + 2].data();
    UNFURL_INDEPENDENT
    for (int e = 0; e < n; ++e) to[e] += factor * (ox[e] * vx[e] + oy[e] * vy[e] + ot[e] * vt[e]);
    const double* __restrict tx = next_d_[row].data();
    const double* __restrict ty = next_d_[3 + row].data();
    const double* __restrict tt = next_d_[6 + row].data();
    UNFURL_INDEPENDENT
    for (int e = 0; e + 1 < n; ++e) {
      to[e] += factor * (nx[e] * vx[e + 1] + ny[e] * vy[e + 1] + nt[e] * vt[e + 1]);
    }
    UNFURL_INDEPENDENT
    for (int e = 0; e + 1 < n; ++e) {
      to[e + 1] += factor * (tx[e] * vx[e] + ty[e] * vy[e] + tt[e] * vt[e]);
    }
  }
  for (const int p : other_pairs_) {
    const Pair& pair = pairs_[p];
    Multiply(d_[n + p], factor, v, pair.b, out, pair.a, n);
    MultiplyTransposed(d_[n + p], factor, v, pair.a, out, pair.b, n);
  }
}

void Tangent::AddStiffness(double factor, const double* v, double* out) const {
  for (int s = 0; s < n_; ++s) {
    if (is_dynamic_[s] != 0) Multiply(k_[s], factor, v, s, out, s, n_);
  }
  for (std::size_t p = 0; p < pairs_.size(); ++p) {
    const Pair& pair = pairs_[p];
    if (pair.a < 0) continue;
    Multiply(k_[n_ + p], factor, v, pair.b, out, pair.a, n_);
    MultiplyTransposed(k_[n_ + p], factor, v, pair.a, out, pair.b, n_);
  }
}

}  // namespace unfurl::sim
