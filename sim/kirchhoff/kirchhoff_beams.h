#pragma once

#include <string>
#include <vector>

#include "sim/kirchhoff/kirchhoff.h"
#include "sim/model/rigid_bodies.h"

namespace unfurl::sim {

// The smooth beams of a model, and where their coordinates stand among the bodies: x_c, y_c and
// theta_0 in the beam's root body, the amplitudes three to a body in the bodies that follow it (x
// and y hold a_k times the length, so that tolerances of lengths fit them; theta holds a_k itself).
// Each attachment has a body too, which joints take for a body: its motion is filled in from the
// coordinates, loads on it are loads on them.
class KirchhoffBeams {
 public:
  struct Beam {
    KirchhoffRod rod;
    int root = -1;              // body
    std::vector<int> attached;  // body by attachment
    std::string name;

    int first_amplitude() const { return root + 1; }
    int amplitude_bodies() const { return (rod.amplitudes() + 2) / 3; }
  };
  // A point along a beam that only samples evaluate.
  struct Watched {
    int beam;
    KirchhoffRod::Place place;
  };
  struct Work {
    std::vector<KirchhoffRod::Work> rods;
    Array q, rate;  // of one beam [m], [rad], [1/s]
    Array load;     // on the attachments of one beam [N], [N m]
    Array free;  // accelerations of all attachments without constraints, 3 each [m/s^2], [rad/s^2]
    Array compliance;  // by beam: accelerations of its attachments by loads on them [SI]
    double power = 0;  // turned into heat [W]
  };

  int count() const { return static_cast<int>(beams_.size()); }
  bool damped() const;
  bool stretches() const;  // any of them
  const Beam& beam(int b) const { return beams_[b]; }
  void Add(Beam beam);
  // Returns an index for MotionAt.
  int Watch(int beam, double at);
  Work MakeWork() const;

  // Fills the attachments' bodies of the six blocks of a state.
  void Update(double* x, double* y, double* theta, double* vx, double* vy, double* omega,
              Work* work) const;
  // Accelerations of the attachments' bodies without constraints, and Work::compliance; at the last
  // Update.
  void Solve(Load load, Work* work, double* ax, double* ay, double* alpha) const;
  // The angular acceleration of a body by a moment of 1 N m on it, all else free, at the last
  // Solve; 0: no beam's attachment [1/(kg m^2)].
  double Mobility(const Work& work, int body) const;
  // Accelerations of all their bodies with the constraints' forces; after Solve.
  void Accelerate(const double* fx, const double* fy, const double* m, Work* work, double* ax,
                  double* ay, double* alpha) const;
  // Takes M^-1 T^T (fx, fy, m) away from the coordinates in three blocks of a state; after Solve.
  void Respond(const double* fx, const double* fy, const double* m, Work* work, double* x,
               double* y, double* theta) const;

  // After Update. Attached bodies and the centre's motion are the bodies' own.
  double KineticAboutCentres(Work* work) const;  // [J]
  double AngularMomentum(Work* work) const;      // each about its centre [kg m^2/s]
  double Bending(const Work& work) const;        // [J]
  double Stretching(const Work& work) const;     // [J]
  double OfStrings(const Work& work) const;      // [J]

  // At a state of `n` bodies.
  KirchhoffRod::Frame MotionAt(int watched, const double* state, int n) const;
  // Of any place of beam b.
  KirchhoffRod::Frame FrameAt(int b, const KirchhoffRod::Place& place, const Motion& motion) const;
  // Its strain there, `at` of the length.
  double StrainAt(int b, double at, const Motion& motion) const;

 private:
  // Coordinates of a beam from three blocks of a state.
  static void Gather(const Beam& beam, const double* x, const double* y, const double* theta,
                     double* q);

  std::vector<Beam> beams_;
  std::vector<Watched> watched_;
  std::vector<int> compliance_at_, free_at_;
  int compliance_size_ = 0, free_size_ = 0;
};

}  // namespace unfurl::sim
