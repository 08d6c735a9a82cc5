// Entries of the Jacobian against differences of the constraints themselves, in each coordinate.
#include "sim/constraints/jacobian_entries.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/random.h"
#include "scenes.h"

namespace unfurl::sim::jacobian_entries_test {
namespace {

// A chain of smooth beams, one of which stretches, segments and a bar; and a second
// bar on a pin that two beams share.
constexpr char kChain[] =
    "[scene]\nname = \"chain\"\nduration = 1.0\n"
    "[beam.a]\nlength = 1.0\nmass = 0.5\nEI = 10.0\nmodel = \"kirchhoff\"\norder = 3\n"
    "[beam.b]\nlength = 0.7\nmass = 0.4\nEI = 5.0\nmodel = \"kirchhoff\"\norder = 2\n"
    "axial = \"elastic\"\nEA = 1e4\n"
    "[beam.c]\nlength = 0.9\nmass = 0.3\nEI = 4.0\nsegments = 3\n"
    "[body.bar]\nmass = 0.2\ninertia = 0.01\n[body.tie]\nmass = 0.1\ninertia = 0.002\n"
    "[joint.p]\ninner = \"ground\"\nouter = \"a.start\"\ntheta = 0.3\n"
    "[joint.q]\ninner = \"a.end\"\nouter = \"b.start\"\ntheta = 0.8\n"
    "[joint.r]\ninner = \"b.end\"\nouter = \"c.start\"\ntheta = 0.9\n"
    "[weld.w]\ninner = \"c.end\"\nouter = \"bar\"\nouter_point = [-0.1, 0.05]\n"
    "[joint.s]\ninner = \"a.end\"\nouter = \"tie\"\nouter_point = [-0.3, 0.1]\ntheta = 0.2\n";

TEST(JacobianEntries, AreWhatTheConstraintsChangeBy) {
  constexpr double kStep = 1e-6;   // of lengths of a metre and of radians
  constexpr double kAgree = 1e-8;  // rounding over the step, and its square
  const Model model = ModelFrom(kChain);
  Dynamics dynamics(model);
  JacobianEntries entries(model);
  // Bent and displaced, so that no entry is what it is in a straight line.
  Rng rng(3);
  std::vector<double> y = model.initial_state;
  for (int k = 0; k < entries.columns(); ++k) y[k] += 0.05 * rng.Uniform(-1.0, 1.0);
  dynamics.EvaluateConstraints(0.0, y.data());
  const double* values = entries.At(dynamics, 0.0, y.data());
  std::vector<std::vector<double>> dense(static_cast<std::size_t>(entries.rows()));
  std::vector<bool> used(static_cast<std::size_t>(entries.columns()), false);
  for (int row = 0; row < entries.rows(); ++row) {
    dense[row].assign(static_cast<std::size_t>(entries.columns()), 0.0);
    for (int e = entries.first(row); e < entries.first(row + 1); ++e) {
      dense[row][entries.column(e)] += values[e];
      used[entries.column(e)] = true;
    }
  }
  EXPECT_GT(std::count(used.begin(), used.end(), true), 20);
  for (int column = 0; column < entries.columns(); ++column) {
    if (!used[column]) continue;
    std::vector<double> rows[2];
    for (const int side : {0, 1}) {
      std::vector<double> moved = y;
      moved[column] += side == 0 ? -kStep : kStep;
      dynamics.EvaluateConstraints(0.0, moved.data());
      rows[side].assign(dynamics.constraint_rows(), dynamics.constraint_rows() + entries.rows());
    }
    for (int row = 0; row < entries.rows(); ++row) {
      if (!model.constraints.IsActive(row)) continue;
      const double change = (rows[1][row] - rows[0][row]) / (2.0 * kStep);
      EXPECT_NEAR(dense[row][column], change, kAgree)
          << model.constraints.NameOf(row) << " by column " << column;
    }
  }
}

}  // namespace
}  // namespace unfurl::sim::jacobian_entries_test
