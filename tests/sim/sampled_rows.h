#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "sim/dynamics/observables.h"
#include "sim/methods/simulate.h"

namespace unfurl::sim {

// Every sampled row of a run.
class SampledRows : public Observer {
 public:
  explicit SampledRows(const Model& model) : observables(model) {}
  void OnSample(double time, double* state, const std::vector<LatchMode>& modes) override {
    t.push_back(time);
    rows.push_back(observables.Row(time, state, modes));
  }
  double At(std::size_t row, const std::string& name) const {
    const auto& q = observables.quantities();
    const auto found =
        std::find_if(q.begin(), q.end(), [&](const data::Quantity& x) { return x.name == name; });
    EXPECT_NE(found, q.end()) << name;
    return rows[row][static_cast<std::size_t>(found - q.begin())];
  }
  Observables observables;
  std::vector<double> t;
  std::vector<std::vector<double>> rows;
};

inline SimulateOptions Sampled(double duration, double rate) {
  SimulateOptions options;
  options.duration = duration;
  options.rate = rate;
  options.rtol = 1e-10;
  return options;
}

}  // namespace unfurl::sim
