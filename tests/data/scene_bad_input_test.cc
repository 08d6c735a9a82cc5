// What a scene may get wrong: one line each, with file, line, key and remedy.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <ctime>

#include "data/scene.h"
#include "errors.h"
#include "scene_texts.h"

namespace unfurl::data::scene_bad_input_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

struct Bad {
  const char* what;     // is wrong, for the test's own message
  std::string text;     // after kHead, kRod and kPivot
  const char* where;    // key
  const char* message;  // part of it
};

const Bad kBad[] = {
    {"negative stiffness", "[joint.pivot.spring]\nstiffness = -1\n", "joint.pivot.spring.stiffness",
     "-1 is out of range; it must be above 0"},
    {"no stiffness", "[joint.pivot.spring]\nstiffness = 0\n", "joint.pivot.spring.stiffness",
     "above 0"},
    {"nan", "[joint.pivot.damper]\ndamping = nan\n", "joint.pivot.damper.damping", "finite"},
    {"infinity", "[gravity]\nacceleration = [0, -inf]\n", "gravity.acceleration", "finite"},
    {"free and preload", "[joint.pivot.spring]\nstiffness = 1\nfree = 1\npreload = 1\n",
     "joint.pivot.spring.preload", "both given"},
    {"stops crossed",
     "[contact.c]\nK = 1e9\nC = 1\nQ = 3\nepsilon = 1e-6\n"
     "[joint.pivot.latch]\ntheta_a = 0.1\ntheta_b = -0.2\nlever = 0.02\ncontact = 'c'\n",
     "joint.pivot.latch.theta_b", "theta_a + theta_b is negative"},
    {"unknown contact",
     "[contact.pin]\nK = 1e9\nC = 1\nQ = 3\nepsilon = 1e-6\n"
     "[joint.pivot.latch]\ntheta_a = 0.1\ntheta_b = 0.2\nlever = 0.02\ncontact = 'pim'\n",
     "joint.pivot.latch.contact", "did you mean \"pin\"?"},
    {"unknown body", "[joint.k]\ninner = 'ground'\nouter = 'bra'\n", "joint.k.outer",
     "did you mean \"bar\"?"},
    {"a beam for its end", "[joint.k]\ninner = 'ground'\nouter = 'rod'\n", "joint.k.outer",
     "name rod.start or rod.end"},
    {"unknown type", "[joint.k]\ntype = 'slidr'\ninner = 'ground'\nouter = 'bar'\n", "joint.k.type",
     "did you mean 'slider'?"},
    {"travel of a pin", "[joint.k]\ninner = 'ground'\nouter = 'bar'\ntravel = 1\n",
     "joint.k.travel", "a revolute joint has no travel"},
    {"angle of a slider",
     "[joint.k]\ntype = 'slider'\ninner = 'ground'\nouter = 'bar'\ntheta = 1\n", "joint.k.theta",
     "a slider does not turn"},
    {"latch of a slider",
     "[joint.k]\ntype = 'slider'\ninner = 'ground'\nouter = 'bar'\n[joint.k.latch]\n",
     "joint.k.latch", "only a revolute joint"},
    {"moment for a force",
     "[joint.k]\ntype = 'slider'\ninner = 'ground'\nouter = 'bar'\n[joint.k.motor]\nmoment = 1\n",
     "joint.k.motor", "'force' is missing"},
    {"table that falls", "[joint.pivot.table]\ntheta = [0, 2, 1]\nmoment = [0, 1, 2]\n",
     "joint.pivot.table.theta", "do not rise: 1 follows 2"},
    {"table of one point", "[joint.pivot.table]\ntheta = [0]\nmoment = [0]\n",
     "joint.pivot.table.theta", "less than two points"},
    {"table with gaps", "[joint.pivot.table]\ntheta = [0, 1]\nmoment = [0]\n",
     "joint.pivot.table.moment", "1 values for 2 points"},
    {"friction without creep", "[joint.pivot.friction]\nmoment = 1\n", "joint.pivot.friction",
     "'creep_rate' is missing"},
    {"two drives", "[joint.pivot.drive]\nposition = 1\nrate = 1\n", "joint.pivot.drive.rate",
     "may conflict"},
    {"no drive", "[joint.pivot.drive]\n", "joint.pivot.drive", "neither position nor rate"},
    {"drive and motor", "[joint.pivot.drive]\nrate = 1\n[joint.pivot.motor]\nmoment = 1\n",
     "joint.pivot.motor", "keep one"},
    {"drive against start", "theta = 0.3\n[joint.pivot.drive]\nposition = 't'\n",
     "joint.pivot.theta", "0.3 at the start, where the drive says 0"},
    {"drive that kinks",
     "[joint.pivot.drive]\nposition = {t = [0, 5], value = [0, 1], interpolation = 'linear'}\n",
     "joint.pivot.drive.position.interpolation", "no acceleration"},
    {"drive that ends early", "[joint.pivot.drive]\nposition = {t = [0, 1], value = [0, 1]}\n",
     "joint.pivot.drive.position.t", "covers 0 to 1 s, the run 0 to 2 s"},
    {"drive without a rate", "[joint.pivot.drive]\nposition = 'sqrt(t)'\n",
     "joint.pivot.drive.position", "has no finite rate or acceleration at t = 0 s"},
    {"expression that divides by zero", "[joint.pivot.motor]\nmoment = '1 / (t - 0.3)'\n",
     "joint.pivot.motor.moment", "divides by zero at t = 0.3 s"},
    {"expression with a mistake", "[joint.pivot.motor]\nmoment = 'cso(t)'\n",
     "joint.pivot.motor.moment", "did you mean 'cos'?"},
    {"function that is none", "[joint.pivot.motor]\nmoment = true\n", "joint.pivot.motor.moment",
     "give a number, an expression"},
    {"function with an unknown key", "[joint.pivot.motor]\nmoment = {t = [0, 1], valu = [0, 1]}\n",
     "joint.pivot.motor.moment", "'value' is missing"},
    {"spring without stiffness", "[spring.s]\na = 'ground'\nb = 'bar'\n", "spring.s",
     "neither stiffness nor damping"},
    {"spring to itself", "[spring.s]\na = 'bar'\nb = 'bar'\nstiffness = 1\n", "spring.s.b",
     "same body"},
    {"spring of a joint's name", "[spring.pivot]\na = 'ground'\nb = 'bar'\nstiffness = 1\n",
     "spring.pivot", "already taken"},
    {"place beyond a beam", "[mark.m]\non = 'rod'\nat = 1.5\n", "mark.m.at", "at most 1"},
    {"place along a body", "[mark.m]\non = 'bar'\nat = 0.5\n", "mark.m.at", "not a whole beam"},
    {"place along nothing", "[mark.m]\non = 'rod'\n", "mark.m.on", "or give at from 0 to 1"},
    {"force that is none", "[force.f]\non = 'bar'\n", "force.f", "exactly one"},
    {"force twice", "[force.f]\non = 'bar'\nforce = [0, 1]\ntorque = 1\n", "force.f",
     "exactly one"},
    {"force of three", "[force.f]\non = 'bar'\nforce = [0, 1, 2]\n", "force.f.force",
     "holds 3 values"},
    {"force that is no number", "[force.f]\non = 'bar'\nforce = [0, 'q']\n", "force.f.force.1",
     "'q' is not known"},
    {"force on the ground", "[force.f]\non = 'ground'\nforce = [0, 1]\n", "force.f.on",
     "moves nothing"},
    {"force along a body", "[force.f]\non = 'bar'\nper_length = [0, 1]\n", "force.f.on",
     "no beam \"bar\""},
    {"event of nothing", "[event.e]\nwhen = 'pivott.theta'\n", "event.e.when",
     "did you mean \"pivot.theta\"?"},
    {"event without a quantity", "[event.e]\nwhen = 'pivot'\n", "event.e.when",
     "use theta and theta_rate"},
    {"event of another", "[event.e]\nwhen = 'pivot.travel'\n", "event.e.when", "has no \"travel\""},
    {"tolerance of 0", "[solver]\nrtol = 0\n", "solver.rtol", "at least 1e-13"},
    {"tolerance of 1", "[solver]\nrtol = 1.0\n", "solver.rtol", "at most 0.01"},
    {"unknown method", "[solver]\nmethod = 'explicit'\n", "solver.method", "choose among"},
    {"rate of 0", "[solver]\nrate = 0\n", "solver.rate", "above 0"},
    {"unknown table", "[forces.f]\n", "forces", "did you mean 'force'?"},
    {"unknown key below", "[joint.pivot.damper]\ndamping = 1\nc = 2\n", "joint.pivot.damper.c",
     "unknown key; remove it; known here: damping"},
    // Keys that would do nothing beside what else is given.
    {"taper of nothing", "[beam.b]\nlength = 1\nmass = 1\nEI = 1\ntaper_of = 'width'\n",
     "beam.b.taper_of", "nothing tapers"},
    {"E beside EI", "[beam.b]\nlength = 1\nmass = 1\nEI = 1\nE = 7e10\n", "beam.b.E",
     "nothing else is to be made of E"},
    {"E beside EI and EA", "[beam.b]\nlength = 1\nmass = 1\nEI = 1\nE = 7e10\nEA = 1e6\n",
     "beam.b.E", "nothing else"},
    {"area beside EA", "[beam.b]\nlength = 1\nmass = 1\nEI = 1\nEA = 1e6\narea = 1e-4\n",
     "beam.b.area", "EA is given"},
    {"density beside area",
     "[beam.b]\nlength = 1\nmass = 1\nE = 7e10\nI = 1e-9\narea = 1e-4\ndensity = 2700\n",
     "beam.b.density", "area is given"},
    {"area without E", "[beam.b]\nlength = 1\nmass = 1\nEI = 1\narea = 1e-4\n", "beam.b.area",
     "without E"},
    {"radius beside K", "[contact.c]\nK = 1e9\nradius_i = 1\nC = 1\nQ = 3\nepsilon = 1e-6\n",
     "contact.c.radius_i", "K is given"},
    {"mass beside C", "[contact.c]\nK = 1e9\nC = 1\nmass = 1\nQ = 3\nepsilon = 1e-6\n",
     "contact.c.mass", "C is given"},
    {"length of a mere damper",
     "[spring.s]\na = 'bar'\nb = 'ground'\ndamping = 1\nfree_length = 0.5\n",
     "spring.s.free_length", "without a stiffness"},
    {"point of a torque", "[force.f]\non = 'bar'\npoint = [0.1, 0]\ntorque = 1\n", "force.f.point",
     "the same at every point"},
    {"frame of a torque", "[force.f]\non = 'bar'\nframe = 'body'\ntorque = 1\n", "force.f.frame",
     "the same in every frame"},
    {"place of a load per length", "[force.f]\non = 'rod'\nat = 0.5\nper_length = [0, 1]\n",
     "force.f.at", "along the whole beam"},
    {"axis of a gyroscope", "[sensor.s]\nkind = 'gyroscope'\non = 'bar'\naxis = 1.5\n",
     "sensor.s.axis", "only an accelerometer"},
    {"point of a gyroscope", "[sensor.s]\nkind = 'gyroscope'\non = 'bar'\npoint = [0.1, 0]\n",
     "sensor.s.point", "alike at every point"},
    {"height of an accelerometer",
     "[sensor.s]\nkind = 'accelerometer'\non = 'bar'\nheight = 0.01\n", "sensor.s.height",
     "only a strain gauge"},
    {"include in the midst", "[joint.pivot.damper]\ninclude = ['x']\ndamping = 1\n",
     "joint.pivot.damper.include", "unknown key"},
};

TEST(SceneBadInput, IsOneLineThatNamesTheKey) {
  for (const Bad& bad : kBad) {
    const std::string error =
        ErrorOf([&] { ParseScene(std::string(kHead) + kRod + kPivot + bad.text, "s.toml"); });
    EXPECT_THAT(error, AllOf(StartsWith("s.toml:"), HasSubstr(std::string(":") + bad.where + ": "),
                             HasSubstr(bad.message), Not(HasSubstr("\n"))))
        << bad.what;
  }
}

// The same on the keys of bodies, beams and the scene itself.
TEST(SceneBadInput, NumbersOutOfRange) {
  const auto error = [](const std::string& from, const std::string& to) {
    std::string text = std::string(kHead) + kRod;
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos);
    return ErrorOf([&] { ParseScene(text.replace(at, from.size(), to), "s.toml"); });
  };
  EXPECT_THAT(error("duration = 2.0", "duration = 1e9"),
              AllOf(HasSubstr("s.toml:3:scene.duration"), HasSubstr("at most 10000000")));
  EXPECT_THAT(error("duration = 2.0", "duration = 0"), HasSubstr("above 0"));
  EXPECT_THAT(error("mass = 1.0", "mass = 0"), HasSubstr("s.toml:5:body.bar.mass: 0 is out"));
  EXPECT_THAT(error("mass = 1.0", "mass = nan"), HasSubstr("not a finite number"));
  EXPECT_THAT(error("inertia = 0.1", "inertia = -inf"), HasSubstr("not a finite number"));
  EXPECT_THAT(error("length = 1.0", "length = -1"), HasSubstr("beam.rod.length: -1 is out"));
  EXPECT_THAT(error("EI = 10.0", "EI = 0"), HasSubstr("beam.rod.EI: 0 is out"));
  EXPECT_THAT(error("EI = 10.0", "EI = 10.0\nsegments = 0"), HasSubstr("from 1 to 1000000"));
  EXPECT_EQ(error("EI = 10.0", "EI = 10.0\nsegments = 1"), "no error");
  EXPECT_THAT(error("EI = 10.0", "EI = 10.0\nsegments = 2.5"), HasSubstr("not a whole number"));
  EXPECT_THAT(error("EI = 10.0", "EI = 10.0\norder = 0"), HasSubstr("from 1 to 11"));
  EXPECT_THAT(error("EI = 10.0", "EI = 10.0\nmodel = 'ancf'"), HasSubstr("choose among"));
  EXPECT_THAT(error("EI = 10.0", "EI = 10.0\ndamping = -1"), HasSubstr("at least 0"));
}

// Large files are read, in a time that grows as they do.
TEST(SceneBadInput, LargeScenesAreRead) {
  const auto seconds = [](std::size_t size) {
    std::string text = "[scene]\nname = 's'\nduration = 1.0\n";
    text.reserve(size + 1000);
    std::size_t bodies = 0;
    while (text.size() < size) {
      const std::string k = std::to_string(bodies++);
      text += "[body.b" + k + "]\nmass = 1.0\ninertia = 0.1\n[joint.j" + k +
              "]\ninner = 'ground'\nouter = 'b" + k + "'\nouter_point = [0.25, 0.0]\n[joint.j" + k +
              ".motor]\nmoment = '0.1 * sin(2 * pi * t)'\n";
    }
    const std::clock_t begin = std::clock();
    const Scene scene = ParseScene(text, "big.toml");
    const std::clock_t end = std::clock();
    EXPECT_EQ(scene.bodies.size(), bodies);
    EXPECT_EQ(scene.joints.back().motor->moment.Value(0.25), 0.1);
    return static_cast<double>(end - begin) / CLOCKS_PER_SEC;
  };
  const double one = seconds(1'000'000), eight = seconds(8'000'000);
  RecordProperty("seconds_of_8_MB", std::to_string(eight));
  // Eight times the size: eight times the time but for logarithms and caches; a square would be 64.
  constexpr double kGrowth = 24.0;
  EXPECT_LT(eight, kGrowth * one);
}

}  // namespace
}  // namespace unfurl::data::scene_bad_input_test
