#include "sim/methods/simulate.h"

#include <fmt/format.h>
#include <sys/statvfs.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/error.h"
#include "base/progress.h"
#include "base/signals.h"
#include "cli/simulate_page.h"
#include "cli/verb.h"
#include "data/atomic_file.h"
#include "data/run.h"
#include "data/scene.h"
#include "sim/record/run_recorder.h"
#include "sim/record/run_summary.h"

namespace unfurl::cli {

namespace {

using nlohmann::ordered_json;

constexpr double kLargeFile = 1e9;  // [byte]; beyond it the size is printed before the run

struct Arguments {
  std::string scene, out, report;
  std::vector<std::string> sets;
  std::optional<std::string> method;
  std::optional<double> rtol, rate, duration;
  bool profile = false;
  sim::RecordOptions record;
};

std::string SizeText(double bytes) {
  constexpr const char* kUnits[] = {"kB", "MB", "GB", "TB"};
  double value = bytes / 1e3;
  int unit = 0;
  while (value >= 999.5 && unit < 3) value /= 1e3, ++unit;
  return fmt::format("{:.3g} {}", value, kUnits[unit]);
}

// Says how large the file will be where that may surprise, and refuses what the disk cannot hold.
void CheckSize(const std::string& out, double bytes, double rate, bool quiet) {
  const std::string folder = std::filesystem::path(out).parent_path().string();
  struct statvfs disk = {};
  const bool known = statvfs(folder.empty() ? "." : folder.c_str(), &disk) == 0;
  const double room = static_cast<double>(disk.f_bavail) * static_cast<double>(disk.f_frsize);
  if (known && bytes > room) {
    throw Error(fmt::format("the run would take {} and the disk has {} left", SizeText(bytes),
                            SizeText(room)),
                out,
                fmt::format("sample less often than --rate {:g}, choose --quantities, shorten "
                            "--duration, or name another disk with -o",
                            rate),
                ErrorKind::kMachine);
  }
  if (bytes > kLargeFile && !quiet) {
    std::fprintf(stderr,
                 "unfurl: %s will take about %s (--rate %g; --quantities chooses columns)\n",
                 out.c_str(), SizeText(bytes).c_str(), rate);
  }
}

class SimulateVerb {
 public:
  SimulateVerb(const Common& common, const Arguments& arguments)
      : common_(common), arguments_(arguments) {}

  int Run() {
    const data::Scene scene = data::ReadScene(arguments_.scene, arguments_.sets);
    Prepare(scene);
    const sim::Model model = sim::Compile(scene);
    const std::string& out = arguments_.out;
    const double duration = options_.duration > 0.0 ? options_.duration : model.duration;
    provenance_.options["duration"] = fmt::format("{}", duration);

    sim::RunRecorder recorder(model, arguments_.record, options_.rate, !common_.quiet);
    const data::RunLayout layout =
        recorder.Layout(data::ReadTextFile(arguments_.scene), options_.profile);
    const double samples = std::floor(duration * options_.rate) + 1.0;
    const double shapes =
        recorder.shape_every() > 0 ? std::ceil(samples / recorder.shape_every()) : 0.0;
    CheckSize(out, data::RunWriter::FileSize(layout, samples, shapes), options_.rate,
              common_.quiet);
    data::RunWriter writer(out, provenance_, layout);
    recorder.SetWriter(&writer);
    sim::SummaryInput summary{model,      report_, recorder,        "good", {}, arguments_.scene,
                              scene.name, out,     options_.profile};
    int code = kExitGood;
    try {
      code = Simulate(model, &recorder, &summary);
      recorder.Finish(report_, summary.status, summary.message, options_.profile);
      if (code == kExitGood) {
        writer.Commit();
      } else {
        writer.Keep();
        summary.out = writer.partial();
      }
    } catch (const Error& error) {
      if (error.kind() != ErrorKind::kMachine || !writer.holds_samples()) throw;
      writer.Abandon();
      throw Error(fmt::format("{}; what got to the disk by t = {:.6g} s is in {}", error.what(),
                              recorder.last_time(), writer.partial()),
                  {}, {}, ErrorKind::kMachine);
    }
    ordered_json json;
    const std::string text = sim::SummaryText(summary, &json);
    if (!arguments_.report.empty() && code != kExitInterrupted) {
      WriteSimulatePage(arguments_.report, summary, provenance_);
      json["report"] = arguments_.report;
    }
    if (code == kExitInterrupted) {
      Complain(fmt::format("interrupted at t = {:.9g} s; the results so far are in {}",
                           recorder.last_time(), summary.out));
      if (common_.json) unfurl::cli::Finish(common_, json, text);
      return code;
    }
    unfurl::cli::Finish(common_, json, text);
    return code;
  }

 private:
  // The command line's words go before the scene's.
  void Prepare(const data::Scene& scene) {
    const auto& method = arguments_.method ? arguments_.method : scene.solver.method;
    if (method) options_.method = sim::MethodOf(*method);
    options_.rtol = arguments_.rtol.value_or(scene.solver.rtol.value_or(options_.rtol));
    options_.rate = arguments_.rate.value_or(scene.solver.rate.value_or(options_.rate));
    if (arguments_.duration) {
      if (!(*arguments_.duration > 0.0)) {
        throw Error(fmt::format("{} is not a duration", *arguments_.duration), "option duration",
                    "use a positive number of seconds");
      }
      options_.duration = *arguments_.duration;
    }
    options_.profile = arguments_.profile;
    options_.Check();
    if (!(arguments_.record.shape_rate >= 0.0) || !std::isfinite(arguments_.record.shape_rate)) {
      throw Error(fmt::format("{} is not a rate", arguments_.record.shape_rate),
                  "option shape-rate", "use shapes per second, or 0 for none");
    }
    provenance_ = StartProvenance(common_);
    for (const std::string& file : scene.files) provenance_.AddInput(file);
    for (const std::string& set : arguments_.sets) {
      const std::size_t equals = set.find('=');
      provenance_.options["set " + set.substr(0, equals)] = set.substr(equals + 1);
    }
    provenance_.options["method"] = sim::MethodName(options_.method);
    provenance_.options["rtol"] = fmt::format("{}", options_.rtol);
    provenance_.options["rate"] = fmt::format("{}", options_.rate);
  }

  // Runs the model; what stops it becomes the summary's status. Bad input that shows only on the
  // way is such a stop, too.
  int Simulate(const sim::Model& model, sim::RunRecorder* recorder, sim::SummaryInput* summary) {
    try {
      report_ = sim::Simulate(model, options_, recorder);
    } catch (const Interrupted&) {
      summary->status = summary->message = "interrupted";
      return kExitInterrupted;
    } catch (const Error& error) {
      if (error.kind() == ErrorKind::kMachine || recorder->samples() <= 1) throw;
      summary->status = "stopped";
      summary->message = error.what();
      return kExitNotUsable;
    }
    summary->status = sim::StatusName(report_.status);
    summary->message = report_.message;
    return report_.Usable() ? kExitGood : kExitNotUsable;
  }

  const Common& common_;
  const Arguments& arguments_;
  sim::SimulateOptions options_;
  sim::SimulateReport report_;
  data::Provenance provenance_;
};

}  // namespace

Verb AddSimulate(CLI::App& program, Common& common) {
  Verb verb = DeclareVerb(program, common, "simulate",
                          "A deployment, from a scene to a run with every quantity in time",
                          "unfurl simulate scene.toml -o run.h5 --set beam.beam1.segments=8 "
                          "--report page.html");
  CLI::App* app = verb.app;
  VerbFiles& files = *verb.files;
  auto arguments = std::make_shared<Arguments>();
  files.Read("SCENE", &arguments->scene, "The scene (TOML)")->required();
  files.WriteOr(
      "-o,--output", &arguments->out,
      [arguments] { return DefaultOutput(arguments->scene, ".h5"); },
      "The run to write (default: the scene's name, .h5); while it runs, and when it "
      "is stopped, NAME.partial");
  files.Overrides(&arguments->sets,
                  "Overrides a key of the scene: joint.joint1.latch.theta_a=0.004 (repeatable)");
  app->add_option("--method", arguments->method,
                  "auto, projected, partitioned or implicit (default: the scene's, or auto)")
      ->type_name("METHOD");
  app->add_option("--rtol", arguments->rtol,
                  "Error allowed per step, relative to the longest beam, 1 rad, and the speeds "
                  "(default: the scene's, or 1e-6)");
  app->add_option("--rate", arguments->rate, "Samples per second (default: the scene's, or 1000)");
  app->add_option("--duration", arguments->duration, "Seconds to simulate (default: the scene's)");
  app->add_option("--quantities", arguments->record.quantities,
                  "What to sample, by name, * and ? standing for letters: 'mark*' 'energy.*' "
                  "(default: all)")
      ->delimiter(',')
      ->type_name("NAMES");
  app->add_option("--shape-rate", arguments->record.shape_rate,
                  "Beam shapes per second; 0 for none")
      ->capture_default_str();
  files.Write("--report", &arguments->report, "Also write a page with pictures (HTML)");
  app->add_flag("--profile", arguments->profile,
                "Report the share of the time that each part took, and store it in the run");
  verb.run = [&common, arguments] { return SimulateVerb(common, *arguments).Run(); };
  return verb;
}

}  // namespace unfurl::cli
