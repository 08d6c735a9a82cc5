#include "data/lab.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/source_dir.h"

namespace unfurl::data::lab_test {
namespace {

using ::testing::HasSubstr;

constexpr char kShipped[] = UNFURL_SOURCE_DIR "/data/sets/deployment/lab.toml";

std::string ErrorOf(const std::vector<std::string>& overrides) {
  try {
    ReadLab(kShipped, overrides);
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

TEST(Lab, TheShippedOneIsTheOneOfThePhysicsPage) {
  const Lab lab = ReadLab(kShipped);
  ASSERT_EQ(lab.cameras.size(), 4U);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_NEAR((lab.cameras[i].position - lab.cameras[i].look_at).norm(), 3.2, 1e-6);
    EXPECT_NEAR(std::abs(lab.cameras[i].roll), 0.785398163, 1e-9);
    EXPECT_EQ(lab.cameras[i].roll > 0.0, i % 2 == 0);  // alternately
    const auto& next = lab.cameras[(i + 1) % 4];
    EXPECT_NEAR((lab.cameras[i].position - next.position).norm(), 2.0, 1e-12);
  }
  EXPECT_TRUE((lab.volume_high - lab.volume_low).isConstant(2.2, 1e-12));
  EXPECT_EQ(lab.strobe.slots,
            (std::vector<std::string>{"mark1", "mark1b", "mark2", "mark3", "dark"}));
  EXPECT_EQ(lab.strobe.line_rate, 1000.0);
  EXPECT_EQ(lab.slit.width, 0.8e-3);
  EXPECT_EQ(lab.survey.sigma, 0.3e-3);
  EXPECT_EQ(lab.sensor.format.elements(), 2235U);
  EXPECT_EQ(lab.sensor.format.pitch, 14e-6);
}

TEST(Lab, EffectsThatAreNotNamedAreOff) {
  const Lab lab = ReadLab(kShipped);
  EXPECT_FALSE(lab.sensor.has_pattern());
  EXPECT_EQ(lab.sensor.blooming, 0.0);
  EXPECT_EQ(lab.sensor.residual, 0.0);
  EXPECT_EQ(lab.led.half_angle, 0.0);
  EXPECT_EQ(lab.ambient.level, 0.0);
  EXPECT_EQ(lab.flat_field.lines, 0);
  EXPECT_TRUE(lab.lamps.empty() && lab.reflections.empty() && lab.occluders.empty());
  const Lab full = ReadLab(UNFURL_SOURCE_DIR "/data/sets/deployment/lab_full.toml");
  EXPECT_TRUE(full.sensor.has_pattern());
  EXPECT_GT(full.sensor.residual, 0.0);
  EXPECT_GT(full.ambient.flicker, 0.0);
  EXPECT_GT(full.flat_field.lines, 0);
  EXPECT_EQ(full.cameras.size(), 4U);
  EXPECT_EQ(full.sensor.read_noise, lab.sensor.read_noise);
}

TEST(Lab, RefusesWhatCannotBe) {
  EXPECT_THAT(ErrorOf({"lens.radius=-0.016"}), HasSubstr("lens.radius"));
  EXPECT_THAT(ErrorOf({"lens.width=0.04"}), HasSubstr("wider than its cylinder"));
  EXPECT_THAT(ErrorOf({"lens.thickness=0.0005"}), HasSubstr("no edge left"));
  EXPECT_THAT(ErrorOf({"lens.curved=left"}), HasSubstr("lens.curved"));
  EXPECT_THAT(ErrorOf({"lens.indx=1.5"}), HasSubstr("index"));  // the nearest known key
  EXPECT_THAT(ErrorOf({"sensor.bits=7"}), HasSubstr("sensor.bits"));
  EXPECT_THAT(ErrorOf({"sensor.dark_level=40000.0"}), HasSubstr("half of the full scale"));
  EXPECT_THAT(ErrorOf({"strobe.slots=[\"mark1\"]"}), HasSubstr("no dark slot"));
  EXPECT_THAT(ErrorOf({"strobe.lead=[0.7, 0.3]"}), HasSubstr("strobe.lead"));
  EXPECT_THAT(ErrorOf({"led.flash=0.002"}), HasSubstr("longer than a line"));
  EXPECT_THAT(ErrorOf({"volume.high=[-2.0, 1.1, 1.1]"}), HasSubstr("volume is empty"));
  EXPECT_THAT(ErrorOf({"camera.north_east.look_at=[1.0, 1.0, 2.870540]"}),
              HasSubstr("looks at itself"));
  EXPECT_EQ(ErrorOf({"seed=7"}), "no error");
  EXPECT_THAT(ErrorOf({"sensor.residual=0.4"}), HasSubstr("sensor.residual"));
  EXPECT_THAT(ErrorOf({"sensor.nonuniformity=-0.1"}), HasSubstr("sensor.nonuniformity"));
  EXPECT_THAT(ErrorOf({"sensor.blooming=1.5"}), HasSubstr("sensor.blooming"));
  EXPECT_THAT(ErrorOf({"led.half_angle=1.6"}), HasSubstr("led.half_angle"));
  EXPECT_THAT(ErrorOf({"led.axis=[0.0, 0.0, 0.0]"}), HasSubstr("is no direction"));
  EXPECT_THAT(ErrorOf({"ambient.flicker=0.3"}), HasSubstr("level"));
  EXPECT_THAT(ErrorOf({"ambient.level=1e6", "ambient.flicke=0.3"}), HasSubstr("flicker"));
  EXPECT_THAT(ErrorOf({"flat_field.lines=0", "flat_field.level=0.5"}),
              HasSubstr("flat_field.lines"));
  EXPECT_THAT(ErrorOf({"lamp.a.brightness=1.0"}), HasSubstr("position"));
  const std::string disc = "occluder.a.centre=[0.0, 0.0, 0.0]";
  EXPECT_THAT(ErrorOf({disc, "occluder.a.normal=[0.0, 0.0, 1.0]", "occluder.a.radius=0.1",
                       "occluder.a.from=2.0", "occluder.a.until=1.0"}),
              HasSubstr("before"));
}

}  // namespace
}  // namespace unfurl::data::lab_test
