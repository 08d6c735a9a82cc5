#pragma once

#include <optional>
#include <string>
#include <vector>

#include "data/toml.h"

namespace unfurl::data {

// What is to be learnt from which trial with which model, as a person wrote it; every key is in
// docs/study.md. Paths are relative to the study's own folder.
struct StudyParameter {
  std::string name;
  std::string unit;               // as the scene's keys have it
  std::vector<std::string> keys;  // of the scene; all get the parameter's value
  double start = 0.0;
  double low = 0.0, high = 0.0;  // bounds
  bool log = false;              // the solver moves the logarithm
  struct Prior {
    double mean = 0.0, sigma = 0.0;  // a normal density, in the parameter's unit
  };
  std::optional<Prior> prior;
  std::string where;  // file:line:key, for messages
};

struct StudyTrial {
  std::string tracks;                          // path
  std::vector<std::string> marks;              // empty: all of the tracks
  double window_low = 0.0, window_high = 0.0;  // on the tracks' clock [s]; equal: all
  std::string where;
};

// The same scene with less error of its own, to see what that error does to the parameters.
struct StudyMeshCheck {
  std::vector<std::string> keys;  // of the scene: the numbers of segments
  double value = 0.0;             // what they are set to
  double spacing_ratio = 2.0;     // coarse spacing over fine, > 1
  double order = 2.0;             // the error falls with spacing^order
};

struct Study {
  std::string name;
  std::string path;              // of the study itself
  std::string scene;             // path
  std::vector<std::string> set;  // overrides of the scene, "dotted.key=value"
  std::vector<StudyTrial> trials;
  std::vector<StudyParameter> parameters;
  double rtol = 1e-5;          // of the simulator
  std::vector<double> stages;  // ends of a growing horizon on the run's clock [s], rising
  int max_iterations = 25;     // per stage
  std::optional<StudyMeshCheck> mesh_check;
};

// Throws Error (file:line:key).
Study ReadStudy(const std::string& path, const std::vector<std::string>& overrides = {});
Study ParseStudy(const std::string& text, const std::string& name);

}  // namespace unfurl::data
