#pragma once

#include <string>
#include <vector>

#include "sim/slots.h"
#include "sim/sparse_ldlt.h"

namespace unfurl::sim {

// All constraints, and the multipliers that keep them, [paper, eq. (26) to (33)]:
//   M a = Q + J^T lambda,   J a = gamma,   (J M^-1 J^T) lambda = gamma - J M^-1 Q.
// Rows: the longitudinal constraint (r_j - r_i).e_xi - l of element e is row e (rows of pairs that
// are no such element stay empty); the pins follow, two rows each (x, y of the gap between the two
// points), from row Slots::beam_count on. M is diagonal, so the Schur complement is as sparse as
// the graph of the constraints: along a beam it is tridiagonal.
class Constraints {
 public:
  struct Pin {
    int inner, outer;  // slots
    double ix, iy;     // the point in the inner body's frame [m]
    double ox, oy;     // in the outer's [m]
    std::string name;  // of the joint
  };

  // Mutable arrays of one simulation.
  struct Work {
    Array tilt;                      // d(row)/d(theta_i), in the station's coordinates, by row
    Array tilt_i, tilt_j;            // the same for the bodies that carry the stations
    Array diagonal, off, inverse;    // the Schur complement, then its factor
    Array lambda;                    // by row
    Array fx, fy, m;                 // J^T lambda by slot
    Array ax, ay, alpha;             // accelerations by slot
    std::vector<double> pin_points;  // offsets in the world, 4 per pin
    std::vector<double> blocks;      // Jacobian blocks used in cross terms, 3 each
    std::vector<double> station;     // offsets in the world, 2 per station
  };

  Constraints() = default;
  // `element_length[e]` is l where the longitudinal constraint holds on (e, e + 1), else 0.
  Constraints(const Slots& slots, const std::vector<double>& element_length,
              const std::vector<Pin>& pins, const std::vector<std::string>& element_names);

  int count() const { return ldlt_.size(); }  // equations
  int rows() const { return rows_; }          // with empty ones
  const SparseLdlt& ldlt() const { return ldlt_; }
  bool IsActive(int row) const { return active_[row] != 0.0; }
  // Of the joint or beam that the row belongs to.
  std::string NameOf(int row) const;
  Work MakeWork() const;

  // Turns the load into accelerations that keep the constraints. `work.station` holds the stations'
  // offsets. Accelerations of stations and of the ground come out as zero.
  void Accelerate(const Motion& motion, Load load, Work* work) const;

  // The constraints and their rates at the positions of the last Accelerate, left in work->lambda;
  // returns the largest [m], [m/s].
  double PositionDrift(const Motion& motion, Work* work) const;  // fills work->lambda
  // The same at a motion that Accelerate has not seen.
  double PositionDriftAt(const Motion& motion, Work* work) const;
  double VelocityDrift(const Motion& motion, Work* work) const;  // fills work->lambda
  // Adds -M^-1 J^T S^-1 (what is in work->lambda) to three blocks of a state vector, with the
  // factor of the last Accelerate: the correction that is least in the norm of the masses.
  void RemoveDrift(const Motion& motion, Work* work, double* x, double* y, double* theta) const;

  // The row with the smallest pivot relative to its first diagonal entry, and that ratio.
  double SmallestPivot(const Work& work, int* row) const;

  // Dense J (rows() x 3 slots; x, y, theta of slot k in columns 3 k to 3 k + 2, stations folded
  // into their bodies) for tests and checks.
  std::vector<double> DenseJacobian(const Motion& motion, Work* work) const;

 private:
  struct Side {  // a row's i or j station that is carried by a body
    int row, station, body;
  };
  struct Block {  // which Jacobian block a cross term reads
    int row;      // of an element, or 0/1 for the x/y row of a pin
    int pin;      // -1 for an element's row
    bool outer;   // the j side
  };
  struct Cross {  // off[place] += a . M_body^-1 . b
    int place, a, b, body;
  };

  void FillGeometry(const Motion& motion, Work* work) const;
  void AssembleSchur(const Motion& motion, Work* work) const;
  void ConstraintLoad(const Motion& motion, Work* work) const;

  int n_ = 0, beam_count_ = 0, rows_ = 0;
  Array inverse_mass_, inverse_inertia_;  // by slot
  std::vector<Station> stations_;
  std::vector<Pin> pins_;
  std::vector<std::string> element_names_;  // by slot of the beam
  Array active_, length_;                   // by row of elements
  Array mass_sum_;                          // 1/m_i + 1/m_j by row
  Array inertia_i_, inertia_j_;             // 1/I of the two sides, 0 where tilt is 0, by row
  Array shared_;                            // 1/m of the segment that rows e, e + 1 share
  std::vector<Side> i_sides_, j_sides_;
  std::vector<Block> blocks_;
  std::vector<Cross> crosses_;
  SparseLdlt ldlt_;
};

}  // namespace unfurl::sim
