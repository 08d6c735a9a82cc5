#include "sim/record/run_recorder.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "sim/methods/events.h"
#include "sim/record/certificate.h"

namespace unfurl::sim {

namespace {

constexpr double kBinWidth = 0.001;  // of a restitution [-]; medians are known to half of it
// Samples that wait in a buffer go to the disk after so many looks, some seconds of work. Work is
// counted, not timed, so that the same run gives the same bytes.
constexpr int kFlushLooks = 300;

std::string LimitKey(int k) {
  std::string key = LimitName(static_cast<StepLimit>(k));
  std::replace(key.begin(), key.end(), ' ', '_');
  return key;
}

}  // namespace

void LatchCount::AddRestitution(double value) {
  if (bins_.empty()) bins_.assign(kBins, 0);
  const double bin = std::isfinite(value) ? value / kBinWidth : 0.0;
  ++bins_[static_cast<std::size_t>(std::clamp(bin, 0.0, kBins - 1.0))];
  ++ended;
}

double LatchCount::MedianRestitution() const {
  if (ended == 0) return std::nan("");
  long below = 0;
  for (int k = 0; k < kBins; ++k) {
    below += bins_[static_cast<std::size_t>(k)];
    if (2 * below >= ended) return (k + 0.5) * kBinWidth;
  }
  return std::nan("");
}

RunRecorder::RunRecorder(const Model& model, const std::vector<std::string>& quantities,
                         double shape_rate, double rate, bool progress)
    : model_(model),
      observables_(model, quantities),
      progress_("simulate", progress),
      latches_(static_cast<std::size_t>(model.latches.count())) {
  if (shape_rate > 0.0) {
    constexpr double kRounding = 1.0 + 1e-9;  // of a quotient that is a whole number
    shape_every_ = static_cast<int>(std::max(1.0, std::floor(kRounding * rate / shape_rate)));
  }
}

data::RunLayout RunRecorder::Layout(const std::string& scene, bool profile) const {
  data::RunLayout layout;
  layout.quantities = observables_.quantities();
  if (certificate_ != nullptr) certificate_->Bind(&layout.quantities);
  layout.marks = observables_.marks();
  if (shape_every_ > 0) layout.shapes = observables_.shapes();
  layout.event_data = {{"theta_rate", "rad/s", "rate of the joint's angle"},
                       {"stop", "1", "1: upper stop, -1: lower"},
                       {"duration", "s", "how long the contact lasted"},
                       {"restitution", "1", "-rate at the end / rate at the start"},
                       {"direction", "1", "of a watched quantity: 1 rising, -1 falling"}};
  for (int k = 0; k < model_.watches.count(); ++k) {
    layout.event_places.push_back(model_.watches.at(k).name);
  }
  layout.summary = {{"t_end", "s", "time reached"},
                    {"steps", "1", "steps taken"},
                    {"rejected", "1", "steps tried in vain"},
                    {"evaluations", "1", "of the right side"},
                    {"projections", "1", "times that drift was removed"},
                    {"near_dependence", "1",
                     "times that constraints came near to depending on "
                     "one another"},
                    {"repartitions", "1", "times that the coordinates were chosen anew"},
                    {"impacts", "1", "contacts that began"},
                    {"largest_position_drift", "m", "of a constraint, before it was removed"},
                    {"largest_velocity_drift", "m/s", "of a constraint, before it was removed"},
                    {"largest_energy_residual", "J", "largest magnitude of energy.residual"}};
  for (int k = 0; k < kStepLimits; ++k) {
    layout.summary.push_back(
        {"limit." + LimitKey(k), "1", "steps that this kept from being longer"});
  }
  for (const Model::Joint& joint : model_.joints) {
    layout.event_places.push_back(joint.name);
    const auto add = [&](const char* name, const char* units, const char* what) {
      layout.summary.push_back({joint.name + "." + name, units, what});
    };
    add("peak_pin_force", "N", "largest force at the pin; none where that is not known");
    add("peak_pin_time", "s", "when");
    if (joint.latch < 0) continue;
    add("peak_moment", "N m", "largest moment of contact");
    add("peak_time", "s", "when");
    add("latch_time", "s", "when the latch closed");
    add("latch_rate", "rad/s", "rate of the angle then");
    add("torque_margin", "1", "least driving over resisting moment before the latch closed");
    add("torque_margin_theta", "rad", "where");
    add("least_driving_moment", "N m", "before the latch closed");
    add("least_driving_theta", "rad", "where");
  }
  if (certificate_ != nullptr) {
    for (const Certificate::Line& line : certificate_->LoadLines({})) {
      layout.summary.push_back({line.name + ".error_time", line.units,
                                "of time stepping, in the largest load, estimated"});
      if (certificate_->mesh().empty()) continue;
      layout.summary.push_back(
          {line.name + ".error_mesh", line.units, "of the mesh, in the largest load, estimated"});
    }
  }
  if (profile) {
    for (int part = 0; part < Dynamics::kParts; ++part) {
      layout.summary.push_back(
          {fmt::format("seconds.{}", Dynamics::PartName(part)), "s", "of computing, by part"});
    }
    layout.summary.push_back({"seconds.all", "s", "of computing"});
  }
  layout.text["scene"] = scene;
  return layout;
}

void RunRecorder::Finish(const SimulateReport& report, const std::string& status,
                         const std::string& message, bool profile) {
  sink_->SetText("status", status);
  sink_->SetText("message", message);
  sink_->SetText("method", report.method);
  if (!report.stopped_by.empty()) sink_->SetText("stopped_by", report.stopped_by);
  sink_->SetSummary("t_end", report.steps > 0 ? report.t_end : last_time_);
  sink_->SetSummary("impacts", static_cast<double>(impacts()));
  sink_->SetSummary("largest_energy_residual", worst_residual_);
  for (const Model::Joint& joint : model_.joints) {
    if (joint.latch < 0) continue;
    const LatchCount& count = latch(joint.latch);
    if (count.latched) {
      sink_->SetSummary(joint.name + ".latch_time", count.latch_time);
      sink_->SetSummary(joint.name + ".latch_rate", count.latch_rate);
    }
    const auto j = static_cast<int>(&joint - model_.joints.data());
    const TorqueMargin& margin = observables_.margins().of(j);
    if (margin.resisted()) {
      sink_->SetSummary(joint.name + ".torque_margin", margin.ratio);
      sink_->SetSummary(joint.name + ".torque_margin_theta", margin.ratio_theta);
    }
    if (margin.seen()) {
      sink_->SetSummary(joint.name + ".least_driving_moment", margin.least_driving);
      sink_->SetSummary(joint.name + ".least_driving_theta", margin.least_theta);
    }
  }
  if (report.steps == 0) return;  // interrupted: the rest is not known
  const auto set = [&](const std::string& name, auto value) {
    sink_->SetSummary(name, static_cast<double>(value));
  };
  set("steps", report.steps);
  set("rejected", report.rejected);
  set("evaluations", report.evaluations);
  set("projections", report.projections);
  set("repartitions", report.repartitions);
  set("near_dependence", report.near_dependence);
  set("largest_position_drift", report.largest_position_drift);
  set("largest_velocity_drift", report.largest_velocity_drift);
  for (int k = 0; k < kStepLimits; ++k) {
    set("limit." + LimitKey(k), report.limited[static_cast<std::size_t>(k)]);
  }
  for (std::size_t j = 0; j < model_.joints.size(); ++j) {
    const Model::Joint& joint = model_.joints[j];
    if (!report.PinForceUnknown(j)) set(joint.name + ".peak_pin_force", report.peak_pin_force[j]);
    set(joint.name + ".peak_pin_time", report.peak_pin_time[j]);
    if (joint.latch < 0) continue;
    set(joint.name + ".peak_moment", report.peak_moment[static_cast<std::size_t>(joint.latch)]);
    set(joint.name + ".peak_time", report.peak_time[static_cast<std::size_t>(joint.latch)]);
  }
  if (certificate_ != nullptr) {
    for (const Certificate::Line& line : certificate_->LoadLines(report)) {
      set(line.name + ".error_time", line.time);
      if (!certificate_->mesh().empty()) set(line.name + ".error_mesh", line.mesh);
    }
  }
  if (!profile) return;
  for (int part = 0; part < Dynamics::kParts; ++part) {
    set(fmt::format("seconds.{}", Dynamics::PartName(part)), report.PartSeconds(part));
  }
  set("seconds.all", report.seconds);
}

void RunRecorder::OnSample(double t, double* state, const std::vector<LatchMode>& modes) {
  const std::vector<double>& row = observables_.Row(t, state, modes);
  if (certificate_ == nullptr) {
    sink_->Append(t, row);
  } else {
    const std::vector<double>& errors = certificate_->Add(row);
    row_.assign(row.begin(), row.end());
    row_.insert(row_.end(), errors.begin(), errors.end());
    sink_->Append(t, row_);
  }
  if (shape_every_ > 0 && samples_ % shape_every_ == 0) {
    sink_->AppendShapes(t, observables_.ShapeRow(t, state));
  }
  worst_residual_ = std::max(worst_residual_, std::abs(observables_.residual()));
  last_time_ = t;
  ++samples_;
}

void RunRecorder::OnWay(const Motion& motion, const std::vector<LatchMode>& modes) {
  observables_.WatchMargins(motion, modes);
}

void RunRecorder::OnEvent(const Event& event) {
  data::RunEvent record;
  record.t = event.t;
  record.kind = EventName(event.kind);
  record.where = PlaceOf(model_, event);
  ++events_;
  if (event.kind == EventKind::kWatch) {
    record.data["direction [1]"] = event.upper ? 1.0 : -1.0;
    sink_->AddEvent(record);
    return;
  }
  record.data["theta_rate [rad/s]"] = event.theta_rate;
  LatchCount& count = latches_[static_cast<std::size_t>(event.latch)];
  if (event.kind == EventKind::kLatch) {
    count.latched = true;
    count.latch_time = event.t;
    count.latch_rate = event.theta_rate;
  } else {
    record.data["stop [1]"] = event.upper ? 1.0 : -1.0;
  }
  if (event.kind == EventKind::kContactStart) ++(event.upper ? count.upper : count.lower);
  if (event.kind == EventKind::kContactEnd) {
    record.data["duration [s]"] = event.duration;
    record.data["restitution [1]"] = event.restitution;
    count.AddRestitution(event.restitution);
  }
  sink_->AddEvent(record);
}

void RunRecorder::OnProgress(double fraction) {
  if (++looks_ % kFlushLooks == 0) sink_->Flush();
  progress_.Update(fraction);
}

long RunRecorder::impacts() const {
  long sum = 0;
  for (const LatchCount& count : latches_) sum += count.upper + count.lower;
  return sum;
}

}  // namespace unfurl::sim
