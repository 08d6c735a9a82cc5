#include "sim/methods/simulate.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/error.h"
#include "base/signals.h"
#include "cli/simulate_page.h"
#include "cli/terminal_plots.h"
#include "cli/verb.h"
#include "data/atomic_file.h"
#include "data/scene.h"
#include "sim/record/certificate.h"
#include "sim/record/record.h"
#include "sim/record/run_summary.h"

namespace unfurl::cli {

namespace {

using nlohmann::ordered_json;

constexpr double kLargeFile = 1e9;  // [byte]; beyond it the size is printed before the run

struct SimulateArguments {
  std::string scene, out, report;
  std::vector<std::string> sets;
  std::optional<std::string> method;
  std::optional<double> rtol, rate, duration, shape_rate;
  bool profile = false, certify = false;
  std::vector<std::string> quantities, plots;
};

// Says while a run goes on that it will take long.
class SlowRunWarning : public sim::Observer {
 public:
  void OnSlow(const std::string& text) override {
    std::fprintf(stderr, "unfurl: %s\n", text.c_str());
  }
};

class SimulateVerb {
 public:
  SimulateVerb(const Common& common, const SimulateArguments& arguments)
      : common_(common), arguments_(arguments) {}

  int Run() {
    const data::Scene scene = data::ReadScene(arguments_.scene, arguments_.sets);
    sim::RecordOptions options = Options(scene);
    const auto model = sim::CompileModel(scene);
    const std::vector<std::string> plots =
        PlottedQuantities(*model, arguments_.plots, arguments_.quantities);
    const std::string& out = arguments_.out;
    const double duration = sim::DurationOf(*options.simulate, *model);
    options.provenance.options["duration"] = fmt::format("{}", duration);
    const double bytes = sim::RecordingSize(*model, options);
    std::error_code unknown;  // what the disk cannot hold is refused below, in one line
    const auto folder = std::filesystem::absolute(out, unknown).parent_path();
    const double room = static_cast<double>(std::filesystem::space(folder, unknown).available);
    if (bytes > kLargeFile && bytes <= room && !common_.quiet) {
      std::fprintf(stderr,
                   "unfurl: %s will take about %s (--rate %g; --quantities chooses columns)\n",
                   out.c_str(), sim::SizeText(bytes).c_str(), options.simulate->rate);
    }
    SlowRunWarning warning;
    if (!common_.quiet) options.observer = &warning;
    if (arguments_.certify) {
      sim::CertifyOptions certify;
      certify.quantities = arguments_.quantities;
      certify.progress = !common_.quiet;
      options.certificate = sim::Certificate::Make(scene, *options.simulate, certify);
    }
    const sim::Recording run =
        sim::Record(model, options, out, data::ReadTextFile(arguments_.scene));

    const sim::SummaryInput summary{*model,
                                    run.report,
                                    *run.recorder,
                                    run.status,
                                    run.message,
                                    arguments_.scene,
                                    scene.name,
                                    run.path,
                                    run.options.profile,
                                    options.certificate.get()};
    const bool interrupted = run.status == "interrupted";
    ordered_json json;
    std::string text = sim::SummaryText(summary, &json);
    if (!common_.quiet && !common_.json) text += RunPlots(run.path, plots);
    if (!arguments_.report.empty() && !interrupted) {
      WriteSimulatePage(arguments_.report, summary, options.provenance);
      json["report"] = arguments_.report;
    }
    if (interrupted) {
      Complain(fmt::format("interrupted at t = {:.9g} s; the results so far are in {}",
                           run.recorder->last_time(), run.path));
      if (common_.json) Finish(common_, json, text);
      return InterruptExitCode();
    }
    Finish(common_, json, text);
    if (run.Usable() && options.certificate && !options.certificate->problem().empty()) {
      return NotUsable(arguments_.scene, "not certified: " + options.certificate->problem());
    }
    return run.Usable() ? kExitGood : NotUsable(arguments_.scene, run.status + ": " + run.message);
  }

 private:
  // The command line's words go before the scene's.
  sim::RecordOptions Options(const data::Scene& scene) const {
    if (arguments_.duration && !(*arguments_.duration > 0.0)) {
      throw Error(fmt::format("{} is not a duration", *arguments_.duration), "option duration",
                  "use a positive number of seconds");
    }
    sim::SimulateOptions simulate = sim::SolverOptions(scene, arguments_.duration.value_or(0.0));
    if (arguments_.method) simulate.method = sim::MethodOf(*arguments_.method);
    simulate.rtol = arguments_.rtol.value_or(simulate.rtol);
    simulate.rate = arguments_.rate.value_or(simulate.rate);
    simulate.profile = arguments_.profile;
    sim::RecordOptions options;
    options.simulate = simulate;
    options.quantities = arguments_.quantities;
    options.shape_rate = arguments_.shape_rate;
    options.progress = !common_.quiet;
    options.Check();
    options.provenance = StartProvenance(common_);
    for (const std::string& file : scene.files) options.provenance.AddInput(file);
    for (const std::string& set : arguments_.sets) {
      const std::size_t equals = set.find('=');
      options.provenance.options["set " + set.substr(0, equals)] = set.substr(equals + 1);
    }
    options.provenance.options["method"] = sim::MethodName(simulate.method);
    options.provenance.options["rtol"] = fmt::format("{}", simulate.rtol);
    options.provenance.options["rate"] = fmt::format("{}", simulate.rate);
    return options;
  }

  const Common& common_;
  const SimulateArguments& arguments_;
};

}  // namespace

Verb AddSimulate(CLI::App& program, Common& common) {
  Verb verb =
      DeclareVerb(program, common, "simulate",
                  "Simulate a deployment: from a scene to a run with all quantities over time",
                  "unfurl simulate scene.toml -o run.h5 --set beam.beam1.segments=8 "
                  "--report page.html");
  CLI::App* app = verb.app;
  VerbFiles& files = *verb.files;
  auto arguments = std::make_shared<SimulateArguments>();
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
  app->add_option(
      "--rate", arguments->rate,
      "Samples per second (default: the scene's, or 1000, and a thousand in all at least)");
  app->add_option("--duration", arguments->duration, "Seconds to simulate (default: the scene's)");
  app->add_option("--quantities", arguments->quantities,
                  "What to sample, by name, * and ? standing for letters: 'mark*' 'energy.*' "
                  "(default: all)")
      ->delimiter(',')
      ->type_name("NAMES");
  app->add_option("--plot", arguments->plots,
                  "Also draw these quantities in characters, named as above (on a terminal: angles "
                  "of joints; 'none': nothing)")
      ->delimiter(',')
      ->type_name("NAMES");
  app->add_option("--shape-rate", arguments->shape_rate,
                  "Beam shapes per second; 0 for none (default: 50, and 200 in all at least)")
      ->capture_default_str();
  files.Page(&arguments->report, "Also write a page with pictures (HTML)");
  app->add_flag("--certify", arguments->certify,
                "State the numerical error of marks, joints and --quantities, of time stepping and "
                "of the mesh, by two further runs: at a tenth of --rtol, and on another mesh");
  app->add_flag("--profile", arguments->profile,
                "Report the share of the time that each part took, and store it in the run");
  verb.run = [&common, arguments] { return SimulateVerb(common, *arguments).Run(); };
  return verb;
}

}  // namespace unfurl::cli
