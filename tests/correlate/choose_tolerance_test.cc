// The tolerance that a fit runs its simulator with.
#include "correlate/fit/choose_tolerance.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "correlate/fit/reduced_problem.h"
#include "tests/correlate/pendulum.h"

namespace unfurl::correlate::choose_tolerance_test {
namespace {

// The two-link arm with scatter of its own: `gain` times the tolerance, but no less than `floor`.
class Rough : public TwoLink {
 public:
  Rough(double rtol, double gain, double floor)
      : rtol_(rtol), size_(std::max(gain * rtol, floor)) {}
  Prediction Evaluate(std::span<const double> theta, const Stamps& stamps) const override {
    Prediction out = TwoLink::Evaluate(theta, stamps);
    Rng rng = Rng(1).Stream(fmt::format("{:g}", rtol_));
    for (MarkMotion& m : out.marks) {
      for (Eigen::Index i = 0; i < m.p.size(); ++i) m.p(i) += size_ * rng.Normal();
    }
    return out;
  }

 private:
  double rtol_, size_;
};

class Broken : public Model {
 public:
  Prediction Evaluate(std::span<const double>, const Stamps&) const override {
    Prediction out;
    out.status = ModelStatus::kFailed;
    return out;
  }
};

Observations Data(double sigma) {
  Trial trial = TiltedTrial();
  trial.sigma = sigma;
  Rng rng(1);
  return Record(TwoLink(), TwoLink::Truth(), TwoLink::Marks(), trial, rng);
}

ToleranceChoice Choose(double gain, double floor, double sigma, const Model* finer = nullptr) {
  return ChooseTolerance([&](double rtol) { return std::make_unique<Rough>(rtol, gain, floor); },
                         finer, TwoLink::Truth(), Data(sigma));
}

TEST(ChooseTolerance, TheLoosestThatIsQuietEnough) {
  // gain rtol of scatter along each axis against 0.2 / sqrt(rows) of 2e-4 m, some 6e-7 m.
  EXPECT_EQ(Choose(0.01, 0.0, 2e-4).rtol, 1e-5);
  EXPECT_EQ(Choose(0.2, 0.0, 2e-4).rtol, 1e-6);
  EXPECT_EQ(Choose(2.0, 0.0, 2e-4).rtol, 1e-7);
  EXPECT_EQ(Choose(200.0, 0.0, 2e-4).rtol, 1e-9);
  EXPECT_EQ(Choose(200.0, 0.0, 2e-3).rtol, 1e-8);  // ten times the noise in the data
}

TEST(ChooseTolerance, WhereNoneIsTheQuietestAndSaysSo) {
  const ToleranceChoice floor = Choose(100.0, 1e-5, 2e-4);
  EXPECT_GT(floor.noise, floor.wanted);
  EXPECT_LE(floor.rtol, 1e-7);
  const ToleranceChoice loud = Choose(1e5, 0.0, 2e-4);
  EXPECT_EQ(loud.rtol, 1e-9);
  EXPECT_GT(loud.noise, loud.wanted);
}

// The worst that scatter can do is to look like a change of one parameter. Then it moves that by so
// many standard errors as the information of all samples says, however many there are.
TEST(ChooseTolerance, MovesNoParameterByMoreThanAFifthOfItsError) {
  class Moved : public TwoLink {
   public:
    explicit Moved(double by) : by_(by) {}
    Prediction Evaluate(std::span<const double> theta, const Stamps& stamps) const override {
      std::vector<double> moved(theta.begin(), theta.end());
      moved[0] *= 1.0 + by_;
      return TwoLink::Evaluate(moved, stamps);
    }

   private:
    double by_;  // of the first parameter [-]
  };
  constexpr double kGain = 3.0, kFifth = 0.2;
  for (const double step : {0.05, 0.0005}) {
    Trial trial = TiltedTrial();
    trial.step = step;
    Rng rng(1);
    const Observations data = Record(TwoLink(), TwoLink::Truth(), TwoLink::Marks(), trial, rng);
    const ToleranceChoice choice =
        ChooseTolerance([](double rtol) { return std::make_unique<Moved>(kGain * rtol); }, nullptr,
                        TwoLink::Truth(), data);
    constexpr double kStep = 1e-5;  // of the parameter, for its slope
    const Stamps stamps = data.StampsAt(trial.offset);
    const Prediction plus = Moved(kStep).Evaluate(TwoLink::Truth(), stamps);
    const Prediction minus = Moved(-kStep).Evaluate(TwoLink::Truth(), stamps);
    double information = 0.0;  // of the relative change
    for (std::size_t m = 0; m < plus.marks.size(); ++m) {
      information += (plus.marks[m].p - minus.marks[m].p).squaredNorm() /
                     std::pow(2.0 * kStep * trial.sigma, 2);
    }
    const double moved = kGain * choice.rtol * std::sqrt(information);
    EXPECT_LE(choice.noise, choice.of_data) << step;
    EXPECT_LT(0.9 * moved, kFifth) << step;  // what is seen is the way to a tenth of the tolerance
    EXPECT_GT(10.0 * 0.9 * moved, kFifth) << step;
  }
}

TEST(ChooseTolerance, TheMeshsErrorAllowsMore) {
  class Shifted : public TwoLink {
   public:
    Prediction Evaluate(std::span<const double> theta, const Stamps& stamps) const override {
      Prediction out = TwoLink::Evaluate(theta, stamps);
      for (MarkMotion& m : out.marks) m.p.array() += 2e-3;
      return out;
    }
  };
  const Shifted finer;
  EXPECT_EQ(Choose(10.0, 0.0, 2e-5).rtol, 1e-9);
  EXPECT_EQ(Choose(10.0, 0.0, 2e-5, &finer).rtol, 1e-6);
}

// Where the data alone allow the loosest tolerance the finer model, which costs most, is not asked.
TEST(ChooseTolerance, AFinerMeshIsAskedWhereItCanAllowMore) {
  class Counted : public TwoLink {
   public:
    Prediction Evaluate(std::span<const double> theta, const Stamps& stamps) const override {
      ++asked;
      return TwoLink::Evaluate(theta, stamps);
    }
    mutable int asked = 0;
  };
  const Counted finer;
  EXPECT_EQ(Choose(0.01, 0.0, 2e-4, &finer).rtol, 1e-5);
  EXPECT_EQ(finer.asked, 0);
  Choose(1.0, 0.0, 2e-4, &finer);
  EXPECT_EQ(finer.asked, 1);
}

TEST(ChooseTolerance, AModelThatFailsIsTheFitsToReport) {
  const Observations data = Data(2e-4);
  const ToleranceChoice choice = ChooseTolerance([](double) { return std::make_unique<Broken>(); },
                                                 nullptr, TwoLink::Truth(), data);
  EXPECT_EQ(choice.rtol, 1e-5);
  EXPECT_TRUE(std::isfinite(choice.noise));
}

// Thirty impacts: beside the start, too, the marks scatter by less than a thirtieth of their sigma
// about a run at 1e-11.
TEST(ChooseTolerance, HoldsForTheLatchingPendulumElsewhere) {
  constexpr double kSigma = 2e-6;  // [m]: so fine that the loosest tolerance does not do
  std::vector<double> start;
  for (const Parameter& p : Pendulum::Parameters()) start.push_back(p.start);
  const study::SceneModel exact(Pendulum::Binding(1e-11), start);
  Rng rng = Rng(4).Stream("tolerance");
  const Observations data =
      Record(exact, Pendulum::Truth(rng), Pendulum::Marks(), Pendulum::Recording(kSigma), rng);
  const ToleranceChoice choice = ChooseTolerance(
      [&](double rtol) {
        return std::make_unique<study::SceneModel>(Pendulum::Binding(rtol), start);
      },
      nullptr, start, data);
  EXPECT_LE(choice.noise, choice.wanted);
  EXPECT_LT(choice.rtol, 1e-5);
  const study::SceneModel chosen(Pendulum::Binding(choice.rtol), start);
  const Stamps stamps = data.StampsAt(Pendulum::Recording().offset);
  int quiet = 0;
  constexpr int kPlaces = 8;
  for (int i = 0; i < kPlaces; ++i) {
    const std::vector<double> theta = Pendulum::Truth(rng);
    const double off = RmsDifference(chosen.Evaluate(theta, stamps), exact.Evaluate(theta, stamps));
    quiet += off < TypicalSigma(data) / 30.0 ? 1 : 0;
  }
  EXPECT_GE(quiet, kPlaces - 1);
}

}  // namespace
}  // namespace unfurl::correlate::choose_tolerance_test
