#include "sim/constraints/partition.h"

#include <algorithm>
#include <cmath>
#include <deque>

namespace unfurl::sim {
namespace {

constexpr double kThreshold = 0.5;     // a pivot is at least this part of the largest in its row
constexpr double kNothingLeft = 1e-9;  // of a row's largest entry before: redundant
constexpr int kMostCost = 63;          // Markowitz costs beyond count alike

}  // namespace

Partition::Partition(const JacobianEntries& entries, double length)
    : rows_(entries.rows()),
      places_(entries.count()),
      column_count_(entries.columns()),
      scale_(entries.columns(), 1.0) {
  // Angles are the last third.
  std::fill(scale_.begin() + column_count_ / 3 * 2, scale_.end(), 1.0 / length);
  for (int row = 0; row <= rows_; ++row) first_.push_back(entries.first(row));
  for (int entry = 0; entry < entries.count(); ++entry) {
    column_of_.push_back(entries.column(entry));
  }
  value_.assign(places_, 0.0);
}

// The rows as they are while pivots are chosen, and the order in which they come up.
struct Partition::Rows {
  Rows(int rows, int columns)
      : row(static_cast<std::size_t>(rows)),
        in_column(static_cast<std::size_t>(columns)),
        before(static_cast<std::size_t>(rows), 0.0),
        queued(static_cast<std::size_t>(rows), -1),
        done(static_cast<std::size_t>(rows), 0),
        waiting(kMostCost + 2) {}

  std::vector<std::vector<Entry>> row;      // entries left
  std::vector<std::vector<int>> in_column;  // rows that have an entry there
  std::vector<double> before;               // largest entry before any elimination, by row
  std::vector<int> queued;                  // Markowitz cost under which a row waits; -1: none
  std::vector<std::uint8_t> done;
  std::vector<std::deque<int>> waiting;  // rows by cost
  int remaining = 0;
};

double Partition::SizeOf(const Entry& e) const {
  return std::fabs(value_[e.place] * scale_[e.column]);
}

double Partition::LargestOf(const std::vector<Entry>& row) const {
  double largest = 0.0;
  for (const Entry& e : row) largest = std::max(largest, SizeOf(e));
  return largest;
}

// The best pivot of a row, -1 where there is none: of those not much smaller than the largest, the
// one of least Markowitz cost, (rows that it is eliminated from) * (entries beside it).
int Partition::BestOf(const Rows& rows, int r, int* cost) const {
  const std::vector<Entry>& row = rows.row[r];
  const double least = std::max(kThreshold * LargestOf(row), 1e-300);
  int best = -1;
  double best_size = 0.0;
  *cost = kMostCost + 1;
  for (std::size_t k = 0; k < row.size(); ++k) {
    const double size = SizeOf(row[k]);
    if (size < least) continue;
    const auto reach = (rows.in_column[row[k].column].size() - 1) * (row.size() - 1);
    const int c = static_cast<int>(std::min<std::size_t>(reach, kMostCost));
    if (c < *cost || (c == *cost && size > best_size)) {
      *cost = c;
      best = static_cast<int>(k);
      best_size = size;
    }
  }
  return best;
}

// Puts a row where its cost belongs now.
void Partition::Queue(int r, Rows* rows) const {
  int cost;
  BestOf(*rows, r, &cost);
  if (rows->queued[r] == cost) return;
  rows->queued[r] = cost;
  rows->waiting[cost].push_back(r);
}

// The waiting row of least cost.
int Partition::NextOf(Rows* rows) {
  for (;;) {
    std::size_t lowest = 0;
    while (rows->waiting[lowest].empty()) ++lowest;
    const int r = rows->waiting[lowest].front();
    rows->waiting[lowest].pop_front();
    if (rows->done[r] || rows->queued[r] != static_cast<int>(lowest)) continue;
    rows->done[r] = 1;
    --rows->remaining;
    return r;
  }
}

// Subtracts the pivot's row from `target`, and notes how, to be done again with other numbers.
void Partition::EliminateFrom(int target, int r, const Entry& pivot, Rows* rows) {
  std::vector<Entry>& of = rows->row[target];
  const auto below =
      std::find_if(of.begin(), of.end(), [&](const Entry& e) { return e.column == pivot.column; });
  const int multiplier = below->place;
  targets_.push_back({target, multiplier});
  value_[multiplier] /= value_[pivot.place];
  of.erase(below);
  for (const Entry& e : rows->row[r]) {
    if (e.column == pivot.column) continue;
    auto at =
        std::find_if(of.begin(), of.end(), [&](const Entry& o) { return o.column == e.column; });
    if (at == of.end()) {  // fill
      value_.push_back(0.0);
      of.push_back({e.column, places_++});
      rows->in_column[e.column].push_back(target);
      at = of.end() - 1;
    }
    sums_.push_back(at->place);
    value_[at->place] -= value_[multiplier] * value_[e.place];
  }
}

// One step of the elimination, with an entry of row r as the pivot.
void Partition::Eliminate(int r, const Entry& pivot, Rows* rows) {
  smallest_pivot_ = std::min(smallest_pivot_, SizeOf(pivot));
  Step step{r, pivot.place, pivot.column, 0, 0, 0, value_[pivot.place] < 0.0};
  for (const Entry& e : rows->row[r]) {
    if (e.column == pivot.column) continue;
    rest_places_.push_back(e.place);
    rest_scale_.push_back(scale_[e.column]);
    ++step.rest;
  }
  columns_.push_back(pivot.column);
  for (const int target : rows->in_column[pivot.column]) {
    EliminateFrom(target, r, pivot, rows);
    ++step.targets;
  }
  rows->in_column[pivot.column].clear();
  steps_.push_back(step);
}

// For every pivot, which entries of its row are in columns of later pivots.
void Partition::NoteLater(const Rows& rows) {
  row_of_.assign(column_count_, -1);
  for (const Step& step : steps_) row_of_[step.column] = step.row;
  std::vector<std::uint8_t> dependent(column_count_, 0);
  for (const int column : columns_) dependent[column] = 1;
  for (Step& step : steps_) {
    dependent[step.column] = 0;  // those left over are of later pivots
    for (const Entry& e : rows.row[step.row]) {
      if (!dependent[e.column]) continue;
      later_.push_back({e.place, e.column});
      ++step.later;
    }
  }
}

Partition::Rows Partition::Start(const double* jacobian) {
  steps_.clear();
  targets_.clear();
  rest_places_.clear();
  rest_scale_.clear();
  sums_.clear();
  later_.clear();
  columns_.clear();
  redundant_.clear();
  places_ = static_cast<int>(column_of_.size());
  smallest_pivot_ = 1.0;
  value_.assign(jacobian, jacobian + places_);
  Rows rows(rows_, column_count_);
  for (int r = 0; r < rows_; ++r) {
    for (int place = first_[r]; place < first_[r + 1]; ++place) {
      rows.row[r].push_back({column_of_[place], place});
      rows.in_column[column_of_[place]].push_back(r);
    }
    rows.before[r] = LargestOf(rows.row[r]);
  }
  return rows;
}

void Partition::Choose(const double* jacobian) {
  Rows rows = Start(jacobian);
  for (int r = 0; r < rows_; ++r) {
    rows.done[r] = rows.row[r].empty() ? 1 : 0;
    if (!rows.done[r]) ++rows.remaining, Queue(r, &rows);
  }
  while (rows.remaining > 0) {
    const int r = NextOf(&rows);
    int cost;
    const int best = BestOf(rows, r, &cost);
    const double largest = LargestOf(rows.row[r]);
    for (const Entry& e : rows.row[r]) std::erase(rows.in_column[e.column], r);
    const std::size_t targets = targets_.size();
    if (best < 0 || largest <= kNothingLeft * rows.before[r]) {
      redundant_.push_back(r);
    } else {
      Eliminate(r, rows.row[r][best], &rows);
    }
    // Whose costs have changed.
    for (const Entry& e : rows.row[r]) {
      for (const int other : rows.in_column[e.column]) Queue(other, &rows);
    }
    for (std::size_t k = targets_.size(); k > targets; --k) Queue(targets_[k - 1].row, &rows);
  }
  NoteLater(rows);
}

double Partition::Factor(const double* jacobian, bool* turned) {
  const auto given = static_cast<std::ptrdiff_t>(column_of_.size());
  std::copy(jacobian, jacobian + given, value_.begin());
  std::fill(value_.begin() + given, value_.end(), 0.0);
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
