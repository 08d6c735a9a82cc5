// The finer mesh that a fit is checked with where the study names none.
#include "study/finer_mesh.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace unfurl::study {
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

TEST(FinerMesh, EveryBeamHasHalfAsManySegmentsAgain) {
  const FinerMesh mesh = FinerMeshOf({}, {Segments("root", 8), Segments("tip", 4)});
  EXPECT_THAT(mesh.set, ElementsAre("beam.root.segments=12", "beam.tip.segments=6"));
  EXPECT_NEAR(mesh.factor, 1.8, 1e-12);  // 2.25 / 1.25
}

// Rounded up, the ratios differ: the least of them leaves most of the error.
TEST(FinerMesh, TheBeamThatGainsLeastSetsTheFactor) {
  const FinerMesh mesh = FinerMeshOf({}, {Segments("one", 1), Segments("five", 5)});
  EXPECT_THAT(mesh.set, ElementsAre("beam.one.segments=2", "beam.five.segments=8"));
  EXPECT_NEAR(mesh.factor, 2.56 / 1.56, 1e-12);
}

TEST(FinerMesh, SmoothBeamsTakeTwoModesMoreUpToTheirMost) {
  const FinerMesh mesh = FinerMeshOf({}, {Smooth("a", 2), Smooth("b", data::kHighestOrder)});
  EXPECT_THAT(mesh.set, ElementsAre("beam.a.order=4"));
  EXPECT_THAT(FinerMeshOf({}, {Smooth("b", data::kHighestOrder)}).set, IsEmpty());
}

TEST(FinerMesh, NoneWithoutBeamsOrWhereNoneIsWanted) {
  EXPECT_THAT(FinerMeshOf({}, {}).set, IsEmpty());
  data::StudyMeshCheck none;
  none.wanted = false;
  EXPECT_THAT(FinerMeshOf(none, {Segments("root", 8)}).set, IsEmpty());
}

TEST(FinerMesh, TheStudysOwnKeysGoFirst) {
  data::StudyMeshCheck own;
  own.keys = {"beam.root.segments"}, own.value = 16.0;
  const FinerMesh mesh = FinerMeshOf(own, {Segments("root", 8)});
  EXPECT_THAT(mesh.set, ElementsAre("beam.root.segments=16"));
  EXPECT_NEAR(mesh.factor, 4.0 / 3.0, 1e-12);
}

}  // namespace
}  // namespace unfurl::study
