// The rungs of a fit's ladder, as the program finds them and as a study gives them.
#include "study/rungs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace unfurl::study::rungs_test {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

data::SceneBeam Segments(const std::string& name, int segments) {
  data::SceneBeam beam;
  beam.name = name, beam.segments = segments;
  return beam;
}

data::SceneBeam Smooth(const std::string& name, int order) {
  data::SceneBeam beam;
  beam.name = name, beam.model = data::BeamModel::kKirchhoff, beam.order = order;
  return beam;
}

TEST(Rungs, HalfAsManySegmentsAgainAndTwiceAsMany) {
  const auto rungs = RungsOf({}, {Segments("root", 8), Segments("tip", 4)});
  ASSERT_EQ(rungs.size(), 3u);
  EXPECT_THAT(rungs[0].set, IsEmpty());
  EXPECT_THAT(rungs[1].set, ElementsAre("beam.root.segments=12", "beam.tip.segments=6"));
  EXPECT_THAT(rungs[2].set, ElementsAre("beam.root.segments=16", "beam.tip.segments=8"));
  EXPECT_EQ(rungs[2].name, "8 to 16 segments");
  EXPECT_NEAR(rungs[0].error, 1.0, 1e-12);
  EXPECT_NEAR(rungs[1].error, 4.0 / 9.0, 1e-12);
  EXPECT_NEAR(rungs[2].error, 0.25, 1e-12);
}

// Rounded up, the ratios differ: the least of them leaves most of the error.
TEST(Rungs, TheBeamThatGainsLeastSetsTheError) {
  const auto rungs = RungsOf({}, {Segments("one", 1), Segments("five", 5)});
  ASSERT_EQ(rungs.size(), 3u);
  EXPECT_THAT(rungs[1].set, ElementsAre("beam.one.segments=2", "beam.five.segments=8"));
  EXPECT_NEAR(rungs[1].error, 1.0 / 2.56, 1e-12);
  EXPECT_THAT(rungs[2].set, ElementsAre("beam.one.segments=2", "beam.five.segments=10"));
}

TEST(Rungs, SmoothBeamsTakeOneModeMoreUpToTheirMost) {
  const auto rungs = RungsOf({}, {Smooth("a", 2), Smooth("b", data::kHighestOrder)});
  ASSERT_EQ(rungs.size(), 3u);
  EXPECT_THAT(rungs[2].set, ElementsAre("beam.a.order=4"));
  EXPECT_EQ(rungs[2].error, 0.0);  // no order to rely on
  EXPECT_EQ(RungsOf({}, {Smooth("b", data::kHighestOrder)}).size(), 1u);
}

TEST(Rungs, NoneWithoutBeamsOrWhereNoneAreWanted) {
  EXPECT_THAT(RungsOf({}, {}), IsEmpty());
  data::StudyFidelity none;
  none.wanted = false;
  EXPECT_THAT(RungsOf(none, {Segments("root", 8)}), IsEmpty());
  none.rungs.resize(2);
  none.rungs[0].segments = 4, none.rungs[1].segments = 8;
  ASSERT_EQ(RungsOf(none, {Segments("root", 8)}).size(), 1u);  // that one alone
}

TEST(Rungs, TheStudysOwnGoFirst) {
  data::StudyFidelity own;
  own.rungs.resize(4);
  own.rungs[0].segments = 4, own.rungs[1].segments = 8;
  own.rungs[2].order = 3, own.rungs[3].set = {"beam.root.order=5"};
  const auto rungs = RungsOf(own, {Segments("root", 8), Smooth("tip", 2)});
  ASSERT_EQ(rungs.size(), 4u);
  EXPECT_THAT(rungs[0].set, ElementsAre("beam.root.model=segments", "beam.root.segments=4",
                                        "beam.tip.model=segments", "beam.tip.segments=4"));
  EXPECT_EQ(rungs[1].error, 0.25);
  EXPECT_THAT(rungs[2].set, ElementsAre("beam.root.model=kirchhoff", "beam.root.order=3",
                                        "beam.tip.model=kirchhoff", "beam.tip.order=3"));
  EXPECT_EQ(rungs[2].name, "smooth beams of order 3");
  EXPECT_EQ(rungs[2].error, 0.0);
  EXPECT_THAT(rungs[3].set, ElementsAre("beam.root.order=5"));
  EXPECT_EQ(rungs[3].name, "beam.root.order=5");
}

}  // namespace
}  // namespace unfurl::study::rungs_test
