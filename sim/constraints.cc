#include "sim/constraints.h"

#include <algorithm>
#include <map>
#include <utility>

#include "base/error.h"

namespace unfurl::sim {

Constraints::Constraints(const Slots& slots, const std::vector<double>& element_length,
                         const std::vector<Pin>& pins,
                         const std::vector<std::string>& element_names)
    : n_(slots.count),
      beam_count_(slots.beam_count),
      rows_(slots.beam_count + 2 * static_cast<int>(pins.size())),
      inverse_mass_(slots.inverse_mass),
      inverse_inertia_(slots.inverse_inertia),
      stations_(slots.stations),
      pins_(pins),
      element_names_(element_names),
      active_(beam_count_, 0.0),
      length_(beam_count_, 0.0),
      mass_sum_(beam_count_, 0.0),
      inertia_i_(beam_count_, 0.0),
      inertia_j_(beam_count_, 0.0),
      shared_(beam_count_, 0.0) {
  std::vector<int> station_of(n_, -1);
  for (std::size_t k = 0; k < stations_.size(); ++k) {
    station_of[stations_[k].slot] = static_cast<int>(k);
  }
  const auto body_of = [&](int slot) {
    return station_of[slot] < 0 ? slot : stations_[station_of[slot]].body;
  };
  std::vector<std::uint8_t> has_equation(rows_, 0);
  std::vector<std::vector<Block>> incidence(n_);  // by body
  for (int e = 0; e + 1 < beam_count_; ++e) {
    if (!(element_length[e] > 0.0)) continue;
    has_equation[e] = 1;
    active_[e] = 1.0;
    length_[e] = element_length[e];
    const int i = body_of(e), j = body_of(e + 1);
    mass_sum_[e] = inverse_mass_[i] + inverse_mass_[j];
    inertia_i_[e] = inverse_inertia_[i];
    if (station_of[e] >= 0) i_sides_.push_back({e, station_of[e], i});
    if (station_of[e + 1] >= 0) {
      j_sides_.push_back({e, station_of[e + 1], j});
      inertia_j_[e] = inverse_inertia_[j];
    }
    incidence[i].push_back({e, -1, false});
    incidence[j].push_back({e, -1, true});
  }
  for (int p = 0; p < static_cast<int>(pins_.size()); ++p) {
    for (int axis = 0; axis < 2; ++axis) {
      has_equation[beam_count_ + 2 * p + axis] = 1;
      incidence[pins_[p].inner].push_back({axis, p, false});
      incidence[pins_[p].outer].push_back({axis, p, true});
    }
  }

  const auto row_of = [&](const Block& b) {
    return b.pin < 0 ? b.row : beam_count_ + 2 * b.pin + b.row;
  };
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
  for (int p = 0; p < static_cast<int>(pins_.size()); ++p) {
    const int row = beam_count_ + 2 * p;
    place_of[{row, row + 1}] = places;
    entries.push_back({row, row + 1, places++});
  }
  for (int body = 0; body < n_; ++body) {
    if (inverse_mass_[body] == 0.0) continue;
    const std::vector<Block>& on = incidence[body];
    std::vector<int> block_index(on.size(), -1);
    const auto block = [&](std::size_t k) {
      if (block_index[k] < 0) {
        block_index[k] = static_cast<int>(blocks_.size());
        blocks_.push_back(on[k]);
      }
      return block_index[k];
    };
    for (std::size_t a = 0; a < on.size(); ++a) {
      for (std::size_t b = a + 1; b < on.size(); ++b) {
        const int row_a = row_of(on[a]), row_b = row_of(on[b]);
        if (on[a].pin >= 0 && on[a].pin == on[b].pin) continue;  // the pin's own block
        const std::pair<int, int> key{std::min(row_a, row_b), std::max(row_a, row_b)};
        const bool chain =
            on[a].pin < 0 && on[b].pin < 0 && key.second == key.first + 1 && body == key.first + 1;
        if (chain) continue;  // shared_
        const auto [found, added] = place_of.emplace(key, places);
        if (added) entries.push_back({key.first, key.second, places++});
        crosses_.push_back({found->second, block(a), block(b), body});
      }
    }
  }
  ldlt_ = SparseLdlt(rows_, has_equation, entries, places);
}

std::string Constraints::NameOf(int row) const {
  if (row >= beam_count_) return pins_[(row - beam_count_) / 2].name;
  return element_names_[row];
}

Constraints::Work Constraints::MakeWork() const {
  Work w;
  const int beams = beam_count_ + kBlock;
  w.tilt = w.tilt_i = w.tilt_j = Array(beams, 0.0);
  w.diagonal = w.inverse = w.lambda = Array(PaddedSize(rows_) + kBlock, 1.0);
  w.off = Array(ldlt_.places() + kBlock, 0.0);
  w.lambda.assign(w.lambda.size(), 0.0);
  w.fx = w.fy = w.m = w.ax = w.ay = w.alpha = Array(n_ + kBlock, 0.0);
  w.pin_points.assign(4 * pins_.size(), 0.0);
  w.blocks.assign(3 * blocks_.size(), 0.0);
  w.station.assign(2 * stations_.size(), 0.0);
  return w;
}

std::vector<double> Constraints::DenseJacobian(const Motion& m, Work* work) const {
  const int columns = 3 * n_;
  std::vector<double> J(static_cast<std::size_t>(rows_) * columns, 0.0);
  std::vector<int> station_of(n_, -1);
  for (std::size_t k = 0; k < stations_.size(); ++k) {
    station_of[stations_[k].slot] = static_cast<int>(k);
  }
  FillGeometry(m, work);
  const auto add = [&](int row, int slot, double jx, double jy, double jt) {
    int body = slot;
    if (station_of[slot] >= 0) {
      const int k = station_of[slot];
      body = stations_[k].body;
      jt += jy * work->station[2 * k] - jx * work->station[2 * k + 1];
    }
    double* at = &J[static_cast<std::size_t>(row) * columns + 3 * body];
    at[0] += jx;
    at[1] += jy;
    at[2] += jt;
  };
  for (int e = 0; e < beam_count_; ++e) {
    if (active_[e] == 0.0) continue;
    add(e, e, -m.c[e], -m.s[e], work->tilt[e]);
    add(e, e + 1, m.c[e], m.s[e], 0.0);
  }
  for (std::size_t p = 0; p < pins_.size(); ++p) {
    const double* o = &work->pin_points[4 * p];
    const int row = beam_count_ + 2 * static_cast<int>(p);
    add(row, pins_[p].inner, -1, 0, o[1]);
    add(row + 1, pins_[p].inner, 0, -1, -o[0]);
    add(row, pins_[p].outer, 1, 0, -o[3]);
    add(row + 1, pins_[p].outer, 0, 1, o[2]);
  }
  return J;
}

}  // namespace unfurl::sim
