#include "sim/record/record.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

#include "base/error.h"
#include "base/progress.h"
#include "scenes.h"

namespace unfurl::sim::record_test {
namespace {

namespace fs = std::filesystem;

class RecordTest : public ::testing::Test {
 protected:
  RecordTest()
      : folder_(fs::temp_directory_path() / ("unfurl_record_" + std::to_string(getpid()))) {
    fs::create_directories(folder_);
  }
  ~RecordTest() override { fs::remove_all(folder_); }
  std::string At(const char* name) const { return (folder_ / name).string(); }

  fs::path folder_;
};

data::Scene Bar() { return data::ParseScene(LatchingBarScene(), "bar.toml"); }

// The file and the memory hold the same numbers.
TEST_F(RecordTest, MemoryHoldsWhatTheFileHolds) {
  const Recording kept = Record(Bar());
  RecordOptions options;
  const Recording filed = Record(Bar(), options, At("run.h5"));
  ASSERT_TRUE(kept.Usable() && filed.Usable()) << kept.message << filed.message;
  EXPECT_EQ(filed.path, At("run.h5"));
  EXPECT_TRUE(filed.run.t.empty());
  const data::Run read = data::ReadRun(At("run.h5"));
  EXPECT_EQ(kept.run.t, read.t);
  ASSERT_EQ(kept.run.quantities.size(), read.quantities.size());
  for (const data::Quantity& q : read.quantities) {
    EXPECT_EQ(kept.run.Column(q.name), read.Column(q.name)) << q.name;
  }
  EXPECT_EQ(kept.run.marks, read.marks);
  ASSERT_EQ(kept.run.events.size(), read.events.size());
  for (std::size_t k = 0; k < read.events.size(); ++k) {
    EXPECT_EQ(kept.run.events[k].t, read.events[k].t);
    EXPECT_EQ(kept.run.events[k].kind, read.events[k].kind);
    EXPECT_EQ(kept.run.events[k].where, read.events[k].where);
    EXPECT_EQ(kept.run.events[k].data, read.events[k].data);
  }
  EXPECT_EQ(kept.run.summary, read.summary);
  EXPECT_EQ(kept.run.text, read.text);
  EXPECT_GT(read.events.size(), 3u);
}

TEST_F(RecordTest, TakesTheScenesSolverUnlessOptionsAreGiven) {
  data::Scene scene = Bar();
  scene.duration = 0.1;
  scene.solver.rate = 200.0;
  scene.solver.rtol = 1e-9;
  EXPECT_EQ(Record(scene).run.t.size(), 21u);
  EXPECT_EQ(Record(scene).options.rtol, 1e-9);
  RecordOptions options;
  options.simulate.emplace();
  options.simulate->rate = 100.0;
  EXPECT_EQ(Record(scene, options).run.t.size(), 11u);
}

// A mechanism of 30 ms is seen as well as a deployment of seconds, unless somebody asks for a rate.
TEST_F(RecordTest, AShortRunHasSamplesAndPicturesEnough) {
  data::Scene scene = Bar();
  scene.duration = 0.03;
  const data::Run run = Record(scene).run;
  EXPECT_EQ(run.t.size(), 1501u);  // at 50,000 a second
  EXPECT_GE(run.shape_t.size(), 200u);
  scene.solver.rate = 1000.0;
  EXPECT_EQ(Record(scene).run.t.size(), 31u);
  RecordOptions options;
  options.shape_rate = 100.0;
  EXPECT_EQ(Record(scene, options).run.shape_t.size(), 4u);
  EXPECT_EQ(SolverOptions(Bar(), 0.5).rate, 2000.0);
}

TEST_F(RecordTest, TheUsualRateIsARoundNumber) {
  for (const auto& [duration, rate] : {std::pair{1e4, 1e3},
                                       {5.5, 1e3},
                                       {1.0, 1e3},
                                       {0.9, 2e3},
                                       {0.5, 2e3},
                                       {0.2, 5e3},
                                       {0.1, 1e4},
                                       {0.03, 5e4},
                                       {3e-4, 5e6},
                                       {1e-7, 1e7}}) {
    EXPECT_EQ(UsualRate(duration), rate) << duration;
  }
}

TEST_F(RecordTest, KeepsTheQuantitiesThatAreNamed) {
  RecordOptions options;
  options.quantities = {"hinge.theta", "tip.*"};
  const Recording kept = Record(Bar(), options);
  EXPECT_EQ(kept.run.quantities.size(), 5u);
  EXPECT_EQ(kept.run.marks, std::vector<std::string>{"tip"});
}

// What a signal stops is what was reached, in memory and in NAME.partial.
TEST_F(RecordTest, AnInterruptionKeepsWhatWasReached) {
  struct Stop : Observer {
    void OnSample(double t, double*, const std::vector<LatchMode>&) override {
      if (t > 0.3) throw Interrupted();
    }
  } stop;
  RecordOptions options;
  options.observer = &stop;
  const Recording kept = Record(Bar(), options);
  EXPECT_EQ(kept.status, "interrupted");
  EXPECT_FALSE(kept.Usable());
  EXPECT_NEAR(kept.run.t.back(), 0.3, 1e-3);
  EXPECT_EQ(kept.run.text.at("status"), "interrupted");
  const Recording filed = Record(Bar(), options, At("stopped.h5"));
  EXPECT_EQ(filed.status, "interrupted");
  EXPECT_FALSE(fs::exists(At("stopped.h5")));
  ASSERT_TRUE(fs::exists(filed.path)) << filed.path;
  EXPECT_EQ(data::ReadRun(filed.path).t, kept.run.t);
}

TEST_F(RecordTest, BadOptionsAreNamedBeforeAnythingIsWritten) {
  RecordOptions options;
  options.shape_rate = -1.0;
  EXPECT_THROW(Record(Bar(), options, At("none.h5")), Error);
  options = {};
  options.simulate.emplace();
  options.simulate->rtol = 1.0;
  EXPECT_THROW(Record(Bar(), options, At("none.h5")), Error);
  options = {};
  options.quantities = {"hinge.thetta"};
  EXPECT_THROW(Record(Bar(), options, At("none.h5")), Error);
  EXPECT_TRUE(fs::is_empty(folder_));
}

}  // namespace
}  // namespace unfurl::sim::record_test
