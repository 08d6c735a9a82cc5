#include "data/fit.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "base/error.h"
#include "data/h5.h"

namespace unfurl::data {
namespace {

class FitFile : public ::testing::Test {
 protected:
  void SetUp() override {
    path_ = (std::filesystem::temp_directory_path() /
             ("unfurl_fit_" +
              std::string(::testing::UnitTest::GetInstance()->current_test_info()->name()) + ".h5"))
                .string();
  }
  void TearDown() override { std::filesystem::remove(path_); }
  std::string path_;
};

FitRecord Example() {
  FitRecord f;
  f.study = "clearance";
  f.status = "converged";
  f.message = "all is well";
  f.verdict = "Clearance is determined.";
  f.reasons = {"because", "and because"};
  f.parameters = {
      {"clearance",
       "rad",
       {"joint.a", "joint.b"},
       1,
       2,
       3,
       4,
       5,
       6,
       7,
       8,
       9,
       10,
       "determined",
       "known to 1%"},
      {"damping", "s", {"beam.c"}, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, "at its bound", "no"}};
  f.covariance = Eigen::MatrixXd::Identity(2, 2) * 0.25;
  f.nuisances = {{"time offset", "s", 0.7, 1e-5}};
  f.evaluations = {{{1.0, 2.0}, "trial", "", 0, false, 12.5},
                   {{1.5, 2.0}, "difference", "it failed", 1, true, -1.0}};
  f.marks = {"a", "b"};
  f.t = {0.0, 0.1, 0.05};
  f.mark = {0, 0, 1};
  f.measured = Eigen::Matrix3Xd::Random(3, 3);
  f.sigma = Eigen::Matrix3Xd::Constant(3, 3, 2e-4);
  f.simulated = Eigen::Matrix3Xd::Random(3, 3);
  f.model_error.resize(3, 0);
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
  for (auto* m : {&f.measured, &f.sigma, &f.simulated}) m->resize(3, 0);
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
}  // namespace unfurl::data
