#include "sim/constraints/constraints.h"

#include <algorithm>
#include <map>
#include <utility>

#include "base/error.h"

namespace unfurl::sim {

Constraints::Constraints(const Slots& slots, const std::vector<Longitudinal>& elements,
                         JointRows joints, const std::vector<std::string>& element_names,
                         const std::vector<int>& dropped)
    : n_(slots.count),
      beam_count_(slots.beam_count),
      rows_(slots.beam_count + joints.rows()),
      inverse_mass_(slots.inverse_mass),
      inverse_inertia_(slots.inverse_inertia),
      stations_(slots.stations),
      station_of_(slots.count, -1),
      joints_(std::move(joints)),
      element_names_(element_names),
      active_(beam_count_, 0.0),
      length_(beam_count_, 0.0),
      chord_(beam_count_, 0.0),
      mass_sum_(beam_count_, 0.0),
      inertia_i_(beam_count_, 0.0),
      inertia_j_(beam_count_, 0.0),
      shared_(beam_count_, 0.0) {
  std::vector<int>& station_of = station_of_;
  for (std::size_t k = 0; k < stations_.size(); ++k) {
    station_of[stations_[k].slot] = static_cast<int>(k);
  }
  const auto body_of = [&](int slot) {
    return station_of[slot] < 0 ? slot : stations_[station_of[slot]].body;
  };
  is_dropped_.assign(joints_.rows(), 0);
  std::vector<std::uint8_t> has_equation(rows_, 0), left_out(rows_, 0);
  for (const int row : dropped) {
    left_out[row] = 1;
    if (row < beam_count_) continue;
    is_dropped_[row - beam_count_] = 1;
    dropped_.push_back(row);
  }
  struct Incident {  // a row that touches a body
    int row;
    bool outer;
  };
  std::vector<std::vector<Incident>> incidence(n_);  // by body
  for (int e = 0; e + 1 < beam_count_; ++e) {
    if (!(elements[e].length > 0.0) || left_out[e]) continue;
    has_equation[e] = 1;
    active_[e] = 1.0;
    length_[e] = elements[e].length;
    chord_[e] = elements[e].along_chord ? 1.0 : 0.0;
    const int i = body_of(e), j = body_of(e + 1);
    mass_sum_[e] = inverse_mass_[i] + inverse_mass_[j];
    inertia_i_[e] = inverse_inertia_[i];
    if (station_of[e] >= 0) i_sides_.push_back({e, station_of[e], i});
    if (station_of[e + 1] >= 0) {
      j_sides_.push_back({e, station_of[e + 1], j});
      inertia_j_[e] = inverse_inertia_[j];
    }
    incidence[i].push_back({e, false});
    incidence[j].push_back({e, true});
  }
  for (int k = 0; k < joints_.rows(); ++k) {
    if (is_dropped_[k]) continue;
    has_equation[beam_count_ + k] = 1;
    incidence[joints_.Inner(k)].push_back({beam_count_ + k, false});
    incidence[joints_.Outer(k)].push_back({beam_count_ + k, true});
  }
  driven_ = joints_.driven();

  std::vector<SparseLdlt::Pair> entries;
  std::map<std::pair<int, int>, int> place_of;
  int places = beam_count_;
  for (int e = 0; e + 1 < beam_count_; ++e) {
    // Two elements of one beam meet in a segment: their coupling has the place of the first row.
    if (has_equation[e] && has_equation[e + 1] && station_of[e + 1] < 0) {
      shared_[e] = inverse_mass_[e + 1];
      entries.push_back({e, e + 1, e});
      place_of[{e, e + 1}] = e;
    }
  }
  for (int p = 0; p < static_cast<int>(joints_.pins.size()); ++p) {
    const int row = beam_count_ + 2 * p;
    place_of[{row, row + 1}] = places;
    if (has_equation[row] && has_equation[row + 1]) entries.push_back({row, row + 1, places});
    ++places;
  }
  for (int body = 0; body < n_; ++body) {
    if (inverse_mass_[body] == 0.0) continue;
    const std::vector<Incident>& on = incidence[body];
    std::vector<int> element_block(on.size(), -1);
    // Where the row's Jacobian block of this body stands in work.blocks.
    const auto block = [&](std::size_t k) {
      if (on[k].row >= beam_count_) {
        return 6 * (on[k].row - beam_count_) + (on[k].outer ? 3 : 0);
      }
      if (element_block[k] < 0) {
        element_block[k] = 6 * joints_.rows() + 3 * static_cast<int>(blocks_.size());
        blocks_.push_back({on[k].row, on[k].outer});
      }
      return element_block[k];
    };
    for (std::size_t a = 0; a < on.size(); ++a) {
      for (std::size_t b = a + 1; b < on.size(); ++b) {
        const int row_a = on[a].row, row_b = on[b].row;
        const std::pair<int, int> key{std::min(row_a, row_b), std::max(row_a, row_b)};
        const bool own_pin = key.first >= beam_count_ && key.second == key.first + 1 &&
                             (key.first - beam_count_) % 2 == 0 &&
                             key.second - beam_count_ < 2 * static_cast<int>(joints_.pins.size());
        const bool chain =
            key.second < beam_count_ && key.second == key.first + 1 && body == key.first + 1;
        if (own_pin || chain) continue;  // assembled apart
        const auto [found, added] = place_of.emplace(key, places);
        if (added) entries.push_back({key.first, key.second, places++});
        crosses_.push_back({found->second, block(a), block(b), body});
      }
    }
  }
  // Slots of a smooth beam's attachments: every two rows on the beam meet.
  int at = 0;
  for (const std::vector<int>& attached : slots.attached) {
    const int stride = 3 * static_cast<int>(attached.size());
    struct Touch {
      int row, block, place;  // of the row's Jacobian, of the attachment
    };
    std::vector<Touch> touches;
    for (std::size_t k = 0; k < attached.size(); ++k) {
      for (const Incident& on : incidence[attached[k]]) {
        touches.push_back(
            {on.row, 6 * (on.row - beam_count_) + (on.outer ? 3 : 0), 3 * static_cast<int>(k)});
      }
    }
    for (std::size_t a = 0; a < touches.size(); ++a) {
      for (std::size_t b = a; b < touches.size(); ++b) {
        const Touch &i = touches[a], &j = touches[b];
        const int entry = at + i.place * stride + j.place;
        if (i.row == j.row) {
          answers_.push_back({i.row, true, i.block, j.block, entry, stride, a == b ? 1.0 : 2.0});
          continue;
        }
        const std::pair<int, int> key{std::min(i.row, j.row), std::max(i.row, j.row)};
        const auto [found, added] = place_of.emplace(key, places);
        if (added) entries.push_back({key.first, key.second, places++});
        answers_.push_back({found->second, false, i.block, j.block, entry, stride, 1.0});
      }
    }
    at += stride * stride;
  }
  ldlt_ = SparseLdlt(rows_, has_equation, entries, places);
}

bool Constraints::HasLoops() const {
  // Joins bodies row by row; the rows between the same two bodies are one edge.
  std::vector<int> root(n_);
  for (int k = 0; k < n_; ++k) root[k] = k;
  const auto find = [&](int k) {
    while (root[k] != k) k = root[k] = root[root[k]];
    return k;
  };
  std::map<std::pair<int, int>, int> edges;
  for (int row = 0; row < rows_; ++row) {
    if (!IsActive(row)) continue;
    int a = InnerBody(row), b = OuterBody(row);
    if (inverse_mass_[a] == 0.0) a = n_ - 1;  // the ground is one, whatever stands for it
    if (inverse_mass_[b] == 0.0) b = n_ - 1;
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
  w.diagonal = w.inverse = w.lambda = Array(PaddedSize(rows_) + kBlock, 1.0);
  w.off = Array(ldlt_.places() + kBlock, 0.0);
  w.lambda.assign(w.lambda.size(), 0.0);
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
