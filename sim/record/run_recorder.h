#pragma once

#include <array>
#include <vector>

#include "base/progress.h"
#include "data/run.h"
#include "sim/dynamics/observables.h"
#include "sim/methods/simulate.h"

namespace unfurl::sim {

// What happened at one latch, counted as it happens.
struct LatchCount {
  bool latched = false;
  double latch_time = 0.0, latch_rate = 0.0;  // [s], [rad/s]
  long upper = 0, lower = 0, ended = 0;       // impacts by stop; those that have ended

  void AddRestitution(double value);
  // Over the impacts that ended, to 0.001; NaN without any.
  double MedianRestitution() const;

 private:
  // Up to 2. A stop alone gives 1 at most; what load adds beyond counts in the last bin.
  static constexpr int kBins = 2000;
  std::vector<long> bins_;  // of 0.001 from 0 on; made when first needed
};

class Certificate;

// Writes samples, beam shapes and events to a run as they occur, in constant memory.
class RunRecorder : public Observer {
 public:
  // `quantities`: patterns of names to keep; empty: all. `shape_rate`: beam shapes per second, 0:
  // none. `rate`: samples per second.
  RunRecorder(const Model& model, const std::vector<std::string>& quantities, double shape_rate,
              double rate, bool progress);

  // What the file will hold; `scene` is the scene's text.
  data::RunLayout Layout(const std::string& scene, bool profile) const;
  int shape_every() const { return shape_every_; }  // samples; 0: no shapes
  // Before Layout; the certificate outlives the run. Null: none.
  void SetCertificate(Certificate* certificate) { certificate_ = certificate; }
  void SetSink(data::RunSink* sink) { sink_ = sink; }
  // The summary of a run that ended, or of one that was interrupted (report without steps).
  void Finish(const SimulateReport& report, const std::string& status, const std::string& message,
              bool profile);

  void OnSample(double t, double* state, const std::vector<LatchMode>& modes) override;
  void OnWay(const Motion& motion, const std::vector<LatchMode>& modes) override;
  void OnEvent(const Event& event) override;
  void OnProgress(double fraction) override;

  const Observables& observables() const { return observables_; }
  const LatchCount& latch(int k) const { return latches_[static_cast<std::size_t>(k)]; }
  double worst_residual() const { return worst_residual_; }
  double last_time() const { return last_time_; }  // of a sample [s]
  long samples() const { return samples_; }
  long events() const { return events_; }
  long impacts() const;

 private:
  const Model& model_;
  Observables observables_;
  data::RunSink* sink_ = nullptr;
  Certificate* certificate_ = nullptr;
  std::vector<double> row_;  // with the certificate's columns [Quantity::units]
  Progress progress_;
  int shape_every_ = 0;
  std::vector<LatchCount> latches_;
  double worst_residual_ = 0.0, last_time_ = 0.0;  // [J], [s]
  long samples_ = 0, events_ = 0;
  long looks_ = 0;  // at the progress
};

}  // namespace unfurl::sim
