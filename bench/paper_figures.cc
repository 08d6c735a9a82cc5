// The paper's claims and Figures 6 to 10, computed anew: pictures into a folder, numbers as tables
// on the standard output. docs/paper-claims.md holds both and judges them.
//   paper_figures FOLDER
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <ctime>
#include <map>
#include <string>
#include <vector>

#include "base/error.h"
#include "bench/svg_plot.h"
#include "data/scene.h"
#include "sim/dynamics/observables.h"
#include "sim/methods/simulate.h"

namespace unfurl::bench {
namespace {

using sim::Event;
using sim::EventKind;
using Column = std::vector<double>;

struct Record : sim::Observer {
  explicit Record(const sim::Model& model) : observables(model) {}
  void OnSample(double time, double* y, const std::vector<sim::LatchMode>& modes) override {
    t.push_back(time);
    const auto& row = observables.Row(time, y, modes);
    columns.resize(row.size());
    for (std::size_t k = 0; k < row.size(); ++k) columns[k].push_back(row[k]);
  }
  const Column& operator[](const std::string& name) const {
    const auto& all = observables.quantities();
    for (std::size_t k = 0; k < all.size(); ++k) {
      if (all[k].name == name) return columns[k];
    }
    throw Error("no such column", name, "see docs/formats.md");
  }
  sim::Observables observables;
  Column t;
  std::vector<Column> columns;
  sim::SimulateReport report;
  double cpu = 0.0;  // [s]
};

data::Scene Read(const std::string& file, const std::vector<std::string>& overrides = {}) {
  return data::ReadScene(std::string(UNFURL_SOURCE_DIR) + "/data/sets/" + file, overrides);
}

Record Run(const data::Scene& scene, const sim::SimulateOptions& options) {
  const sim::Model model = sim::Compile(scene);
  Record record(model);
  record.report = sim::Simulate(model, options, &record);
  if (!record.report.Usable()) throw Error(record.report.message, scene.name, "");
  return record;
}

// ---------------------------------------------------------------- slider-crank

Column Beta(const Record& run) {
  const Column &x0 = run["start.x"], &y0 = run["start.y"], &x1 = run["middle.x"],
               &y1 = run["middle.y"], &x2 = run["end.x"], &y2 = run["end.y"];
  Column beta;
  for (std::size_t k = 0; k < x0.size(); ++k) {
    const std::complex<double> chord(x2[k] - x0[k], y2[k] - y0[k]),
        middle(x1[k] - x0[k], y1[k] - y0[k]);
    beta.push_back(std::imag(std::conj(chord / std::abs(chord)) * middle) / 0.3048);
  }
  return beta;
}

Record SliderCrank(int segments, const std::string& axial, double rtol) {
  sim::SimulateOptions options;
  options.method = sim::Method::kProjected;
  options.rate = 12000.0;
  options.rtol = rtol;
  return Run(Read("slider_crank/scene.toml", {"beam.rod.segments=" + std::to_string(segments),
                                              "beam.rod.axial=\"" + axial + "\""}),
             options);
}

double Scatter(const Column& a, const Column& b) {  // RMS of the difference over b's peak
  double sum = 0.0, peak = 0.0;
  const std::size_t n = std::min(a.size(), b.size());
  for (std::size_t k = 0; k < n; ++k) {
    sum += (a[k] - b[k]) * (a[k] - b[k]);
    peak = std::max(peak, std::fabs(b[k]));
  }
  return std::sqrt(sum / static_cast<double>(n)) / peak;
}

double CpuOf(int segments, const std::string& axial, double rtol, long* evaluations) {
  const data::Scene scene =
      Read("slider_crank/scene.toml",
           {"beam.rod.segments=" + std::to_string(segments), "beam.rod.axial=\"" + axial + "\""});
  const sim::Model model = sim::Compile(scene);
  sim::SimulateOptions options;
  options.method = sim::Method::kProjected;
  options.rtol = rtol;
  options.track_energy = false;
  std::vector<double> times;
  for (int k = 0; k < 9; ++k) {
    const std::clock_t begin = std::clock();
    *evaluations = sim::Simulate(model, options, nullptr).evaluations;
    times.push_back(static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC);
  }
  std::sort(times.begin(), times.end());
  return times[times.size() / 2];
}

void SliderCrankFigures(const std::string& folder) {
  const Record fine = SliderCrank(49, "rigid", 1e-8);
  const Column exact = Beta(fine);
  Plot six{"Figure 6(a): transverse deformation of the connecting rod",
           "crank angle [rad]",
           "beta [-]",
           {}};
  Column angle;
  for (const double t : fine.t) angle.push_back(150.0 * t);
  fmt::print("\n| segments | RMS difference of beta to n = 49, of its peak |\n|---|---|\n");
  for (const int n : {3, 5, 9, 17}) {
    const Column beta = Beta(SliderCrank(n, "rigid", 1e-8));
    if (n == 5 || n == 9)
      six.curves.push_back({fmt::format("{} segments", n), angle, beta, n == 5});
    fmt::print("| {} | {:.2f}% |\n", n, 100.0 * Scatter(beta, exact));
  }
  six.curves.push_back({"49 segments", angle, exact});
  WriteSvg(folder + "/figure_6.svg", six);
  const Column rigid = Beta(SliderCrank(3, "rigid", 1e-8));
  const Column elastic = Beta(SliderCrank(3, "elastic", 1e-8));
  WriteSvg(folder + "/figure_7.svg", {"Figure 7: beta, three segments",
                                      "crank angle [rad]",
                                      "beta [-]",
                                      {{"longitudinal constraint", angle, rigid},
                                       {"elastic axially", angle, elastic, true}}});
  fmt::print("\nn = 3, elastic against rigid: RMS difference {:.3f}% of the peak\n",
             100.0 * Scatter(elastic, rigid));
  fmt::print(
      "\n| n | rtol | evaluations, rigid | elastic | time, rigid [ms] | elastic [ms] | ratio |\n"
      "|---|---|---|---|---|---|---|\n");
  for (const int n : {3, 9}) {
    for (const double rtol : {1e-3, 1e-4, 1e-6, 1e-8}) {
      long e_rigid = 0, e_elastic = 0;
      const double t_rigid = CpuOf(n, "rigid", rtol, &e_rigid);
      const double t_elastic = CpuOf(n, "elastic", rtol, &e_elastic);
      fmt::print("| {} | {:.0e} | {} | {} | {:.2f} | {:.2f} | {:.0f}% |\n", n, rtol, e_rigid,
                 e_elastic, 1e3 * t_rigid, 1e3 * t_elastic, 100.0 * t_rigid / t_elastic);
    }
  }
}

// ------------------------------------------------------------------ deployment

struct Case {
  int segments = 4;
  double damping = 0.0;
  std::string fold = "zigzag";  // or "roll", "ajar"
};

Record Deployment(bool clearance, const Case& c, double duration) {
  data::Scene scene =
      Read(fmt::format("deployment/scene_{}clearance.toml", clearance ? "" : "no_"));
  for (auto& beam : scene.beams) beam.segments = c.segments, beam.damping = c.damping;
  for (auto& joint : scene.joints) {
    const bool outer = joint.name == "joint2" || joint.name == "joint4";
    if (outer && c.fold == "roll") joint.sign = -joint.sign;
    if (outer && c.fold == "ajar") joint.theta = 170.0 / 180.0 * M_PI;
  }
  sim::SimulateOptions options;
  options.duration = duration;
  options.rtol = 1e-6;
  options.rate = 5000.0;  // shorter than the contacts
  return Run(scene, options);
}

// Across the axis of a joint's outer half, seen from its pin: how far a point is bent away [m].
Column Deflection(const Record& run, const std::string& half, const std::string& point) {
  const Column &x = run[half + ".x"], &y = run[half + ".y"], &phi = run[half + ".theta"],
               &px = run[point + ".x"], &py = run[point + ".y"];
  Column across;
  for (std::size_t k = 0; k < x.size(); ++k) {
    across.push_back(-(px[k] - x[k]) * std::sin(phi[k]) + (py[k] - y[k]) * std::cos(phi[k]));
  }
  return across;
}

double LastLatch(const Record& run) {
  double t = 0.0;
  int count = 0;
  for (const Event& e : run.report.events) {
    if (e.kind == EventKind::kLatch) t = e.t, ++count;
  }
  return count == 4 ? t : NAN;
}

// The strongest peaks [Hz] of a column's spectrum from `begin` on, Hann's window, lowest first.
std::vector<double> Peaks(const Column& t, const Column& v, double begin, int count) {
  Column x, time;
  constexpr std::size_t kEvery = 10;  // 500 a second are enough
  for (std::size_t k = 0; k < t.size(); k += kEvery) {
    if (t[k] >= begin) x.push_back(v[k]), time.push_back(t[k]);
  }
  const double n = static_cast<double>(x.size());
  // Less its straight line: what turns as a whole is no vibration.
  double mean = 0.0, slope = 0.0, norm = 0.0;
  for (const double value : x) mean += value / n;
  for (std::size_t k = 0; k < x.size(); ++k) {
    const double u = static_cast<double>(k) - 0.5 * (n - 1);
    slope += u * (x[k] - mean), norm += u * u;
  }
  for (std::size_t k = 0; k < x.size(); ++k) {
    const double u = static_cast<double>(k) - 0.5 * (n - 1);
    x[k] = (x[k] - mean - slope / norm * u) * 0.5 *
           (1 - std::cos(2 * M_PI * (static_cast<double>(k) + 0.5) / n));
  }
  Column amplitude;
  constexpr double kStep = 0.02, kLow = 0.3, kHigh = 40.0;
  for (double f = kLow; f < kHigh; f += kStep) {
    std::complex<double> sum = 0.0, turn = std::polar(1.0, -2 * M_PI * f * (time[1] - time[0])),
                         at = 1.0;
    for (const double value : x) sum += value * at, at *= turn;
    amplitude.push_back(std::abs(sum));
  }
  std::vector<std::pair<double, double>> found;
  for (std::size_t k = 1; k + 1 < amplitude.size(); ++k) {
    if (amplitude[k] > amplitude[k - 1] && amplitude[k] >= amplitude[k + 1]) {
      found.push_back({amplitude[k], kLow + kStep * static_cast<double>(k)});
    }
  }
  std::sort(found.rbegin(), found.rend());
  std::vector<double> peaks;
  for (std::size_t k = 0; k < found.size() && peaks.size() < static_cast<std::size_t>(count); ++k) {
    peaks.push_back(found[k].second);
  }
  std::sort(peaks.begin(), peaks.end());
  return peaks;
}

struct Numbers {
  double range_y, range_angle, after_angle, last_latch;
  double moment, locking;  // largest at joint 2: within 5 s, within 0.1 s of its latch [N m]
  long impacts;
  std::vector<double> hub, tip;  // peaks of the spectra [Hz]
};

Numbers NumbersOf(const Record& run) {
  Numbers n;
  const double five = 5.0;
  const auto range = [&](const Column& v, double from, double to) {
    double low = INFINITY, high = -INFINITY;
    for (std::size_t k = 0; k < v.size(); ++k) {
      if (run.t[k] < from || run.t[k] > to) continue;
      low = std::min(low, v[k]), high = std::max(high, v[k]);
    }
    return high - low;
  };
  n.last_latch = LastLatch(run);
  n.range_y = range(run["hub.y"], 0.0, five);
  n.range_angle = range(run["hub.theta"], 0.0, five);
  n.after_angle = range(run["hub.theta"], n.last_latch, n.last_latch + 2.0);
  double latch = NAN;
  for (const Event& e : run.report.events) {
    if (e.kind == EventKind::kLatch && e.joint == 1) latch = e.t;
  }
  const Column& moment = run["joint2.contact_moment"];
  n.moment = n.locking = 0.0;
  for (std::size_t k = 0; k < run.t.size() && run.t[k] <= five; ++k) {
    n.moment = std::max(n.moment, std::fabs(moment[k]));
    if (run.t[k] >= latch && run.t[k] <= latch + 0.1) {
      n.locking = std::max(n.locking, std::fabs(moment[k]));
    }
  }
  n.impacts = 0;
  for (const Event& e : run.report.events) {
    if (e.kind == EventKind::kContactStart && e.t < five) ++n.impacts;
  }
  n.hub = Peaks(run.t, run["hub.theta"], n.last_latch + 0.2, 3);
  n.tip = Peaks(run.t, Deflection(run, "joint2_out", "mark3"), n.last_latch + 0.2, 3);
  return n;
}

void DeploymentFigures(const std::string& folder) {
  const Record with = Deployment(true, {}, 5.0), without = Deployment(false, {}, 5.0);
  const auto both = [&](const std::string& file, const std::string& title, const std::string& unit,
                        auto column) {
    WriteSvg(folder + "/" + file, {title,
                                   "time [s]",
                                   unit,
                                   {{"with clearance", with.t, column(with)},
                                    {"without", without.t, column(without), true}}});
  };
  both("figure_8a.svg", "Figure 8(a): the hub across the deployed axis", "y [m]",
       [](const Record& r) { return r["hub.y"]; });
  both("figure_8b.svg", "Figure 8(b): the hub's angle", "angle [rad]",
       [](const Record& r) { return r["hub.theta"]; });
  both("figure_9a.svg", "Figure 9(a): deflection of the tip of beam 1", "deflection [m]",
       [](const Record& r) { return Deflection(r, "joint1_out", "mark2"); });
  both("figure_9b.svg", "Figure 9(b): deflection of the tip of beam 2", "deflection [m]",
       [](const Record& r) { return Deflection(r, "joint2_out", "mark3"); });
  WriteSvg(folder + "/figure_10a.svg",
           {"Figure 10(a): moment of contact at joint 2, with clearance",
            "time [s]",
            "moment [N m]",
            {{"with clearance", with.t, with["joint2.contact_moment"]}}});
  WriteSvg(folder + "/figure_10b.svg",
           {"Figure 10(b): moment of contact at joint 2, without clearance",
            "time [s]",
            "moment [N m]",
            {{"without", without.t, without["joint2.contact_moment"]}}});
}

std::string Listed(const std::vector<double>& values) {
  std::string text;
  for (const double v : values) text += fmt::format("{}{:.2f}", text.empty() ? "" : ", ", v);
  return text;
}

void Claims() {
  fmt::print(
      "\n| n | beta [s] | fold | clearance | last latch [s] | contacts in 5 s | hub.y [mm] | "
      "hub.theta [rad] | in the 2 s after the last latch | moment at joint 2 [N m] | at locking | "
      "peaks of hub.theta [Hz] | of the tip's deflection [Hz] |\n"
      "|---|---|---|---|---|---|---|---|---|---|---|---|---|\n");
  const std::vector<Case> cases = {{4, 0.0, "zigzag"},  {8, 0.0, "zigzag"},  {16, 0.0, "zigzag"},
                                   {4, 5e-5, "zigzag"}, {8, 5e-5, "zigzag"}, {8, 5e-4, "zigzag"},
                                   {4, 0.0, "roll"},    {8, 5e-5, "roll"},   {4, 0.0, "ajar"},
                                   {8, 5e-5, "ajar"}};
  for (const Case& c : cases) {
    for (const bool clearance : {true, false}) {
      const Numbers n = NumbersOf(Deployment(clearance, c, 10.0));
      fmt::print(
          "| {} | {:g} | {} | {} | {:.3f} | {} | {:.1f} | {:.4f} | {:.4f} | {:.1f} | {:.1f} | {} | "
          "{} |\n",
          c.segments, c.damping, c.fold, clearance ? "yes" : "no", n.last_latch, n.impacts,
          1e3 * n.range_y, n.range_angle, n.after_angle, n.moment, n.locking, Listed(n.hub),
          Listed(n.tip));
      std::fflush(stdout);
    }
  }
}

void Suspension() {
  fmt::print("\n| suspension | latches [s], joints in the order of their names |\n|---|---|\n");
  for (const bool hung : {true, false}) {
    data::Scene scene = Read("deployment/scene_suspension.toml");
    if (!hung) scene.suspension.reset();
    sim::SimulateOptions options;
    const Record run = Run(scene, options);
    std::vector<double> at(4, NAN);
    for (const Event& e : run.report.events) {
      if (e.kind == EventKind::kLatch) at[e.joint] = e.t;
    }
    fmt::print("| {} | {} |\n", hung ? "7 m strings" : "none", Listed(at));
  }
}

}  // namespace
}  // namespace unfurl::bench

int main(int argc, char** argv) {
  if (argc != 2) {
    fmt::print(stderr, "usage: paper_figures FOLDER\n");
    return 2;
  }
  try {
    unfurl::bench::SliderCrankFigures(argv[1]);
    unfurl::bench::DeploymentFigures(argv[1]);
    unfurl::bench::Suspension();
    unfurl::bench::Claims();
  } catch (const unfurl::Error& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 2;
  }
  return 0;
}
