#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "correlate/model.h"
#include "data/run.h"
#include "data/scene.h"
#include "data/toml.h"
#include "study/scene_motion.h"

namespace unfurl::study {

// The simulator as a model to be fitted: a scene whose keys the parameters set.
struct SceneModelOptions {
  std::string scene;  // path
  // Texts already read, which other models share: all of them then see one scene. Null: from disk.
  data::TextFiles* texts = nullptr;
  std::vector<std::string> set;                // fixed overrides, "dotted.key=value"
  std::vector<std::vector<std::string>> keys;  // by parameter: the keys that take its value
  double rtol = 1e-5;                          // [-]
};

class SceneModel : public correlate::Model {
 public:
  // Reads the scene once, and compiles it at `theta`, so that what is wrong in it is an Error here,
  // placed at its file, and not a failure of every evaluation. No file is read after that.
  SceneModel(SceneModelOptions options, std::span<const double> theta);

  // Simulates past the last stamp. Events are those of the joints. Motions are kept for a while: a
  // point that is asked at other stamps costs nothing more.
  correlate::Prediction Evaluate(std::span<const double> theta,
                                 const correlate::Stamps& stamps) const override;

  // The run at `theta` until `duration` [s] in memory: marks and shapes, for pictures. Not usable:
  // as its status says. Throws Error for values that the scene refuses.
  data::Run RunAt(std::span<const double> theta, double duration) const;

  // Of the nearest of the motions that are kept; none: nothing was simulated here.
  std::optional<std::vector<std::string>> WarningsNear(std::span<const double> theta) const {
    return motions_.WarningsNear(theta);
  }

  const std::vector<std::string>& marks() const { return marks_; }
  const std::vector<std::string>& joints() const { return joints_; }
  const std::vector<std::string>& watches() const { return watches_; }
  const std::vector<std::string>& files() const { return files_; }  // that the scene came from
  const std::vector<data::SceneBeam>& beams() const { return beams_; }
  const std::vector<data::SceneJoint>& joint_records() const { return joint_records_; }
  const std::vector<data::Quantity>& quantities() const { return quantities_; }  // of its run
  double duration() const { return duration_; }                                  // the scene's [s]

 private:
  data::Scene SceneAt(std::span<const double> theta) const;
  data::Scene FirstScene(std::span<const double> theta) const;

  SceneModelOptions options_;
  data::TomlDocument document_;
  std::vector<std::string> marks_, joints_, watches_, files_;
  std::vector<data::SceneBeam> beams_;
  std::vector<data::SceneJoint> joint_records_;
  std::vector<data::Quantity> quantities_;
  double duration_ = 0.0;  // [s]
  mutable MotionStore motions_;
};

}  // namespace unfurl::study
