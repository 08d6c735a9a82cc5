// Operational modes: structures of known modes, driven by noise, in closed form. Slow and wider:
// ambient_slow_test.cc.
#include "correlate/modes/ambient.h"

#include <gmock/gmock.h>

#include <numeric>

#include "base/error.h"
#include "base/statistics.h"
#include "correlate/modes/identify.h"
#include "correlate/modes/subspace.h"
#include "tests/correlate/ambient_cases.h"

namespace unfurl::correlate::ambient_test {
namespace {

using ::testing::AnyOf;
using ::testing::HasSubstr;
using Output = DrivenStructure::Output;

constexpr double kTau = 2.0 * std::numbers::pi;

// Four masses, ten minutes at 10 Hz.
AmbientCase FourMasses() {
  return {"four masses", DrivenStructure::Chain(4, 0.8, 0.02),
          0.1,           6000,
          {0, 1, 2, 3},  Output::kAcceleration,
          0.05};
}

std::string Doubts(const AmbientFit& fit) {
  std::string all;
  for (const std::string& d : fit.doubts) all += d + "; ";
  for (const AmbientMode& m : fit.modes) {
    for (const std::string& d : m.doubts) all += d + "; ";
  }
  return all;
}

TEST(Ambient, FindsTheModesOfAChainWhereAFreeDecaysMethodFindsFew) {
  const AmbientCase c{"eight masses",
                      DrivenStructure::Chain(8, 0.5, 0.01),
                      0.1,
                      12000,
                      {0, 2, 4, 6},
                      Output::kAcceleration,
                      0.05};
  Rng rng(1);
  const auto record = c.structure.Draw(rng, c.step, c.samples, c.coordinates, c.output, c.noise);
  const Identification found = Identify(record, Excitation::kByTheData);
  EXPECT_EQ(found.excitation, Excitation::kAmbient) << found.why;
  // The eighth is at 5.2 Hz, beyond what 10 Hz can show, and is folded to 4.8 Hz.
  ASSERT_GE(found.fit.decay.modes.size(), 7u) << found.fit.decay.message;
  for (std::size_t k = 0; k < 6; ++k) {
    const Mode& m = found.fit.decay.modes[k];
    EXPECT_LT(std::abs(m.frequency - c.structure.frequency()[k]), 4.5 * m.frequency_sigma) << k;
    EXPECT_LT(std::abs(m.damping - 0.01), 4.5 * m.damping_sigma) << k;
  }
  EXPECT_LT(IdentifyModes(record).decay.modes.size(), 7u);
}

TEST(Ambient, IntervalsHoldWhatTheySay) {
  constexpr int kRuns = 60;
  const AmbientTally t = Tally(FourMasses(), kRuns, 1000);
  EXPECT_EQ(t.spurious, 0);
  EXPECT_EQ(t.harmonic, 0);
  const auto found = std::accumulate(t.found.begin(), t.found.end(), 0);
  const auto frequency = std::accumulate(t.frequency.begin(), t.frequency.end(), 0);
  const auto damping = std::accumulate(t.damping.begin(), t.damping.end(), 0);
  EXPECT_GE(found, 4 * kRuns - 4);
  // A wrong sigma by a fifth would hold 88 or 98.5% of them.
  for (const int held : {frequency, damping}) {
    const auto [low, high] =
        BinomialInterval(static_cast<std::size_t>(held), static_cast<std::size_t>(found), 0.99);
    EXPECT_LT(low, 0.95) << held << " of " << found;
    EXPECT_GT(high, 0.95) << held << " of " << found;
  }
}

TEST(Ambient, CloseModesAreTwo) {
  // Half-power widths of 2% of the frequency, 2% apart.
  Eigen::Matrix2d shapes;
  shapes << 1.0, 1.0, 1.0, -1.0;
  const AmbientCase c{"close", {shapes / std::sqrt(2.0), {1.0, 1.02}, {0.01, 0.01}},
                      0.1,     10000,
                      {0, 1},  Output::kAcceleration,
                      0.05};
  const AmbientTally t = Tally(c, 20, 500);
  EXPECT_EQ(t.spurious, 0);
  EXPECT_GE(t.found[0] + t.found[1], 39);
  EXPECT_GE(t.frequency[0] + t.frequency[1] + t.damping[0] + t.damping[1], 70);
  EXPECT_GE(t.shapes, t.shape_parts * 85 / 100);
}

// Poles of a heavily damped mode scatter from order to order; where they become no mode, that is a
// doubt of the record.
TEST(Ambient, AHeavilyDampedModeIsFoundOrTold) {
  Eigen::Matrix2d pair;
  pair << 1.0, 1.0, 1.0, -1.0;
  pair /= std::sqrt(2.0);
  const AmbientCase c = {"",     {pair, {1.0, 2.5}, {0.2, 0.01}}, 0.05, 12000,
                         {0, 1}, DrivenStructure::Output::kRate,  0.05};
  const AmbientTally t = Tally(c, 10, 40);
  EXPECT_EQ(t.spurious, 0);
  EXPECT_EQ(t.hidden, 0);
  EXPECT_GE(t.found[0], 5);
  EXPECT_EQ(t.found[1], 10);
  EXPECT_GE(t.frequency[0] + t.damping[0], 2 * t.found[0] * 8 / 10);
}

TEST(Ambient, NoiseHasNoModes) {
  int modes = 0;
  for (int seed = 0; seed < 20; ++seed) {
    Rng rng(static_cast<std::uint64_t>(900 + seed));
    std::vector<DecaySignal> signals(seed % 2 == 0 ? 1 : 4);
    const double rho = seed % 4 < 2 ? 0.0 : 0.8;
    for (DecaySignal& s : signals) {
      double x = rng.Normal();
      for (int i = 0; i < 4000; ++i) {
        x = rho * x + rng.Normal();
        s.t.push_back(0.01 * i);
        s.value.push_back(x);
      }
    }
    const AmbientFit fit = IdentifyAmbientModes(signals);
    for (const AmbientMode& m : fit.modes) modes += m.doubts.empty() ? 1 : 0;
    EXPECT_LE(fit.modes.size(), 1u) << seed;
  }
  EXPECT_EQ(modes, 0);
}

// A tenth of each signal's RMS at 1.5 Hz, where the chain has no mode, or on its second.
TEST(Ambient, AMachineIsNoModeWithoutAWarning) {
  const AmbientCase c = FourMasses();
  for (const double frequency : {1.5, c.structure.frequency()[1]}) {
    Rng rng(7);
    auto record = c.structure.Draw(rng, c.step, c.samples, c.coordinates, c.output, c.noise);
    for (DecaySignal& s : record) {
      const double amplitude = 0.1 * DrivenStructure::RmsOf(s) * std::numbers::sqrt2;
      for (std::size_t i = 0; i < s.t.size(); ++i) {
        s.value[i] += amplitude * std::sin(kTau * frequency * s.t[i]);
      }
    }
    const AmbientFit fit = IdentifyAmbientModes(record);
    ASSERT_EQ(fit.lines.size(), 1u) << frequency;
    EXPECT_NEAR(fit.lines[0].frequency, frequency, 0.2 / fit.duration);
    EXPECT_THAT(Doubts(fit), HasSubstr("steady"));
    int honest = 0;
    for (const AmbientMode& m : fit.modes) {
      if (m.harmonic) continue;
      ++honest;
      EXPECT_GE(PlantedAs(c, m.mode), 0) << m.mode.frequency;
    }
    EXPECT_EQ(honest, 4);
  }
}

// One mode, read in grains of its RMS or clipped: what is not linear makes multiples of it, of
// which some stay where they are from order to order.
TEST(Ambient, MultiplesOfAModeAreDoubted) {
  const DrivenStructure one(Eigen::MatrixXd::Identity(1, 1), {1.0}, {0.005});
  int multiples = 0;
  for (const double grain : {0.5, 1.0, 1.5, 0.0}) {  // over the RMS; 0: clipped at 0.7 of it
    for (std::uint64_t seed = 1; seed <= 4; ++seed) {
      Rng rng(seed);
      auto record = one.Draw(rng, 0.06, 20000, {0}, DrivenStructure::Output::kPlace, 0.02);
      const double rms = DrivenStructure::RmsOf(record[0]);
      for (double& y : record[0].value) {
        y = grain > 0.0 ? grain * rms * std::round(y / (grain * rms))
                        : std::clamp(y, -0.7 * rms, 0.7 * rms);
      }
      const AmbientFit fit = IdentifyAmbientModes(record);
      for (const AmbientMode& m : fit.modes) {
        if (std::abs(m.mode.frequency - 1.0) < 0.1) continue;
        ++multiples;
        EXPECT_FALSE(m.doubts.empty()) << grain << " " << seed << ": " << m.mode.frequency;
      }
    }
  }
  EXPECT_GE(multiples, 4);
}

// A machine whose speed wanders by a fifth of a per cent: no line, but an amplitude that does not.
TEST(Ambient, AMachineThatWandersIsDoubtedToo) {
  const AmbientCase c = FourMasses();
  Rng rng(8);
  auto record = c.structure.Draw(rng, c.step, c.samples, c.coordinates, c.output, c.noise);
  std::vector<double> amplitude;
  for (const DecaySignal& s : record) amplitude.push_back(0.5 * DrivenStructure::RmsOf(s));
  double phase = 0.0, off = 0.0;
  for (std::size_t i = 0; i < record[0].t.size(); ++i) {
    off += 3e-4 * rng.Normal() - 5e-3 * off;
    phase += kTau * (1.5 + off) * c.step;
    for (std::size_t j = 0; j < record.size(); ++j) {
      record[j].value[i] += amplitude[j] * std::sin(phase);
    }
  }
  const AmbientFit fit = IdentifyAmbientModes(record);
  for (const AmbientMode& m : fit.modes) {
    if (std::abs(m.mode.frequency - 1.5) < 0.05) {
      EXPECT_TRUE(m.harmonic) << m.mode.damping;
    }
  }
}

TEST(Ambient, WhatChangesIsSaid) {
  const AmbientCase c = FourMasses();
  Rng rng(9);
  auto louder = c.structure.Draw(rng, c.step, c.samples, c.coordinates, c.output, c.noise);
  for (DecaySignal& s : louder) {
    for (std::size_t i = 0; i < s.value.size(); ++i) {
      s.value[i] *= 1.0 + static_cast<double>(i) / 3000.0;
    }
  }
  EXPECT_THAT(Doubts(IdentifyAmbientModes(louder)), HasSubstr("not stationary"));
  // Stiffer by 4% from half-time on: frequencies by 2%.
  const auto before = c.structure.Draw(rng, c.step, 3000, c.coordinates, c.output, c.noise);
  const auto after = DrivenStructure::Chain(4, 0.816, 0.02)
                         .Draw(rng, c.step, 3000, c.coordinates, c.output, c.noise);
  auto both = before;
  for (std::size_t j = 0; j < both.size(); ++j) {
    for (std::size_t i = 0; i < after[j].t.size(); ++i) {
      both[j].t.push_back(300.0 + after[j].t[i]);
      both[j].value.push_back(after[j].value[i]);
    }
  }
  EXPECT_THAT(Doubts(IdentifyAmbientModes(both)), HasSubstr("moves"));
}

TEST(Ambient, TooShortIsSaid) {
  const AmbientCase c = FourMasses();
  Rng rng(10);
  const auto short_one = c.structure.Draw(rng, c.step, 800, c.coordinates, c.output, c.noise);
  EXPECT_THAT(Doubts(IdentifyAmbientModes(short_one)),
              AnyOf(HasSubstr("too short"), HasSubstr("as narrow as the record resolves")));
  const AmbientFit none =
      IdentifyAmbientModes(c.structure.Draw(rng, c.step, 300, c.coordinates, c.output, c.noise));
  EXPECT_EQ(none.status, DecayStatus::kTooLittle);
  EXPECT_FALSE(none.message.empty());
}

// Signals of other rates, units and beginnings, one with a gap: the same modes.
TEST(Ambient, RatesUnitsAndGapsMayDiffer) {
  const DrivenStructure two = DrivenStructure::Chain(3, 0.4, 0.02);
  Rng rng(11);
  const auto fine = two.Draw(rng, 0.025, 48000, {0, 1, 2}, Output::kRate, 0.02);
  std::vector<DecaySignal> mixed(3);
  for (std::size_t j = 0; j < 3; ++j) {
    const std::size_t every = j == 0 ? 1 : 4;
    for (std::size_t i = 37 * j; i < fine[j].t.size(); i += every) {
      if (j == 1 && i > 20000 && i < 21000) continue;
      mixed[j].t.push_back(fine[j].t[i]);
      mixed[j].value.push_back((j == 2 ? 1000.0 : 1.0) * fine[j].value[i] + 3.0);
    }
  }
  const AmbientFit fit = IdentifyAmbientModes(mixed);
  ASSERT_EQ(fit.modes.size(), 3u) << fit.message;
  for (std::size_t k = 0; k < 3; ++k) {
    const Mode& m = fit.modes[k].mode;
    EXPECT_LT(std::abs(m.frequency - two.frequency()[k]), 4.5 * m.frequency_sigma) << k;
    EXPECT_LT(std::abs(m.damping - 0.02), 4.5 * m.damping_sigma) << k;
  }
  EXPECT_NEAR(fit.duration, 1200.0 - 25.0, 3.0);
}

// The first-order changes against covariances changed by a little: no formula of theirs.
TEST(Ambient, InfluencesAreDerivatives) {
  Rng rng(12);
  const auto record =
      DrivenStructure::Chain(3, 0.8, 0.03).Draw(rng, 0.1, 3000, {0, 1}, Output::kRate, 0.1);
  const JointSignals joint = OnJointGrid(record);
  const LagCovariances covariances = Covariances(joint, 19, 12, 20);
  const Subspace subspace(covariances, 2, 10, joint.step);
  constexpr double kLittle = 1e-6;
  for (const Eigen::Index block : {Eigen::Index{0}, Eigen::Index{13}}) {
    LagCovariances moved = covariances;
    moved.mean += kLittle * covariances.blocks.col(block);
    const Subspace other(moved, 2, 10, joint.step);
    for (const Eigen::Index order : {6, 10}) {
      const auto poles = subspace.Poles(order), changed = other.Poles(order);
      ASSERT_EQ(poles.size(), changed.size());
      for (std::size_t k = 0; k < poles.size(); ++k) {
        const auto by = subspace.Influence(poles[k])(block);
        const auto seen = (changed[k].pole - poles[k].pole) / kLittle;
        EXPECT_LT(std::abs(by - seen), 1e-3 * std::abs(by) + 1e-4) << order << " " << k;
        const Eigen::VectorXcd shape = subspace.ShapeInfluence(poles[k]).col(block);
        const Eigen::VectorXcd shape_seen = (changed[k].shape - poles[k].shape) / kLittle;
        EXPECT_LT((shape - shape_seen).norm(), 1e-3 * shape.norm() + 1e-4) << order << " " << k;
      }
    }
  }
}

TEST(Ambient, AFreeDecayIsOne) {
  for (int seed = 0; seed < 5; ++seed) {
    Rng rng(static_cast<std::uint64_t>(40 + seed));
    std::vector<DecaySignal> signals(2);
    for (int i = 0; i < 800; ++i) {
      for (std::size_t j = 0; j < 2; ++j) {
        const double t = 0.02 * i, a = std::exp(-0.05 * kTau * t) * std::sin(kTau * t);
        signals[j].t.push_back(t);
        signals[j].value.push_back((j == 0 ? 1.0 : 0.4) * a + 0.05 * rng.Normal());
      }
    }
    const Identification found = Identify(signals, Excitation::kByTheData);
    EXPECT_EQ(found.excitation, Excitation::kDecay) << seed;
    EXPECT_FALSE(found.doubtful) << seed;
    EXPECT_EQ(Identify(signals, Excitation::kAmbient).excitation, Excitation::kAmbient);
  }
}

// Two cycles of one mode and five of another, in closed form: whether both are found hangs on the
// phases. Where one is missed what is left is no noise, and that is said.
TEST(Ambient, WhereAModeOfTwoCyclesIsMissedItIsSaid) {
  constexpr int kSeeds = 20;
  int missed = 0;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    Rng rng(static_cast<std::uint64_t>(seed));
    std::vector<DecaySignal> signals(2);
    for (DecaySignal& s : signals) {
      const double one = rng.Uniform(0.0, kTau), other = rng.Uniform(0.0, kTau);
      for (int i = 0; i < 100; ++i) {
        const double t = 0.02 * i;
        s.t.push_back(t);
        s.value.push_back(std::exp(-0.02 * kTau * t) * std::cos(kTau * t + one) +
                          std::exp(-0.02 * kTau * 2.7 * t) * std::cos(kTau * 2.7 * t + other) +
                          0.01 * rng.Normal());
      }
    }
    for (const Excitation how : {Excitation::kByTheData, Excitation::kDecay}) {
      const Identification found = Identify(signals, how);
      if (found.excitation != Excitation::kDecay || found.fit.decay.modes.size() >= 2) continue;
      ++missed;
      EXPECT_TRUE(found.doubtful || !found.fit.decay.Usable()) << seed << ": " << found.why;
    }
  }
  EXPECT_GE(missed, 1);
}

// One mode of 2 Hz and 1% for 20 s, five of its memories: damped sines imitate some of these. None
// is taken for a free decay without a doubt, unless it fades by chance as a free decay does.
TEST(Ambient, AShortRecordTakenForAFreeDecayIsDoubted) {
  const DrivenStructure one(Eigen::MatrixXd::Identity(1, 1), {2.0}, {0.01});
  constexpr int kSeeds = 30;
  int decays = 0, doubted = 0;
  for (int seed = 0; seed < kSeeds; ++seed) {
    Rng rng(static_cast<std::uint64_t>(300 + seed));
    const auto record = one.Draw(rng, 0.02, 1000, {0}, Output::kPlace, 0.05);
    const Identification found = Identify(record, Excitation::kByTheData);
    if (found.excitation != Excitation::kDecay) continue;
    ++decays;
    doubted += found.doubtful ? 1 : 0;
    if (found.doubtful) {
      EXPECT_THAT(found.why, HasSubstr("no noise"));
    }
  }
  EXPECT_GE(decays, 1);
  EXPECT_GE(doubted, decays - 1);
}

TEST(Ambient, OptionsThatMakeNoSenseAreRefused) {
  AmbientOptions options;
  options.max_order = 2;
  EXPECT_THROW(IdentifyAmbientModes({}, options), Error);
  EXPECT_THROW(ParseExcitation("loud", "--modes"), Error);
}

}  // namespace
}  // namespace unfurl::correlate::ambient_test
