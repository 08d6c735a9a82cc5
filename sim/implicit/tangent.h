#pragma once

#include <array>
#include <map>
#include <utility>
#include <vector>

#include "sim/model/aligned.h"
#include "sim/model/coordinate.h"
#include "sim/model/hinge.h"
#include "sim/model/rigid_bodies.h"

namespace unfurl::sim {

// The loads' linearisation, K = -dQ/dq and D = -dQ/dv, as 3 x 3 blocks between bodies. A part of
// the load that is no gradient enters by its symmetric half. The pattern never changes: a first
// pass over the effects records which bodies they couple, later ones fill in numbers, and every
// pass adds to the same blocks in the same order, at every state.
class Tangent {
 public:
  using Block = std::array<double, 9>;  // by rows
  struct Pair {
    int a, b;  // bodies; the block has the rows of a and the columns of b
  };

  Tangent() = default;
  bool empty() const { return n_ == 0; }
  explicit Tangent(const RigidBodies& bodies);

  // A pass: Begin, the effects' AddTangent, FoldStations. The first one notes the pattern.
  void Begin(bool note);
  // Adds the stations' rows and columns to those of their bodies. Loads and reactions: the forces
  // on the stations, by body [N]; `offset`: of the stations from their bodies, 2 each [m].
  void FoldStations(const double* load_x, const double* load_y, const double* reaction_x,
                    const double* reaction_y, const double* offset);

  // What the effects call. A block between neighbours on a beam, K_ii, K_ij, K_jj of element e.
  Block& DiagonalK(int body) { return k_[body]; }
  Block& DiagonalD(int body) { return d_[body]; }
  Block& ElementK(int e) { return k_[n_ + e]; }
  Block& ElementD(int e) { return d_[n_ + e]; }
  // Spreads a symmetric form in (r_j - r_i | theta_i, theta_j), times `f`, over the blocks of i and
  // j: `tt` is the entry of an angle with itself, `ij` of one with the other.
  static void Scatter(double f, double xx, double xy, double yy, double xt, double yt, double tt,
                      double ij, Block* ii, Block* block_ij, Block* jj) {
    Block &a = *ii, &b = *block_ij, &d = *jj;
    xx *= f, xy *= f, yy *= f, xt *= f, yt *= f, tt *= f, ij *= f;
    a[0] += xx, a[1] += xy, a[3] += xy, a[4] += yy;
    a[2] -= xt, a[6] -= xt, a[5] -= yt, a[7] -= yt, a[8] += tt;
    d[0] += xx, d[1] += xy, d[3] += xy, d[4] += yy;
    d[2] += xt, d[6] += xt, d[5] += yt, d[7] += yt, d[8] += tt;
    b[0] -= xx, b[1] -= xy, b[3] -= xy, b[4] -= yy;
    b[2] -= xt, b[5] -= yt, b[6] += xt, b[7] += yt, b[8] += ij;
  }
  // A stiffness [N m/rad] and damping [N m s/rad] on the angle of a hinge.
  void AddHinge(const Hinge& hinge, double stiffness, double damping);
  // The same on a joint's coordinate, angle or travel, that bears `moment` now.
  void AddCoordinate(const Motion& motion, const Coordinate& coordinate, double stiffness,
                     double damping, double moment);
  // Blocks of any two bodies (once for the pair), or of a body with itself; d may be null where
  // nothing ever damps.
  void AddPair(int a, int b, const Block& k, const Block* d);
  // Says that bodies e and e + 1 are coupled, and whether by damping too. Counts in the first pass.
  void NoteElement(int e, bool damps);

  // The result. Blocks 0 to bodies - 1 are diagonal, pairs follow; a pair with `a` below zero is
  // unused. Two pairs may have the same bodies.
  const std::vector<Pair>& pairs() const { return pairs_; }
  const Block& K(int body) const { return k_[body]; }
  const Block& D(int body) const { return d_[body]; }
  const Block& PairK(int p) const { return k_[n_ + p]; }
  const Block& PairD(int p) const { return d_[n_ + p]; }
  // out += factor D v; vectors as three blocks of the bodies.
  void AddDamping(double factor, const double* v, double* out) const;
  // out += factor K v.
  void AddStiffness(double factor, const double* v, double* out) const;

 private:
  int PlaceOf(int a, int b);
  void FillChains();
  void NoteDamped(int body);
  void NoteDampedPair(int p);

  int n_ = 0;
  bool note_ = false;
  std::vector<Station> stations_;
  std::vector<int> body_of_;      // by body
  std::vector<char> is_dynamic_;  // by body
  std::vector<Pair> pairs_;       // those of the elements first
  std::vector<Block> k_, d_;
  std::map<std::pair<int, int>, int> place_of_;
  std::vector<int> visits_;  // blocks of AddPair, in the order of calls
  std::size_t next_ = 0;
  std::vector<char> damped_;  // by block
  std::vector<int> damped_bodies_, damped_pairs_;
  // D once more, for AddDamping: of every body with itself and of neighbours on a beam, entry by
  // entry; and the pairs that are none of these.
  std::array<Array, 9> own_d_, next_d_;
  std::vector<int> other_pairs_;
};

}  // namespace unfurl::sim
