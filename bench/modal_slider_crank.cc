#include "modal_slider_crank.h"

#include <cmath>
#include <complex>

#include "beam_scenes.h"
#include "tests/verification/modal_rod.h"
#include "tests/verification/reference.h"

namespace unfurl::bench {

std::vector<double> ModalSliderCrank(double rate) {
  constexpr int kModes = 9;
  reference::ModalRod rod(kModes, false);
  rod.length = kRod;
  rod.mass = kRodMass;
  rod.EI = kRodEI;
  rod.tip_mass = kBlock;
  rod.tip_on_x_axis = true;
  rod.base = [](double t) {
    reference::ModalRod::Base base;
    base.place = std::polar(kCrank, kSpeed * t);
    base.acceleration = -kSpeed * kSpeed * base.place;
    return base;
  };
  std::vector<double> y(2 * kModes, 0.0);
  y[kModes] = -kCrank * kSpeed / kRod;
  std::vector<double> times;
  for (int k = 0; k / rate <= 4.0 * M_PI / kSpeed * (1.0 + 1e-12); ++k) times.push_back(k / rate);
  reference::Integrator integrator;
  integrator.tolerance = 1e-10;
  const auto states = integrator.Run(
      [&](double t, const auto& at, auto& derivative) { rod.RightSide(t, at, derivative); }, y,
      times);
  std::vector<double> beta;
  for (std::size_t k = 0; k < times.size(); ++k) {
    const auto p = rod.At(times[k], states[k]);
    const std::complex<double> chord = p.end - p.start;
    beta.push_back(std::imag(std::conj(chord / std::abs(chord)) * (p.middle - p.start)) / kRod);
  }
  return beta;
}

}  // namespace unfurl::bench
