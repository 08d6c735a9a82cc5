// What instruments other than cameras recorded, through `unfurl fit`.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include <numbers>

#include "base/random.h"
#include "data/run.h"
#include "tests/cli/program.h"

namespace unfurl::cli::fit_channels_test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr double kDamping = 0.02, kGravity = 9.81;

class FitChannelsTest : public ProgramTest {
 protected:
  Outcome Good(const std::vector<std::string>& arguments) const {
    Outcome outcome = Run(arguments);
    EXPECT_EQ(outcome.code, 0) << outcome.err << outcome.out;
    return outcome;
  }
  void SetUp() override {
    ProgramTest::SetUp();
    Put("pendulum.toml",
        fmt::format("[scene]\nname = \"pendulum\"\nduration = 10.0\n"
                    "[gravity]\nacceleration = [0.0, {}]\n"
                    "[body.arm]\nmass = 1.0\ninertia = 0.08333333333333333\n"
                    "[joint.hinge]\ninner = \"ground\"\nouter = \"arm\"\n"
                    "outer_point = [-0.5, 0.0]\nzero_angle = -1.5707963267948966\ntheta = 0.6\n"
                    "[joint.hinge.damper]\ndamping = {}\n"
                    "[sensor.tip]\nkind = \"accelerometer\"\non = \"arm\"\npoint = [0.45, 0.0]\n"
                    "axis = 1.5707963267948966\n",
                    -kGravity, kDamping));
    Good({"simulate", "pendulum.toml", "-o", "run.h5", "--rate", "2000"});
  }

  // Readings of a run's quantity by a clock that shows 0.37 s at the release.
  void Record(const std::string& file, const std::string& column, const std::string& quantity,
              double step, double factor, double bias, double sigma) const {
    const data::Run run = data::ReadRun((folder_ / "run.h5").string());
    const std::vector<double>& values = run.Column(quantity);
    Rng rng(4);
    std::string text = fmt::format("t [s],{}\n", column);
    for (double t = 0.0; t < 9.0; t += step) {
      const double at = (t - 0.37) * 2000.0;
      const auto k = static_cast<std::size_t>(std::max(0.0, at));
      const double part = at - static_cast<double>(k);
      double q = at <= 0.0 ? values[0] : (1.0 - part) * values[k] + part * values[k + 1];
      if (at < 0.0 && quantity == "tip.reading") q = 3.0;  // in somebody's hand
      text += fmt::format("{:.6f},{:.10g}\n", t, factor * q + bias + sigma * rng.Normal());
    }
    Put(file, text);
  }

  void Study(const std::string& channels) const {
    Put("study.toml", "[study]\nscene = \"pendulum.toml\"\n[trial]\n" + channels +
                          "[parameter.damping]\nkeys = [\"joint.hinge.damper.damping\"]\n"
                          "start = 0.03\nbounds = [0.001, 0.1]\n"
                          "[parameter.gravity]\nkeys = [\"gravity.acceleration[1]\"]\n"
                          "start = -9.5\nbounds = [-11, -8]\n");
  }
};

// No marks, no stages, no sigma: frequency to 0.001 Hz and damping to 2%, and the intervals hold.
TEST_F(FitChannelsTest, APendulumFromItsEncoderAlone) {
  Record("encoder.csv", "angle [deg]", "hinge.theta", 0.005, 180.0 / std::numbers::pi, 1.5, 0.05);
  Study(
      "[trial.channel.encoder]\nfile = \"encoder.csv\"\ncolumn = \"angle\"\n"
      "quantity = \"hinge.theta\"\nbias = \"free\"\n");
  const Outcome fit = Good({"fit", "study.toml", "-o", "fit.h5", "--json"});
  const auto json = nlohmann::json::parse(fit.out);
  const auto& damping = json["parameters"][0];
  const auto& gravity = json["parameters"][1];
  EXPECT_NEAR(damping["value"].get<double>(), kDamping, 0.02 * kDamping);
  EXPECT_LE(damping["low95"].get<double>(), kDamping);
  EXPECT_GE(damping["high95"].get<double>(), kDamping);
  // f is in proportion to the root of gravity.
  const double inertia = 1.0 / 12.0 + 0.25;
  auto frequency = [&](double g) { return std::sqrt(0.5 * g / inertia) / 2.0 / std::numbers::pi; };
  EXPECT_NEAR(frequency(-gravity["value"].get<double>()), frequency(kGravity), 1e-3);
  EXPECT_LE(gravity["low95"].get<double>(), -kGravity);
  EXPECT_GE(gravity["high95"].get<double>(), -kGravity);
  EXPECT_THAT(fit.out, HasSubstr("taken for its noise since none was stated"));
  EXPECT_THAT(fit.out, HasSubstr("the channels' sigma"));
  // Resumed and with another number of workers the same numbers.
  const auto again = nlohmann::json::parse(
      Good({"fit", "study.toml", "-o", "again.h5", "--json", "--workers", "1"}).out);
  EXPECT_EQ(again["parameters"], json["parameters"]);
}

// A computed record has no noise, whatever sigma is stated, and the model that made it explains it.
// Sigmas below the simulation's own error are told as such.
TEST_F(FitChannelsTest, RecordsWithoutNoise) {
  Record("encoder.csv", "angle [rad]", "hinge.theta", 0.03, 1.0, 0.0, 0.0);
  for (const char* sigma : {"", "sigma = 1e-3\n", "sigma = 1e-12\n"}) {
    Study(
        "[trial.channel.encoder]\nfile = \"encoder.csv\"\ncolumn = \"angle\"\n"
        "quantity = \"hinge.theta\"\n" +
        std::string(sigma));
    const Outcome fit = Good({"fit", "study.toml", "-o", "fit.h5", "--force", "--json"});
    if (std::string(sigma).find("12") != std::string::npos) {
      EXPECT_THAT(fit.out, HasSubstr("the simulation's own error"));
      continue;
    }
    EXPECT_THAT(fit.out, Not(HasSubstr("does not explain"))) << sigma;
    EXPECT_THAT(fit.out, HasSubstr("where a record was computed")) << sigma;
    const auto json = nlohmann::json::parse(fit.out);
    const auto& damping = json["parameters"][0];
    EXPECT_LE(damping["low95"].get<double>(), kDamping) << sigma;
    EXPECT_GE(damping["high95"].get<double>(), kDamping) << sigma;
  }
}

// An accelerometer in volts, gain and bias unknown: nothing of what it read before the release.
TEST_F(FitChannelsTest, AnAccelerometerInVolts) {
  Record("tip.csv", "signal [V]", "tip.reading", 0.002, 0.102, 0.31, 0.01);
  Study(
      "[trial.channel.signal]\nfile = \"tip.csv\"\nquantity = \"tip.reading\"\nsigma = 0.01\n"
      "gain = \"free\"\nbias = \"free\"\n");
  const Outcome fit = Good({"fit", "study.toml", "-o", "fit.h5", "--json"});
  const auto json = nlohmann::json::parse(fit.out);
  const double truth[] = {kDamping, -kGravity};
  for (std::size_t j = 0; j < 2; ++j) {
    const auto& p = json["parameters"][j];
    EXPECT_LT(std::abs(p["value"].get<double>() - truth[j]), 4.0 * p["sigma"].get<double>());
  }
  EXPECT_THAT(fit.out, HasSubstr("gain of signal"));
}

TEST_F(FitChannelsTest, BadOnesAreRefused) {
  Record("encoder.csv", "angle [deg]", "hinge.theta", 0.02, 57.3, 1.5, 0.05);
  struct Case {
    const char *channel, *what;
  };
  const std::string file = "file = \"encoder.csv\"\n";
  for (const Case& c :
       {Case{"quantity = \"hinge.theta\"\n", "did you mean 'angle'"},
        Case{"column = \"angle\"\n", "quantity"},
        Case{"column = \"angle\"\nquantity = \"hinge.tehta\"\n", "hinge.theta"},
        Case{"column = \"angle\"\nquantity = \"hinge.theta_rate\"\n", "deg"},
        Case{"column = \"angle\"\nquantity = \"hinge.theta\"\nunit = \"rad\"\n", "by its file"},
        Case{"column = \"angle\"\nquantity = \"hinge.theta\"\ngain = 0\n", "gain"},
        Case{"column = \"angle\"\nquantity = \"hinge.theta\"\nsigma = 0\n", "sigma"},
        Case{"column = \"angle\"\nquantity = \"hinge.theta\"\n"
             "filter = { kind = \"bessel\", order = 4 }\n",
             "cutoff"},
        Case{"column = \"angle\"\nquantity = \"hinge.theta\"\n"
             "window = [20.0, 30.0]\n",
             "0 readings"},
        Case{"column = \"angle\"\nevent = \"latch\"\njoint = \"hinge\"\n",
             "'tracks' is missing"}}) {
    Study("[trial.channel.angel]\n" + file + c.channel);
    ExpectRefused(Run({"fit", "study.toml", "-o", "fit.h5"}), {c.what}, Files());
  }
  // What is said of marks that are not there would do nothing.
  for (const char* said : {"window = [0.0, 5.0]", "sigma = 1e-3", "marks = [\"tip\"]",
                           "sigma_factor = { tip = 2.0 }"}) {
    Study(std::string(said) + "\n[trial.channel.angle]\n" + file + "quantity = \"hinge.theta\"\n");
    ExpectRefused(Run({"fit", "study.toml", "-o", "fit.h5"}), {"is of the tracks"}, Files());
  }
  Study("[trial.channel.angle]\nfile = \"nowhere.csv\"\nquantity = \"hinge.theta\"\n");
  ExpectRefused(Run({"fit", "study.toml", "-o", "fit.h5"}), {"nowhere.csv"}, Files());
}

}  // namespace
}  // namespace unfurl::cli::fit_channels_test
