#include "cli/terminal_plots.h"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "base/error.h"
#include "cli/run_columns.h"
#include "cli/verb.h"
#include "report/terminal_plot.h"
#include "sim/dynamics/observables.h"

namespace unfurl::cli {

namespace {

// Unasked: no more than leave the words above them on a screen.
constexpr std::size_t kUnasked = 3;
constexpr int kWidest = 100, kUsual = 72;  // characters
constexpr double kDegrees = 180.0 / std::numbers::pi;  // [deg/rad]

int Columns() {
  winsize size = {};
  if (ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0) return kUsual;
  return std::min<int>(size.ws_col, kWidest);
}

bool IsNone(const std::vector<std::string>& asked) {
  return asked.size() == 1 && asked.front() == "none";
}

std::vector<std::string> NamesOf(const sim::Observables& observables) {
  std::vector<std::string> out;
  for (const data::Quantity& q : observables.quantities()) out.push_back(q.name);
  return out;
}

std::vector<std::string> Unasked(const sim::Model& model, const std::set<std::string>& kept) {
  std::vector<std::string> wanted;
  for (const sim::Model::Joint& joint : model.joints) wanted.push_back(joint.name + ".theta");
  std::vector<std::string> out;
  for (const std::string& name : wanted) {
    if (kept.contains(name) && out.size() < kUnasked) out.push_back(name);
  }
  if (!out.empty()) return out;
  for (const auto& mark : model.marks) {
    for (const char* axis : {".x", ".y"}) {
      if (kept.contains(mark.name + axis) && out.size() < kUnasked) out.push_back(mark.name + axis);
    }
  }
  return out;
}

}  // namespace

bool OnTerminal() { return isatty(STDOUT_FILENO) != 0; }

std::vector<std::string> PlottedQuantities(const sim::Model& model,
                                           const std::vector<std::string>& asked,
                                           const std::vector<std::string>& kept) {
  if (IsNone(asked) || (asked.empty() && !OnTerminal())) return {};
  const std::vector<std::string> names = NamesOf(sim::Observables(model, kept));
  const std::set<std::string> there(names.begin(), names.end());
  if (asked.empty()) return Unasked(model, there);
  std::vector<std::string> out;
  try {
    out = NamesOf(sim::Observables(model, asked));
  } catch (const Error& error) {
    throw AtOption(error, {{"option quantities", "--plot"}});
  }
  for (const std::string& name : out) {
    if (there.contains(name)) continue;
    throw Error("'" + name + "' is not among --quantities", "--plot", "add it there");
  }
  return out;
}

std::string RunPlots(const std::string& run, const std::vector<std::string>& quantities) {
  if (quantities.empty()) return {};
  const RunColumns columns(run);
  std::string out;
  for (const std::string& name : quantities) {
    const auto& all = columns.reader().quantities();
    const auto found =
        std::find_if(all.begin(), all.end(), [&](const auto& q) { return q.name == name; });
    if (found == all.end()) continue;  // of a run without a sample
    // As on pages: angles in degrees.
    const bool angle = found->units == "rad";
    const report::Series series = columns.Read(name, name, angle ? kDegrees : 1.0);
    report::TerminalPlot plot;
    plot.title = fmt::format("{} [{}]", name, angle ? "deg" : found->units);
    plot.x_title = "t [s]";
    plot.columns = Columns();
    out += report::TerminalText(plot, series.x, series.y);
  }
  return out;
}

std::string ResidualPlot(const data::FitRecord& fit) {
  std::vector<double> t, sigmas;
  for (Eigen::Index i = 0; i < fit.measured.cols(); ++i) {
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      const double sigma = fit.sigma(axis, i);
      if (!(sigma > 0.0)) continue;
      t.push_back(fit.t[static_cast<std::size_t>(i)]);
      sigmas.push_back((fit.measured(axis, i) - fit.simulated(axis, i)) / sigma);
    }
  }
  if (t.empty()) return {};
  report::TerminalPlot plot;
  plot.title = "measured less model, every coordinate of every mark [sigma]";
  plot.x_title = "t [s]";
  plot.columns = Columns();
  plot.joined = false;
  return report::TerminalText(plot, t, sigmas);
}

}  // namespace unfurl::cli
