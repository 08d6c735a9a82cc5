// What a trial is compared by: channels by clocks of their own beside few samples of a mark.
#include "study/trial_observations.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "study/fit_study.h"
#include "tests/study/swing.h"

namespace unfurl::study::trial_observations_test {
namespace {

constexpr double kDamping = 0.02, kStart = 0.6, kSigma = 1e-3;  // [N m s], [rad], [rad] and [m]

class TrialObservations : public SwingTest {
 protected:
  // The encoder's readings by a clock that is `behind` the record's [s], and `samples` of the tip.
  data::Study Swing(double behind, int samples, const std::string& more) const {
    SceneModelOptions options;
    options.scene = Put("scene.toml", Scene({.linear = kDamping}));
    options.rtol = 1e-10;
    correlate::Stamps stamps;
    stamps.marks = {"tip"};
    stamps.t.emplace_back();
    stamps.quantities.push_back({"a", "hinge.theta", {}});
    for (int i = 0; i < samples; ++i) stamps.t[0].push_back(0.5 + i);
    for (int i = 0; i < 580; ++i) stamps.quantities[0].t.push_back(0.01 * i);
    const correlate::Prediction truth = SceneModel(options, {}).Evaluate({}, stamps);
    Rng rng(11);
    std::string text = "t [s],angle [rad]\n";
    for (int i = 0; i < 580; ++i) {
      text += fmt::format("{:.4f},{:.9f}\n", 0.01 * i + behind,
                          truth.quantities[0].values(i) + kSigma * rng.Normal());
    }
    Put("angle.csv", text);
    text =
        "t [s],mark,x [m],y [m],z [m],cxx [m^2],cxy [m^2],cxz [m^2],cyy [m^2],cyz [m^2],czz "
        "[m^2]\n";
    constexpr double v = kSigma * kSigma;
    for (int i = 0; i < samples; ++i) {
      const Eigen::Vector3d p =
          truth.marks[0].p.col(i) + kSigma * Eigen::Vector3d(rng.Normal(), rng.Normal(), 0.0);
      text += fmt::format("{:.3f},tip,{:.9f},{:.9f},{:.9f},{},0,0,{},0,{}\n", 0.5 + i, p.x(), p.y(),
                          p.z(), v, v, v);
    }
    Put("tracks.csv", text);
    return data::ReadStudy(
        Put("study.toml",
            fmt::format("[study]\nscene = \"scene.toml\"\n[trial]\noffset = 0.0\n{}{}"
                        "[trial.channel.angle]\nfile = \"angle.csv\"\nquantity = \"hinge.theta\"\n"
                        "sigma = {}\ndelay = {}\n[parameter.damping]\n"
                        "keys = [\"joint.hinge.damper.damping\"]\nstart = 0.03\n"
                        "bounds = [1e-4, 0.2]\n[parameter.start]\nkeys = [\"joint.hinge.theta\"]\n"
                        "start = 0.5\nbounds = [0.1, 1.0]\n",
                        samples > 0 ? "tracks = \"tracks.csv\"\nframe = \"known\"\n" : "", more,
                        kSigma, behind)));
  }
};

// Nothing is to be aligned where all is known: they were refused for being fewer than 20.
TEST_F(TrialObservations, FiveSamplesBesideADelayedEncoderFit) {
  const StudyFit fit = Fit(Swing(0.5, 5, ""));
  ASSERT_TRUE(fit.Usable()) << fit.result.message;
  const correlate::Observations& o = *fit.problem().trials[0].observations;
  constexpr double kRounding = 1e-12;  // of stamps of seconds [s]
  EXPECT_NEAR(o.Start(), 0.0, kRounding);
  EXPECT_NEAR(o.End(), 5.79, kRounding);
  EXPECT_EQ(fit.result.trials[0].registration.known, 5U);
  const double truth[] = {kDamping, kStart};
  constexpr double kFar = 4.0;  // standard errors
  for (std::size_t j = 0; j < 2; ++j) {
    const correlate::ParameterEstimate& e = fit.result.parameters[j];
    EXPECT_LT(std::abs(e.value - truth[j]), kFar * e.sigma) << j;
    EXPECT_GT(e.sigma, 0.0);
  }
}

// A time by the record's clock was looked for among the instrument's stamps.
TEST_F(TrialObservations, EventsLieWithinTheRecordByItsOwnClock) {
  auto read = [&](double time) {
    const data::Study study = Swing(
        100.0, 0,
        fmt::format("[trial.event.stop]\nkind = \"latch\"\njoint = \"hinge\"\ntime = {}\nsigma = "
                    "1e-3\n",
                    time));
    correlate::Observations out;
    AddChannels(study.trials[0], nullptr, &out);
    return out.others.size();
  };
  EXPECT_EQ(read(2.0), 2U);
  EXPECT_THROW(read(102.0), Error);
}

}  // namespace
}  // namespace unfurl::study::trial_observations_test
