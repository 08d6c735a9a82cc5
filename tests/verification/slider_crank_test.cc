// The slider-crank of data/sets/slider_crank, two turns. Source: [paper, section 4.2, Figures 6,
// 7]. Quantity: beta, the offset of the rod's middle from its chord over its length. Reference: an
// inextensible rod in seven modes of its angle (modal_rod.h), Fehlberg 7(8) at 1e-10; nine modes
// differ by 4e-5 of the peak. Tolerance: second order in the segments, and the level that follows
// from it. Not checked: the values of the paper's curves, which are drawn and not printed.
#include <gtest/gtest.h>

#include <cmath>

#include "modal_rod.h"
#include "reference.h"
#include "runs.h"

namespace unfurl::sim::slider_crank_test {
namespace {

using Complex = std::complex<double>;
constexpr int kSamples = 200;
constexpr double kCrank = 0.1524, kRod = 0.3048, kSpeed = 150.0, kEnd = 4 * M_PI / kSpeed;

double Offset(Complex start, Complex middle, Complex end) {
  const Complex chord = end - start;
  return std::imag(std::conj(chord / std::abs(chord)) * (middle - start)) / kRod;
}

const std::vector<double>& Reference() {
  static const std::vector<double> kBeta = [] {
    constexpr int kModes = 7;
    reference::ModalRod rod(kModes, false);
    rod.length = kRod;
    rod.mass = 0.076;
    rod.EI = 2.0e11 * M_PI * std::pow(6.35e-3, 4) / 64.0;
    rod.tip_mass = 0.038;
    rod.tip_on_x_axis = true;
    rod.base = [](double t) {
      reference::ModalRod::Base b;
      b.place = std::polar(kCrank, kSpeed * t);
      b.acceleration = -kSpeed * kSpeed * b.place;
      return b;
    };
    std::vector<double> y(2 * kModes, 0.0);
    y[kModes] = -kCrank * kSpeed / kRod;
    reference::Integrator integrator;
    integrator.tolerance = 1e-10;
    const std::vector<double> times = reference::EvenTimes(kEnd, kSamples);
    const auto states = integrator.Run(
        [&](double t, const auto& at, auto& rate) { rod.RightSide(t, at, rate); }, y, times);
    std::vector<double> beta;
    for (std::size_t k = 0; k < times.size(); ++k) {
      const auto p = rod.At(times[k], states[k]);
      beta.push_back(Offset(p.start, p.middle, p.end));
    }
    return beta;
  }();
  return kBeta;
}

double Peak() {
  double peak = 0.0;
  for (const double b : Reference()) peak = std::max(peak, std::fabs(b));
  return peak;
}

std::vector<double> Beta(const std::vector<std::string>& overrides) {
  SimulateOptions options;
  options.rate = kSamples / kEnd;
  options.rtol = 1e-8;
  const Recorder run = Record(Compile(ReadSet("slider_crank/scene.toml", overrides)), options);
  const auto x0 = run["start.x"], y0 = run["start.y"], x1 = run["middle.x"], y1 = run["middle.y"],
             x2 = run["end.x"], y2 = run["end.y"];
  std::vector<double> beta;
  for (std::size_t k = 0; k < x0.size() && k <= kSamples; ++k) {
    beta.push_back(Offset({x0[k], y0[k]}, {x1[k], y1[k]}, {x2[k], y2[k]}));
  }
  beta.resize(kSamples + 1, beta.back());
  return beta;
}

TEST(SliderCrank, SegmentsConvergeToTheRodInSecondOrder) {
  const double peak = Peak();
  std::vector<double> error;
  for (const int n : {9, 17, 33}) {
    error.push_back(
        RootMeanSquareDifference(Beta({"beam.rod.segments=" + std::to_string(n)}), Reference()) /
        peak);
    std::printf("found: slider-crank, n = %d: RMS error of beta %.3f%% of its peak %.6f\n", n,
                100 * error.back(), peak);
  }
  // 17 and 33 are not quite 9 and 17 doubled.
  for (int k = 0; k < 2; ++k) {
    const double order =
        std::log(error[k] / error[k + 1]) / std::log(k == 0 ? 17.0 / 9 : 33.0 / 17);
    std::printf("found: slider-crank, order %.3f\n", order);
    EXPECT_GT(order, 1.7);
    EXPECT_LT(order, 2.2);
  }
  ExpectWithin("slider-crank, 33 segments, RMS of beta over its peak", error[2], 2.5e-3);
}

// Figure 7: with and without the longitudinal constraint. Eq. (30) measures along the inboard
// station's axis and the elastic element along the mean one: lengths that differ by l dtheta^2 / 8,
// so that the rod's axial force P changes its bending stiffness by P l^2 / (4 EI), some 5% at three
// segments. That goes as n^-2; what is left is the rod's stretch.
TEST(SliderCrank, LongitudinalConstraintChangesTheCurveLessAndLess) {
  double difference[2];
  for (const int n : {3, 9}) {
    const std::string segments = "beam.rod.segments=" + std::to_string(n);
    difference[n == 9] =
        RootMeanSquareDifference(Beta({segments, "beam.rod.axial=\"elastic\""}), Beta({segments})) /
        Peak();
  }
  ExpectWithin("slider-crank, elastic against rigid axially, n = 3, RMS over the peak",
               difference[0], 0.05);
  ExpectWithin("slider-crank, elastic against rigid axially, n = 9, RMS over the peak",
               difference[1], 0.05 / 9.0);
}

}  // namespace
}  // namespace unfurl::sim::slider_crank_test
