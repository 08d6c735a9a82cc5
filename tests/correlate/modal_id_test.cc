#include "correlate/modes/modal_id.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "base/statistics.h"
#include "correlate/modes/matrix_pencil.h"
#include "tests/correlate/free_decay.h"

namespace unfurl::correlate::modal_id_test {
namespace {

// Root mean square errors over the Cramer-Rao bound, and errors in units of their own sigmas.
struct Scatter {
  std::vector<double> over_bound;      // f1, zeta1, f2, ..
  std::vector<std::vector<double>> z;  // the same, one list each
  std::vector<double> shape_z;
  int wrong_count = 0;  // draws with another number of modes than planted
};

Scatter Repeat(const PlantedDecay& planted, int draws, std::uint64_t seed) {
  const Eigen::VectorXd bound = planted.Bound();
  Scatter out;
  std::vector<double> squares(static_cast<std::size_t>(bound.size()), 0.0);
  out.z.resize(squares.size());
  int good = 0;
  for (int i = 0; i < draws; ++i) {
    Rng rng = Rng(seed).Stream("draw", static_cast<std::uint64_t>(i));
    const ModalFit fit = IdentifyModes(planted.Draw(rng));
    if (!fit.decay.Usable() || fit.decay.modes.size() != planted.modes.size()) {
      ++out.wrong_count;
      continue;
    }
    ++good;
    for (std::size_t k = 0; k < planted.modes.size(); ++k) {
      const Mode& m = fit.decay.modes[k];
      const double df = m.frequency - planted.modes[k].frequency;
      const double dz = m.damping - planted.modes[k].damping;
      squares[2 * k] += df * df;
      squares[2 * k + 1] += dz * dz;
      out.z[2 * k].push_back(df / m.frequency_sigma);
      out.z[2 * k + 1].push_back(dz / m.damping_sigma);
      Eigen::Index r = 0;
      m.amplitude.cwiseAbs().maxCoeff(&r);
      for (Eigen::Index j = 0; j < m.shape.size(); ++j) {
        if (j == r) continue;
        const auto& a = planted.modes[k].amplitude;
        const std::complex<double> off =
            m.shape(j) - a[static_cast<std::size_t>(j)] / a[static_cast<std::size_t>(r)];
        out.shape_z.push_back(off.real() / m.shape_sigma(0, j));
        out.shape_z.push_back(off.imag() / m.shape_sigma(1, j));
      }
    }
  }
  for (std::size_t i = 0; i < squares.size(); ++i) {
    out.over_bound.push_back(std::sqrt(squares[i] / std::max(1, good)) /
                             bound(static_cast<Eigen::Index>(i)));
  }
  return out;
}

TEST(ModalId, ExactDecaysComeBackExactly) {
  PlantedDecay planted = StrobedDecay(3, 10.0);
  planted.sigma = 0.0;
  Rng rng(1);
  const ModalFit fit = IdentifyModes(planted.Draw(rng, false));
  ASSERT_TRUE(fit.decay.Usable()) << fit.decay.message;
  ASSERT_EQ(fit.decay.modes.size(), 3u);
  constexpr double kRoundOff = 1e-9;  // relative: an iteration's end, not the arithmetic's
  for (std::size_t k = 0; k < 3; ++k) {
    const Mode& m = fit.decay.modes[k];
    EXPECT_NEAR(m.frequency / planted.modes[k].frequency, 1.0, kRoundOff);
    EXPECT_NEAR(m.damping / planted.modes[k].damping, 1.0, 1e-6);
    for (Eigen::Index j = 0; j < 4; ++j) {
      EXPECT_LT(std::abs(m.amplitude(j) - planted.modes[k].amplitude[static_cast<std::size_t>(j)]),
                1e-7);
    }
  }
  EXPECT_NEAR(fit.decay.explained, 1.0, 1e-12);
}

class ModalIdNoise : public testing::TestWithParam<int> {};

TEST_P(ModalIdNoise, AtTwentyDecibelsReachesTheCramerRaoBound) {
  constexpr int kDraws = 60;  // modal_id_slow_test.cc: 1000
  const Scatter s = Repeat(StrobedDecay(GetParam(), 10.0), kDraws, 7);
  EXPECT_EQ(s.wrong_count, 0);
  // Issue: 1.2. An RMS of 60 errors scatters by 1/sqrt(120) = 9% itself; three of that are added.
  for (const double ratio : s.over_bound) EXPECT_LT(ratio, 1.2 + 0.27);
  for (const auto& z : s.z) EXPECT_NEAR(Variance(z), 1.0, 4.0 * std::sqrt(2.0 / kDraws));
  EXPECT_NEAR(Variance(s.shape_z), 1.0, 0.2);
}
INSTANTIATE_TEST_SUITE_P(OneToThreeModes, ModalIdNoise, testing::Values(1, 2, 3));

TEST(ModalId, GapsRatesAndUnevenStampsAreTakenAsTheyAre) {
  PlantedDecay planted = StrobedDecay(3, 30.0);
  planted.t[0] = EvenStamps(0.0, 4.0, 0.004);                                 // another rate
  std::erase_if(planted.t[1], [](double t) { return t > 1.0 && t < 1.35; });  // a gap
  Rng jitter(3);
  for (double& t : planted.t[2]) t += 0.002 * jitter.Uniform(-1.0, 1.0);  // uneven
  std::erase_if(planted.t[3], [](double t) { return t < 0.5; });          // starts later
  const Scatter s = Repeat(planted, 40, 11);
  EXPECT_EQ(s.wrong_count, 0);
  for (const double ratio : s.over_bound) EXPECT_LT(ratio, 1.2 + 3.0 / std::sqrt(80.0));
}

TEST(ModalId, ModesAFewPercentApartAreTwo) {
  PlantedDecay planted = StrobedDecay(2, 20.0);
  planted.modes[1].frequency = 2.1 * 1.08;
  const Scatter s = Repeat(planted, 30, 13);
  EXPECT_EQ(s.wrong_count, 0);
}

TEST(ModalId, CorrelatedNoiseWidensTheStandardErrors) {
  PlantedDecay planted = StrobedDecay(1, 20.0);
  planted.rho = 0.8;
  constexpr int kDraws = 80;
  const Scatter s = Repeat(planted, kDraws, 17);
  EXPECT_LE(s.wrong_count, 1);
  for (const auto& z : s.z) EXPECT_NEAR(Variance(z), 1.0, 4.0 * std::sqrt(2.0 / kDraws));
  EXPECT_GT(s.over_bound[0], 1.3);  // what white noise would allow is out of reach
}

TEST(ModalId, WithoutSigmasTheScatterGivesTheScale) {
  const PlantedDecay planted = StrobedDecay(2, 20.0);
  Rng a(5), b(5);
  const ModalFit with = IdentifyModes(planted.Draw(a, true));
  const ModalFit without = IdentifyModes(planted.Draw(b, false));
  ASSERT_TRUE(with.decay.Usable() && without.decay.Usable());
  ASSERT_EQ(with.decay.modes.size(), without.decay.modes.size());
  EXPECT_NEAR(without.decay.residual_rms, planted.sigma, 0.05 * planted.sigma);
  EXPECT_NEAR(without.decay.modes[0].frequency_sigma, with.decay.modes[0].frequency_sigma,
              0.1 * with.decay.modes[0].frequency_sigma);
}

TEST(ModalId, NoiseHasNoModes) {
  PlantedDecay planted = StrobedDecay(1, 10.0);
  for (auto& c : planted.modes[0].amplitude) c = 0.0;
  int found = 0;
  for (std::uint64_t seed = 0; seed < 30; ++seed) {
    Rng rng(100 + seed);
    found += IdentifyModes(planted.Draw(rng)).decay.Usable() ? 1 : 0;
  }
  EXPECT_EQ(found, 0);
}

TEST(ModalId, TooLittleIsSaid) {
  PlantedDecay planted = StrobedDecay(1, 10.0);
  for (auto& t : planted.t) t.resize(12);
  Rng rng(1);
  const ModalFit fit = IdentifyModes(planted.Draw(rng));
  EXPECT_FALSE(fit.decay.Usable());
  EXPECT_FALSE(fit.decay.message.empty());
}

TEST(ModalId, PairsByFrequencyAndShape) {
  Mode a, b, c;
  a.frequency = 2.0;
  a.shape = Eigen::Vector2cd(1.0, 0.5);
  b = a;
  b.frequency = 2.05;
  c = a;
  c.frequency = 2.01;
  c.shape = Eigen::Vector2cd(-0.5, 1.0);  // nearer in frequency, another shape
  const std::vector<ModePair> pairs = PairModes({a}, {b, c});
  ASSERT_EQ(pairs.size(), 2u);
  EXPECT_EQ(pairs[0].b, 0);
  EXPECT_NEAR(pairs[0].mac, 1.0, 1e-12);
  EXPECT_EQ(pairs[1].a, -1);
}

TEST(Mac, IsOneForMultiplesAndZeroForOrthogonalShapes) {
  const Eigen::Vector3cd a(1.0, std::complex<double>(0.0, 2.0), -0.5);
  EXPECT_NEAR(ModalAssurance(a, std::complex<double>(0.3, -2.0) * a), 1.0, 1e-12);
  EXPECT_NEAR(ModalAssurance(Eigen::Vector2cd(1.0, 1.0), Eigen::Vector2cd(1.0, -1.0)), 0.0, 1e-12);
  // Closed form: cos^2 of the angle between real vectors.
  EXPECT_NEAR(
      ModalAssurance(Eigen::Vector2cd(1.0, 0.0), Eigen::Vector2cd(std::cos(0.4), std::sin(0.4))),
      std::cos(0.4) * std::cos(0.4), 1e-12);
}

// Samples are left out where the band is narrow; unfiltered, it ends at half the rate.
TEST(MatrixPencil, TheBandOfTheGrid) {
  DecaySignal s;
  for (int i = 0; i < 400; ++i) {
    s.t.push_back(0.01 * i);
    s.value.push_back(std::sin(0.3 * i));
  }
  const EvenSignals whole = OnEvenGrid({&s, 1}, 0, 1e99);
  EXPECT_NEAR(whole.step, 0.01, 1e-12);
  EXPECT_NEAR(whole.high, 50.0, 1e-9);
  // 0.4 of the new rate must let 9.9 Hz pass: every fourth sample.
  const EvenSignals thinned = OnEvenGrid({&s, 1}, 0, 9.9);
  EXPECT_NEAR(thinned.step, 0.04, 1e-12);
  EXPECT_NEAR(thinned.high, 10.0, 1e-9);
}

// In an exact sum of decays the true poles of one order are those of the next: they are stable in
// all three ways.
TEST(ModalId, PolesOfExactDecaysAreStable) {
  PlantedDecay planted = StrobedDecay(2, 10.0);
  planted.sigma = 0.0;
  Rng rng(1);
  const ModalFit fit = IdentifyModes(planted.Draw(rng, false));
  ASSERT_EQ(fit.decay.modes.size(), 2u);
  std::array<int, 2> seen{};
  for (const StabilisationPole& pole : fit.poles) {
    for (std::size_t k = 0; k < 2; ++k) {
      const auto& mode = planted.modes[k];
      const bool is = std::abs(pole.frequency - mode.frequency) < 1e-3 * mode.frequency &&
                      std::abs(pole.damping - mode.damping) < 1e-3;
      seen[k] += is && pole.stable_frequency && pole.stable_damping && pole.stable_shape ? 1 : 0;
    }
  }
  EXPECT_GT(seen[0], 1);
  EXPECT_GT(seen[1], 1);
}

TEST(MatrixPencil, PolesOfAnExactSumAtItsOwnOrder) {
  PlantedDecay planted = StrobedDecay(2, 10.0);
  planted.sigma = 0.0;
  planted.level.clear();
  planted.slope.clear();
  Rng rng(1);
  const auto orders = MatrixPencil(OnEvenGrid(planted.Draw(rng, false), -1, 1e99), 4);
  ASSERT_EQ(orders.back().order, 4);
  ASSERT_EQ(orders.back().poles.size(), 2u);
  for (std::size_t k = 0; k < 2; ++k) {
    const double w = 2.0 * std::numbers::pi * planted.modes[k].frequency;
    EXPECT_NEAR(std::abs(orders.back().poles[k]), w, 1e-5 * w);
  }
}

}  // namespace
}  // namespace unfurl::correlate::modal_id_test
