#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "base/random.h"
#include "data/atomic_file.h"
#include "data/study.h"
#include "study/fit_study.h"
#include "study/scene_model.h"

namespace unfurl::study {

// A swinging arm, records of it, and a study of its damping and gravity.
class ArmTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::path(::testing::TempDir()) / fmt::format("unfurl_arm-{}", getpid());
    std::filesystem::create_directories(folder_);
    // Marks at the middle and at the end of an arm.
    Put("arm.toml",
        "[scene]\nname = \"arm\"\nduration = 6.0\n[gravity]\nacceleration = [0.0, -9.81]\n"
        "[body.arm]\nmass = 1.0\ninertia = 0.08333333333333333\n"
        "[joint.hinge]\ninner = \"ground\"\nouter = \"arm\"\nouter_point = [-0.5, 0.0]\n"
        "zero_angle = -1.5707963267948966\ntheta = 0.6\n[joint.hinge.damper]\ndamping = 0.02\n"
        "[mark.mid]\non = \"arm\"\npoint = [0.0, 0.0]\n[mark.tip]\non = \"arm\"\n"
        "point = [0.5, 0.0]\n");
    Record("tracks.csv", {"mid", "tip", ""}, {}, 1);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string Put(const std::string& name, const std::string& text) const {
    data::WriteTextFile((folder_ / name).string(), text);
    return (folder_ / name).string();
  }

  // 4 s of it, a line every 10 ms, lit as the cycle says; 1 mm of noise.
  void Record(const std::string& file, const std::vector<std::string>& cycle,
              const std::vector<std::string>& set, std::uint64_t seed) const {
    SceneModelOptions options;
    options.scene = (folder_ / "arm.toml").string();
    options.set = set;
    options.rtol = 1e-9;
    const SceneModel model(options, {});
    correlate::Stamps stamps;
    stamps.marks = model.marks();
    stamps.t.resize(stamps.marks.size());
    std::vector<std::pair<std::size_t, std::size_t>> order;
    for (std::size_t k = 0; k < 400; ++k) {
      for (std::size_t m = 0; m < stamps.marks.size(); ++m) {
        if (cycle[k % cycle.size()] != stamps.marks[m]) continue;
        order.emplace_back(m, stamps.t[m].size());
        stamps.t[m].push_back(0.01 * static_cast<double>(k));
      }
    }
    const correlate::Prediction truth = model.Evaluate({}, stamps);
    Rng rng(seed);
    std::string text =
        "t [s],mark,x [m],y [m],z [m],cxx [m^2],cxy [m^2],cxz [m^2],cyy [m^2],cyz [m^2],czz "
        "[m^2]\n";
    for (const auto& [m, i] : order) {
      const Eigen::Vector3d p = truth.marks[m].p.col(static_cast<Eigen::Index>(i));
      text += fmt::format("{:.3f},{},{:.7f},{:.7f},{:.7f},1e-6,0,0,1e-6,0,1e-6\n", stamps.t[m][i],
                          stamps.marks[m], p.x() + 1e-3 * rng.Normal(), p.y() + 1e-3 * rng.Normal(),
                          1e-3 * rng.Normal());
    }
    Put(file, text);
  }

  data::Study Study(const std::string& tracks, const std::string& set = {}) const {
    return data::ReadStudy(Put(
        "study.toml",
        fmt::format("[study]\nscene = \"arm.toml\"\n[trial]\ntracks = \"{}\"\noffset = 0.0\n"
                    "frame = \"known\"\nset = [{}]\n"
                    "[parameter.damping]\nkeys = [\"joint.hinge.damper.damping\"]\nstart = 0.02\n"
                    "bounds = [0.001, 0.2]\n"
                    "[parameter.gravity]\nkeys = [\"gravity.acceleration[1]\"]\nstart = -9.8\n"
                    "bounds = [-11.0, -9.0]\n",
                    tracks, set)));
  }

  // The standard errors of the data that a fit of such a record has.
  std::vector<double> Fitted(const std::string& tracks, const std::string& set = {}) const {
    const StudyFit fit = Fit(Study(tracks, set));
    EXPECT_TRUE(fit.Usable());
    std::vector<double> out;
    for (const auto& e : fit.result.parameters) out.push_back(e.sigma_data);
    return out;
  }

  // A clamped beam of four segments that is let go, its stiffness sought from a record of sixteen.
  data::Study BeamStudy(const std::string& set = {}) const {
    Put("beam.toml",
        "[scene]\nname = \"beam\"\nduration = 0.5\n[gravity]\nacceleration = [0.0, -9.81]\n"
        "[beam.a]\nlength = 1.0\nmass = 0.5\nEI = 2.0\nsegments = 4\ndamping = 1e-3\n"
        "[weld.clamp]\ninner = \"ground\"\nouter = \"a.start\"\n[mark.tip]\non = \"a.end\"\n");
    SceneModelOptions options;
    options.scene = (folder_ / "beam.toml").string();
    options.set = {"beam.a.segments=16"};
    options.rtol = 1e-8;
    const SceneModel model(options, {});
    correlate::Stamps stamps;
    stamps.marks = {"tip"};
    stamps.t.resize(1);
    for (int i = 0; i < 200; ++i) stamps.t[0].push_back(0.0025 * i);
    const correlate::Prediction truth = model.Evaluate({}, stamps);
    Rng rng(1);
    std::string text =
        "t [s],mark,x [m],y [m],z [m],cxx [m^2],cxy [m^2],cxz [m^2],cyy [m^2],cyz [m^2],czz "
        "[m^2]\n";
    for (int i = 0; i < 200; ++i) {
      const Eigen::Vector3d p = truth.marks[0].p.col(i);
      text += fmt::format("{:.4f},tip,{:.8f},{:.8f},{:.8f},1e-8,0,0,1e-8,0,1e-8\n",
                          stamps.t[0][static_cast<std::size_t>(i)], p.x() + 1e-4 * rng.Normal(),
                          p.y() + 1e-4 * rng.Normal(), 1e-4 * rng.Normal());
    }
    Put("tip.csv", text);
    return data::ReadStudy(Put(
        "beam_study.toml",
        fmt::format("[study]\nscene = \"beam.toml\"\nset = [{}]\n[trial]\ntracks = \"tip.csv\"\n"
                    "offset = 0.0\nframe = \"known\"\n"
                    "[parameter.EI]\nkeys = [\"beam.a.EI\"]\nstart = 2.1\nbounds = [1.0, 4.0]\n"
                    "[profile]\nlevels = []\n",
                    set)));
  }

  std::filesystem::path folder_;
};

}  // namespace unfurl::study
