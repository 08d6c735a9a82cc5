// Nothing in this room has a preferred length, time or mass: the same mechanism in other sizes,
// paces and weights goes through the same steps and events, and its results are the same once
// scaled back.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <regex>
#include <span>

#include "data/scene.h"
#include "sim/dynamics/observables.h"
#include "sim/implicit/equilibrium.h"
#include "sim/implicit/modes.h"
#include "sim/methods/simulate.h"
#include "tests/repeats.h"

namespace unfurl::sim::scaling_test {
namespace {

struct Scale {
  double length = 1.0, time = 1.0, mass = 1.0;

  // Of a unit such as "N m/rad", "kg m^2", "N/m^1.5", "1/s".
  double Of(const std::string& unit) const {
    const std::map<std::string, double> units = {{"m", length},
                                                 {"s", time},
                                                 {"kg", mass},
                                                 {"N", mass * length / (time * time)},
                                                 {"J", mass * length * length / (time * time)},
                                                 {"rad", 1.0},
                                                 {"Hz", 1.0 / time},
                                                 {"1", 1.0}};
    double factor = 1.0;
    bool below = false;
    const std::regex token(R"(([A-Za-z]+|1)(?:\^([0-9.]+))?|(/))");
    for (auto it = std::sregex_iterator(unit.begin(), unit.end(), token);
         it != std::sregex_iterator(); ++it) {
      if ((*it)[3].matched) {
        below = true;
        continue;
      }
      const double power = (*it)[2].matched ? std::stod((*it)[2]) : 1.0;
      factor *= std::pow(units.at((*it)[1]), below ? -power : power);
    }
    return factor;
  }

  // Every <number unit> of a scene's text.
  std::string Text(const std::string& text) const {
    const std::regex quantity(R"(<(-?[0-9.e+-]+) ([^>]+)>)");
    std::string out;
    std::size_t last = 0;
    for (auto it = std::sregex_iterator(text.begin(), text.end(), quantity);
         it != std::sregex_iterator(); ++it) {
      out += text.substr(last, static_cast<std::size_t>(it->position()) - last);
      out += fmt::format("{:.17g}", std::stod((*it)[1]) * Of((*it)[2]));
      last = static_cast<std::size_t>(it->position() + it->length());
    }
    return out + text.substr(last);
  }
};

struct Outcome : Observer {
  explicit Outcome(const Model& model) : observables(model) {}
  void OnSample(double time, double* y, const std::vector<LatchMode>& modes) override {
    t.push_back(time);
    rows.push_back(observables.Row(time, y, modes));
  }
  Observables observables;
  std::vector<double> t;
  std::vector<std::vector<double>> rows;
  SimulateReport report;
};

// Lengths by powers of four (the contact takes their roots), times and masses by powers of two:
// every number of the scaled run has the same digits, so steps, events and results are the same to
// the bit.
const Scale kExact[] = {{0.25, 1, 1},
                        {16, 1, 1},
                        {1, 0.125, 1},
                        {1, 8, 1},
                        {1, 1, 0.25},
                        {1, 1, 256},
                        {1.0 / 64, 0.5, 1.0 / 1024}};
// By other numbers every product rounds otherwise, and where stability limits the steps their sizes
// turn on that. At a tight tolerance the results are the same whatever the steps.
const Scale kOther[] = {{0.1, 1, 1}, {10, 1, 1},   {30, 1, 1},  {1, 0.1, 1},
                        {1, 10, 1},  {1, 1, 0.01}, {1, 1, 300}, {0.03, 0.2, 1e-4}};
constexpr double kSame = 1e-9;  // of the largest of its unit

void ExpectSame(const std::string& text, const SimulateOptions& unscaled, bool exact) {
  const auto run = [&](const Scale& scale) {
    const Model model = Compile(data::ParseScene(scale.Text(text), "scaled.toml"));
    auto outcome = std::make_unique<Outcome>(model);
    SimulateOptions options = unscaled;
    options.rate /= scale.time;
    options.duration *= scale.time;
    outcome->report = Simulate(model, options, outcome.get());
    return outcome;
  };
  const auto one = run({});
  ASSERT_TRUE(one->report.Usable()) << one->report.message;
  std::vector<double> largest(one->rows[0].size(), 0.0);
  for (const auto& row : one->rows) {
    for (std::size_t q = 0; q < row.size(); ++q) {
      largest[q] = std::max(largest[q], std::fabs(row[q]));
    }
  }
  // What nearly vanishes is held to the largest of its unit.
  std::map<std::string, double> of_unit;
  const auto& quantities = one->observables.quantities();
  for (std::size_t q = 0; q < largest.size(); ++q) {
    double& unit = of_unit[quantities[q].units];
    unit = std::max(unit, largest[q]);
  }
  const double same = exact ? 0.0 : kSame;
  for (const Scale& scale :
       exact ? std::span<const Scale>(kExact) : std::span<const Scale>(kOther)) {
    SCOPED_TRACE(
        fmt::format("lengths x {}, times x {}, masses x {}", scale.length, scale.time, scale.mass));
    const auto other = run(scale);
    EXPECT_EQ(other->report.status, one->report.status);
    if (exact) {
      EXPECT_EQ(other->report.steps, one->report.steps);
      EXPECT_EQ(other->report.rejected, one->report.rejected);
      EXPECT_EQ(other->report.limited, one->report.limited);
    }
    EXPECT_EQ(other->report.method, one->report.method);
    ASSERT_EQ(other->report.events.size(), one->report.events.size());
    for (std::size_t k = 0; k < one->report.events.size(); ++k) {
      const Event &a = one->report.events[k], &b = other->report.events[k];
      EXPECT_EQ(a.kind, b.kind);
      EXPECT_EQ(a.upper, b.upper);
      EXPECT_NEAR(b.t / scale.time, a.t, same);
      EXPECT_NEAR(b.theta_rate * scale.time, a.theta_rate, same * std::fabs(a.theta_rate));
    }
    ASSERT_EQ(other->rows.size(), one->rows.size());
    std::string worst;
    double off = 0.0;
    for (std::size_t k = 0; k < one->rows.size(); ++k) {
      for (std::size_t q = 0; q < largest.size(); ++q) {
        // These are errors: of the whole, not of themselves.
        if (quantities[q].name.starts_with("constraint.")) continue;
        if (of_unit[quantities[q].units] == 0.0) {
          EXPECT_EQ(other->rows[k][q], 0.0) << quantities[q].name;
          continue;
        }
        const double factor = scale.Of(quantities[q].units);
        const double difference =
            std::fabs(other->rows[k][q] / factor - one->rows[k][q]) / of_unit[quantities[q].units];
        if (difference > off) off = difference, worst = quantities[q].name;
      }
    }
    EXPECT_LE(off, same) << worst;
  }
}

// A boom of two beams that latches and bounces, on strings, with losses of every kind.
const char kBoom[] =
    "[scene]\nname = 'boom'\nduration = <2.0 s>\n"
    "[beam.inner]\nlength = <0.8 m>\nmass = <0.4 kg>\nEI = <6.0 N m^2>\nsegments = 3\n"
    "damping = <1e-4 s>\n"
    "[beam.outer]\nlength = <0.7 m>\nmass = <0.3 kg>\nEI = <5.0 N m^2>\nsegments = 3\n"
    "[body.bracket]\nmass = <0.1 kg>\ninertia = <2e-4 kg m^2>\n"
    "[weld.tip]\ninner = 'inner.end'\nouter = 'bracket'\nouter_point = [<-0.02 m>, 0.0]\n"
    "[contact.stop]\nK = <2e7 N/m^1.5>\nC = <300.0 N s/m>\nQ = 3.0\nepsilon = <2e-5 m>\n"
    "[contact.soft]\nlaw = 'hunt_crossley'\nK = <1e7 N/m^1.5>\nalpha = <0.5 s/m>\n"
    "[joint.root]\ninner = 'ground'\nouter = 'inner.start'\ntheta = 0.35\n"
    "[joint.root.spring]\nstiffness = <1.5 N m>\npreload = 1.0\n"
    "[joint.root.latch]\ntheta_a = 0.02\ntheta_b = 0.01\nlever = <0.02 m>\ncontact = 'stop'\n"
    "[joint.root.quadratic_damper]\ndamping = <0.02 N m s^2>\n"
    "[joint.elbow]\ninner = 'bracket'\ninner_point = [<0.02 m>, 0.0]\nouter = 'outer.start'\n"
    "theta = 0.5\nsign = -1\n"
    "[joint.elbow.table]\ntheta = [-0.2, 0.0, 0.4, 1.0]\n"
    "moment = [<0.3 N m>, <-0.4 N m>, <-0.6 N m>, <-0.5 N m>]\n"
    "[joint.elbow.damper]\ndamping = <0.01 N m s>\n"
    "[joint.elbow.friction]\nmoment = <0.02 N m>\ncreep_rate = <0.05 1/s>\n"
    "[joint.elbow.latch]\ntheta_a = 0.02\ntheta_b = 0.01\nlever = <0.02 m>\ncontact = 'soft'\n"
    "[suspension]\nlength = <4.0 m>\ngravity = <9.81 m/s^2>\n"
    "[mark.tip]\non = 'outer.end'\n"
    "[event.half]\nwhen = 'tip.y'\nlevel = <0.3 m>\n";

// A crank, its rod and a slider: a closed loop, with effects on a travel and functions of time.
const char kCrank[] =
    "[scene]\nname = 'crank'\nduration = <1.5 s>\n"
    "[body.crank]\nmass = <0.5 kg>\ninertia = <2e-3 kg m^2>\n"
    "[body.rod]\nmass = <0.4 kg>\ninertia = <8e-3 kg m^2>\n"
    "[body.piston]\nmass = <0.6 kg>\ninertia = <1e-3 kg m^2>\n"
    "[joint.axle]\ninner = 'ground'\nouter = 'crank'\nouter_point = [<-0.1 m>, 0.0]\n"
    "theta = 0.6\ntheta_rate = <2.0 1/s>\n"
    "[joint.pin]\ninner = 'crank'\ninner_point = [<0.1 m>, 0.0]\nouter = 'rod'\n"
    "outer_point = [<-0.25 m>, 0.0]\ntheta = -0.9\n"
    "[joint.wrist]\ninner = 'rod'\ninner_point = [<0.25 m>, 0.0]\nouter = 'piston'\ntheta = 0.3\n"
    "[joint.bore]\ntype = 'slider'\ninner = 'ground'\nouter = 'piston'\ntravel = <0.6 m>\n"
    "[joint.bore.spring]\nstiffness = <40.0 N/m>\nfree = <0.5 m>\n"
    "[joint.bore.damper]\ndamping = <0.4 N s/m>\n"
    "[joint.bore.quadratic_damper]\ndamping = <0.3 N s^2/m^2>\n"
    "[joint.axle.motor]\nmoment = '<0.5 N m> * sin(<7.0 1/s> * t)'\n"
    "[spring.tie]\na = 'ground'\na_point = [0.0, <0.7 m>]\nb = 'rod'\nstiffness = <15.0 N/m>\n"
    "damping = <0.2 N s/m>\nfree_length = <0.4 m>\n"
    "[force.push]\non = 'piston'\nforce = [{t = [0, <0.6 s>, <1.5 s>], "
    "value = [0, <3.0 N>, <-2.0 N>]}, 0.0]\n"
    "[gravity]\nacceleration = [0.0, <-9.81 m/s^2>]\n"
    "[mark.end]\non = 'rod'\npoint = [<0.25 m>, 0.0]\n";

// A weight on a spring that a driven belt takes along by friction: no joint has an offset.
const char kBelt[] =
    "[scene]\nname = 'belt'\nduration = <2.0 s>\n"
    "[body.belt]\nmass = <5.0 kg>\ninertia = <0.6 kg m^2>\n"
    "[body.weight]\nmass = <0.6 kg>\ninertia = <0.1 kg m^2>\n"
    "[joint.roll]\ntype = 'slider'\ninner = 'ground'\nouter = 'belt'\n"
    "drive.rate = '<-0.25 m/s> * smoothstep(<1.0 1/s> * t)'\n"
    "[joint.grip]\ntype = 'slider'\ninner = 'belt'\nouter = 'weight'\n"
    "[joint.grip.friction]\nforce = <1.4 N>\ncreep_rate = <5e-3 m/s>\n"
    "[spring.tie]\na = 'ground'\na_point = [<-1.0 m>, 0.0]\nb = 'weight'\n"
    "stiffness = <20.0 N/m>\nfree_length = <1.0 m>\n"
    "[mark.m]\non = 'weight'\n";

// An arm that is driven about, fast for its mass, with a slider that is kept from turning: rows of
// angles beside rows of places.
const char kDriven[] =
    "[scene]\nname = 'driven'\nduration = <1.1 s>\n"
    "[body.crank]\nmass = <2.4 kg>\ninertia = <0.5 kg m^2>\n"
    "[body.rod]\nmass = <2.9 kg>\ninertia = <0.06 kg m^2>\n"
    "[body.piston]\nmass = <2.8 kg>\ninertia = <0.7 kg m^2>\n"
    "[joint.axle]\ninner = 'ground'\nouter = 'crank'\nouter_point = [<-0.09 m>, 0.0]\n"
    "drive.position = '-0.467 * tanh(<4000.0 1/s> * (t - <0.3 s>))'\n"
    "[joint.pin]\ninner = 'crank'\ninner_point = [<0.09 m>, 0.0]\nouter = 'rod'\n"
    "outer_point = [<-0.37 m>, 0.0]\ntheta = -1.3\n"
    "[joint.wrist]\ninner = 'rod'\ninner_point = [<0.37 m>, 0.0]\nouter = 'piston'\ntheta = 0.3\n"
    "[joint.bore]\ntype = 'slider'\ninner = 'ground'\nouter = 'piston'\ntravel = <0.83 m>\n"
    "[mark.end]\non = 'rod'\npoint = [<0.37 m>, 0.0]\n";

SimulateOptions With(Method method, double rtol, double duration) {
  SimulateOptions options;
  options.method = method;
  options.rtol = rtol;
  options.rate = 100.0;
  options.duration = duration;
  return options;
}

TEST(Scaling, ABoomThatLatchesAndBounces) {
  ExpectSame(kBoom, With(Method::kProjected, 1e-6, 0.6), true);
}
// To the first bounces; later ones double every error.
TEST(Scaling, ABoomThatLatches) { ExpectSame(kBoom, With(Method::kProjected, 1e-13, 0.25), false); }
TEST(Scaling, ABoomByImplicitSteps) { ExpectSame(kBoom, With(Method::kImplicit, 1e-4, 0.4), true); }
TEST(Scaling, ACrank) {
  for (const Method method : {Method::kProjected, Method::kPartitioned}) {
    ExpectSame(kCrank, With(method, 1e-6, 1.5), true);
    ExpectSame(kCrank, With(method, 1e-11, Repeats(1, 5) * 0.3), false);
  }
}

// An angle that is off by 1e-8 was taken for 1e-8 m: a mechanism of millimetres was "not usable".
TEST(Scaling, ADrivenMechanism) { ExpectSame(kDriven, With(Method::kProjected, 1e-6, 0.35), true); }

// Where joints have no offsets tolerances referred to 1 m, whatever the springs and drives span.
TEST(Scaling, ABeltWithoutOffsets) { ExpectSame(kBelt, With(Method::kProjected, 1e-6, 1.0), true); }

TEST(Scaling, EquilibriumAndModes) {
  const auto modes = [](const Scale& scale, EquilibriumReport* equilibrium) {
    data::Scene scene = data::ParseScene(scale.Text(kBoom), "scaled.toml");
    for (data::SceneJoint& joint : scene.joints) joint.theta = -joint.latch->theta_b;
    const Model model = Compile(scene);
    Dynamics dynamics(model);
    std::vector<double> y = model.initial_state;
    *equilibrium = FindLatchedEquilibrium(&dynamics, y.data());
    return FindModes(&dynamics, y.data(), 6);
  };
  EquilibriumReport rest, scaled_rest;
  const ModesReport one = modes({}, &rest);
  ASSERT_TRUE(rest.found);
  ASSERT_EQ(one.modes.size(), 6u);
  for (const Scale& scale : {Scale{0.1, 1, 1}, Scale{30, 1, 1}, Scale{1, 0.1, 1}, Scale{1, 10, 1},
                             Scale{0.03, 0.2, 1e-4}}) {
    const ModesReport other = modes(scale, &scaled_rest);
    ASSERT_TRUE(scaled_rest.found) << scale.length << ' ' << scale.time;
    EXPECT_EQ(other.rigid, one.rigid);
    ASSERT_EQ(other.modes.size(), one.modes.size());
    for (std::size_t k = 0; k < one.modes.size(); ++k) {
      const double frequency = one.modes[k].frequency, damping = one.modes[k].damping;
      EXPECT_NEAR(other.modes[k].frequency * scale.time, frequency, kSame * frequency);
      EXPECT_NEAR(other.modes[k].damping, damping, kSame * damping);
    }
  }
}

}  // namespace
}  // namespace unfurl::sim::scaling_test
