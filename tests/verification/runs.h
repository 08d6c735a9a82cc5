#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <string>
#include <vector>

#include "data/scene.h"
#include "sim/dynamics/observables.h"
#include "sim/methods/simulate.h"
#include "tests/source_dir.h"

namespace unfurl::sim {

inline std::string SetPath(const std::string& file) {
  return std::string(UNFURL_SOURCE_DIR) + "/data/sets/" + file;
}
inline data::Scene ReadSet(const std::string& file,
                           const std::vector<std::string>& overrides = {}) {
  return data::ReadScene(SetPath(file), overrides);
}

// Every sampled quantity of a run by its column's name, and the balances.
struct Recorder : Observer {
  explicit Recorder(const Model& model) : observables(model) {}
  void OnSample(double time, double* y, const std::vector<LatchMode>& modes) override {
    t.push_back(time);
    rows.push_back(observables.Row(time, y, modes));
    const Balance& b = observables.balance();
    kinetic = std::max(kinetic, b.kinetic);
    drift = std::max(drift, b.position_drift);
  }
  std::vector<double> operator[](const std::string& column) const {
    const auto& names = observables.quantities();
    for (std::size_t k = 0; k < names.size(); ++k) {
      if (names[k].name != column) continue;
      std::vector<double> values;
      for (const auto& row : rows) values.push_back(row[k]);
      return values;
    }
    ADD_FAILURE() << "no column " << column;
    return std::vector<double>(rows.size(), NAN);
  }

  Observables observables;
  SimulateReport report;
  std::vector<double> t;
  std::vector<std::vector<double>> rows;
  double kinetic = 0.0, drift = 0.0;  // largest
};

inline Recorder Record(const Model& model, const SimulateOptions& options) {
  Recorder recorder(model);
  recorder.report = Simulate(model, options, &recorder);
  EXPECT_TRUE(recorder.report.Usable()) << recorder.report.message;
  return recorder;
}

inline double LargestDifference(const std::vector<double>& a, const std::vector<double>& b) {
  if (a.size() != b.size()) return INFINITY;
  double worst = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double d = std::fabs(a[i] - b[i]);
    if (!(d <= worst)) worst = d;  // NaN counts
  }
  return worst;
}

inline double RootMeanSquareDifference(const std::vector<double>& a, const std::vector<double>& b) {
  if (a.size() != b.size() || a.empty()) return INFINITY;
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return std::sqrt(sum / static_cast<double>(a.size()));
}

// The error found must be below the tolerance; both are printed, for the table of
// docs/verification.md.
inline void ExpectWithin(const std::string& what, double error, double tolerance) {
  std::printf("found: %-58s error %.2e  tolerance %.1e\n", what.c_str(), error, tolerance);
  EXPECT_LE(error, tolerance) << what;
}

}  // namespace unfurl::sim
