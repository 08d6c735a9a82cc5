#include "data/modes.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/count.h"
#include "base/error.h"
#include "base/table.h"
#include "cli/modes_page.h"
#include "cli/verb.h"
#include "data/scene.h"
#include "sim/implicit/find_modes.h"

namespace unfurl::cli {

namespace {

using nlohmann::ordered_json;

struct ModesArguments {
  std::string scene, out, report, state = "auto";
  std::vector<std::string> sets;
  std::optional<double> at;  // [s]
  bool as_is = false, no_mesh_error = false;
  int count = 12;
};

std::string EquilibriumText(const sim::SceneModes& modes, bool as_is) {
  if (as_is) return "linearised about that state as it is, in equilibrium or not\n";
  const sim::EquilibriumReport& e = modes.equilibrium;
  if (e.found) return fmt::format("equilibrium found in {} iterations\n", e.iterations);
  return fmt::format("NOT USABLE: no equilibrium found, {:.3g} m/s^2 left after {} iterations\n",
                     e.acceleration, e.iterations);
}

// A motion may be soft and yet not be told from one without stiffness.
std::string RigidText(const sim::SceneModes& modes) {
  std::string text = fmt::format("{} rigid motion{}", modes.rigid, modes.rigid == 1 ? "" : "s");
  if (modes.rigid > 0) {
    text += fmt::format(", or slower than {:.2g} Hz, which rounding hides", modes.rigid_below);
  }
  constexpr double kDigits = 1e-6;  // what is printed of a frequency
  if (modes.rounding > kDigits) {
    text += fmt::format("\nrounding leaves frequencies wrong by up to {:.1g}% of themselves",
                        100.0 * modes.rounding);
  }
  return text;
}

std::string LatchText(const sim::SceneModes& modes, ordered_json* json) {
  if (modes.latches.empty()) return "";
  std::vector<std::vector<std::string>> rows = {{"joint", "theta [rad]", "contact"}};
  for (const sim::SceneModes::Latch& latch : modes.latches) {
    const char* side = latch.upper ? "upper stop" : latch.lower ? "lower stop" : "none";
    (*json)["joints"].push_back(
        {{"joint", latch.joint}, {"theta", latch.theta}, {"contact", side}});
    rows.push_back({latch.joint, fmt::format("{:.7g}", latch.theta), side});
  }
  return AlignedTable(rows);
}

std::string ModeText(const data::ModesRecord& record, ordered_json* json) {
  (*json)["modes"] = ordered_json::array();
  for (const data::ModesRecord::Mode& mode : record.modes) {
    (*json)["modes"].push_back({{"frequency", mode.frequency},
                                {"damping", mode.damping},
                                {"growth", mode.growth},
                                {"mesh_error", mode.error},
                                {"moves_most", record.places[record.MovesMost(mode)]}});
  }
  return AlignedTable(ModeRows(record));
}

int RunModes(const Common& common, const ModesArguments& arguments) {
  sim::ModesOptions options;
  options.count = arguments.count;
  options.state = sim::ModesStateOf(arguments.state);
  options.at = arguments.at;
  options.find_equilibrium = !arguments.as_is;
  options.mesh_error = !arguments.no_mesh_error;
  options.Check();
  const data::Scene scene = data::ReadScene(arguments.scene, arguments.sets);
  const sim::SceneModes modes = sim::FindModes(scene, options);
  data::Provenance provenance = StartProvenance(common);
  for (const std::string& file : scene.files) provenance.AddInput(file);
  if (!arguments.out.empty()) data::WriteModes(arguments.out, modes.record, provenance);

  const char* state = modes.latched
                          ? "latched, every clearance closed on the side that the load presses"
                      : options.at ? "as it is at the time given, brought to rest"
                                   : "as drawn";
  ordered_json json = {{"scene", arguments.scene},
                       {"state", modes.latched ? "latched"
                                 : options.at  ? "at"
                                               : "drawn"},
                       {"equilibrium", modes.equilibrium.found},
                       {"rigid_motions", modes.rigid},
                       {"rigid_below", modes.rigid_below},
                       {"rounding", modes.rounding}};
  if (options.at) json["at"] = *options.at;
  std::string text = fmt::format("{}: \"{}\", {}\n", arguments.scene, scene.name, state);
  text += EquilibriumText(modes, arguments.as_is);
  text += LatchText(modes, &json);
  text += RigidText(modes) + "\n";
  text += ModeText(modes.record, &json);
  if (!arguments.out.empty()) text += fmt::format("shapes -> {}\n", arguments.out);
  if (!arguments.report.empty()) {
    WriteModesPage(arguments.report,
                   {modes.record,
                    scene.name,
                    {fmt::format("{}, {}", Counted(modes.record.modes.size(), "mode"), state),
                     EquilibriumText(modes, arguments.as_is), RigidText(modes)},
                    modes.usable},
                   provenance);
    text += fmt::format("page -> {}\n", arguments.report);
  }
  Finish(common, json, text);
  return modes.usable
             ? kExitGood
             : NotUsable(arguments.scene,
                         "no equilibrium was found; --as-is linearises at the state as it is");
}

}  // namespace

Verb AddModes(CLI::App& program, Common& common) {
  Verb verb = DeclareVerb(program, common, "modes",
                          "Equilibrium, natural frequencies and shapes of a scene, latched or not",
                          "unfurl modes scene.toml --count 8 -o shapes.h5");
  CLI::App* app = verb.app;
  VerbFiles& files = *verb.files;
  auto arguments = std::make_shared<ModesArguments>();
  files.Read("SCENE", &arguments->scene, "The scene (TOML)")->required();
  files.Write("-o,--output", &arguments->out, "Where to write the shapes (.h5 or .csv)");
  files.Page(&arguments->report, "Also write a page with the shapes in motion (HTML)");
  files.Overrides(&arguments->sets, "Overrides a key of the scene (repeatable)");
  app->add_option(
         "--state", arguments->state,
         "drawn, or latched: every latch closed (default: latched where there are latches)")
      ->type_name("STATE");
  app->add_option("--at", arguments->at,
                  "Start from the state that a run reaches at this time [s]");
  app->add_flag("--as-is", arguments->as_is,
                "Take the state as it is, and look for no equilibrium");
  app->add_flag("--no-mesh-error", arguments->no_mesh_error,
                "Leave out the finer mesh that says what this one leaves wrong");
  app->add_option("--count", arguments->count, "How many modes")->capture_default_str();
  verb.run = [&common, arguments] { return RunModes(common, *arguments); };
  return verb;
}

}  // namespace unfurl::cli
