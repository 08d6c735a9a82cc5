// Readings of channels with gross errors planted: found, named, and of no consequence; and what
// looks like them and is none.
#include <gtest/gtest.h>

#include <functional>
#include <numbers>
#include <set>

#include "base/statistics.h"
#include "correlate/align/far_samples.h"
#include "correlate/fit/gross_samples.h"
#include "correlate/residual/row_layout.h"
#include "tests/correlate/instruments.h"
#include "tests/repeats.h"

namespace unfurl::correlate::channel_gross_test {
namespace {

constexpr double kOffset = 0.7312;

// What is planted.
struct Gross {
  double share = 0.0, sigmas = 0.0;
  bool one_sided = false;
  bool known = false;  // those planted are left out beforehand, which no method can do better than
};

// How the channel reads.
struct Reading {
  Instrument instrument;
  double resolution = 0.0;   // [unit]
  double correlation = 0.0;  // of its noise, from one reading to the next [-]
};

Instrument Encoder(bool states_sigma) {
  Instrument i;
  i.quantity = "first.angle";
  i.sigma = 2e-3;
  i.states_sigma = states_sigma;
  return i;
}

struct Tally {
  int usable = 0, unexplained = 0, records_named = 0, held[2] = {0, 0};
  std::vector<double> off[2];  // value - truth
  std::size_t planted = 0, missed = 0, wrongly = 0, clean = 0;
};

struct Planted {
  ChannelRecord record;
  std::set<std::size_t> gross;
};

Planted Plant(const Reading& reading, const Gross& gross, Rng* rng) {
  Planted out;
  Instrument quiet = reading.instrument;
  const double sigma = quiet.sigma, rho = reading.correlation;
  quiet.sigma = 0.0;
  const bool stated = quiet.states_sigma;
  quiet.states_sigma = false;
  out.record = Read(quiet, kOffset, *rng);
  double noise = rng->Normal();
  for (Eigen::Index i = 0; i < out.record.y.size(); ++i) {
    out.record.y(i) += sigma * noise;
    noise = rho * noise + std::sqrt(1.0 - rho * rho) * rng->Normal();
    if (reading.resolution > 0.0) {
      out.record.y(i) = reading.resolution * std::round(out.record.y(i) / reading.resolution);
    }
    if (rng->Uniform() >= gross.share) continue;
    out.gross.insert(static_cast<std::size_t>(i));
    const double by = gross.sigmas * sigma * (0.7 + 0.6 * rng->Uniform());
    out.record.y(i) += gross.one_sided || rng->Uniform() < 0.5 ? by : -by;
  }
  if (stated) out.record.sigma = Eigen::VectorXd::Constant(out.record.y.size(), sigma);
  return out;
}

Tally Repeat(const Reading& reading, const Gross& gross, int seeds) {
  constexpr double k95 = 1.959964;
  std::vector<Tally> each(static_cast<std::size_t>(seeds));
  ParallelFor(each.size(), 0, [&](std::size_t s) {
    Rng rng(3000 + s);
    Planted planted = Plant(reading, gross, &rng);
    if (gross.known) {
      std::vector<Eigen::Index> keep;
      std::vector<double> t;
      for (std::size_t i = 0; i < planted.record.t.size(); ++i) {
        if (planted.gross.count(i) > 0) continue;
        keep.push_back(static_cast<Eigen::Index>(i));
        t.push_back(planted.record.t[i]);
      }
      planted.record.t = t;
      planted.record.y = planted.record.y(keep).eval();
      if (planted.record.sigma.size() > 0) {
        planted.record.sigma = planted.record.sigma(keep).eval();
      }
      planted.gross.clear();
    }
    Observations data;
    data.others = {std::make_shared<Channel>(planted.record)};
    const FitResult fit = FitInstruments(data);
    Tally& t = each[s];
    t.planted = planted.gross.size();
    t.clean = planted.record.t.size() - planted.gross.size();
    if (!fit.Usable()) return;
    t.usable = 1;
    std::set<std::size_t> found;
    for (const ChannelGross& g : fit.trials[0].channel_gross) {
      for (const GrossSample& one : g.errors.samples) found.insert(one.index);
    }
    for (std::size_t p : planted.gross) t.missed += found.count(p) == 0 ? 1 : 0;
    for (std::size_t p : found) t.wrongly += planted.gross.count(p) == 0 ? 1 : 0;
    t.records_named = found.empty() ? 0 : 1;
    t.unexplained = fit.trials[0].goodness.outcome == Explained::kNo ? 1 : 0;
    for (std::size_t j = 0; j < 2; ++j) {
      const ParameterEstimate& e = fit.parameters[j];
      t.off[j].push_back(e.value - TwoLink::Truth()[j]);
      t.held[j] = std::abs(t.off[j].back()) <= k95 * e.sigma ? 1 : 0;
    }
  });
  Tally out;
  for (const Tally& t : each) {
    out.usable += t.usable, out.unexplained += t.unexplained;
    out.records_named += t.records_named;
    out.planted += t.planted, out.missed += t.missed, out.wrongly += t.wrongly;
    out.clean += t.clean;
    for (int j = 0; j < 2; ++j) {
      out.held[j] += t.held[j];
      out.off[j].insert(out.off[j].end(), t.off[j].begin(), t.off[j].end());
    }
  }
  return out;
}

void Expect95(int held, int of, const std::string& what) {
  EXPECT_GE(
      BinomialInterval(static_cast<std::size_t>(held), static_cast<std::size_t>(of), 0.999).second,
      0.95)
      << what;
}

// The scatter over the seeds is held against that of the same seeds without gross errors.
TEST(ChannelGross, IsNamedAndCostsLittle) {
  const int seeds = Repeats(10, 40);
  struct Case {
    double share, sigmas;
    bool one_sided, stated;
  };
  for (const bool stated : {true, false}) {
    const Reading encoder{Encoder(stated)};
    const Tally clean = Repeat(encoder, {}, seeds);
    ASSERT_EQ(clean.usable, seeds);
    for (const Case& c : {Case{0.05, 10.0, false, true}, Case{0.05, 100.0, true, true},
                          Case{0.01, 30.0, true, false}, Case{0.05, 30.0, false, false},
                          Case{0.1, 100.0, true, false}}) {
      if (c.stated != stated) continue;
      const std::string what =
          fmt::format("{}% by {} sigma{}, sigma {}", 100.0 * c.share, c.sigmas,
                      c.one_sided ? ", one-sided" : "", stated ? "stated" : "not stated");
      const Tally t = Repeat(encoder, {c.share, c.sigmas, c.one_sided}, seeds);
      const Tally best = Repeat(encoder, {c.share, c.sigmas, c.one_sided, true}, seeds);
      fmt::print("{}: {} of {} usable, {} of {} missed, {} of {} clean ones named, {} unexplained;",
                 what, t.usable, seeds, t.missed, t.planted, t.wrongly, t.clean, t.unexplained);
      ASSERT_EQ(t.usable, seeds) << what;
      for (std::size_t j = 0; j < 2; ++j) {
        const double ratio = std::sqrt(Variance(t.off[j]) / Variance(clean.off[j]));
        const double least = std::sqrt(Variance(best.off[j]) / Variance(clean.off[j]));
        fmt::print(" scatter {:.3f} of clean, {:.3f} were they known, {} held;", ratio, least,
                   t.held[j]);
        EXPECT_LE(ratio, 1.1 * least) << what;
        Expect95(t.held[j], seeds, what);
      }
      fmt::print("\n");
      EXPECT_LT(static_cast<double>(t.missed), 0.02 * static_cast<double>(t.planted)) << what;
      // Of one coordinate a density ten times as wide with a share of a twentieth is the likelier
      // one beyond 3.3 sigma: 1 in 1000, three times that where neighbours are gross, too.
      EXPECT_LT(static_cast<double>(t.wrongly), 5e-3 * static_cast<double>(t.clean)) << what;
      EXPECT_LE(t.unexplained, seeds / 50 + 2) << what;
    }
  }
}

// No reading is called gross where none is: noise that follows its last value, coarse steps.
TEST(ChannelGross, OfSoundReadingsThereIsNone) {
  const int seeds = Repeats(10, 40);
  for (const double correlation : {0.0, 0.9}) {
    for (const double resolution : {0.0, 4e-3, 0.03}) {
      const Tally t = Repeat({Encoder(false), resolution, correlation}, {}, seeds);
      fmt::print("correlation {}, resolution {}: {} of {} records have readings named, {} in all\n",
                 correlation, resolution, t.records_named, seeds, t.wrongly);
      EXPECT_LE(t.records_named, 1);
    }
  }
}

TEST(ChannelGross, BesideCorrelatedNoiseIsNamed) {
  const int seeds = Repeats(10, 40);
  const Reading reading{Encoder(false), 0.0, 0.8};
  const Tally clean = Repeat(reading, {}, seeds), t = Repeat(reading, {0.05, 30.0}, seeds);
  for (std::size_t j = 0; j < 2; ++j) {
    const double ratio = std::sqrt(Variance(t.off[j]) / Variance(clean.off[j]));
    fmt::print("scatter {:.3f} of clean, {} held ({} clean); ", ratio, t.held[j], clean.held[j]);
    // Of few seeds the ratio itself scatters, by some sqrt(0.1 / seeds).
    EXPECT_LE(ratio, Repeats(14, 11) * 0.1);
    Expect95(t.held[j], seeds, "correlated");
  }
  fmt::print("{} of {} missed, {} named wrongly\n", t.missed, t.planted, t.wrongly);
  EXPECT_LT(static_cast<double>(t.missed), 0.02 * static_cast<double>(t.planted));
}

// Readings and residuals of a channel whose model has a peak of one sample, height 200 sigma, every
// fortieth, which the readings show `late` samples later.
struct Peaks {
  Observations data;
  Eigen::VectorXd residual;
};
Peaks LatePeaks(Eigen::Index late, double off, Rng* rng) {
  ChannelRecord r;
  r.name = r.quantity = "peaks", r.unit = "V";
  constexpr Eigen::Index kCount = 400, kEvery = 40;
  r.y.resize(kCount);
  r.sigma = Eigen::VectorXd::Ones(kCount);
  Eigen::VectorXd model(kCount);
  for (Eigen::Index i = 0; i < kCount; ++i) {
    const double slow = 50.0 * std::sin(0.03 * static_cast<double>(i));
    r.t.push_back(0.01 * static_cast<double>(i));
    model(i) = slow + (i % kEvery == 20 ? 200.0 : 0.0);
    r.y(i) = slow + (i % kEvery == 20 + late ? 200.0 : 0.0) + rng->Normal();
  }
  r.y(80) += off;
  Peaks out;
  out.residual = r.y - model;
  out.data.others = {std::make_shared<Channel>(r)};
  return out;
}

TEST(ChannelGross, ImpactsThatTheModelHasLateAreNone) {
  for (const Eigen::Index late : {1, 2, 5, 12}) {
    Rng rng(11);
    const Peaks peaks = LatePeaks(late, 0.0, &rng);
    EXPECT_TRUE(FindChannelGross(peaks.data, peaks.residual).empty()) << late;
  }
  // A reading that is off elsewhere is found beside them.
  Rng rng(11);
  const Peaks peaks = LatePeaks(2, 40.0, &rng);
  const std::vector<ChannelGross> found = FindChannelGross(peaks.data, peaks.residual);
  ASSERT_EQ(found.size(), 1u);
  ASSERT_EQ(found[0].errors.samples.size(), 1u);
  EXPECT_EQ(found[0].errors.samples[0].index, 80u);
  EXPECT_EQ(found[0].name, "peaks");
}

// Two swings and a half of 45 readings each: what the model does at its turning points, and at the
// record's ends, excuses no reading that is off by much more, and leaves enough to tell the noise.
TEST(ChannelGross, OfAShortSwingIsFoundToItsEnds) {
  constexpr double kSize = 1000.0;  // of the swing [sigmas]
  const std::vector<std::pair<Eigen::Index, double>> planted = {
      {11, -28.0}, {25, -90.0}, {80, 870.0}, {101, 30.0}};
  for (const std::uint64_t seed : {1, 2, 3}) {
    Rng rng(seed);
    ChannelRecord r;
    r.name = r.quantity = "swing", r.unit = "deg";
    constexpr Eigen::Index kCount = 104;
    r.y.resize(kCount);
    r.sigma = Eigen::VectorXd::Ones(kCount);
    Peaks swing;
    swing.residual.resize(kCount);
    for (Eigen::Index i = 0; i < kCount; ++i) {
      const double phase = 2.0 * std::numbers::pi * static_cast<double>(i) / 45.0;
      r.t.push_back(0.01 * static_cast<double>(i));
      swing.residual(i) = rng.Normal();
      for (const auto& [at, off] : planted) swing.residual(i) += at == i ? off : 0.0;
      r.y(i) = kSize * std::cos(phase) + 0.1 * kSize * std::cos(3.0 * phase) + swing.residual(i);
    }
    swing.data.others = {std::make_shared<Channel>(r)};
    const std::vector<ChannelGross> found = FindChannelGross(swing.data, swing.residual);
    ASSERT_EQ(found.size(), 1u) << seed;
    std::set<Eigen::Index> named;
    for (const GrossSample& one : found[0].errors.samples) {
      named.insert(static_cast<Eigen::Index>(one.index));
    }
    EXPECT_EQ(named, (std::set<Eigen::Index>{11, 25, 80, 101})) << seed;
  }
}

// A record of `count` readings with sigma 1 of what `truth` does, beside a model that does `model`.
Peaks Record(Eigen::Index count, const std::function<double(double)>& truth,
             const std::function<double(double)>& model,
             const std::vector<std::pair<Eigen::Index, double>>& planted, Rng* rng) {
  ChannelRecord r;
  r.name = r.quantity = "signal", r.unit = "V";
  r.y.resize(count);
  r.sigma = Eigen::VectorXd::Ones(count);
  Peaks out;
  out.residual.resize(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    r.t.push_back(0.01 * static_cast<double>(i));
    r.y(i) = truth(static_cast<double>(i)) + rng->Normal();
    for (const auto& [at, off] : planted) r.y(i) += at == i ? off : 0.0;
    out.residual(i) = r.y(i) - model(static_cast<double>(i));
  }
  out.data.others = {std::make_shared<Channel>(r)};
  return out;
}

std::set<Eigen::Index> Named(const Peaks& record) {
  std::set<Eigen::Index> out;
  for (const ChannelGross& one : FindChannelGross(record.data, record.residual)) {
    for (const GrossSample& s : one.errors.samples) out.insert(static_cast<Eigen::Index>(s.index));
  }
  return out;
}

// A vibration of 1400 sigma, 18 readings a swing, that dies down, and jumps wherever it turns as
// dry friction has it: what the model does at once there excuses nothing where the residuals about
// show it to be on time.
TEST(ChannelGross, OfAModelThatIsOnTimeNothingIsExcused) {
  constexpr double kPi = std::numbers::pi;
  auto signal = [](double i) {
    const double phase = 2.0 * kPi * i / 18.0;
    return 1400.0 * std::exp(-0.012 * i) * std::cos(phase) +
           40.0 * (std::sin(phase) > 0.0 ? 1 : -1);
  };
  const std::vector<std::pair<Eigen::Index, double>> planted = {
      {4, -38.0}, {14, 48.0}, {16, -13.7}, {32, 34.0}, {60, 12.0}, {100, 30.0}, {149, -12.0}};
  for (const std::uint64_t seed : {1, 2, 3, 4, 5}) {
    Rng rng(seed);
    const std::set<Eigen::Index> named = Named(Record(440, signal, signal, planted, &rng));
    for (const auto& [at, off] : planted) EXPECT_EQ(named.count(at), 1u) << seed << " " << at;
    EXPECT_LE(named.size(), planted.size() + 2) << seed;
  }
}

// The same rate turned back by a stop every ninetieth reading, which the model hits late by a part
// of a sample, and has all that follows late by as much.
TEST(ChannelGross, OfAModelThatIsLateItIs) {
  auto signal = [](double i) {
    const double since = std::fmod(i, 90.0), sign = std::fmod(i, 180.0) < 90.0 ? 1.0 : -1.0;
    return sign * (400.0 + 3.0 * since + 60.0 * std::sin(0.4 * since));
  };
  for (const double late : {0.1, 0.3, 0.9}) {
    Rng rng(7);
    auto model = [&](double i) { return i < 85.0 ? signal(i) : signal(i - late); };
    EXPECT_TRUE(Named(Record(400, signal, model, {}, &rng)).empty()) << late;
  }
}

// Of few readings of a motion that is fast, no two in a row lie near each other; that is no
// resolution.
TEST(ChannelGross, FewReadingsOfAFastMotionAreNoCoarseOnes) {
  auto signal = [](double i) { return 3000.0 * std::sin(0.31 * i + 0.4); };
  for (const std::uint64_t seed : {1, 2, 3}) {
    Rng rng(seed);
    const std::set<Eigen::Index> named =
        Named(Record(50, signal, signal, {{0, 10.0}, {28, -17.0}}, &rng));
    EXPECT_EQ(named, (std::set<Eigen::Index>{0, 28})) << seed;
  }
}

// Put aside, a reading has no row, and the noise of those beside it is that of a gap.
TEST(ChannelGross, PutAsideIsAGap) {
  Rng rng(4);
  const ChannelRecord all = Read(Encoder(true), kOffset, rng);
  Observations data;
  data.others = {Channel(all).Without({7, 8, 100})};
  ChannelRecord fewer = all;
  std::vector<Eigen::Index> keep;
  fewer.t.clear();
  for (std::size_t i = 0; i < all.t.size(); ++i) {
    if (i == 7 || i == 8 || i == 100) continue;
    keep.push_back(static_cast<Eigen::Index>(i));
    fewer.t.push_back(all.t[i]);
  }
  fewer.y = all.y(keep), fewer.sigma = all.sigma(keep);
  Observations rest;
  rest.others = {std::make_shared<Channel>(fewer)};
  SeriesNoise noise;
  noise.series = {{1.3, 0.7, 0.9}};
  Eigen::MatrixXd a = all.y / all.sigma(0), b = a(keep, Eigen::all);
  RowWhitening(data, noise).Apply(a);
  RowWhitening(rest, noise).Apply(b);
  EXPECT_EQ(a(7, 0), 0.0);
  EXPECT_LT((a(keep, 0) - b.col(0)).cwiseAbs().maxCoeff(), 1e-9);
}

// An accelerometer whose range ends a sigma or three below its peaks, or at half of them; gain and
// bias free, so that readings at the end would bend them if they were taken at their word.
TEST(Clipped, GainAndBiasAreRight) {
  const int seeds = Repeats(10, 40);
  constexpr double k95 = 1.959964;
  for (const double part : {0.97, 0.9, 0.5}) {
    std::vector<double> off[4];  // in standard errors
    int usable = 0, unexplained = 0, held[4] = {0, 0, 0, 0};
    double clipped = 0.0;
    for (int s = 0; s < seeds; ++s) {
      Rng rng(5000 + static_cast<std::uint64_t>(s));
      Instrument accelerometer;
      accelerometer.gain = 0.11, accelerometer.bias = 0.4, accelerometer.sigma = 0.1;
      accelerometer.states_sigma = false;
      ChannelRecord record = Read(accelerometer, kOffset, rng);
      const double middle = 0.4, reach = part * (record.y.array() - middle).abs().maxCoeff();
      record.y = record.y.cwiseMin(middle + reach).cwiseMax(middle - reach).eval();
      clipped += ((record.y.array() - middle).abs() >= reach).cast<double>().mean() / seeds;
      record.gain = Prior::Free(), record.bias = Prior::Free();
      Observations data;
      data.placement.offset = Prior::Normal(kOffset, 1e-3);
      data.others = {std::make_shared<Channel>(std::move(record))};
      const FitResult fit = FitInstruments(data);
      if (!fit.Usable()) continue;
      ++usable;
      unexplained += fit.trials[0].goodness.outcome == Explained::kNo ? 1 : 0;
      for (std::size_t j = 0; j < 2; ++j) {
        const ParameterEstimate& e = fit.parameters[j];
        off[j].push_back((e.value - TwoLink::Truth()[j]) / e.sigma);
      }
      const TrialResult& t = fit.trials[0];
      for (std::size_t i = 0; i < t.nuisances.size(); ++i) {
        const double value = ValueOf(t.nuisances[i], t.registration);
        const double sigma = t.nuisance_sigma(static_cast<Eigen::Index>(i));
        if (t.nuisances[i].Name().starts_with("gain")) off[2].push_back((value - 0.11) / sigma);
        if (t.nuisances[i].Name().starts_with("bias")) off[3].push_back((value - 0.4) / sigma);
      }
    }
    fmt::print("{:.1f}% clipped: {} of {} usable, {} unexplained;", 100.0 * clipped, usable, seeds,
               unexplained);
    EXPECT_EQ(usable, seeds);
    EXPECT_LE(unexplained, 3);
    for (int j = 0; j < 4; ++j) {
      ASSERT_EQ(off[j].size(), static_cast<std::size_t>(usable)) << j;
      for (const double z : off[j]) held[j] += std::abs(z) <= k95 ? 1 : 0;
      fmt::print(" {:.2f} standard errors off in the mean, {} held;", Mean(off[j]), held[j]);
      Expect95(held[j], usable, "clipped");
    }
    fmt::print("\n");
  }
}

// An encoder that rests at its stop shows the same value again and again, and is at no end.
TEST(Clipped, RestAtAStopIsNoEndOfTheRange) {
  Rng rng(6);
  Eigen::VectorXd y(400);
  for (Eigen::Index i = 0; i < y.size(); ++i) {
    const double angle = std::min(0.01 * static_cast<double>(i), 2.0);
    y(i) = 0.01 * std::round(100.0 * angle + 0.1 * rng.Normal());
  }
  EXPECT_EQ(RangeOf(y).high, std::numeric_limits<double>::infinity());
  EXPECT_EQ(RangeOf(y).low, -std::numeric_limits<double>::infinity());
}

}  // namespace
}  // namespace unfurl::correlate::channel_gross_test
