#include "sim/constraints/constraints.h"

#include <algorithm>
#include <map>
#include <utility>

#include "base/error.h"

namespace unfurl::sim {

// The pattern of the Schur complement J M^-1 J^T while it is built: two rows have an entry where
// they touch one body that moves. The smooth beams couple every two rows on them.
struct Constraints::Pattern {
  struct Incident {  // a row that touches a body
    int row;
    bool outer;
  };
  struct Touch {            // a row that touches a smooth beam
    int row, block, place;  // of the row's Jacobian in work.blocks, of the attachment
  };
  // Where the entry of two rows stands below the diagonal: a new place the first time.
  int PlaceOf(int a, int b) {
    const std::pair<int, int> key{std::min(a, b), std::max(a, b)};
    const auto [found, added] = place_of.emplace(key, places);
    if (added) entries.push_back({key.first, key.second, places++});
    return found->second;
  }

  std::vector<std::uint8_t> has_equation;        // by row
  std::vector<std::vector<Incident>> incidence;  // by body
  std::vector<SparseLdlt::Pair> entries;
  std::map<std::pair<int, int>, int> place_of;  // of entries
  int places = 0;
};

Constraints::Constraints(const RigidBodies& bodies, const std::vector<Longitudinal>& elements,
                         JointRows joints, const std::vector<std::string>& element_names,
                         const std::vector<int>& dropped)
    : n_(bodies.count),
      beam_count_(bodies.beam_count),
      rows_(bodies.beam_count + joints.rows()),
      inverse_mass_(bodies.inverse_mass),
      inverse_inertia_(bodies.inverse_inertia),
      stations_(bodies.stations),
      station_of_(bodies.count, -1),
      joints_(std::move(joints)),
      element_names_(element_names),
      active_(beam_count_, 0.0),
      length_(beam_count_, 0.0),
      chord_(beam_count_, 0.0),
      mass_sum_(beam_count_, 0.0),
      inertia_i_(beam_count_, 0.0),
      inertia_j_(beam_count_, 0.0),
      shared_(beam_count_, 0.0) {
  for (std::size_t k = 0; k < stations_.size(); ++k) {
    station_of_[stations_[k].index] = static_cast<int>(k);
  }
  // The ground is one, whatever stands for it, and so is each smooth beam with what sits on it.
  for (int k = 0; k < n_; ++k) stands_for_.push_back(inverse_mass_[k] == 0.0 ? n_ - 1 : k);
  for (const std::vector<int>& attached : bodies.attached) {
    for (const int body : attached) stands_for_[body] = attached.front();
  }
  is_dropped_.assign(joints_.rows(), 0);
  std::vector<std::uint8_t> left_out(rows_, 0);
  for (const int row : dropped) {
    left_out[row] = 1;
    if (row < beam_count_) continue;
    is_dropped_[row - beam_count_] = 1;
    dropped_.push_back(row);
  }
  driven_ = joints_.driven();

  Pattern pattern;
  pattern.has_equation.assign(rows_, 0);
  pattern.incidence.resize(n_);
  pattern.places = beam_count_;
  AddElements(elements, left_out, &pattern);
  AddJoints(&pattern);
  CoupleAlongBeams(&pattern);
  CouplePins(&pattern);
  for (int body = 0; body < n_; ++body) {
    if (inverse_mass_[body] != 0.0) CoupleOnBody(body, &pattern);
  }
  int first = 0;  // of this beam's compliances
  for (const std::vector<int>& attached : bodies.attached) {
    const int stride = 3 * static_cast<int>(attached.size());
    CoupleOnSmoothBeam(attached, first, &pattern);
    first += stride * stride;
  }
  ldlt_ = SparseLdlt(rows_, pattern.has_equation, pattern.entries, pattern.places);
}

void Constraints::AddElements(const std::vector<Longitudinal>& elements,
                              const std::vector<std::uint8_t>& left_out, Pattern* pattern) {
  for (int e = 0; e + 1 < beam_count_; ++e) {
    if (!(elements[e].length > 0.0) || left_out[e]) continue;
    pattern->has_equation[e] = 1;
    active_[e] = 1.0;
    length_[e] = elements[e].length;
    chord_[e] = elements[e].along_chord ? 1.0 : 0.0;
    const int i = InnerBody(e), j = OuterBody(e);
    mass_sum_[e] = inverse_mass_[i] + inverse_mass_[j];
    inertia_i_[e] = inverse_inertia_[i];
    if (station_of_[e] >= 0) i_sides_.push_back({e, station_of_[e], i});
    if (station_of_[e + 1] >= 0) {
      j_sides_.push_back({e, station_of_[e + 1], j});
      inertia_j_[e] = inverse_inertia_[j];
    }
    pattern->incidence[i].push_back({e, false});
    pattern->incidence[j].push_back({e, true});
  }
}

void Constraints::AddJoints(Pattern* pattern) {
  for (int k = 0; k < joints_.rows(); ++k) {
    if (is_dropped_[k]) continue;
    const int row = beam_count_ + k;
    pattern->has_equation[row] = 1;
    pattern->incidence[joints_.Inner(k)].push_back({row, false});
    pattern->incidence[joints_.Outer(k)].push_back({row, true});
  }
}

// Two elements of one beam meet in a segment: the Schur complement is tridiagonal there, and the
// coupling has the place of the first row.
void Constraints::CoupleAlongBeams(Pattern* pattern) {
  for (int e = 0; e + 1 < beam_count_; ++e) {
    if (!pattern->has_equation[e] || !pattern->has_equation[e + 1]) continue;
    if (station_of_[e + 1] >= 0) continue;
    shared_[e] = inverse_mass_[e + 1];
    pattern->entries.push_back({e, e + 1, e});
    pattern->place_of[{e, e + 1}] = e;
  }
}

// The two rows of a pin, assembled by the joints themselves.
void Constraints::CouplePins(Pattern* pattern) {
  for (int p = 0; p < static_cast<int>(joints_.pins.size()); ++p) {
    const int row = beam_count_ + 2 * p;
    pattern->place_of[{row, row + 1}] = pattern->places;
    if (pattern->has_equation[row] && pattern->has_equation[row + 1]) {
      pattern->entries.push_back({row, row + 1, pattern->places});
    }
    ++pattern->places;
  }
}

bool Constraints::IsAssembledApart(int row_a, int row_b, int body) const {
  const int first = std::min(row_a, row_b), second = std::max(row_a, row_b);
  if (second != first + 1) return false;
  const int joint_row = first - beam_count_;
  const bool own_pin = joint_row >= 0 && joint_row % 2 == 0 &&
                       joint_row + 1 < 2 * static_cast<int>(joints_.pins.size());
  return own_pin || (second < beam_count_ && body == second);
}

void Constraints::CoupleOnBody(int body, Pattern* pattern) {
  const std::vector<Pattern::Incident>& on = pattern->incidence[body];
  std::vector<int> element_block(on.size(), -1);
  // Where the row's Jacobian block of this body stands in work.blocks.
  const auto block = [&](std::size_t k) {
    if (on[k].row >= beam_count_) return JointBlock(on[k].row, on[k].outer);
    if (element_block[k] < 0) {
      element_block[k] = 6 * joints_.rows() + 3 * static_cast<int>(blocks_.size());
      blocks_.push_back({on[k].row, on[k].outer});
    }
    return element_block[k];
  };
  for (std::size_t a = 0; a < on.size(); ++a) {
    for (std::size_t b = a + 1; b < on.size(); ++b) {
      if (IsAssembledApart(on[a].row, on[b].row, body)) continue;
      const int place = pattern->PlaceOf(on[a].row, on[b].row);
      const int block_a = block(a), block_b = block(b);
      crosses_.push_back({place, block_a, block_b, body});
    }
  }
}

void Constraints::CoupleOnSmoothBeam(const std::vector<int>& attached, int first,
                                     Pattern* pattern) {
  const int stride = 3 * static_cast<int>(attached.size());
  std::vector<Pattern::Touch> touches;
  for (std::size_t k = 0; k < attached.size(); ++k) {
    for (const Pattern::Incident& on : pattern->incidence[attached[k]]) {
      touches.push_back({on.row, JointBlock(on.row, on.outer), 3 * static_cast<int>(k)});
    }
  }
  for (std::size_t a = 0; a < touches.size(); ++a) {
    for (std::size_t b = a; b < touches.size(); ++b) {
      const Pattern::Touch &i = touches[a], &j = touches[b];
      const int entry = first + i.place * stride + j.place;
      if (i.row == j.row) {
        const double twice = a == b ? 1.0 : 2.0;  // C is symmetric
        beam_couplings_.push_back({i.row, true, i.block, j.block, entry, stride, twice});
      } else {
        const int place = pattern->PlaceOf(i.row, j.row);
        beam_couplings_.push_back({place, false, i.block, j.block, entry, stride, 1.0});
      }
    }
  }
}

bool Constraints::HasLoops(bool rigid) const {
  // Joins bodies row by row; the rows between the same two bodies are one edge.
  std::vector<int> root(n_);
  for (int k = 0; k < n_; ++k) root[k] = k;
  const auto find = [&](int k) {  // union-find with path halving
    while (root[k] != k) k = root[k] = root[root[k]];
    return k;
  };
  const auto standing_for = [&](int body) {
    const bool ground = stands_for_[body] == n_ - 1;
    return rigid && !ground ? body : stands_for_[body];
  };
  std::map<std::pair<int, int>, int> edges;
  for (int row = 0; row < rows_; ++row) {
    if (!IsActive(row)) continue;
    const int a = standing_for(InnerBody(row)), b = standing_for(OuterBody(row));
    if (++edges[{std::min(a, b), std::max(a, b)}] > 1) continue;
    if (find(a) == find(b)) return true;
    root[find(a)] = find(b);
  }
  for (const auto& [edge, rows] : edges) {
    if (rows > 3) return true;
  }
  return false;
}

std::string Constraints::NameOf(int row) const {
  if (row >= beam_count_) return joints_.NameOf(row - beam_count_);
  return element_names_[row];
}

Constraints::Work Constraints::MakeWork() const {
  Work w;
  const int beams = beam_count_ + kBlock;
  w.tilt = w.tilt_i = w.tilt_j = w.axis_x = w.axis_y = Array(beams, 0.0);
  w.diagonal = w.inverse = Array(PaddedSize(rows_) + kBlock, 1.0);
  w.off = Array(ldlt_.places() + kBlock, 0.0);
  w.lambda = w.drift = Array(PaddedSize(rows_) + kBlock, 0.0);
  w.fx = w.fy = w.m = w.ax = w.ay = w.alpha = Array(n_ + kBlock, 0.0);
  w.joints.assign(joints_.GeometrySize(), 0.0);
  w.blocks.assign(6 * joints_.rows() + 3 * blocks_.size(), 0.0);
  w.station.assign(2 * stations_.size(), 0.0);
  return w;
}

int Constraints::InnerBody(int row) const {
  if (row >= beam_count_) return joints_.Inner(row - beam_count_);
  return station_of_[row] < 0 ? row : stations_[station_of_[row]].body;
}

int Constraints::OuterBody(int row) const {
  if (row >= beam_count_) return joints_.Outer(row - beam_count_);
  return station_of_[row + 1] < 0 ? row + 1 : stations_[station_of_[row + 1]].body;
}

void Constraints::Jacobian(const Motion&, const Work& work, double* six) const {
  for (int e = 0; e < beam_count_; ++e, six += 6) {
    const double on = active_[e];
    six[0] = -on * work.axis_x[e];
    six[1] = -on * work.axis_y[e];
    six[2] = on * work.tilt_i[e];
    six[3] = on * work.axis_x[e];
    six[4] = on * work.axis_y[e];
    six[5] = on * work.tilt_j[e];
  }
  std::copy_n(work.blocks.data(), 6 * joints_.rows(), six);
  for (const int row : dropped_) std::fill_n(six + 6 * (row - beam_count_), 6, 0.0);
}

std::vector<double> Constraints::DenseJacobian(const Motion& m, Work* work) const {
  const int columns = 3 * n_;
  std::vector<double> J(static_cast<std::size_t>(rows_) * columns, 0.0), six(6 * rows_, 0.0);
  FillGeometry(m, work);
  Jacobian(m, *work, six.data());
  for (int row = 0; row < rows_; ++row) {
    if (!IsActive(row)) continue;
    double* at = &J[static_cast<std::size_t>(row) * columns];
    for (int k = 0; k < 3; ++k) {
      at[3 * InnerBody(row) + k] += six[6 * row + k];
      at[3 * OuterBody(row) + k] += six[6 * row + 3 + k];
    }
  }
  return J;
}

}  // namespace unfurl::sim
