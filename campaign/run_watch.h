#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "data/campaign.h"
#include "sim/dynamics/observables.h"
#include "sim/methods/simulate.h"

namespace unfurl::campaign {

/// Responses of a scene's run, gathered while it runs, in constant memory.
class RunWatch : public sim::Observer {
 public:
  /// Throws Error (file:line:key) for a quantity, a joint or a watch that the model does not have.
  RunWatch(const sim::Model& model, const std::vector<data::CampaignResponse>& responses);

  /// Some response is of a quantity in time.
  bool WantsSamples() const { return observables_.has_value(); }

  void OnSample(double t, double* state, const std::vector<sim::LatchMode>& modes) override;
  void OnEvent(const sim::Event& event) override;
  void OnProgress(double fraction) override;

  /// Of the run that has ended: NaN where it has none, and for those that are not the run's own.
  void Finish(std::span<double> responses) const;

 private:
  // Of a quantity, over the samples of its window.
  struct Tally {
    std::size_t column = 0;
    long count = 0;
    double last_t = 0.0, last = 0.0;                  // sample before [s, unit]
    double low = 0.0, high = 0.0;                     // [unit]
    double integral = 0.0, square = 0.0, span = 0.0;  // by trapezoids [unit s, unit^2 s, s]
    double at = 0.0;                                  // where it is asked for [unit]
    bool known_at = false;
  };
  // Of an event.
  struct Count {
    long number = 0;
    double time = 0.0;       // of the one that is asked for [s]
    std::vector<int> where;  // by latch: how often it was seen
    bool all = false;        // every latch of the scene is meant
  };
  void AddSample(const data::CampaignResponse& r, double t, double value, Tally* tally);
  void Observe(const sim::Model& model);
  void CheckPlace(const data::CampaignResponse& r) const;
  double Of(const data::CampaignResponse& r, const Tally& tally) const;
  double Of(const data::CampaignResponse& r, const Count& count) const;

  const sim::Model& model_;
  const std::vector<data::CampaignResponse>& responses_;
  std::optional<sim::Observables> observables_;
  std::vector<Tally> tallies_;  // by response; unused for others
  std::vector<Count> counts_;   // likewise
};

}  // namespace unfurl::campaign
