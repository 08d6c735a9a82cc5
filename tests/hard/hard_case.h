#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <ostream>
#include <string>
#include <vector>

#include "sim/dynamics/observables.h"
#include "sim/methods/simulate.h"
#include "sim/model/model.h"

namespace unfurl::sim {

/// A run to its end: what was sampled, by column.
class Outcome {
 public:
  Outcome(const Model& model, const SimulateOptions& options);
  double EndTime() const { return times_.back(); }  ///< of the last sample [s]
  double End(const std::string& column) const { return Row(rows_.size() - 1, column); }
  double Start(const std::string& column) const { return Row(0, column); }
  /// The largest magnitude of a column, and of its difference from where it started.
  double Largest(const std::string& column) const;
  double Farthest(const std::string& column) const;

  const Model& model;
  SimulateReport report;
  double energy_scale = 0.0;  ///< range of the kinetic energy, or the stored at the start [J]
  double residual = 0.0;      ///< largest of the balance of energy [J]

 private:
  friend struct Watch;
  int Column(const std::string& name) const;
  double Row(std::size_t row, const std::string& column) const {
    return rows_.at(row).at(Column(column));
  }
  std::vector<std::string> names_;
  std::vector<double> times_;
  std::vector<std::vector<double>> rows_;
};

/// How hard a case is, as NIST's problems of regression are graded: easy ones must be right by any
/// method and setting, hard ones may be refused by name.
enum class Grade { kEasy, kMedium, kHard };

/// A scene, and the truth about it from outside: a closed form, a conservation law, another method.
struct HardCase {
  const char* name;
  Grade grade;
  std::string toml;
  /// What holds of the run, if it is usable; none: it must not be.
  std::function<void(const Outcome&)> rule = {};
  /// Part of the message with which the scene, or the run, is refused; empty: it must not be.
  std::string refused = {};
  Method method = Method::kAuto;
  double rtol = 1e-8;
  bool runs_away = false;  ///< steps overflow and are given up: no traps
};
void PrintTo(const HardCase& c, std::ostream* out);

class HardCases : public testing::TestWithParam<HardCase> {};

/// Expects the last sample of a column within `tolerance` of a function of its time, or of a value.
std::function<void(const Outcome&)> Follows(const std::string& column,
                                            const std::function<double(double)>& truth,
                                            double tolerance);
std::function<void(const Outcome&)> Ends(const std::string& column, double value, double tolerance);

/// x and v at `end` of x'' = f(t, x, x'), by the classical Runge-Kutta method in 40,000 steps.
std::array<double, 2> Oscillate(const std::function<double(double, double, double)>& f, double x,
                                double v, double end);

// Parts of scenes.
std::string Scene(double duration, const std::string& rest);
std::string Body(const std::string& name, double mass, double inertia,
                 const std::string& more = {});
/// A revolute joint between points on the x axes of both sides.
std::string Pin(const std::string& name, const std::string& inner, double inner_x,
                const std::string& outer, double outer_x, const std::string& more = {});
std::string Weight(double g = 9.81);

}  // namespace unfurl::sim
