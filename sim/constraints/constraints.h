#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "sim/constraints/joint_rows.h"
#include "sim/constraints/sparse_ldlt.h"
#include "sim/kirchhoff/kirchhoff_beams.h"
#include "sim/model/rigid_bodies.h"

namespace unfurl::sim {

class Tangent;

// All constraints, and the multipliers that keep them, [paper, eq. (26) to (33)]:
//   M a = Q + J^T lambda,   J a = gamma,   (J M^-1 J^T) lambda = gamma - J M^-1 Q.
// Rows: the longitudinal constraint (r_j - r_i).a - l of element e is row e (rows of pairs that are
// no such element stay empty), a along the inboard segment, eq. (30), or along r_j - r_i itself;
// the joints' rows follow from row RigidBodies::beam_count on. M is diagonal, so the Schur
// complement is as sparse as the graph of the constraints: along a beam it is tridiagonal.
class Constraints {
 public:
  // Of an element; length 0: none.
  struct Longitudinal {
    double length = 0.0;       // l [m]
    bool along_chord = false;  // else along the inboard segment
  };
  // Mutable arrays of one simulation.
  struct Work {
    Array axis_x, axis_y;          // a, of length 1, by row of elements [-]
    Array tilt;                    // d(row)/d(theta_i), in the station's coordinates, by row [m]
    Array tilt_i, tilt_j;          // the same for the bodies that carry the stations [m]
    Array diagonal, off, inverse;  // the Schur complement, then its factor [1/kg], inverse [kg]
    Array lambda;                  // multipliers by row, of the last Accelerate [N], [N m]
    Array drift;                   // the constraints or their rates by row [m], [rad] and 1/s
    Array fx, fy, m;               // J^T lambda by body [N], [N m]
    Array ax, ay, alpha;           // accelerations by body [m/s^2], [rad/s^2]
    std::vector<double> joints;    // geometry of the joints' rows [m], [-]
    std::vector<double> blocks;    // Jacobian of the joints' rows, 6 each, then the blocks of
                                   // elements that cross terms use, 3 each [m], [-]
    std::vector<double> station;   // offsets in the world, 2 per station [m]
    const KirchhoffBeams* smooth = nullptr;  // where the model has any
    KirchhoffBeams::Work smooth_work;
  };

  Constraints() = default;
  // `elements[e]` joins bodies e and e + 1.
  // `dropped`: rows that get no equation, as they follow from others.
  Constraints(const RigidBodies& bodies, const std::vector<Longitudinal>& elements,
              JointRows joints, const std::vector<std::string>& element_names,
              const std::vector<int>& dropped = {});

  int count() const { return ldlt_.size(); }  // equations
  int rows() const { return rows_; }          // with empty ones
  const SparseLdlt& ldlt() const { return ldlt_; }
  bool IsActive(int row) const {
    return row < beam_count_ ? active_[row] != 0.0 : !is_dropped_[row - beam_count_];
  }
  const JointRows& joints() const { return joints_; }
  int first_joint_row() const { return beam_count_; }
  // The bodies that a row joins (stations stand for the bodies that carry them).
  int InnerBody(int row) const;
  int OuterBody(int row) const;
  // J at the motion of the last Accelerate: six entries a row, x, y, theta of the inner body, then
  // of the outer; zeros for rows without an equation.
  void Jacobian(const Motion& motion, const Work& work, double* six_per_row) const;
  // Whether joints close loops: only then can constraints come to depend on one another. A loop
  // through a smooth beam bends where rigid ones come to depend; `rigid`: such do not count.
  bool HasLoops(bool rigid = false) const;
  // Of the joint or beam that the row belongs to.
  std::string NameOf(int row) const;
  Work MakeWork() const;

  // Turns the load into accelerations that keep the constraints. `work.station` holds the stations'
  // offsets. Accelerations of stations and of the ground come out as zero.
  void Accelerate(const Motion& motion, Load load, Work* work) const;

  // The constraints and their rates at the positions of the last Accelerate, left in work->drift;
  // returns the largest [m], [m/s]. An angle counts as what it moves at the end of the arm.
  double PositionDrift(const Motion& motion, Work* work) const;  // fills work->drift
  // The same at a motion that Accelerate has not seen.
  double PositionDriftAt(const Motion& motion, Work* work) const;
  double VelocityDrift(const Motion& motion, Work* work) const;  // fills work->drift
  // Adds -M^-1 J^T S^-1 (what is in work->drift) to three blocks of a state vector, with the
  // factor of the last Accelerate: the correction that is least in the norm of the masses.
  void RemoveDrift(Work* work, double* x, double* y, double* theta) const;

  // The row with the smallest pivot relative to its first diagonal entry, and that ratio.
  double SmallestPivot(const Work& work, int* row) const;
  // Power that the drives give, with the multipliers of the last Accelerate [W].
  double DrivePower(double t, const Work& work) const {
    return joints_.DrivePower(t, work.lambda.data() + beam_count_);
  }
  bool driven() const { return driven_; }
  void SetArm(double length) { arm_ = length; }  // the scene's length scale [m]

  // The stiffness that the multipliers give, -d(J^T lambda)/dq; `lambda` by row. To be called at
  // the geometry of the last Accelerate.
  void AddTangent(const Motion& motion, const Work& work, const double* lambda,
                  Tangent* tangent) const;
  // Dense J (rows() x 3 bodies; x, y, theta of body k in columns 3 k to 3 k + 2, stations folded
  // into their bodies) for tests and checks.
  std::vector<double> DenseJacobian(const Motion& motion, Work* work) const;

 private:
  struct Side {  // a row's i or j station that is carried by a body
    int row, station, body;
  };
  struct Block {  // of an element's Jacobian, used in cross terms
    int row;
    bool outer;  // the j side
  };
  struct Cross {  // off[place] += a . M_body^-1 . b, with a and b at these places of work.blocks
    int place, a, b, body;
  };

  // off[place] (or diagonal[place]) += factor a . C . b, C a block of the compliance by which
  // bodies on one smooth beam move under loads on one another.
  struct BeamCoupling {
    int place;
    bool diagonal;
    int a, b;        // in work.blocks
    int at, stride;  // of C's first entry in smooth_work.compliance
    double factor;   // [-]
  };
  double Product(const BeamCoupling& coupling, const Work& work) const;
  void AddBeamCouplings(Work* work) const;

  // The constructor's steps: which rows have an equation, and which two of them are coupled.
  struct Pattern;
  void AddElements(const std::vector<Longitudinal>& elements,
                   const std::vector<std::uint8_t>& left_out, Pattern* pattern);
  void AddJoints(Pattern* pattern);
  void CoupleAlongBeams(Pattern* pattern);
  void CouplePins(Pattern* pattern);
  void CoupleOnBody(int body, Pattern* pattern);
  // `first`: of this beam in smooth_work.compliance.
  void CoupleOnSmoothBeam(const std::vector<int>& attached, int first, Pattern* pattern);
  // Whether CoupleAlongBeams or CouplePins covers what two rows have in common on `body`.
  bool IsAssembledApart(int row_a, int row_b, int body) const;
  // Where a joint's row has the block of its inner or outer body in work.blocks.
  int JointBlock(int row, bool outer) const { return 6 * (row - beam_count_) + (outer ? 3 : 0); }

  // a . M_body^-1 . b
  double BodyProduct(int body, const double* a, const double* b) const {
    return inverse_mass_[body] * (a[0] * b[0] + a[1] * b[1]) + inverse_inertia_[body] * a[2] * b[2];
  }
  void FillGeometry(const Motion& motion, Work* work) const;
  void ClearDropped(double* rows) const {
    for (const int row : dropped_) rows[row] = 0.0;
  }
  double LargestDrift(const Array& by_row) const;  // [m], [m/s]
  void AssembleSchur(Work* work) const;
  // J^T of values by row, into work->fx, fy, m.
  void ConstraintLoad(const Array& by_row, Work* work) const;

  int n_ = 0, beam_count_ = 0, rows_ = 0;
  std::vector<int> stands_for_;           // by body, what it is fixed to: itself, ground or beam
  Array inverse_mass_, inverse_inertia_;  // by body [1/kg], [1/(kg m^2)]
  std::vector<Station> stations_;
  std::vector<int> station_of_;  // by body; -1: none
  JointRows joints_;
  std::vector<std::string> element_names_;  // by body of the beam
  Array active_, length_, chord_;           // by row of elements [-], [m], [-]
  Array mass_sum_;                          // 1/m_i + 1/m_j by row [1/kg]
  Array inertia_i_, inertia_j_;  // 1/I of the two sides, 0 where tilt is 0, by row [1/(kg m^2)]
  Array shared_;                 // 1/m of the segment that rows e, e + 1 share [1/kg]
  std::vector<Side> i_sides_, j_sides_;
  std::vector<Block> blocks_;
  std::vector<Cross> crosses_;
  std::vector<BeamCoupling> beam_couplings_;
  std::vector<std::uint8_t> is_dropped_;  // by row of the joints
  std::vector<int> dropped_;              // such rows
  bool driven_ = false;
  double arm_ = 1.0;  // by which an angle is as bad as a distance [m]
  SparseLdlt ldlt_;
};

}  // namespace unfurl::sim
