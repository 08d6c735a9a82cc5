#pragma once

#include <string>
#include <vector>

#include "sim/methods/axial_peak.h"
#include "sim/model/model.h"

namespace unfurl::sim {

// The axial force P of a beam's elements beside their bending stiffness, P l^2 / EI with l the
// element's length: what the mesh leaves out of bending. In tension a bend dies out over
// sqrt(EI / P), in compression it buckles in waves of 2 pi sqrt(EI / P), and the elements' bending
// stiffness lacks P l^2 / (12 EI) of itself (a quarter of P l^2 / EI with the constraint along the
// inboard axis, which is gone at 4). What counts is the force that lasts: its average over a period
// of the beam's first bending mode, as a force that swings faster than that hardly bends it. For
// beams of segments; a smooth beam has no mesh.
class AxialWatch {
 public:
  explicit AxialWatch(const Model& model);

  bool empty() const { return elements_.empty(); }
  // `lambda`: multipliers by row of the last right side, which was at or near `state`.
  void Look(double t, const double* lambda, const double* state);
  const std::vector<AxialPeak>& peaks() const { return peaks_; }  // by Model::beams

  // Why the run must stop, and what is doubtful; empty where all is well.
  bool MustStop() const { return worst_ > kStop; }
  std::string Complaint() const;
  std::vector<std::string> Warnings() const;

 private:
  // At `kWarn` bending lacks 1% of its stiffness, at `kStop` 4% (2.5% and 12% along the inboard
  // axis) and a bend dies out within 1.4 elements.
  static constexpr double kWarn = 0.1, kStop = 0.5;

  struct Element {
    int body;  // the inboard one, and the row of the constraint
    int beam;
    double ratio;          // l^2 / EI [1/N]
    double length;         // [m]
    double stiffness;      // EA / l [N/m]; 0: rigid
    double period;         // of the beam's first bending mode [s]
    double lasting = 0.0;  // P, averaged [N]
  };
  std::string Describe(std::size_t beam) const;

  const Model& model_;
  std::vector<Element> elements_;
  std::vector<AxialPeak> peaks_;
  double t_ = 0.0, worst_ = 0.0;  // [s], [-]
};

}  // namespace unfurl::sim
