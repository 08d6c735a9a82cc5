// `correlate` of channels through the program: signals in closed form, and a run's own quantities.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "base/random.h"
#include "data/run.h"
#include "tests/cli/program.h"

namespace unfurl::cli::correlate_channels_test {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

constexpr double kTau = 2.0 * std::numbers::pi, kDegrees = 360.0 / kTau;

// Two damped sines from the start on [rad]; `rate`: of the second's derivative [rad/s].
double Angle(double t) {
  return 0.2 * std::exp(-0.15 * t) * std::cos(kTau * 0.9 * t) +
         0.05 * std::exp(-0.3 * t) * std::sin(kTau * 2.3 * t);
}
double Rate(double t) { return (Angle(t + 1e-5) - Angle(t - 1e-5)) / 2e-5; }

class CorrelateChannelsTest : public ProgramTest {
 protected:
  // A column of readings; `late`: what its clock shows when the signal's shows 0. NaN: no reading.
  template <class Of>
  static std::string Column(const std::string& head, double step, double to, double late, Of of) {
    std::string out = "t [s]," + head + "\n";
    for (double t = late; t < to; t += step) {
      const double y = of(t - late);
      if (!std::isnan(y)) out += fmt::format("{:.6f},{:.9g}\n", t, y);
    }
    return out;
  }
  json Good(const std::vector<std::string>& arguments) const {
    const Outcome o = Run(arguments);
    EXPECT_EQ(o.code, 0) << o.out << o.err;
    return json::parse(o.out);
  }
};

TEST_F(CorrelateChannelsTest, RatesUnitsAndClockMayDiffer) {
  Rng rng(1);
  std::string a = "t [s],hinge [deg],hinge.sigma [deg]\n";
  for (double t = 0.8; t < 12.0; t += 0.01) {
    a += fmt::format("{:.6f},{:.9g},0.02\n", t, kDegrees * Angle(t - 0.8) + 0.02 * rng.Normal());
  }
  Put("a.csv", a);
  Put("b.csv", Column("angle [rad]", 0.004, 14.0, 0.0, Angle));
  const json found = Good({"correlate", "a.csv", "b.csv", "--channels", "hinge=angle", "--json",
                           "--report", "page.html"});
  const auto& offset = found.at("time_offset");
  EXPECT_LT(std::abs(offset.at("value").get<double>() - 0.8),
            4.5 * offset.at("sigma").get<double>());
  const auto& score = found.at("scores").at(0);
  EXPECT_EQ(score.at("kind"), "channel");
  EXPECT_EQ(score.at("unit"), "deg");
  EXPECT_NEAR(score.at("sigmas").get<double>(), 1.0, 0.1);
  EXPECT_EQ(score.at("iso_18571").at("grade"), "excellent");
  const auto& spectrum = found.at("spectra").at(0);
  EXPECT_EQ(spectrum.at("unit"), "deg");
  EXPECT_THAT(spectrum.at("density").at("convention").get<std::string>(), HasSubstr("deg"));
  const auto& modes = found.at("modes").at("measured");
  EXPECT_EQ(modes.at("vibration"), "decay") << modes;
  ASSERT_EQ(modes.at("modes").size(), 2u) << modes;
  // |s| of a sine that decays at a and turns at w.
  const double first = std::hypot(0.15, kTau * 0.9) / kTau;
  const auto& mode = modes.at("modes").at(0);
  EXPECT_LT(std::abs(mode.at("frequency").get<double>() - first),
            4.5 * mode.at("frequency_sigma").get<double>());
  EXPECT_EQ(found.at("modes").at("units").at(0), "deg");
  EXPECT_THAT(Get("page.html"), HasSubstr("ISO/TS 18571"));
}

// A gain of 0.9 is a gain of 0.9 and no time offset, where the clock is known.
TEST_F(CorrelateChannelsTest, AKnownClockIsNotMoved) {
  Put("a.csv", Column("gyro [rad/s]", 0.01, 10.0, 0.0, [](double t) { return 0.9 * Rate(t); }));
  Put("b.csv", Column("gyro [rad/s]", 0.01, 10.0, 0.0, Rate));
  const json found = Good({"correlate", "a.csv", "b.csv", "--offset", "known", "--json"});
  EXPECT_EQ(found.at("time_offset").at("value"), 0.0);
  const auto& score = found.at("scores").at(0);
  // Of two alike the second is the test, and the record nine tenths of it.
  EXPECT_NEAR(score.at("sprague_geers").at("magnitude").get<double>(), -0.1, 1e-6);
  EXPECT_NEAR(score.at("sprague_geers").at("phase").get<double>(), 0.0, 1e-6);
  EXPECT_NEAR(score.at("iso_18571").at("phase").get<double>(), 1.0, 1e-9);
}

TEST_F(CorrelateChannelsTest, AGapOfTheReferenceIsNotBridged) {
  Put("a.csv", Column("x [mm]", 0.01, 10.0, 0.0, [](double t) { return 1e3 * Angle(t); }));
  Put("b.csv", Column("x [m]", 0.01, 10.0, 0.0,
                      [](double t) { return t > 4.0 && t < 5.0 ? std::nan("") : Angle(t); }));
  const json found = Good({"correlate", "a.csv", "b.csv", "--offset", "0", "--json"});
  const auto samples = found.at("scores").at(0).at("samples").get<int>();
  EXPECT_GE(samples, 890);
  EXPECT_LE(samples, 905);
  EXPECT_LT(found.at("scores").at(0).at("rmse").get<double>(), 1e-3);  // [mm]
}

TEST_F(CorrelateChannelsTest, UnlikeUnitsAreRefusedInOneLine) {
  Put("a.csv", Column("load [N]", 0.01, 3.0, 0.0, Angle));
  Put("b.csv", Column("load [m]", 0.01, 3.0, 0.0, Angle));
  ExpectRefused(Run({"correlate", "a.csv", "b.csv"}), {"'load' is in 'N'", "'m'", "a.csv"},
                {"a.csv", "b.csv"});
  Put("b.csv", Column("other [N]", 0.01, 3.0, 0.0, Angle));
  ExpectRefused(Run({"correlate", "a.csv", "b.csv"}), {"no channel has the same name"},
                {"a.csv", "b.csv"});
  ExpectRefused(Run({"correlate", "a.csv", "b.csv", "--channels", "load=othr"}), {"othr", "other"},
                {"a.csv", "b.csv"});
  ExpectRefused(Run({"correlate", "a.csv", "b.csv", "--modes", "loud"}), {"loud", "--modes"},
                {"a.csv", "b.csv"});
}

// Two accelerometers on an oscillator that noise drives, by an exact step of its own.
TEST_F(CorrelateChannelsTest, ARecordAlone) {
  Rng rng(3);
  const double w = kTau * 1.2, zeta = 0.02, step = 0.05, wd = w * std::sqrt(1.0 - zeta * zeta);
  const double decay = std::exp(-zeta * w * step);
  double re = 0.0, im = 0.0;  // a rotating vector that noise feeds has the oscillator's poles
  std::string text = "t [s],left [m/s^2],right [gn]\n";
  for (int i = -2000; i < 8000; ++i) {
    const double next = decay * (std::cos(wd * step) * re - std::sin(wd * step) * im);
    im = decay * (std::sin(wd * step) * re + std::cos(wd * step) * im) + rng.Normal();
    re = next + rng.Normal();
    if (i < 0) continue;
    text += fmt::format("{:.3f},{:.6g},{:.6g}\n", i * step, re + 0.5 * rng.Normal(),
                        -0.05 * re + 0.02 * rng.Normal());
  }
  Put("a.csv", text);
  const json found = Good({"correlate", "a.csv", "--json", "--report", "page.html"});
  EXPECT_TRUE(found.at("reference").is_null());
  const auto& modes = found.at("modes").at("measured");
  EXPECT_EQ(modes.at("vibration"), "ambient") << modes.at("why");
  ASSERT_EQ(modes.at("modes").size(), 1u);
  const auto& m = modes.at("modes").at(0);
  EXPECT_LT(std::abs(m.at("frequency").get<double>() - 1.2),
            4.5 * m.at("frequency_sigma").get<double>());
  EXPECT_LT(std::abs(m.at("damping_ratio").get<double>() - zeta),
            4.5 * m.at("damping_ratio_sigma").get<double>());
  EXPECT_EQ(found.at("modes").at("units"), json::array({"1", "1"}));
  EXPECT_EQ(found.at("channels").size(), 2u);
  EXPECT_THAT(Get("page.html"), HasSubstr("Modes of the ambient record"));
  EXPECT_THAT(Run({"correlate", "a.csv", "--channels", "left"}).out, HasSubstr("1 channel,"));
}

// A run's own quantity, and the same through a study that knows the instrument.
TEST_F(CorrelateChannelsTest, AgainstARun) {
  Put("pendulum.toml",
      "[scene]\nname = \"pendulum\"\nduration = 8.0\n[gravity]\nacceleration = [0.0, -9.81]\n"
      "[body.arm]\nmass = 1.0\ninertia = 0.08333333333333333\n"
      "[joint.hinge]\ninner = \"ground\"\nouter = \"arm\"\nouter_point = [-0.5, 0.0]\n"
      "zero_angle = -1.5707963267948966\ntheta = 0.6\n[joint.hinge.damper]\ndamping = 0.02\n");
  ASSERT_EQ(Run({"simulate", "pendulum.toml", "-o", "run.h5", "--rate", "1000"}).code, 0);
  const data::Run run = data::ReadRun((folder_ / "run.h5").string());
  const auto& theta = run.Column("hinge.theta");
  Rng rng(5);
  std::string text = "t [s],angle [deg]\n";
  for (std::size_t k = 0; k < 7000; k += 10) {
    text += fmt::format("{:.6f},{:.9g}\n", 0.25 + 1e-3 * static_cast<double>(k),
                        1.5 + kDegrees * theta[k] + 0.05 * rng.Normal());
  }
  Put("a.csv", text);
  // Its bias is not known here, and is what is left.
  const json plain = Good({"correlate", "a.csv", "run.h5", "--channels", "angle=hinge.theta",
                           "--offset", "0.25", "--json"});
  EXPECT_NEAR(plain.at("scores").at(0).at("rmse").get<double>(), 1.5, 0.01);
  Put("study.toml",
      "[study]\nscene = \"pendulum.toml\"\n[trial]\n[trial.channel.encoder]\nfile = \"a.csv\"\n"
      "column = \"angle\"\nquantity = \"hinge.theta\"\nbias = \"free\"\nsigma = 0.05\n"
      "[parameter.damping]\nkeys = [\"joint.hinge.damper.damping\"]\nstart = 0.03\n"
      "bounds = [0.001, 0.1]\n");
  const json known = Good({"correlate", "study.toml", "run.h5", "--json"});
  EXPECT_NEAR(known.at("scores").at(0).at("sigmas").get<double>(), 1.0, 0.1);
  EXPECT_LT(std::abs(known.at("time_offset").at("value").get<double>() - 0.25),
            4.5 * known.at("time_offset").at("sigma").get<double>());
  const json named = Good(
      {"correlate", "study.toml", "run.h5", "--channels", "encoder", "--trial", "trial", "--json"});
  EXPECT_EQ(named.at("scores"), known.at("scores"));
  const std::vector<std::string> before = {"a.csv", "pendulum.toml", "run.h5", "study.toml"};
  ExpectRefused(Run({"correlate", "study.toml", "run.h5", "--channels", "gyro"}),
                {"no channel 'gyro'", "encoder"}, before);
  ExpectRefused(Run({"correlate", "study.toml", "run.h5", "--channels", "encoder=hinge.theta"}),
                {"--channels", "its name alone"}, before);
  ExpectRefused(Run({"correlate", "study.toml", "run.h5", "--trial", "other"}),
                {"no trial 'other'", "trial"}, before);
  ExpectRefused(Run({"correlate", "study.toml", "run.h5", "--marks", "tip"}), {"--marks"}, before);
  ExpectRefused(Run({"correlate", "a.csv", "run.h5", "--trial", "trial"}), {"--trial"}, before);
  // And the run's own, alone.
  EXPECT_EQ(Run({"correlate", "run.h5", "--channels", "hinge.theta"}).code, 0);
}

}  // namespace
}  // namespace unfurl::cli::correlate_channels_test
