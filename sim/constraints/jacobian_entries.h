#pragma once

#include <vector>

#include "sim/dynamics/dynamics.h"

namespace unfurl::sim {

// The Jacobian of a model's constraints by the coordinates that are integrated, row by row. A body
// on a smooth beam has none of its own: its three columns are those of the beam, by how its frame
// moves with them (KirchhoffRod::FillMotions). Columns have the numbers of the state's entries
// (StateIndex).
class JacobianEntries {
 public:
  explicit JacobianEntries(const Model& model);

  int rows() const { return static_cast<int>(first_.size()) - 1; }
  int columns() const { return columns_; }
  int count() const { return static_cast<int>(column_.size()); }
  // The entries of a row are first(row) to first(row + 1); none in rows without an equation.
  int first(int row) const { return first_[row]; }
  int column(int entry) const { return column_[entry]; }

  // The entries at the y of the last RightSide or EvaluateConstraints [-], [m]; valid until the
  // next call.
  const double* At(const Dynamics& dynamics, double t, double* y);

 private:
  struct Rigid {
    int six, entry;
  };
  struct Smooth {
    int six;    // the first of three
    int entry;  // of the beam's first coordinate
    int beam, attachment;
  };
  void AddBeam(int beam, int n);  // its columns, of n bodies

  const KirchhoffBeams& beams_;
  int columns_;
  std::vector<int> first_{0}, column_;
  std::vector<Rigid> rigid_;
  std::vector<Smooth> smooth_;
  std::vector<double> six_, value_;           // as Constraints::Jacobian; by entry
  std::vector<std::vector<double>> motions_;  // by smooth beam
};

}  // namespace unfurl::sim
