#include "sim/constraints/redundancy.h"

#include <algorithm>
#include <cmath>

#include "sim/constraints/partition.h"
#include "sim/dynamics/dynamics.h"

namespace unfurl::sim {
namespace {

constexpr double kMove = 1e-2;                 // of the length scale, or radians
constexpr double kMet = 1e-9;                  // of the length scale: a constraint is met
constexpr int kRedundancyMostIterations = 20;  // of Newton's method

// Some directions, all different, none special: multiples of the golden ratio modulo 2.
double Direction(int k) { return std::fmod(0.6180339887498949 * (k + 1), 1.0) * 2.0 - 1.0; }

// A motion from the initial state: independent coordinates move freely, the others follow to first
// order, J move = 0 in the equations that are kept.
std::vector<double> FirstOrderMove(const Model& model, const JacobianEntries& entries,
                                   const double* jacobian, const Partition& partition) {
  const int n = model.rigid_bodies.count, rows = model.constraints.rows();
  std::vector<double> move(3 * n, 0.0), b(rows, 0.0);
  for (int body = 0; body < n; ++body) {
    if (!model.rigid_bodies.IsDynamic(body)) continue;
    for (int k = 0; k < 3; ++k)
      move[k * n + body] = (k < 2 ? model.length_scale : 1.0) * Direction(3 * body + k);
  }
  for (const int column : partition.dependents()) move[column] = 0.0;
  for (int row = 0; row < rows; ++row) {
    for (int e = entries.first(row); e < entries.first(row + 1); ++e) {
      b[row] += jacobian[e] * move[entries.column(e)];
    }
  }
  partition.Correct(b.data(), move.data());
  return move;
}

// Adds the move, scaled so that its largest entry is kMove, to positions and angles.
void AddScaled(const std::vector<double>& move, double length, std::vector<double>* y) {
  const std::size_t angles = move.size() / 3 * 2;
  double largest = 0.0;
  for (std::size_t i = 0; i < move.size(); ++i) {
    largest = std::max(largest, std::fabs(move[i]) / (i < angles ? length : 1.0));
  }
  if (!(largest > 0.0)) return;
  for (std::size_t i = 0; i < move.size(); ++i) (*y)[i] += kMove / largest * move[i];
}

// The largest violation of two sets of constraints.
struct Violation {
  double kept = 0.0, redundant = 0.0;
};

Violation ViolationAt(const std::vector<int>& redundant, int rows, Dynamics* dynamics,
                      std::vector<double>* y) {
  dynamics->EvaluateConstraints(0.0, y->data());
  Violation worst;
  for (int row = 0; row < rows; ++row) {
    const bool is = std::find(redundant.begin(), redundant.end(), row) != redundant.end();
    double& of = is ? worst.redundant : worst.kept;
    of = std::max(of, std::fabs(dynamics->constraint_rows()[row]));
  }
  return worst;
}

}  // namespace

// Rows that depend on others at the start are redundant if they stay met wherever the kept ones
// lead; else the start is singular, and dropping them would free a motion.
Redundancy FindRedundancy(const Model& model) {
  Redundancy found;
  if (!model.constraints.HasLoops()) return found;
  const double length = model.length_scale;
  const int rows = model.constraints.rows();
  Dynamics dynamics(model);
  std::vector<double> y = model.initial_state;
  JacobianEntries entries(model);
  Partition partition(entries, length);
  dynamics.EvaluateConstraints(0.0, y.data());
  const double* jacobian = entries.At(dynamics, 0.0, y.data());
  partition.Choose(jacobian);
  found.rows = partition.redundant();
  if (found.rows.empty()) return found;

  AddScaled(FirstOrderMove(model, entries, jacobian, partition), length, &y);
  // Newton's method on the kept equations, for the dependent coordinates.
  Violation off = ViolationAt(found.rows, rows, &dynamics, &y);
  int iteration = 0;
  while (off.kept > kMet * 1e-3 * length && ++iteration < kRedundancyMostIterations) {
    bool turned = false;
    partition.Factor(entries.At(dynamics, 0.0, y.data()), &turned);
    partition.Correct(dynamics.constraint_rows(), y.data());
    off = ViolationAt(found.rows, rows, &dynamics, &y);
  }
  Partition moved(entries, length);
  moved.Choose(entries.At(dynamics, 0.0, y.data()));
  found.singular = iteration == kRedundancyMostIterations || off.redundant > kMet * length ||
                   moved.redundant().size() < found.rows.size();
  return found;
}

}  // namespace unfurl::sim
