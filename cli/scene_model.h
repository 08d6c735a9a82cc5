#pragma once

#include <string>
#include <vector>

#include "correlate/model.h"

namespace unfurl::cli {

// The simulator as a model to be fitted: a scene whose keys the parameters set.
struct SceneModelOptions {
  std::string scene;                           // path
  std::vector<std::string> set;                // fixed overrides, "dotted.key=value"
  std::vector<std::vector<std::string>> keys;  // by parameter: the keys that take its value
  double rtol = 1e-5;
};

class SceneModel : public correlate::Model {
 public:
  // Reads and compiles the scene once at `theta`, so that what is wrong in it is an Error here,
  // placed at its file, and not a failure of every evaluation.
  SceneModel(SceneModelOptions options, std::span<const double> theta);

  // Simulates to the last stamp. Events are those of the joints. Noise: how far the marks move,
  // RMS, when the tolerance is ten times tighter; measured by MeasureNoise.
  correlate::Prediction Evaluate(std::span<const double> theta,
                                 const correlate::Stamps& stamps) const override;

  const std::vector<std::string>& marks() const { return marks_; }
  double duration() const { return duration_; }  // the scene's [s]

  // One run at each of two tolerances; what they differ by is noise() from then on.
  void MeasureNoise(std::span<const double> theta, const correlate::Stamps& stamps,
                    std::size_t workers);
  double noise() const { return noise_; }  // [m]

 private:
  correlate::Prediction Run(std::span<const double> theta, const correlate::Stamps& stamps,
                            double rtol) const;
  std::vector<std::string> Overrides(std::span<const double> theta) const;

  SceneModelOptions options_;
  std::vector<std::string> marks_;
  double duration_ = 0.0;
  double noise_ = 0.0;
};

}  // namespace unfurl::cli
