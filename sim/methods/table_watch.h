#pragma once

#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include "sim/model/model.h"

namespace unfurl::sim {

// Whether steps see what moment tables do. A method's stages see a table at some places of the
// travel alone, and what lies between them (the snap of a tape spring) neither moves anything nor
// shows in the estimate of the error. A table holds nothing that its knots do not show: so where a
// quartic through five values within the travel is off at a knot or midway between two, the step is
// too long. After that it is the estimate's matter.
class TableWatch {
 public:
  TableWatch(const Model& model, double rtol);
  // Of a table's range, that it may be off the quartic [-].
  static double PartUnseen(double rtol);
  // Knots in one travel: more than a quartic through five values goes through, unless it is smooth.
  static constexpr std::ptrdiff_t kMostKnots = 64;
  static constexpr double kShortestTravel = 1e-6;  // of a table: no knots that matter are so near

  bool empty() const { return tables_.count() == 0; }
  // The longest step of h, h / 2, h / 4, ... [s] from `motion` on, at its rates.
  double Resolved(const Motion& motion, double h);
  // Which coordinates went beyond the points of their tables, where nobody measured.
  std::vector<std::string> Warnings() const;

 private:
  const Model& model_;
  const JointEffect<MomentTable>& tables_;
  const double part_;  // of a table's range, that it may be off
  struct Reach {
    double low = std::numeric_limits<double>::infinity(), high = -low;
  };
  std::vector<Reach> reach_;  // of the coordinates, by table
};

}  // namespace unfurl::sim
