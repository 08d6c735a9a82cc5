#include "study/scene_model.h"

#include <algorithm>
#include <ctime>
#include <memory>

#include "base/cpu_time.h"
#include "base/error.h"
#include "data/scene.h"
#include "sim/dynamics/observables.h"
#include "sim/record/record.h"

namespace unfurl::study {

SceneModel::SceneModel(SceneModelOptions options, std::span<const double> theta)
    : options_(std::move(options)), document_(options_.scene, options_.set, options_.texts) {
  options_.texts = nullptr;
  const data::Scene scene = FirstScene(theta);
  quantities_ = sim::Observables(sim::Compile(scene)).quantities();
  duration_ = scene.duration;
  files_ = scene.files;
  beams_ = scene.beams;
  joint_records_ = scene.joints;
  for (const data::SceneMark& mark : scene.marks) marks_.push_back(mark.name);
  for (const data::SceneJoint& joint : scene.joints) joints_.push_back(joint.name);
  for (const data::SceneWatch& watch : scene.watches) watches_.push_back(watch.name);
}

data::Scene SceneModel::FirstScene(std::span<const double> theta) const {
  try {
    return SceneAt(theta);
  } catch (const Error&) {
    // What is wrong without the parameters, too, has a line in its file.
    data::ReadScene(document_.table(), options_.scene);
    throw;
  }
}

data::Scene SceneModel::SceneAt(std::span<const double> theta) const {
  std::vector<data::TomlDocument::Value> values;
  for (std::size_t j = 0; j < options_.keys.size(); ++j) {
    for (const std::string& key : options_.keys[j]) values.push_back({key, theta[j]});
  }
  return data::ReadScene(document_.With(values), options_.scene);
}

correlate::Prediction SceneModel::Evaluate(std::span<const double> theta,
                                           const correlate::Stamps& stamps) const {
  const double start = CpuSeconds(CLOCK_THREAD_CPUTIME_ID);
  const MotionRequest wanted = MotionRequest::For(theta, stamps);
  correlate::Prediction out =
      motions_
          .Get(wanted,
               [&] {
                 const sim::Model model = sim::Compile(SceneAt(theta));
                 return std::make_shared<const SceneMotion>(model, wanted, options_.rtol);
               })
          ->At(stamps);
  out.seconds = CpuSeconds(CLOCK_THREAD_CPUTIME_ID) - start;
  return out;
}

data::Run SceneModel::RunAt(std::span<const double> theta, double duration) const {
  sim::RecordOptions options;
  options.simulate.emplace();
  options.simulate->rtol = options_.rtol;
  options.simulate->duration = duration;
  constexpr double kPictures = 400.0, kSamplesEach = 4.0;  // whatever the duration
  options.shape_rate = kPictures / duration;
  options.simulate->rate = std::min(kSamplesEach * *options.shape_rate, sim::UsualRate(duration));
  for (const std::string& mark : marks_) {
    options.quantities.push_back(mark + ".x");
    options.quantities.push_back(mark + ".y");
  }
  return sim::Record(sim::CompileModel(SceneAt(theta)), options).run;
}

}  // namespace unfurl::study
