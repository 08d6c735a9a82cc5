#pragma once

#include <vector>

#include "sim/kirchhoff/kirchhoff_shapes.h"
#include "sim/model/aligned.h"

namespace unfurl::sim {

// One beam as a smooth line that bends, and stretches where asked, exactly for any rotation
// (Kirchhoff's rod in the plane); docs/physics-simulator.md, "The smooth beam". Coordinates are
//   q = (x_c, y_c, theta_0, a_1 ... a_p),
// centre of mass, mean angle and amplitudes of KirchhoffShapes. Relative to the centre the kinetic
// energy is a double integral over directions,
//   T = m |v_c|^2 / 2 + (1/2) sum_qq' K_qq' theta_q' theta_q'' cos(theta_q - theta_q'),
//   V = (EI / 2 L) sum_k S_k a_k^2,
// and Lagrange's equations of them, with Kelvin-Voigt damping, are what is solved. Where it
// stretches the amplitudes of the strains follow the a_k: directions t = (cos, sin) become d =
// lambda t,
//   T = m |v_c|^2 / 2 + (1/2) sum_qq' K_qq' d_q' . d_q'',   V += (EA L / 2) sum_j S_j b_j^2.
//
// Joints and welds act on attachments: points along the beam, each with a frame (x, y, theta) of
// its own, and perhaps a rigid body that is fixed there. They move with q: their rates are T_b q',
// with T_b of three rows.
class KirchhoffRod {
 public:
  struct Properties {
    double length = 0.0;   // [m]
    double mass = 0.0;     // [kg]
    double EI = 0.0;       // at the start [N m^2]
    double damping = 0.0;  // Kelvin-Voigt beta [s]
    int modes = 3;         // of the free beam, in the shapes
    KirchhoffShapes::Ends ends;
    data::BeamSection section;  // along the beam
    double EA = 0.0;            // at the start; 0: it does not stretch [N]
  };
  struct Attachment {
    double at = 0.0;            // place, of the length [-]
    double px = 0.0, py = 0.0;  // of the attached frame, in the beam's frame there [m]
    double angle = 0.0;         // against the beam's [rad]
    double mass = 0.0;          // of the body there [kg]
    double inertia = 0.0;       // about the attached frame's origin [kg m^2]
  };
  // Long strings on every point of the beam, vertical when it is straight at `angle` (Suspension
  // holds its centre).
  struct Strings {
    double gravity_per_length = 0.0;  // g / L_s [1/s^2]
    double angle = 0.0;               // [rad]
  };
  struct Frame {
    double x = 0.0, y = 0.0, theta = 0.0, vx = 0.0, vy = 0.0, omega = 0.0;  // [SI]
  };

  // Mutable arrays of one simulation.
  struct Work {
    Array theta, cosine, sine, rate;  // by point, then by attachment [rad], [-], [-], [rad/s]
    Array a, a_rate;             // theta_0, amplitudes; shapes().width entries, as all below [rad]
    Array products;              // K_qq' cos(theta_q - theta_q') [kg m^2]
    Array push;                  // by point, 4 arrays [1/s^2], [N m]
    Array jx, jy;                // d(place)/d(theta_0, a) by attachment, about the centre [m]
    Array centre_x, centre_y;    // the same of the common centre with the attached bodies [m]
    Array system;                // mass matrix and its right sides, row() entries a row [SI]
    Array factor, inverse;       // M = L D L^T: L by rows, 1 / D [SI]
    Array alpha;                 // right side, then solution [N m], [rad/s^2]
    std::vector<Frame> frame;    // by attachment
    std::vector<double> offset;  // x, y: of its origin from the beam's line [m]
    std::vector<double> bias;    // x, y: acceleration of the place at q'' = 0 [m/s^2]
    double drift[2] = {0.0, 0.0};  // acceleration of the common centre [m/s^2]
    // Where it stretches, by point: lambda and its rate, and d(d)/d(theta_0, a, b) by rows.
    Array stretch, stretch_rate, turn_x, turn_y;  // [-], [1/s], [-], [-]
  };

  KirchhoffRod() = default;
  KirchhoffRod(const Properties& properties, std::vector<Attachment> attachments,
               const Strings& strings);
  Work MakeWork() const;

  const KirchhoffShapes& shapes() const { return shapes_; }
  const Properties& properties() const { return properties_; }
  const std::vector<Attachment>& attachments() const { return attachments_; }
  int amplitudes() const { return shapes_.count; }
  int coordinates() const { return shapes_.count + 3; }

  // Frames of the attachments at q and q' (coordinates() entries each); what follows is at them.
  void Update(const double* q, const double* rate, Work* work) const;

  // Mass matrix and forces. `load`: on the centre, fx and fy; `attached`: fx, fy, m by attachment,
  // about its origin. Fills the accelerations of the attachments, 3 each, and their compliance C,
  // a symmetric matrix of (3 attachments)^2: accelerations += C loads. Adds the
  // power turned into heat to `dissipated` where given.
  void Solve(const double load[2], const double* attached, Work* work, double* acceleration,
             double* compliance, double* dissipated) const;
  // q'' with further loads on the attachments (of constraints), 3 each; after Solve.
  void Accelerate(const double* attached, Work* work, double* acceleration) const;
  // M^-1 T^T load: the change of q' by impulses on the attachments; after Solve.
  void Respond(const double* attached, Work* work, double* change) const;

  // M, coordinates() squared, and by attachment T_b, three rows; after Solve.
  struct Linear {
    Array mass, motion;  // [kg m^2], [m]
  };
  void Linearise(const Work& work, Linear* out) const;
  // Linear::motion alone, where Solve has not been: after Update.
  void FillMotions(const Work& work, double* motion) const;
  // Adds to `k`, coordinates() squared, -dQ/dq of what turns with the beam: the strings' forces,
  // and those of attached frames, `attached` as for Solve; of a beam at rest, after Solve [SI].
  void AddGeometric(const Work& work, const double* attached, double* k) const;
  // d^2V/da_k^2, k from 1, strains included [N m].
  double stiffness(int k) const { return stiffness_[k]; }

  // Energies relative to the centre's motion and without attached bodies; after Update.
  double KineticAboutCentre(Work* work) const;  // [J]
  double AngularMomentum(Work* work) const;     // about the centre of mass [kg m^2/s]
  double Bending(const Work& work) const;       // [J]
  double Stretching(const Work& work) const;    // [J]
  double OfStrings(const Work& work) const;     // less the centre's [J]

  // A place along the beam, with its tables.
  struct Place {
    Array arm, shape;  // [m], [-]
  };
  Place PlaceAt(double at) const { return {shapes_.Arm(at), shapes_.ShapesAt(at)}; }
  // Its frame at q and q'; for samples.
  Frame At(const Place& place, const double* q, const double* rate) const;
  // Curvature d(theta)/ds there [1/m], s being the length at rest.
  double Curvature(double at, const double* q) const;
  // Strain there, by amplitudes or their rates.
  double Strain(double at, const double* q) const;
  bool stretches() const { return shapes_.stretches > 0; }
  // The smallest lambda of its points; 1 where it does not stretch.
  double LeastStretch(const Work& work) const;

 private:
  int row() const {
    return shapes_.width + PaddedSize(3 * static_cast<int>(attachments_.size()) + 1);
  }
  template <int kWidth, bool kStretches>
  void AssembleAttachments(Work* work) const;
  template <int kWidth>
  void AssembleLine(Work* work) const;
  template <int kWidth, bool kStretches>
  void AssembleMass(Work* work) const;
  template <int kWidth, bool kStretches>
  void AssembleForce(const double load[2], const double* attached, Work* work,
                     double* dissipated) const;
  template <int kWidth>
  void Eliminate(Work* work) const;
  template <int kWidth, bool kStretches>
  void SolveAs(const double load[2], const double* attached, Work* work, double* acceleration,
               double* compliance, double* dissipated) const;
  // q'' with loads on the attachments; without `free`, only what these add to it.
  void Answer(const double* attached, bool free, Work* work, double* out) const;
  // alpha = D^-1 L^-T of work->alpha.
  void BackSubstitute(Work* work) const;
  void FillProducts(Work* work) const;
  Frame BentAt(const Place& place, const double* q, const double* rate) const;

  // Of a beam that stretches (kirchhoff_stretch.cc).
  void UpdateStretched(const double* q, const double* rate, Work* work) const;
  void FillTurns(Work* work) const;
  template <int kWidth>
  void AssembleStretchedLine(Work* work) const;
  void PushStretched(Work* work) const;
  double StretchedKinetic(const Work& work) const;
  double StretchedMomentum(const Work& work) const;
  void AddStretchedGeometric(const Work& work, const double* attached, double* k) const;
  Frame StretchedAt(const Place& place, const double* q, const double* rate) const;

  Properties properties_;
  KirchhoffShapes shapes_;
  std::vector<Attachment> attachments_;
  Strings strings_;
  double hang_cosine_ = 1.0, hang_sine_ = 0.0;  // [-]
  double total_mass_ = 0.0;                     // with attached bodies [kg]
  bool bodies_ = false;                         // some attachment has mass
  Array kernel_;                                // m L^2 times the shapes' [kg m^2]
  Array stiffness_;                             // EI / L and EA L times the shapes' [N m]
  int stations_ = 0;                            // points and attachments, padded
  Array column_;                                // N_k at points and attachments, by column [-]
  Array arm_;                                   // by attachment, L times the shapes' [m]
  Array attached_shape_;                        // by attachment [-]
};

}  // namespace unfurl::sim
