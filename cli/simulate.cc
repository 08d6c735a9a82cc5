#include "sim/simulate.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/progress.h"
#include "base/statistics.h"
#include "cli/verb.h"
#include "data/atomic_file.h"
#include "data/run.h"
#include "data/scene.h"
#include "sim/observables.h"

namespace unfurl::cli {

namespace {

using nlohmann::ordered_json;

struct Arguments {
  std::string scene, out;
  std::vector<std::string> sets;
  sim::SimulateOptions options;
};

// Writes every sample and event to the run file as it comes.
class RunRecorder : public sim::Observer {
 public:
  RunRecorder(const sim::Model& model, data::RunWriter* writer, bool progress)
      : model_(model), observables_(model), writer_(writer), progress_("simulate", progress) {}

  void OnSample(double t, double* state, const std::vector<sim::LatchMode>& modes) override {
    writer_->Append(t, observables_.Row(t, state, modes));
    const sim::Balance& b = observables_.balance();
    const double residual = b.Conserved() - observables_.energy_at_start();
    worst_residual_ = std::max(worst_residual_, std::abs(residual));
  }
  void OnEvent(const sim::Event& event) override {
    data::RunEvent record;
    record.t = event.t;
    record.kind = sim::EventName(event.kind);
    record.where = sim::PlaceOf(model_, event);
    if (event.kind == sim::EventKind::kWatch) {
      record.data["direction [1]"] = event.upper ? 1.0 : -1.0;
    } else {
      record.data["theta_rate [rad/s]"] = event.theta_rate;
      if (event.kind != sim::EventKind::kLatch) record.data["stop [1]"] = event.upper ? 1.0 : -1.0;
    }
    if (event.kind == sim::EventKind::kContactEnd) {
      record.data["duration [s]"] = event.duration;
      record.data["restitution [1]"] = event.restitution;
    }
    writer_->AddEvent(std::move(record));
  }
  void OnProgress(double fraction) override { progress_.Update(fraction); }

  const sim::Observables& observables() const { return observables_; }
  double worst_residual() const { return worst_residual_; }

 private:
  const sim::Model& model_;
  sim::Observables observables_;
  data::RunWriter* writer_;
  Progress progress_;
  double worst_residual_ = 0.0;
};

// What happened at each latch, as a table and as JSON.
std::string LatchTable(const sim::Model& model, const sim::SimulateReport& report,
                       ordered_json* json) {
  std::vector<std::vector<std::string>> rows = {{"joint", "latched [s]", "rate [rad/s]", "impacts",
                                                 "upper", "lower", "restitution", "peak [N m]",
                                                 "at [s]"}};
  for (const sim::Model::Joint& joint : model.joints) {
    if (joint.latch < 0) continue;
    std::string latched = "-", rate = "-";
    ordered_json entry = {{"joint", joint.name}, {"latched", nullptr}};
    const sim::EventLog::LatchCount& impacts = report.latch_counts[joint.latch];
    std::vector<double> restitution;
    for (const sim::Event& event : report.events) {
      if (event.latch != joint.latch) continue;
      if (event.kind == sim::EventKind::kLatch) {
        latched = fmt::format("{:.6f}", event.t);
        rate = fmt::format("{:.3f}", event.theta_rate);
        entry["latched"] = event.t;
        entry["rate"] = event.theta_rate;
      } else if (event.kind == sim::EventKind::kContactEnd) {
        restitution.push_back(event.restitution);
      }
    }
    const std::string median =
        restitution.empty() ? "-" : fmt::format("{:.3f}", Median(restitution));
    entry["impacts"] = impacts.upper + impacts.lower;
    entry["upper"] = impacts.upper;
    entry["lower"] = impacts.lower;
    entry["ended"] = impacts.ended;
    if (!restitution.empty()) entry["median_restitution"] = Median(restitution);
    entry["peak_moment"] = report.peak_moment[joint.latch];
    entry["peak_time"] = report.peak_time[joint.latch];
    json->push_back(entry);
    rows.push_back({joint.name, latched, rate, fmt::format("{}", impacts.upper + impacts.lower),
                    fmt::format("{}", impacts.upper), fmt::format("{}", impacts.lower), median,
                    fmt::format("{:.3f}", report.peak_moment[joint.latch]),
                    fmt::format("{:.4f}", report.peak_time[joint.latch])});
  }
  return AlignedTable(rows) +
         "(restitution: median over the impacts that ended, -rate at the end / "
         "rate at the start)\n";
}

std::string EnergyText(const sim::Balance& b, double start, double worst, ordered_json* json) {
  std::string text = fmt::format("energy at the end [J], of {:.6g} at the start\n", start);
  std::vector<std::vector<std::string>> rows;
  const auto add = [&](const char* name, double value) {
    (*json)[name] = value;
    if (value != 0.0) rows.push_back({fmt::format("  {}", name), fmt::format("{:.6f}", value)});
  };
  add("kinetic", b.kinetic);
  add("bending", b.bending);
  add("axial", b.axial);
  add("spring", b.spring);
  add("suspension", b.suspension);
  add("gravity", b.gravity);
  add("contact", b.contact);
  add("dissipated_contact", b.dissipated_contact);
  add("dissipated_beams", b.dissipated_beams);
  (*json)["start"] = start;
  (*json)["largest_residual"] = worst;
  rows.push_back({"  largest residual", fmt::format("{:.2e}", worst)});
  return text + AlignedTable(rows);
}

std::string ProfileText(const sim::SimulateReport& report, ordered_json* json) {
  std::vector<std::vector<std::string>> rows = {{"part", "share [%]", "seconds"}};
  double inside = 0.0;
  const auto add = [&](const char* name, double seconds) {
    (*json)[name] = seconds;
    if (seconds == 0.0) return;
    rows.push_back({name, fmt::format("{:.1f}", 100.0 * seconds / report.seconds),
                    fmt::format("{:.3f}", seconds)});
  };
  for (int part = 0; part < sim::Dynamics::kParts; ++part) {
    add(sim::Dynamics::PartName(part), report.part_seconds[part]);
    inside += report.part_seconds[part];
  }
  add("steps, events, output", report.seconds - inside);
  return AlignedTable(rows);
}

int Run(const Common& common, const Arguments& arguments) {
  sim::SimulateOptions options = arguments.options;
  options.Check();
  const data::Scene scene = data::ReadScene(arguments.scene, arguments.sets);
  const sim::Model model = sim::Compile(scene);

  data::Provenance provenance = StartProvenance(common);
  provenance.AddInput(arguments.scene);
  for (const std::string& set : arguments.sets) {
    const std::size_t equals = set.find('=');
    provenance.options["set " + set.substr(0, equals)] = set.substr(equals + 1);
  }
  provenance.options["rtol"] = fmt::format("{}", options.rtol);
  provenance.options["rate"] = fmt::format("{}", options.rate);
  const double duration = options.duration > 0.0 ? options.duration : model.duration;
  provenance.options["duration"] = fmt::format("{}", duration);

  const std::string out =
      arguments.out.empty() ? DefaultOutput(arguments.scene, ".h5") : arguments.out;
  std::vector<std::string> marks;
  for (const sim::Model::Mark& mark : model.marks) marks.push_back(mark.name);
  data::RunWriter writer(out, provenance, sim::Observables(model).quantities(), marks);
  RunRecorder recorder(model, &writer, !common.quiet);
  const sim::SimulateReport report = sim::Simulate(model, options, &recorder);

  writer.SetText("scene", data::ReadTextFile(arguments.scene));
  writer.SetText("method", report.method);
  writer.SetText("status", sim::StatusName(report.status));
  if (!report.message.empty()) writer.SetText("message", report.message);
  const auto summarise = [&](const char* name, double value, const char* units) {
    writer.SetSummary(name, value, units);
  };
  summarise("t_end", report.t_end, "s");
  summarise("steps", static_cast<double>(report.steps), "1");
  summarise("rejected", static_cast<double>(report.rejected), "1");
  summarise("evaluations", static_cast<double>(report.evaluations), "1");
  summarise("projections", static_cast<double>(report.projections), "1");
  summarise("impacts", static_cast<double>(report.Count(sim::EventKind::kContactStart)), "1");
  summarise("largest_position_drift", report.largest_position_drift, "m");
  summarise("largest_velocity_drift", report.largest_velocity_drift, "m/s");
  summarise("largest_energy_residual", recorder.worst_residual(), "J");
  for (const sim::Model::Joint& joint : model.joints) {
    if (joint.latch < 0) continue;
    writer.SetSummary(joint.name + ".peak_moment", report.peak_moment[joint.latch], "N m");
    writer.SetSummary(joint.name + ".peak_time", report.peak_time[joint.latch], "s");
  }
  writer.Commit();

  ordered_json json = {{"scene", arguments.scene},
                       {"run", out},
                       {"status", sim::StatusName(report.status)},
                       {"t_end", report.t_end}};
  std::string text = fmt::format("{}: {} s of \"{}\" in {:.2f} s -> {}\n", arguments.scene,
                                 report.t_end, scene.name, report.seconds, out);
  if (!report.Usable()) {
    json["message"] = report.message;
    text += fmt::format("NOT USABLE beyond {} s: {}\n", report.t_end, report.message);
  }
  text += "the scene calls for:";
  for (const sim::Model::EffectCount& effect : model.Effects()) {
    json["effects"][effect.name] = effect.count;
    text += fmt::format(" {} {};", effect.count, effect.name);
  }
  text.back() = '\n';
  if (model.latches.count() > 0) text += LatchTable(model, report, &json["latches"]);
  text += EnergyText(recorder.observables().balance(), recorder.observables().energy_at_start(),
                     recorder.worst_residual(), &json["energy"]);
  text +=
      fmt::format("{} steps ({} rejected), {} evaluations, {} projections, {} samples, {} events\n",
                  report.steps, report.rejected, report.evaluations, report.projections,
                  report.samples, report.events.size());
  json["steps"] = report.steps;
  json["rejected"] = report.rejected;
  json["evaluations"] = report.evaluations;
  json["projections"] = report.projections;
  json["samples"] = report.samples;
  json["events"] = report.events.size();
  json["seconds"] = report.seconds;
  if (options.profile) text += ProfileText(report, &json["profile"]);
  Finish(common, json, text);
  return report.Usable() ? kExitGood : kExitNotUsable;
}

}  // namespace

Verb AddSimulate(CLI::App& program, Common& common) {
  CLI::App* app = DeclareVerb(program, common, "simulate",
                              "A deployment, from a scene to a run with every quantity in time",
                              "unfurl simulate scene.toml -o run.h5 --set beam.beam1.segments=8");
  auto arguments = std::make_shared<Arguments>();
  app->add_option("SCENE", arguments->scene, "The scene (TOML)")->required();
  app->add_option("-o,--output", arguments->out,
                  "The run to write (default: the scene's name, .h5)");
  app->add_option("--set", arguments->sets,
                  "Overrides a key of the scene: joint.joint1.latch.theta_a=0.004 (repeatable)")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  app->add_option("--rtol", arguments->options.rtol,
                  "Error allowed per step, relative to the longest beam, 1 rad, and the speeds")
      ->capture_default_str();
  app->add_option("--rate", arguments->options.rate, "Samples per second")->capture_default_str();
  app->add_option("--duration", arguments->options.duration,
                  "Seconds to simulate (default: the scene's)");
  app->add_flag("--profile", arguments->options.profile,
                "Tell what share of the time each part took");
  return {app, [&common, arguments] { return Run(common, *arguments); }};
}

}  // namespace unfurl::cli
