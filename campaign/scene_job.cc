#include "campaign/scene_job.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "base/error.h"
#include "base/progress.h"
#include "base/text.h"
#include "campaign/responses.h"
#include "campaign/run_watch.h"
#include "data/scene.h"
#include "sim/dynamics/observables.h"
#include "sim/methods/simulate.h"

namespace unfurl::campaign {

namespace {

using data::CampaignResponse;

class SceneJob : public Job {
 public:
  SceneJob(const data::Campaign& plan, std::span<const double> typical)
      : variables_(plan.variables),
        responses_(plan.responses),
        job_(plan.job),
        document_(plan.job.scene, plan.job.set),
        derived_(plan) {
    const data::Scene scene = FirstScene(typical);
    files_ = scene.files;
    const sim::Model model = sim::Compile(scene);
    const RunWatch look(model, responses_);  // names of quantities and joints
  }

  RunOutcome Run(std::uint64_t /*index*/, std::span<const double> values,
                 std::span<double> responses) override {
    std::fill(responses.begin(), responses.end(), std::numeric_limits<double>::quiet_NaN());
    try {
      const sim::Model model = sim::Compile(SceneAt(values));
      RunWatch watch(model, responses_);
      sim::SimulateOptions options;
      options.rtol = job_.rtol;
      options.duration = job_.duration;
      options.rate = watch.WantsSamples() ? SampleRate(model) : 1.0;
      options.track_forces = false;
      const sim::SimulateReport report = sim::Simulate(model, options, &watch);
      if (!report.Usable()) return {false, report.message};
      watch.Finish(responses);
    } catch (const Error& e) {
      return {false, e.what()};
    }
    derived_.Finish(values, responses);
    return {true, {}};
  }

  std::vector<std::string> inputs() const override { return files_; }

 private:
  double SampleRate(const sim::Model& model) const {  // [1/s]
    if (job_.rate > 0.0) return job_.rate;
    return sim::UsualRate(job_.duration > 0.0 ? job_.duration : model.duration);
  }

  data::Scene SceneAt(std::span<const double> values) const {
    std::vector<data::TomlDocument::Value> set;
    for (std::size_t j = 0; j < variables_.size(); ++j) {
      for (const std::string& key : variables_[j].keys) set.push_back({key, values[j]});
    }
    return data::ReadScene(document_.With(set), job_.scene);
  }

  data::Scene FirstScene(std::span<const double> typical) const {
    try {
      return SceneAt(typical);
    } catch (const Error&) {
      // What is wrong without the variables, too, has a line in its file.
      data::ReadScene(document_.table(), job_.scene);
      throw;
    }
  }

  std::vector<data::CampaignVariable> variables_;
  std::vector<CampaignResponse> responses_;
  data::CampaignJob job_;
  data::TomlDocument document_;
  DerivedResponses derived_;
  std::vector<std::string> files_;
};

}  // namespace

std::unique_ptr<Job> MakeSceneJob(const data::Campaign& plan, std::span<const double> typical) {
  return std::make_unique<SceneJob>(plan, typical);
}

}  // namespace unfurl::campaign
