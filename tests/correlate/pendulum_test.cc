// The latching pendulum through the real simulator: what several starts find.
#include <gtest/gtest.h>

#include <set>

#include "base/error.h"
#include "correlate/fit/search.h"
#include "tests/correlate/pendulum_repeats.h"

namespace unfurl::correlate::pendulum_test {
namespace {

TEST(Pendulum, TheHypercubeHasOnePointInEachRow) {
  const std::vector<Parameter> parameters = Pendulum::Parameters();
  constexpr std::size_t kPoints = 20;
  const auto points = LatinHypercube(parameters, kPoints, 3);
  for (std::size_t j = 0; j < parameters.size(); ++j) {
    const double low = ToInternal(parameters[j], parameters[j].low);
    const double high = ToInternal(parameters[j], parameters[j].high);
    std::set<int> rows;
    for (const auto& point : points) {
      const double part = (ToInternal(parameters[j], point[j]) - low) / (high - low);
      rows.insert(static_cast<int>(part * static_cast<double>(kPoints)));
    }
    EXPECT_EQ(rows.size(), kPoints);
  }
  EXPECT_EQ(points, LatinHypercube(parameters, kPoints, 3));
  EXPECT_NE(points, LatinHypercube(parameters, kPoints, 4));
  std::vector<Parameter> open = parameters;
  open[0].high = std::numeric_limits<double>::infinity();
  EXPECT_THROW(LatinHypercube(open, kPoints, 3), Error);
}

// A thousand by label.
TEST(Pendulum, SeveralStartsFindThePlantedMinimum) {
  constexpr int kPendulums = 3;
  const PendulumCount count = RepeatPendulum(kPendulums, 1);
  EXPECT_EQ(count.found, kPendulums) << count.misses;
}

}  // namespace
}  // namespace unfurl::correlate::pendulum_test
