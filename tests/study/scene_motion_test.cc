// What lies between the samples of a run, whatever the scene's pace: against closed forms.
#include "study/scene_motion.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "data/atomic_file.h"
#include "data/scene.h"
#include "tests/own_folder.h"

namespace unfurl::study::scene_motion_test {
namespace {

// A mass on a spring: x = A cos(w t).
struct Swing {
  double mass, size, amplitude, frequency, periods;  // [kg], [m], [m], [Hz], [-]
  double w() const { return 2.0 * M_PI * frequency; }
  double duration() const { return periods / frequency; }
  std::string Text() const {
    const double stiffness = mass * w() * w();
    return "[scene]\nname = \"swing\"\nduration = " + std::to_string(duration() * 1.1) +
           "\n[body.cart]\nmass = " + Digits(mass) + "\ninertia = " + Digits(mass * size * size) +
           "\n[joint.rail]\ntype = \"slider\"\ninner = \"ground\"\nouter = \"cart\"\ntravel = " +
           Digits(amplitude) + "\n[joint.rail.spring]\nstiffness = " + Digits(stiffness) +
           "\npreload = 0.0\n[mark.m]\non = \"cart\"\n[sensor.acc]\nkind = \"accelerometer\"\n" +
           "on = \"cart\"\n";
  }
  static std::string Digits(double x) {
    char text[40];
    std::snprintf(text, sizeof text, "%.17e", x);
    return text;
  }
};

constexpr double kRtol = 1e-8;

class SceneMotionTest : public ::testing::Test {
 protected:
  sim::Model ModelOf(const std::string& text) {
    data::WriteTextFile(path_, text);
    return sim::Compile(data::ReadScene(path_));
  }
  OwnFolder folder_;
  std::string path_ = folder_.File("scene.toml");
};

// Stamps that fall anywhere between those of a grid.
std::vector<double> Uneven(double last, int count) {
  constexpr double kGolden = 0.6180339887498949;
  std::vector<double> out;
  for (int i = 0; i < count; ++i) out.push_back(last * (i + std::fmod(kGolden * i, 1.0)) / count);
  return out;
}

// Errors of place and acceleration, over what they swing by.
void Compare(const sim::Model& model, const Swing& swing, const std::vector<double>& places,
             const std::vector<double>& readings, double part, std::size_t most_bytes) {
  correlate::Stamps stamps;
  stamps.marks = {"m"};
  stamps.t = {places};
  stamps.quantities.push_back({"acc", "acc.reading", readings});
  const SceneMotion motion(model, MotionRequest::For({}, stamps), kRtol);
  const correlate::Prediction p = motion.At(stamps);
  ASSERT_EQ(p.status, correlate::ModelStatus::kGood) << p.message;
  double worst = 0.0, worst_reading = 0.0;
  for (std::size_t i = 0; i < places.size(); ++i) {
    const double exact = swing.amplitude * std::cos(swing.w() * places[i]);
    worst = std::max(worst, std::abs(p.marks[0].p(0, static_cast<Eigen::Index>(i)) - exact));
  }
  for (std::size_t i = 0; i < readings.size(); ++i) {
    const double exact =
        -swing.w() * swing.w() * swing.amplitude * std::cos(swing.w() * readings[i]);
    worst_reading = std::max(
        worst_reading, std::abs(p.quantities[0].values(static_cast<Eigen::Index>(i)) - exact));
  }
  EXPECT_LT(worst, part * swing.amplitude);
  EXPECT_LT(worst_reading, part * swing.w() * swing.w() * swing.amplitude);
  EXPECT_LT(motion.bytes(), most_bytes);
}

// A millimetre's part that rings at 5 kHz.
TEST_F(SceneMotionTest, IsRightOfWhatRings) {
  const Swing swing{1e-6, 1e-3, 1e-4, 5000.0, 40.0};
  Compare(ModelOf(swing.Text()), swing, Uneven(swing.duration(), 333),
          Uneven(swing.duration(), 333), 1e-4, 1'000'000);
}

// Fifty metres that swing once in two minutes: as few samples as that asks for.
TEST_F(SceneMotionTest, CostsLittleOfWhatIsSlow) {
  const Swing swing{1e3, 50.0, 5.0, 1.0 / 120.0, 10.0};
  std::vector<double> even;
  for (int i = 0; i < 4000; ++i) even.push_back(i * swing.duration() / 4000.0);
  Compare(ModelOf(swing.Text()), swing, Uneven(swing.duration(), 1000), even, 1e-5, 600'000);
}

// Velocities that jump between two samples of any grid.
TEST_F(SceneMotionTest, AJumpOfTheRateIsNoBend) {
  constexpr double kWhen = 0.350137, kRate = 2.0;
  const sim::Model model = ModelOf(
      "[scene]\nname = \"push\"\nduration = 1.0\n[body.cart]\nmass = 1.0\ninertia = 0.1\n"
      "[joint.rail]\ntype = \"slider\"\ninner = \"ground\"\nouter = \"cart\"\n"
      "[joint.rail.drive]\nrate = \"2 * step(t - 0.350137)\"\n[mark.m]\non = \"cart\"\n");
  correlate::Stamps stamps;
  stamps.marks = {"m"};
  stamps.t = {{0.2, 0.35001, 0.3501, 0.35013, 0.350137, 0.35014, 0.3502, 0.3504, 0.7}};
  stamps.quantities.push_back({"rate", "rail.travel_rate", stamps.t[0]});
  const SceneMotion motion(model, MotionRequest::For({}, stamps), kRtol);
  const correlate::Prediction p = motion.At(stamps);
  ASSERT_EQ(p.status, correlate::ModelStatus::kGood) << p.message;
  for (std::size_t i = 0; i < stamps.t[0].size(); ++i) {
    const double t = stamps.t[0][i];
    const auto k = static_cast<Eigen::Index>(i);
    EXPECT_NEAR(p.marks[0].p(0, k), kRate * std::max(0.0, t - kWhen), 1e-8) << t;
    EXPECT_NEAR(p.quantities[0].values(k), t < kWhen ? 0.0 : kRate, 1e-6) << t;
  }
}

}  // namespace
}  // namespace unfurl::study::scene_motion_test
