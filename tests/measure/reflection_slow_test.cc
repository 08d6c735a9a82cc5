// Mirrors of any kind, through glass.
#include <gtest/gtest.h>

#include "base/random_vector.h"
#include "tests/measure/reflection.h"

namespace unfurl::measure::reflection_slow_test {
namespace {

TEST(ReflectionSlow, MirrorsAnywhere) {
  // Round mirrors of 0.2 to 1 m radius, 1.2 to 2.2 m from the middle of the volume,
  // facing any way, that send on a fifth to all of the light.
  ReflectionScore score;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    Rng rng(seed);
    Eigen::Vector3d towards = NormalVector(&rng);
    Eigen::Vector3d normal = NormalVector(&rng);
    data::LabReflection mirror;
    mirror.disc.centre = rng.Uniform(1.2, 2.2) * towards.normalized();
    mirror.disc.normal = normal.normalized();
    mirror.disc.radius = rng.Uniform(0.2, 1.0);
    mirror.reflectance = rng.Uniform(0.2, 1.0);
    const ReflectionScore one = Reflected(mirror, 1.0, seed);
    std::printf("%2d ", static_cast<int>(seed));
    one.Print();
    score.Add(one);
  }
  score.Print();
  EXPECT_GT(score.second_spots, score.samples / 10);
  EXPECT_GE(static_cast<double>(score.right), 0.99 * static_cast<double>(score.samples));
  EXPECT_EQ(score.silent, 0U);
}

}  // namespace
}  // namespace unfurl::measure::reflection_slow_test
