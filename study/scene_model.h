#pragma once

#include <string>
#include <vector>

#include "correlate/model.h"
#include "data/scene.h"

namespace unfurl::study {

// The simulator as a model to be fitted: a scene whose keys the parameters set.
struct SceneModelOptions {
  std::string scene;                           // path
  std::vector<std::string> set;                // fixed overrides, "dotted.key=value"
  std::vector<std::vector<std::string>> keys;  // by parameter: the keys that take its value
  double rtol = 1e-5;                          // [-]
};

class SceneModel : public correlate::Model {
 public:
  // Reads and compiles the scene once at `theta`, so that what is wrong in it is an Error here,
  // placed at its file, and not a failure of every evaluation.
  SceneModel(SceneModelOptions options, std::span<const double> theta);

  // Simulates to the last stamp. Events are those of the joints.
  correlate::Prediction Evaluate(std::span<const double> theta,
                                 const correlate::Stamps& stamps) const override;

  const std::vector<std::string>& marks() const { return marks_; }
  const std::vector<std::string>& joints() const { return joints_; }
  const std::vector<std::string>& watches() const { return watches_; }
  const std::vector<std::string>& files() const { return files_; }  // that the scene came from
  const std::vector<data::SceneBeam>& beams() const { return beams_; }
  double duration() const { return duration_; }  // the scene's [s]

 private:
  std::vector<std::string> Overrides(std::span<const double> theta) const;

  SceneModelOptions options_;
  std::vector<std::string> marks_, joints_, watches_, files_;
  std::vector<data::SceneBeam> beams_;
  double duration_ = 0.0;  // [s]
};

}  // namespace unfurl::study
