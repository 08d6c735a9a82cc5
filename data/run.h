#pragma once

#include <Eigen/Core>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "data/h5.h"
#include "data/provenance.h"

namespace unfurl::data {

// What a simulation leaves: sampled quantities, events, and a summary. Names and units:
// docs/formats.md; among them t, BODY.x/.y/.theta, JOINT.theta/.theta_rate/.contact_moment/
// .spring_moment, MARK.x/.y/.vx/.vy (in the model's plane), energy.*.
struct Quantity {
  std::string name;  // "hub.x"
  std::string units;
  std::string description;
};

struct RunEvent {
  double t = 0.0;                      // [s]
  std::string kind;                    // "latch", "contact_start", "contact_end"
  std::string where;                   // joint
  std::map<std::string, double> data;  // by name with unit: "theta_rate [rad/s]"
};

inline constexpr char kRunSchema[] = "unfurl/run";
inline constexpr int kRunVersion = 1;

// Streams rows to disk in constant memory; the file gets its name on Commit.
class RunWriter {
 public:
  // `quantities` without t, which every run has first. `marks` are the mark names, in order.
  RunWriter(const std::string& path, const Provenance& provenance, std::vector<Quantity> quantities,
            std::vector<std::string> marks);
  ~RunWriter();
  // `values` in the order of `quantities`.
  void Append(double t, std::span<const double> values);
  void AddEvent(RunEvent event);
  // One number of the summary: steps, evaluations, seconds by part, drift, impacts, ...
  void SetSummary(const std::string& name, double value, const std::string& units);
  void SetText(const std::string& name, const std::string& text);  // "method", "scene" (its TOML)
  void Commit();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

struct Run {
  std::vector<double> t;                     // n [s]
  std::vector<Quantity> quantities;          // q, without t
  std::vector<std::vector<double>> columns;  // q of n values each
  std::vector<std::string> marks;
  std::vector<RunEvent> events;
  std::map<std::string, double> summary;
  std::map<std::string, std::string> text;

  int Find(const std::string& name) const;                           // -1 when absent
  const std::vector<double>& Column(const std::string& name) const;  // throws Error when absent
};
Run ReadRun(const std::string& path);

}  // namespace unfurl::data
