#include "data/fit.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/error.h"
#include "data/h5.h"
#include "tests/own_folder.h"

namespace unfurl::data::fit_test {
namespace {

class FitFile : public ::testing::Test {
 protected:
  OwnFolder folder_;
  std::string path_ = folder_.File("fit.h5");
};

FitRecord Example() {
  FitRecord f;
  f.study = "clearance";
  f.status = "converged";
  f.message = "all is well";
  f.verdict = "Clearance is determined.";
  f.reasons = {"because", "and because"};
  f.parameters.resize(2);
  FitRecord::Parameter& a = f.parameters[0];
  a.name = "clearance", a.unit = "rad", a.keys = {"joint.a", "joint.b"};
  a.start = 1, a.low = 2, a.high = 3, a.value = 4, a.sigma = 5, a.sigma_data = 6;
  a.sigma_white = 7, a.sigma_model = 8, a.model_shift = 9, a.kink = 10, a.sigma_alone = 11;
  a.imitated = 12, a.low95 = 13, a.high95 = 14, a.low95_data = 15, a.high95_data = 16;
  a.dispersion = 17, a.verdict = "determined", a.reason = "known to 1%";
  FitRecord::Parameter& b = f.parameters[1];
  b.name = "damping", b.unit = "s", b.keys = {"beam.c"}, b.kink = 20, b.verdict = "at its bound";
  b.low95 = std::numeric_limits<double>::quiet_NaN(), b.with = {"clearance", "time offset"};
  f.covariance = Eigen::MatrixXd::Identity(2, 2) * 0.25;
  f.nuisances = {{"time offset", "s", 0.7, 1e-5, 0}};
  f.evaluations = {{{1.0, 2.0}, "trial", "", 0, false, -1, 0, 0, 12.5},
                   {{1.5, 2.0}, "difference", "it failed", 1, true, 3, 1, 2, -1.0}};
  f.profiles = {{1, 3.9, true, {1.5, 2.5}}, {0, 0.0, false, {1.0, 2.0}}};
  a.sigma_doubt = 0.5;
  f.rungs = {{"8 segments", 40}, {"16 segments", 3}};
  f.rounds = {{0, 12.0, std::numeric_limits<double>::quiet_NaN(), 0.25, true, false, {1.0, 2.0}},
              {1, 11.0, 0.5, 0.125, false, true, {1.5, 2.5}}};
  f.starts = {{{1.0, 2.0}, {3.0, 4.0}, 7.5, 11.0, "good"}};
  f.trials = {"trial"};
  f.noise = {{0, 1, 2, 3.5, 0.25, 0.98}};
  f.less_weight = {{0, 1, 2.0, 3.0, 1e-4, 0.5}};
  f.gross = {{0, 1, 2.5, 40.0}};
  f.channels = {{"encoder", "pin.theta", "rad", 0, {0.0, 0.1}, {1.0, 9.0}, {0.1, 0.1}, {1.0, 1.1}}};
  f.channels[0].gross_t = {0.1}, f.channels[0].gross_sigmas = {79.0};
  f.marks = {"a", "b"};
  f.t = {0.0, 0.1, 0.05};
  f.mark = {0, 0, 1};
  f.trial = {0, 0, 0};
  f.measured = Eigen::Matrix3Xd::Random(3, 3);
  f.sigma = Eigen::Matrix3Xd::Constant(3, 3, 2e-4);
  f.simulated = Eigen::Matrix3Xd::Random(3, 3);
  f.model_error.resize(3, 0);
  f.band = Eigen::Matrix3Xd::Random(3, 3);
  f.checks = {{"chi2_per_dof [1]", 1.02}, {"model_noise [m]", 1e-6}};
  return f;
}

TEST_F(FitFile, ComesBackAsItWasWritten) {
  const FitRecord f = Example();
  WriteFit(path_, f, Provenance{});
  const FitRecord g = ReadFit(path_);
  EXPECT_EQ(g.verdict, f.verdict);
  EXPECT_EQ(g.reasons, f.reasons);
  ASSERT_EQ(g.parameters.size(), 2u);
  EXPECT_EQ(g.parameters[0].keys, f.parameters[0].keys);
  EXPECT_EQ(g.parameters[1].kink, 20.0);
  EXPECT_EQ(g.parameters[1].verdict, "at its bound");
  EXPECT_EQ(g.parameters[0].high95, 14.0);
  EXPECT_EQ(g.parameters[0].low95_data, 15.0);
  EXPECT_EQ(g.parameters[0].high95_data, 16.0);
  EXPECT_EQ(g.parameters[0].dispersion, 17.0);
  EXPECT_TRUE(std::isnan(g.parameters[1].low95));
  EXPECT_EQ(g.parameters[1].with, f.parameters[1].with);
  ASSERT_EQ(g.profiles.size(), 2u);
  EXPECT_EQ(g.profiles[0].theta, f.profiles[0].theta);
  EXPECT_FALSE(g.profiles[1].settled);
  ASSERT_EQ(g.starts.size(), 1u);
  EXPECT_EQ(g.starts[0].to, f.starts[0].to);
  EXPECT_EQ(g.starts[0].message, "good");
  ASSERT_EQ(g.rungs.size(), 2u);
  EXPECT_EQ(g.rungs[1].name, "16 segments");
  EXPECT_EQ(g.rungs[1].runs, 3);
  ASSERT_EQ(g.rounds.size(), 2u);
  EXPECT_TRUE(std::isnan(g.rounds[0].step));
  EXPECT_EQ(g.rounds[1].base, 1);
  EXPECT_EQ(g.rounds[1].contraction, 0.125);
  EXPECT_FALSE(g.rounds[1].counted);
  EXPECT_TRUE(g.rounds[1].slope);
  EXPECT_EQ(g.rounds[1].theta, f.rounds[1].theta);
  EXPECT_EQ(g.parameters[0].sigma_doubt, 0.5);
  EXPECT_EQ(g.noise.at(0).rho, 0.98);
  EXPECT_EQ(g.less_weight.at(0).weight, 0.5);
  ASSERT_EQ(g.channels.size(), 1u);
  EXPECT_EQ(g.channels[0].measured, f.channels[0].measured);
  EXPECT_EQ(g.channels[0].gross_t, f.channels[0].gross_t);
  EXPECT_EQ(g.channels[0].gross_sigmas, f.channels[0].gross_sigmas);
  ASSERT_EQ(g.gross.size(), 1u);
  EXPECT_EQ(g.gross[0].mark, 1);
  EXPECT_EQ(g.gross[0].t, 2.5);
  EXPECT_EQ(g.gross[0].sigmas, 40.0);
  EXPECT_EQ(g.band, f.band);
  EXPECT_EQ(g.trial, f.trial);
  EXPECT_EQ(g.evaluations.at(1).fidelity, 2);
  EXPECT_EQ(g.covariance, f.covariance);
  EXPECT_EQ(g.nuisances[0].value, 0.7);
  ASSERT_EQ(g.evaluations.size(), 2u);
  EXPECT_EQ(g.evaluations[1].theta, f.evaluations[1].theta);
  EXPECT_EQ(g.evaluations[1].message, "it failed");
  EXPECT_TRUE(g.evaluations[1].failed);
  EXPECT_EQ(g.evaluations[0].cost, 12.5);
  EXPECT_EQ(g.mark, f.mark);
  EXPECT_EQ(g.measured, f.measured);
  EXPECT_EQ(g.simulated, f.simulated);
  EXPECT_EQ(g.model_error.cols(), 0);
  EXPECT_EQ(g.checks, f.checks);
}

TEST_F(FitFile, AFitThatFoundNothingIsStillARecord) {
  FitRecord f = Example();
  f.evaluations.clear();
  f.nuisances.clear();
  f.marks.clear();
  f.t.clear();
  f.mark.clear();
  f.trial.clear();
  f.profiles.clear();
  f.starts.clear();
  f.noise.clear();
  f.less_weight.clear();
  for (auto* m : {&f.measured, &f.sigma, &f.simulated, &f.band}) m->resize(3, 0);
  WriteFit(path_, f, Provenance{});
  EXPECT_EQ(ReadFit(path_).evaluations.size(), 0u);
}

TEST_F(FitFile, AnotherRecordIsRefused) {
  {
    H5Writer w(path_, "unfurl/run", 1, Provenance{});
    w.Commit();
  }
  EXPECT_THROW(ReadFit(path_), Error);
}

}  // namespace
}  // namespace unfurl::data::fit_test
