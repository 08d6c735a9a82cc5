#include "sim/constraints/redundancy.h"

#include <algorithm>
#include <cmath>

#include "sim/constraints/partition.h"
#include "sim/dynamics/dynamics.h"

namespace unfurl::sim {
namespace {

constexpr double kMove = 1e-2;       // of the length scale, or radians
constexpr double kMet = 1e-9;        // of the length scale: a constraint is met
constexpr int kMostIterations = 20;  // of Newton's method

// Some directions, all different, none special: multiples of the golden ratio modulo 2.
double Direction(int k) { return std::fmod(0.6180339887498949 * (k + 1), 1.0) * 2.0 - 1.0; }

}  // namespace

Redundancy FindRedundancy(const Model& model) {
  Redundancy found;
  // Smooth beams bring coordinates that the partition does not know.
  if (!model.constraints.HasLoops() || model.kirchhoff.count() > 0) return found;
  const double length = model.length_scale;
  const int n = model.slots.count, rows = model.constraints.rows();
  Dynamics dynamics(model);
  std::vector<double> y = model.initial_state, six(6 * rows);
  Partition partition(model.constraints, model.slots, length);
  dynamics.EvaluateConstraints(0.0, y.data());
  dynamics.Jacobian(0.0, y.data(), six.data());
  partition.Choose(six.data());
  found.rows = partition.redundant();
  if (found.rows.empty()) return found;

  // Independent coordinates move at will, the others follow: to first order, then by Newton's
  // method.
  std::vector<double> move(3 * n, 0.0), b(rows, 0.0);
  for (int slot = 0; slot < n; ++slot) {
    if (!model.slots.IsDynamic(slot)) continue;
    for (int k = 0; k < 3; ++k)
      move[k * n + slot] = (k < 2 ? length : 1.0) * Direction(3 * slot + k);
  }
  for (const int column : partition.dependents()) move[column] = 0.0;
  for (int row = 0; row < rows; ++row) {
    if (!model.constraints.IsActive(row)) continue;
    const int body[2] = {model.constraints.InnerBody(row), model.constraints.OuterBody(row)};
    for (int k = 0; k < 6; ++k) b[row] += six[6 * row + k] * move[(k % 3) * n + body[k / 3]];
  }
  partition.Correct(b.data(), move.data());
  double largest = 0.0;
  for (int i = 0; i < 3 * n; ++i) {
    largest = std::max(largest, std::fabs(move[i]) / (i < 2 * n ? length : 1.0));
  }
  if (largest > 0.0) {
    for (int i = 0; i < 3 * n; ++i) y[i] += kMove / largest * move[i];
  }
  const auto violation = [&](bool redundant) {
    dynamics.EvaluateConstraints(0.0, y.data());
    double worst = 0.0;
    for (int row = 0; row < rows; ++row) {
      const bool is = std::find(found.rows.begin(), found.rows.end(), row) != found.rows.end();
      if (is == redundant) worst = std::max(worst, std::fabs(dynamics.constraint_rows()[row]));
    }
    return worst;
  };
  int iteration = 0;
  while (violation(false) > kMet * 1e-3 * length && ++iteration < kMostIterations) {
    bool turned = false;
    dynamics.Jacobian(0.0, y.data(), six.data());
    partition.Factor(six.data(), &turned);
    partition.Correct(dynamics.constraint_rows(), y.data());
  }
  Partition moved(model.constraints, model.slots, length);
  const double off = violation(true);
  dynamics.Jacobian(0.0, y.data(), six.data());
  moved.Choose(six.data());
  found.singular = iteration == kMostIterations || off > kMet * length ||
                   moved.redundant().size() < found.rows.size();
  return found;
}

}  // namespace unfurl::sim
