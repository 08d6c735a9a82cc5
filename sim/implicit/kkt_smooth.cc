#include "sim/implicit/kkt_smooth.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace unfurl::sim {

SmoothSaddle::SmoothSaddle(const RigidBodies& bodies, const KirchhoffBeams& beams,
                           const Constraints& constraints, const Tangent& tangent)
    : n_(bodies.count),
      rows_(constraints.rows()),
      mass_(bodies.mass),
      inertia_(bodies.inertia),
      sides_(bodies.count),
      used_row_(constraints.rows(), 0) {
  const int size = 3 * n_ + rows_;
  std::vector<std::uint8_t> active(size, 0), is_row(size, 0);
  std::vector<char> of_beam(n_, 0);
  for (int b = 0; b < beams.count(); ++b) AddBeam(beams.beam(b), &of_beam);
  for (int s = 0; s < n_; ++s) {
    if (of_beam[s] != 0 || !bodies.IsDynamic(s)) continue;
    sides_[s].unknown = {3 * s, 3 * s + 1, 3 * s + 2};
    rigid_.push_back(s);
  }
  for (const int s : rigid_) {
    for (int d = 0; d < 3; ++d) unknowns_.push_back(3 * s + d);
  }
  for (const Beam& beam : list_) {
    unknowns_.insert(unknowns_.end(), beam.unknown.begin(), beam.unknown.end());
  }
  for (const int u : unknowns_) active[u] = 1;

  std::vector<SparseLdlt::Pair> pairs;
  std::map<std::pair<int, int>, int> place_of;
  const auto place = [&](int a, int b) {
    if (a == b) return -1;
    const auto [found, added] =
        place_of.emplace(std::minmax(a, b), static_cast<int>(place_of.size()));
    if (added) pairs.push_back({found->first.first, found->first.second, found->second});
    return found->second;
  };
  const auto fold = [&](int source, int a, int b) {
    Fold f{source, a, b, {}};
    for (const int u : sides_[a].unknown) {
      for (const int v : sides_[b].unknown) f.place.push_back(place(u, v));
    }
    return f;
  };
  for (Beam& beam : list_) {
    for (int i = 0; i < beam.size; ++i) {
      for (int j = 0; j < i; ++j) beam.place.push_back(place(beam.unknown[i], beam.unknown[j]));
    }
    for (const int s : beam.attached) own_.push_back(fold(s, s, s));
    own_.push_back(fold(beam.root, beam.root, beam.root));
  }
  for (const int s : rigid_) own_.push_back(fold(s, s, s));
  for (std::size_t p = 0; p < tangent.pairs().size(); ++p) {
    const Tangent::Pair& pair = tangent.pairs()[p];
    if (pair.a >= 0) pairs_.push_back(fold(static_cast<int>(p), pair.a, pair.b));
  }
  for (int r = 0; r < rows_; ++r) {
    if (!constraints.IsActive(r)) continue;
    const int row = 3 * n_ + r;
    Fold f{r, constraints.InnerBody(r), constraints.OuterBody(r), {}};
    for (const int s : {f.side_a, f.side_b}) {
      for (const int u : sides_[s].unknown) f.place.push_back(place(row, u));
    }
    if (f.place.empty()) continue;
    active[row] = is_row[row] = 1;
    used_row_[r] = 1;
    row_folds_.push_back(std::move(f));
  }
  ldlt_ = SparseLdlt(size, active, pairs, static_cast<int>(pairs.size()), is_row);
  diagonal_ = inverse_ = x_ = Array(PaddedSize(size) + kBlock, 0.0);
  off_ = Array(PaddedSize(ldlt_.places()) + kBlock, 0.0);
}

void SmoothSaddle::AddBeam(const KirchhoffBeams::Beam& beam, std::vector<char>* of_beam) {
  const KirchhoffRod& rod = beam.rod;
  Beam out;
  out.size = rod.coordinates();
  out.root = beam.root;
  // The centre's coordinates, for what acts on it (strings).
  sides_[beam.root].unknown = {3 * beam.root, 3 * beam.root + 1, 3 * beam.root + 2};
  out.damping = rod.properties().damping;
  out.attached = beam.attached;
  out.scale = out.stiffness = Array(out.size, 0.0);
  for (int k = 0; k < out.size; ++k) {
    // Centre and mean angle, then three amplitudes to a body, of which two times the length.
    const int a = k - 3, body = k < 3 ? beam.root : beam.first_amplitude() + a / 3;
    out.scale[k] = k >= 3 && a % 3 < 2 ? rod.properties().length : 1.0;
    out.stiffness[k] = k < 3 ? 0.0 : rod.stiffness(a + 1) / (out.scale[k] * out.scale[k]);
    out.unknown.push_back(3 * body + (k < 3 ? k : a % 3));
    out.at.push_back(IndexOf(out.unknown.back()));
    (*of_beam)[body] = 1;
  }
  for (std::size_t k = 0; k < beam.attached.size(); ++k) {
    Side& side = sides_[beam.attached[k]];
    side.unknown = out.unknown;
    side.beam = static_cast<int>(list_.size());
    side.attachment = static_cast<int>(k);
    (*of_beam)[beam.attached[k]] = 1;
  }
  out.geometric = Array(out.size * out.size, 0.0);
  product_.assign(std::max(product_.size(), static_cast<std::size_t>(out.size)), 0.0);
  list_.push_back(std::move(out));
}

void SmoothSaddle::Linearise(const KirchhoffBeams& beams, const KirchhoffBeams::Work& work) {
  for (std::size_t b = 0; b < list_.size(); ++b) {
    Beam& beam = list_[b];
    beams.beam(static_cast<int>(b)).rod.Linearise(work.rods[b], &beam.linear);
    for (int i = 0; i < beam.size; ++i) {
      for (int j = 0; j < beam.size; ++j) {
        beam.linear.mass[i * beam.size + j] /= beam.scale[i] * beam.scale[j];
      }
    }
    for (std::size_t k = 0; k < beam.linear.motion.size(); ++k) {
      beam.linear.motion[k] /= beam.scale[k % beam.size];
    }
  }
}

void SmoothSaddle::LineariseFully(const KirchhoffBeams& beams, const KirchhoffBeams::Work& work,
                                  const double* fx, const double* fy) {
  Linearise(beams, work);
  std::vector<double> on;
  for (std::size_t b = 0; b < list_.size(); ++b) {
    Beam& beam = list_[b];
    on.clear();
    for (const int s : beam.attached) on.insert(on.end(), {fx[s], fy[s], 0.0});
    std::fill(beam.geometric.begin(), beam.geometric.end(), 0.0);
    beams.beam(static_cast<int>(b))
        .rod.AddGeometric(work.rods[b], on.data(), beam.geometric.data());
    for (int i = 0; i < beam.size; ++i) {
      for (int j = 0; j < beam.size; ++j) {
        beam.geometric[i * beam.size + j] /= beam.scale[i] * beam.scale[j];
      }
    }
  }
}

void SmoothSaddle::Column(const Side& side, int i, double out[3]) const {
  if (side.beam < 0) {
    for (int d = 0; d < 3; ++d) out[d] = d == i ? 1.0 : 0.0;
    return;
  }
  const Beam& beam = list_[side.beam];
  const double* T = beam.linear.motion.data() + 3 * beam.size * side.attachment;
  for (int d = 0; d < 3; ++d) out[d] = T[d * beam.size + i];
}

// Adds Ta^T B Tb to the lower triangle. Of a body with itself B is symmetric and both triangles
// are one; of a pair, B^T at the mirrored place doubles what falls on the diagonal.
void SmoothSaddle::AddFold(const Fold& fold, const Tangent::Block& block) {
  const Side &a = sides_[fold.side_a], &b = sides_[fold.side_b];
  const bool own = fold.side_a == fold.side_b;
  const int* place = fold.place.data();
  for (std::size_t i = 0; i < a.unknown.size(); ++i) {
    double t[3], v[3];
    Column(a, static_cast<int>(i), t);
    for (int d = 0; d < 3; ++d) v[d] = t[0] * block[d] + t[1] * block[3 + d] + t[2] * block[6 + d];
    for (std::size_t j = 0; j < b.unknown.size(); ++j, ++place) {
      if (own && j > i) continue;
      double u[3];
      Column(b, static_cast<int>(j), u);
      const double value = v[0] * u[0] + v[1] * u[1] + v[2] * u[2];
      if (*place >= 0) {
        off_[*place] += value;
      } else {
        diagonal_[a.unknown[i]] += own ? value : 2.0 * value;
      }
    }
  }
}

void SmoothSaddle::Factor(const Tangent& tangent, const double* jacobian, double a, double b) {
  std::fill(off_.begin(), off_.end(), 0.0);
  std::fill(x_.begin(), x_.end(), 0.0);
  std::fill(diagonal_.begin(), diagonal_.end(), 0.0);
  for (const int s : rigid_) {
    diagonal_[3 * s] = diagonal_[3 * s + 1] = mass_[s];
    diagonal_[3 * s + 2] = inertia_[s];
  }
  for (const Beam& beam : list_) {
    const double bend = a * beam.damping + b;
    const int* place = beam.place.data();
    for (int i = 0; i < beam.size; ++i) {
      const double* mass = beam.linear.mass.data() + i * beam.size;
      const double* turning = beam.geometric.data() + i * beam.size;
      for (int j = 0; j < i; ++j) off_[*place++] += mass[j] + b * turning[j];
      diagonal_[beam.unknown[i]] += mass[i] + bend * beam.stiffness[i] + b * turning[i];
    }
  }
  Tangent::Block block;
  for (const Fold& fold : own_) {
    const Tangent::Block &k = tangent.K(fold.source), &d = tangent.D(fold.source);
    for (int i = 0; i < 9; ++i) block[i] = a * d[i] + b * k[i];
    AddFold(fold, block);
  }
  for (const Fold& fold : pairs_) {
    const Tangent::Block &k = tangent.PairK(fold.source), &d = tangent.PairD(fold.source);
    for (int i = 0; i < 9; ++i) block[i] = a * d[i] + b * k[i];
    AddFold(fold, block);
  }
  for (const Fold& fold : row_folds_) {
    const double* row = jacobian + 6 * fold.source;
    const int* place = fold.place.data();
    for (const int s : {fold.side_a, fold.side_b}) {
      for (std::size_t i = 0; i < sides_[s].unknown.size(); ++i) {
        double t[3];
        Column(sides_[s], static_cast<int>(i), t);
        off_[*place++] += row[0] * t[0] + row[1] * t[1] + row[2] * t[2];
      }
      row += 3;
    }
  }
  ldlt_.FactorAndForward(diagonal_.data(), off_.data(), inverse_.data(), x_.data());
}

void SmoothSaddle::Solve(double* x, const double* g) {
  for (const int u : unknowns_) x_[u] = x[IndexOf(u)];
  for (int r = 0; r < rows_; ++r) {
    x_[3 * n_ + r] = g == nullptr || used_row_[r] == 0 ? 0.0 : g[r];
  }
  ldlt_.Forward(off_.data(), inverse_.data(), x_.data());
  ldlt_.Backward(off_.data(), x_.data());
  std::fill_n(x, 3 * n_, 0.0);
  for (const int u : unknowns_) x[IndexOf(u)] = x_[u];
}

void SmoothSaddle::JacobianTimes(const double* jacobian, const double* v, double* g) const {
  std::fill_n(g, rows_, 0.0);
  for (const Fold& fold : row_folds_) {
    const double* j = jacobian + 6 * fold.source;
    double sum = 0.0;
    for (int d = 0; d < 3; ++d) {
      sum += j[d] * v[d * n_ + fold.side_a] + j[3 + d] * v[d * n_ + fold.side_b];
    }
    g[fold.source] = sum;
  }
}

void SmoothSaddle::FillAttached(double* v) const {
  for (const Beam& beam : list_) {
    const double* T = beam.linear.motion.data();
    for (const int s : beam.attached) {
      for (int d = 0; d < 3; ++d, T += beam.size) {
        double sum = 0.0;
        for (int i = 0; i < beam.size; ++i) sum += T[i] * v[beam.at[i]];
        v[d * n_ + s] = sum;
      }
    }
  }
}

void SmoothSaddle::MassTimes(double* w) const {
  for (const int s : rigid_) {
    w[s] *= mass_[s];
    w[n_ + s] *= mass_[s];
    w[2 * n_ + s] *= inertia_[s];
  }
  for (const Beam& beam : list_) {
    for (int i = 0; i < beam.size; ++i) {
      const double* mass = beam.linear.mass.data() + i * beam.size;
      double sum = 0.0;
      for (int j = 0; j < beam.size; ++j) sum += mass[j] * w[beam.at[j]];
      product_[i] = sum;
    }
    for (int i = 0; i < beam.size; ++i) w[beam.at[i]] = product_[i];
    for (const int s : beam.attached) w[s] = w[n_ + s] = w[2 * n_ + s] = 0.0;
  }
}

void SmoothSaddle::FoldAttached(double* w) const {
  for (const Beam& beam : list_) {
    const double* T = beam.linear.motion.data();
    for (const int s : beam.attached) {
      for (int d = 0; d < 3; ++d, T += beam.size) {
        const double load = w[d * n_ + s];
        w[d * n_ + s] = 0.0;
        for (int i = 0; i < beam.size; ++i) w[beam.at[i]] += T[i] * load;
      }
    }
  }
}

void SmoothSaddle::AddDamping(const Tangent& tangent, double factor, const double* v,
                              double* w) const {
  tangent.AddDamping(factor, v, w);
  FoldAttached(w);
  for (const Beam& beam : list_) {
    const double own = factor * beam.damping;
    for (int i = 0; i < beam.size; ++i) w[beam.at[i]] += own * beam.stiffness[i] * v[beam.at[i]];
  }
}

void SmoothSaddle::AddStiffness(const Tangent& tangent, double factor, const double* v,
                                double* w) const {
  tangent.AddStiffness(factor, v, w);
  FoldAttached(w);
  for (const Beam& beam : list_) {
    for (int i = 0; i < beam.size; ++i) {
      const double* turning = beam.geometric.data() + i * beam.size;
      double sum = beam.stiffness[i] * v[beam.at[i]];
      for (int j = 0; j < beam.size; ++j) sum += turning[j] * v[beam.at[j]];
      w[beam.at[i]] += factor * sum;
    }
  }
}

std::vector<int> SmoothSaddle::Entries() const {
  std::vector<int> entries;
  for (const int u : unknowns_) entries.push_back(IndexOf(u));
  return entries;
}

double SmoothSaddle::BendingSquares(const double* v) const {
  double sum = 0.0;
  for (const Beam& beam : list_) {
    for (int i = 0; i < beam.size; ++i) {
      const double part = v[beam.at[i]];
      const double term =
          (beam.stiffness[i] + std::fabs(beam.geometric[i * beam.size + i])) * part * part;
      sum += term * term;
    }
  }
  return sum;
}

double SmoothSaddle::Stiffest(const Tangent& tangent) const {
  double largest = 0.0;
  for (const int s : rigid_) {
    for (int d = 0; d < 3; ++d) {
      const double mass = d < 2 ? mass_[s] : inertia_[s];
      largest = std::max(largest, std::fabs(tangent.K(s)[4 * d]) / mass);
    }
  }
  for (const Beam& beam : list_) {
    for (int i = 0; i < beam.size; ++i) {
      double stiffness = beam.stiffness[i];
      for (std::size_t k = 0; k < beam.attached.size(); ++k) {
        const double* T = beam.linear.motion.data() + 3 * beam.size * k + i;
        for (int d = 0; d < 3; ++d) {
          const double t = T[d * beam.size];
          stiffness += t * t * tangent.K(beam.attached[k])[4 * d];
        }
      }
      largest = std::max(largest, stiffness / beam.linear.mass[i * beam.size + i]);
    }
  }
  return largest;
}

}  // namespace unfurl::sim
