#pragma once

#include <cstdint>
#include <vector>

#include "sim/constraints/jacobian_entries.h"

namespace unfurl::sim {

// Generalized coordinate partitioning (Wehage and Haug 1982, the paper's [19]): which of the
// coordinates follow from the others through the constraints.
//
// The Jacobian is eliminated row by row, with Markowitz's choice of the pivot that makes the least
// fill among those not much smaller than the largest of their row (angles count times a length);
// the pivots' columns are the dependent coordinates. On chains and trees nothing fills in, and the
// work is O(n). A row with nothing left is redundant. The eliminations are kept as flat lists, to
// be run again at other states without searching or allocating.
//
// Jacobians are given as JacobianEntries::At has them.
class Partition {
 public:
  // `length`: of the scene [m].
  Partition(const JacobianEntries& entries, double length);

  // Chooses pivots at this Jacobian, and factors it.
  void Choose(const double* jacobian);
  // Factors with the pivots chosen. The smallest pivot over the largest entry of its row then:
  // where that is small, others would be better.
  // `turned`: whether one has changed its sign since the factor before.
  double Factor(const double* jacobian, bool* turned);
  // Solves J_u x = b for the dependent coordinates (J_u their columns of J): `b` by row, destroyed;
  // out[column] -= x[column].
  void Correct(double* b, double* out) const;

  const std::vector<int>& dependents() const { return columns_; }   // in the order of elimination
  const std::vector<int>& redundant() const { return redundant_; }  // rows
  // Smallest pivot (angles scaled) of the last factor: near zero where constraints depend on one
  // another.
  double smallest_pivot() const { return smallest_pivot_; }
  int fill() const { return places_ - static_cast<int>(column_of_.size()); }

 private:
  struct Entry {
    int column, place;  // place: into value_
  };
  struct Rows;
  // Choose, step by step (partition.cc).
  Rows Start(const double* jacobian);
  double SizeOf(const Entry& e) const;
  double LargestOf(const std::vector<Entry>& row) const;
  int BestOf(const Rows& rows, int r, int* cost) const;
  void Queue(int r, Rows* rows) const;
  static int NextOf(Rows* rows);
  void EliminateFrom(int target, int r, const Entry& pivot, Rows* rows);
  void Eliminate(int r, const Entry& pivot, Rows* rows);
  void NoteLater(const Rows& rows);

  struct Step {
    int row, pivot;  // pivot: place
    int column;
    int targets, rest;  // how many rows it is eliminated from; entries of its row beside the pivot
    int later;          // of those, in columns of pivots that follow
    bool negative;      // the pivot, when last factored
  };
  struct Target {
    int row, place;  // place of the entry below the pivot, then of the multiplier
  };

  int rows_ = 0, places_ = 0, column_count_ = 0;
  std::vector<int> first_, column_of_;  // of a row's entries, by row; column by entry
  std::vector<double> scale_;           // by column [-], [1/m]
  std::vector<int> row_of_;             // row that a dependent column is the pivot of, by column
  std::vector<int> columns_, redundant_;
  double smallest_pivot_ = 1.0;  // [-]

  std::vector<Step> steps_;
  std::vector<Target> targets_;     // step after step
  std::vector<int> rest_places_;    // of the pivot row beside the pivot, step after step
  std::vector<double> rest_scale_;  // [-], [1/m]
  std::vector<int> sums_;           // places that take -multiplier * rest, target after target
  struct Later {
    int place, column;
  };
  std::vector<Later> later_;
  std::vector<double> value_;  // by place [-], [m]
};

}  // namespace unfurl::sim
