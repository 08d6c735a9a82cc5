#include "sim/constraints/partition.h"

#include <algorithm>
#include <cmath>
#include <deque>

namespace unfurl::sim {
namespace {

constexpr double kThreshold = 0.5;     // a pivot is at least this part of the largest in its row
constexpr double kNothingLeft = 1e-9;  // of a row's largest entry before: redundant
constexpr int kMostCost = 63;          // Markowitz costs beyond count alike

struct Entry {
  int column, place;
};

}  // namespace

Partition::Partition(const Constraints& constraints, const Slots& slots, double length)
    : rows_(constraints.rows()),
      places_(6 * constraints.rows()),
      column_count_(3 * slots.count),
      length_(length),
      column_of_(6 * constraints.rows(), -1),
      scale_(3 * slots.count, 1.0) {
  for (int slot = 0; slot < slots.count; ++slot) scale_[2 * slots.count + slot] = 1.0 / length;
  for (int row = 0; row < rows_; ++row) {
    if (!constraints.IsActive(row)) continue;
    const int body[2] = {constraints.InnerBody(row), constraints.OuterBody(row)};
    for (int side = 0; side < 2; ++side) {
      if (!slots.IsDynamic(body[side])) continue;
      for (int k = 0; k < 3; ++k) column_of_[6 * row + 3 * side + k] = k * slots.count + body[side];
    }
  }
  value_.assign(places_, 0.0);
}

void Partition::Choose(const double* six) {
  steps_.clear();
  targets_.clear();
  rest_places_.clear();
  rest_scale_.clear();
  sums_.clear();
  later_.clear();
  columns_.clear();
  redundant_.clear();
  places_ = 6 * rows_;
  smallest_pivot_ = 1.0;
  value_.assign(six, six + places_);

  std::vector<std::vector<Entry>> row(rows_);
  std::vector<std::vector<int>> in_column(column_count_);  // rows
  std::vector<double> before(rows_, 0.0);                  // largest entry
  for (int r = 0; r < rows_; ++r) {
    for (int k = 0; k < 6; ++k) {
      const int place = 6 * r + k, column = column_of_[place];
      if (column < 0) continue;
      row[r].push_back({column, place});
      in_column[column].push_back(r);
      before[r] = std::max(before[r], std::fabs(value_[place] * scale_[column]));
    }
  }
  const auto largest_of = [&](int r) {
    double largest = 0.0;
    for (const Entry& e : row[r]) {
      largest = std::max(largest, std::fabs(value_[e.place] * scale_[e.column]));
    }
    return largest;
  };
  // The best pivot of a row; its cost is (rows that it reaches) * (entries that it brings).
  const auto best_of = [&](int r, int* cost) {
    const double least = std::max(kThreshold * largest_of(r), 1e-300);
    int best = -1;
    double best_size = 0.0;
    *cost = kMostCost + 1;
    for (std::size_t k = 0; k < row[r].size(); ++k) {
      const Entry& e = row[r][k];
      const double size = std::fabs(value_[e.place] * scale_[e.column]);
      if (size < least) continue;
      const auto reach = (in_column[e.column].size() - 1) * (row[r].size() - 1);
      const int c = static_cast<int>(std::min<std::size_t>(reach, kMostCost));
      if (c < *cost || (c == *cost && size > best_size)) {
        *cost = c;
        best = static_cast<int>(k);
        best_size = size;
      }
    }
    return best;
  };

  std::vector<std::deque<int>> waiting(kMostCost + 2);
  std::vector<int> queued(rows_, -1);
  std::vector<std::uint8_t> done(rows_, 0);
  int remaining = 0;
  const auto queue = [&](int r) {
    int cost;
    best_of(r, &cost);
    if (queued[r] == cost) return;
    queued[r] = cost;
    waiting[cost].push_back(r);
  };
  for (int r = 0; r < rows_; ++r) {
    done[r] = row[r].empty() ? 1 : 0;
    if (!done[r]) ++remaining, queue(r);
  }
  std::size_t lowest = 0;
  while (remaining > 0) {
    for (lowest = 0; waiting[lowest].empty();) ++lowest;
    const int r = waiting[lowest].front();
    waiting[lowest].pop_front();
    if (done[r] || queued[r] != static_cast<int>(lowest)) continue;
    done[r] = 1;
    --remaining;
    const double largest = largest_of(r);
    int cost;
    const int best = best_of(r, &cost);
    for (const Entry& e : row[r]) std::erase(in_column[e.column], r);
    if (best < 0 || largest <= kNothingLeft * before[r]) {
      redundant_.push_back(r);
      for (const Entry& e : row[r]) {
        for (const int other : in_column[e.column]) queue(other);
      }
      continue;
    }
    const Entry pivot = row[r][best];
    smallest_pivot_ =
        std::min(smallest_pivot_, std::fabs(value_[pivot.place] * scale_[pivot.column]));
    Step step{r, pivot.place, pivot.column, 0, 0, 0, value_[pivot.place] < 0.0};
    for (const Entry& e : row[r]) {
      if (e.column == pivot.column) continue;
      rest_places_.push_back(e.place);
      rest_scale_.push_back(scale_[e.column]);
      ++step.rest;
    }
    columns_.push_back(pivot.column);
    for (const int target : in_column[pivot.column]) {
      std::vector<Entry>& of = row[target];
      const auto below = std::find_if(of.begin(), of.end(),
                                      [&](const Entry& e) { return e.column == pivot.column; });
      const int multiplier = below->place;
      targets_.push_back({target, multiplier});
      ++step.targets;
      value_[multiplier] /= value_[pivot.place];
      of.erase(below);
      for (const Entry& e : row[r]) {
        if (e.column == pivot.column) continue;
        auto at = std::find_if(of.begin(), of.end(),
                               [&](const Entry& o) { return o.column == e.column; });
        if (at == of.end()) {
          value_.push_back(0.0);
          of.push_back({e.column, places_++});
          in_column[e.column].push_back(target);
          at = of.end() - 1;
        }
        sums_.push_back(at->place);
        value_[at->place] -= value_[multiplier] * value_[e.place];
      }
    }
    in_column[pivot.column].clear();
    steps_.push_back(step);
    for (const Entry& e : row[r]) {
      for (const int other : in_column[e.column]) queue(other);
    }
    for (int k = 0; k < step.targets; ++k) queue(targets_[targets_.size() - 1 - k].row);
  }
  row_of_.assign(column_count_, -1);
  for (const Step& step : steps_) row_of_[step.column] = step.row;
  std::vector<std::uint8_t> dependent(column_count_, 0);
  for (const int column : columns_) dependent[column] = 1;
  for (Step& step : steps_) {
    dependent[step.column] = 0;  // those left over are of later pivots
    for (const Entry& e : row[step.row]) {
      if (!dependent[e.column]) continue;
      later_.push_back({e.place, e.column});
      ++step.later;
    }
  }
}

double Partition::Factor(const double* six, bool* turned) {
  std::copy(six, six + 6 * rows_, value_.begin());
  std::fill(value_.begin() + 6 * rows_, value_.end(), 0.0);
  double* v = value_.data();
  const int* rest = rest_places_.data();
  const double* rest_scale = rest_scale_.data();
  const int* sum = sums_.data();
  const Target* target = targets_.data();
  double worst = 1.0;
  *turned = false;
  smallest_pivot_ = 1.0;
  for (Step& step : steps_) {
    const double inverse = 1.0 / v[step.pivot];
    *turned |= step.negative != (inverse < 0.0);
    step.negative = inverse < 0.0;
    double largest = 0.0;
    for (int k = 0; k < step.rest; ++k) {
      largest = std::max(largest, std::fabs(v[rest[k]] * rest_scale[k]));
    }
    const double pivot = std::fabs(v[step.pivot] * scale_[step.column]);
    smallest_pivot_ = std::min(smallest_pivot_, pivot);
    if (pivot < worst * largest || !std::isfinite(inverse)) {
      worst = std::isfinite(inverse) ? pivot / largest : 0.0;
    }
    for (int t = 0; t < step.targets; ++t, ++target) {
      const double multiplier = v[target->place] * inverse;
      v[target->place] = multiplier;
      for (int k = 0; k < step.rest; ++k) v[*sum++] -= multiplier * v[rest[k]];
    }
    rest += step.rest;
    rest_scale += step.rest;
  }
  return worst;
}

void Partition::Correct(double* b, double* out) const {
  const double* v = value_.data();
  const Target* target = targets_.data();
  for (const Step& step : steps_) {
    for (int t = 0; t < step.targets; ++t, ++target)
      b[target->row] -= v[target->place] * b[step.row];
  }
  // x of a pivot's column takes the place of its row's right side.
  double* x = b;
  const Later* later = later_.data() + later_.size();
  for (auto step = steps_.rbegin(); step != steps_.rend(); ++step) {
    double sum = b[step->row];
    later -= step->later;
    for (int k = 0; k < step->later; ++k) sum -= v[later[k].place] * x[row_of_[later[k].column]];
    x[step->row] = sum / v[step->pivot];
  }
  for (const Step& step : steps_) out[step.column] -= x[step.row];
}

}  // namespace unfurl::sim
