#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "base/random.h"
#include "data/atomic_file.h"
#include "data/study.h"
#include "study/scene_model.h"
#include "tests/own_folder.h"

namespace unfurl::study {

// A pendulum whose angle an encoder records, with laws of damping and a spring beside its gravity.
class SwingTest : public ::testing::Test {
 protected:
  // What is in a pendulum [N m s, N m s^2, N m/rad].
  struct Laws {
    double linear = 0.0, quadratic = 0.0, stiffness = 0.0;
  };

  std::string Put(const std::string& name, const std::string& text) const {
    data::WriteTextFile((folder_ / name).string(), text);
    return (folder_ / name).string();
  }

  static std::string Scene(const std::string& joint) {
    return "[scene]\nname = \"pendulum\"\nduration = 6.0\n"
           "[gravity]\nacceleration = [0.0, -9.81]\n"
           "[body.arm]\nmass = 1.0\ninertia = 0.08333333333333333\n"
           "[joint.hinge]\ninner = \"ground\"\nouter = \"arm\"\n"
           "outer_point = [-0.5, 0.0]\nzero_angle = -1.5707963267948966\n"
           "theta = 0.6\n" +
           joint + "[mark.tip]\non = \"arm\"\npoint = [0.5, 0.0]\n";
  }
  static std::string Scene(const Laws& laws) {
    std::string joint;
    auto add = [&](const char* law, const char* key, double value) {
      if (value > 0.0) joint += fmt::format("[joint.hinge.{}]\n{} = {}\n", law, key, value);
    };
    add("damper", "damping", laws.linear);
    add("quadratic_damper", "damping", laws.quadratic);
    add("spring", "stiffness", laws.stiffness);
    return Scene(joint);
  }

  // 580 readings of the angle, a line every 10 ms.
  void Record(const Laws& laws, double sigma, std::uint64_t seed) const {
    RecordScene(Scene(laws), sigma, seed);
  }
  // Of any scene with a hinge.
  void RecordScene(const std::string& scene, double sigma, std::uint64_t seed) const {
    SceneModelOptions options;
    options.scene = Put("truth.toml", scene);
    options.rtol = 1e-10;
    const SceneModel model(options, {});
    correlate::Stamps stamps;
    stamps.quantities.push_back({"a", "hinge.theta", {}});
    for (int i = 0; i < 580; ++i) stamps.quantities[0].t.push_back(0.01 * i);
    const correlate::Prediction truth = model.Evaluate({}, stamps);
    Rng rng(seed);
    std::string text = "t [s],angle [rad]\n";
    for (std::size_t i = 0; i < stamps.quantities[0].t.size(); ++i) {
      text += fmt::format(
          "{:.4f},{:.9f}\n", stamps.quantities[0].t[i],
          truth.quantities[0].values(static_cast<Eigen::Index>(i)) + sigma * rng.Normal());
    }
    Put("angle.csv", text);
  }

  // A study of a scene's file; `parameters` in TOML.
  data::Study StudyOf(const std::string& name, const std::string& scene, double sigma,
                      const std::string& parameters) const {
    return data::ReadStudy(
        Put(name + "_study.toml",
            fmt::format("[study]\nname = \"{}\"\nscene = \"{}\"\n[trial]\noffset = 0.0\n"
                        "[trial.channel.angle]\nfile = \"angle.csv\"\nquantity = \"hinge.theta\"\n"
                        "sigma = {}\n{}",
                        name, scene, sigma, parameters)));
  }

  // Laws of the joint, the number of each a parameter.
  data::Study LawStudy(const std::string& name, const std::vector<std::string>& laws) const {
    std::string joint, parameters;
    for (const std::string& law : laws) {
      joint += fmt::format("[joint.hinge.{}]\ndamping = 0.02\n", law);
      parameters += fmt::format(
          "[parameter.{}]\nkeys = [\"joint.hinge.{}.damping\"]\nstart = 0.02\n"
          "bounds = [1e-9, 0.2]\n",
          law, law);
    }
    Put(name + ".toml", Scene(joint));
    return StudyOf(name, name + ".toml", 1e-3, parameters);
  }

  const OwnFolder own_;
  const std::filesystem::path folder_ = own_.path();
};

}  // namespace unfurl::study
