#pragma once

namespace unfurl::sim {

/// The axial force of one beam of segments beside its bending stiffness; each value of its worst
/// element, of length l. "Lasting": averaged over a period of the beam's first bending mode.
struct AxialPeak {
  double ratio = 0.0;        // largest |P| l^2 / EI at an instant [-]
  double time = 0.0;         // when [s]
  double tension = 0.0;      // largest lasting P l^2 / EI [-]
  double compression = 0.0;  // largest lasting -P l^2 / EI [-]
  double pressed = 0.0;      // largest lasting compressive force [N]
  double euler = 0.0;        // what buckles the beam between two pins, pi^2 EI / L^2 [N]
};

}  // namespace unfurl::sim
