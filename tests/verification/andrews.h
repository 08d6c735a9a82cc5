#pragma once

#include <array>
#include <vector>

namespace unfurl::reference {

// Andrews' squeezing mechanism in its own seven angles beta, Theta, gamma, Phi, delta, Omega,
// epsilon: seven equations of motion and six constraints, as the Test Set for IVP Solvers (Mazzia
// and Magherini; after Hairer and Wanner, "Solving Ordinary Differential Equations II") gives them.
// State: the angles [rad], then their rates.
struct Andrews {
  static std::vector<double> Start();
  static void RightSide(const std::vector<double>& y, std::vector<double>& dydt);
  // At t = 0.03 s, the Test Set's reference.
  static constexpr std::array<double, 7> kPublished = {
      15.81077119629904,  -15.75637105984298, 0.04082224013073101, -0.5347301163226948,
      0.5244099658805304, 0.5347301163226948, 1.048080741042263};
};

}  // namespace unfurl::reference
