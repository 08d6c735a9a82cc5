#include "data/trial_health.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "base/error.h"
#include "data/h5.h"
#include "data/tracks.h"
#include "tests/own_folder.h"

namespace unfurl::data::trial_health_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class Health : public ::testing::Test {
 protected:
  // Two slices of three cameras and two marks.
  static TrialHealth Looked() {
    TrialHealth out;
    out.cameras = {"door", "crane", "window"};
    out.marks = {"tip", "root"};
    out.t = {0.5, 1.5};
    out.offset_px = out.sigma_px = out.gain = out.width_px = Eigen::MatrixXd::Constant(2, 3, 0.25);
    return out;
  }
  static TrialHealth Wide() {
    TrialHealth out = Looked();
    out.scatter_words = "readings scatter 1.7 times as much as they state";
    out.scatter_wide = true;
    out.scatter = 1.7;
    out.scatter_sigma = 1.0 / 3.0;
    out.camera_scatter = {1.0, 2.5, 1.25};
    out.camera_scatter_sigma = {0.1, 0.2, 0.3};
    out.mark_scatter.resize(2, 3);
    out.mark_scatter << 1.0, 2.0, 3.0, 4.0, 5.0, 6.0;
    out.wrong_words = "7 readings were left out";
    out.wrong = {0, 7, 0};
    out.misfit_words = "readings depart by 0.3 px";
    out.misfit = 0.3;
    out.camera_misfit = {0.1, 0.5, 0.0};
    return out;
  }
  TrialHealth ThereAndBack(const TrialHealth& health) const {
    H5Writer file(Path(), kTracksSchema, kTracksVersion, {});
    WriteTrialHealth(health, &file);
    file.Commit();
    return ReadTrialHealth(Path());
  }
  std::string Path() const { return folder_.File("tracks.h5"); }

 private:
  OwnFolder folder_;
};

TEST_F(Health, ScatterGoesToAFileAndBack) {
  const TrialHealth is = Wide(), read = ThereAndBack(is);
  EXPECT_EQ(read.scatter_words, is.scatter_words);
  EXPECT_EQ(read.scatter_unknown, "");
  EXPECT_TRUE(read.scatter_wide);
  EXPECT_EQ(read.scatter, 1.7);
  EXPECT_EQ(read.scatter_sigma, 1.0 / 3.0);
  EXPECT_THAT(read.camera_scatter, ElementsAre(1.0, 2.5, 1.25));
  EXPECT_THAT(read.camera_scatter_sigma, ElementsAre(0.1, 0.2, 0.3));
  EXPECT_EQ(read.mark_scatter, is.mark_scatter);
  EXPECT_EQ(read.wrong_words, is.wrong_words);
  EXPECT_THAT(read.wrong, ElementsAre(0, 7, 0));
  EXPECT_EQ(read.misfit_words, is.misfit_words);
  EXPECT_EQ(read.misfit, 0.3);
  EXPECT_THAT(read.camera_misfit, ElementsAre(0.1, 0.5, 0.0));
}

TEST_F(Health, WhatWasNotWidenedHasNoFactors) {
  TrialHealth is = Looked();
  is.scatter_unknown = "too few readings";
  is.wrong = {0, 0, 0};
  const TrialHealth read = ThereAndBack(is);
  EXPECT_EQ(read.scatter_unknown, "too few readings");
  EXPECT_FALSE(read.scatter_wide);
  EXPECT_THAT(read.camera_scatter, IsEmpty());
  EXPECT_EQ(read.mark_scatter.size(), 0);
  EXPECT_EQ(read.wrong_words, "");
  EXPECT_THAT(read.wrong, ElementsAre(0, 0, 0));
}

TEST_F(Health, ScatterOfOtherCamerasIsRefused) {
  const auto error_of = [&](auto&& spoil) {
    TrialHealth is = Wide();
    spoil(&is);
    try {
      ThereAndBack(is);
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string("no error");
  };
  EXPECT_THAT(error_of([](TrialHealth* h) { h->wrong.pop_back(); }),
              HasSubstr("counts readings of other cameras"));
  EXPECT_THAT(error_of([](TrialHealth* h) { h->camera_scatter_sigma.pop_back(); }),
              HasSubstr("factors of other cameras"));
  EXPECT_THAT(error_of([](TrialHealth* h) { h->mark_scatter.conservativeResize(2, 2); }),
              HasSubstr("factors of other cameras"));
}

}  // namespace
}  // namespace unfurl::data::trial_health_test
