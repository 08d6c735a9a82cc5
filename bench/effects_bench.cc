// What each effect of sensor, light and room costs in time, and what it does to the readings: one
// effect at a time on the shipped laboratory, the same noise in every run.
//   effects_bench [LINES]
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <limits>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/statistics.h"
#include "cpu_time.h"
#include "data/lab.h"
#include "measure/expose.h"
#include "measure/exposer.h"
#include "measure/spot.h"

namespace {

using namespace unfurl;
using namespace unfurl::measure;

struct Outcome {
  std::vector<double> error;        // reading less truth, NaN where there is none [px]
  std::vector<double> whitened;     // of those there are
  double lost = 0.0, second = 0.0;  // shares of lit lines
};

// Four marks on circles in the model's plane, about 1 m/s, and a dark line, in turn.
Eigen::Vector3d Place(std::size_t mark, double t) {
  const double reach = 0.15 + 0.2 * static_cast<double>(mark);
  const double phase = (2.0 - 0.3 * static_cast<double>(mark)) * t + static_cast<double>(mark);
  return {reach * std::cos(phase), reach * std::sin(phase), 0.0};
}

// The shipped laboratory with these settings. `still` takes the noise away, but not from what the
// estimators know of it: what is left is bias.
Outcome Run(const std::vector<std::string>& settings, bool still, std::size_t lines) {
  std::vector<std::string> overrides;
  if (still) {
    overrides = {"sensor.shot_noise=false", "sensor.read_noise=0.0", "sensor.bits=16"};
  }
  overrides.insert(overrides.end(), settings.begin(), settings.end());
  constexpr std::size_t kWarm = 1280;  // lines that only teach the background
  const data::Lab lab =
      data::ReadLab(UNFURL_SOURCE_DIR "/data/sets/deployment/lab.toml", overrides);
  const VirtualRig rig = MakeVirtualRig(lab);
  data::TrialHeader header = HeaderOf(lab);
  if (still) header.format.read_noise_counts = 35.0 / header.format.electrons_per_count;
  const std::size_t cameras = rig.cameras.size();
  std::vector<Background> backgrounds(cameras, Background(header.format));
  std::vector<SpotFinder> finders(cameras, SpotFinder(header.format));
  SetResponses(header.response, finders);
  Exposer exposer(lab, rig);
  std::vector<std::uint16_t> counts(header.format.elements());
  const Rng noise = Rng(lab.seed).Stream("bench");
  const Eigen::Vector3d axis = rig.X_WM.linear() * lab.led.axis;
  Outcome outcome;
  std::size_t lit = 0;
  for (std::size_t line = 0; line < kWarm + lines; ++line) {
    const double t = (static_cast<double>(line) + 0.5) / header.line_rate;
    const std::size_t mark = line % 5;
    const Eigen::Vector3d p = Place(mark, t);
    const Exposer::Led led{.instants = {&p, 1}, .axis = axis};
    const Exposer::Line light{.leds = {&led, mark < 4 ? std::size_t{1} : std::size_t{0}},
                              .electrons = rig.flash_electrons,
                              .t = t,
                              .mains_phase = rig.mains_phase};
    for (std::size_t c = 0; c < cameras; ++c) {
      exposer.Collect(c, light);
      exposer.Read(c, DarkLevel(lab.sensor, t, rig.drift_phase[c]),
                   noise.Stream("line", line * cameras + c), counts);
      if (mark == 4) backgrounds[c].Add(counts);
      if (mark == 4 || line < kWarm) continue;
      ++lit;
      SpotLight truth;
      const bool seen = TraceSpot(rig.cameras[c], p, &truth);
      const Spot spot = finders[c].Find(counts, backgrounds[c]);
      const bool usable = seen && Usable(spot);
      outcome.error.push_back(usable ? spot.u_px - truth.centre_px
                                     : std::numeric_limits<double>::quiet_NaN());
      outcome.lost += !usable;
      outcome.second += (spot.flags & kSpotSecond) != 0;
      if (usable) outcome.whitened.push_back(outcome.error.back() / spot.s_px);
    }
  }
  outcome.lost /= static_cast<double>(lit);
  outcome.second /= static_cast<double>(lit);
  return outcome;
}

// Microseconds per camera and line of exposing with these settings, and without them: the least of
// rounds in turn, since other work on the machine only adds.
void Time(const std::vector<std::string>& settings, double* with, double* without) {
  constexpr int kRounds = 12;
  constexpr std::size_t kLines = 50;
  const char* path = UNFURL_SOURCE_DIR "/data/sets/deployment/lab.toml";
  const data::Lab labs[] = {data::ReadLab(path, settings), data::ReadLab(path)};
  double least[] = {1e9, 1e9};
  for (int round = 0; round < kRounds; ++round) {
    for (int i = 0; i < 2; ++i) {
      const VirtualRig rig = MakeVirtualRig(labs[i]);
      Exposer exposer(labs[i], rig);
      std::vector<std::uint16_t> counts(labs[i].sensor.format.elements());
      const double start = bench::ThreadSeconds();
      for (std::size_t line = 0; line < kLines; ++line) {
        const Eigen::Vector3d p = Place(line % 4, 0.001 * static_cast<double>(line));
        const Exposer::Led led{.instants = {&p, 1}, .axis = labs[i].led.axis};
        for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
          exposer.Collect(c, {.leds = {&led, 1},
                              .electrons = rig.flash_electrons,
                              .t = 0.001 * static_cast<double>(line)});
          exposer.Read(c, labs[i].sensor.dark_level, Rng(line), counts);
        }
      }
      const double each =
          (bench::ThreadSeconds() - start) / static_cast<double>(kLines * rig.cameras.size());
      least[i] = std::min(least[i], 1e6 * each);
    }
  }
  *with = least[0];
  *without = least[1];
}

struct Effect {
  const char* name;
  std::vector<std::string> settings;
};

void Table(std::size_t lines) {
  const std::vector<std::string> flat = {"flat_field.lines=100", "flat_field.level=0.5"};
  const std::vector<std::string> pane = {
      "reflection.pane.centre=[1.6, 0.0, 0.5]", "reflection.pane.normal=[1.0, 0.0, 0.0]",
      "reflection.pane.radius=1.5", "reflection.pane.reflectance=0.08"};
  const std::vector<Effect> effects = {
      {"as shipped", {}},
      {"shot noise off", {"sensor.shot_noise=false"}},
      {"read noise off", {"sensor.read_noise=0.0"}},
      {"drift of the dark level off", {"sensor.dark_drift=0.0"}},
      {"drift five times as large", {"sensor.dark_drift=750.0"}},
      {"10 bits", {"sensor.bits=10"}},
      {"8 bits", {"sensor.bits=8"}},
      {"odd/even offset 120 e-", {"sensor.odd_offset=120.0"}},
      {"odd/even gain 1%", {"sensor.odd_gain=0.01"}},
      {"odd/even gain 1%, flat field", {"sensor.odd_gain=0.01", flat[0], flat[1]}},
      {"response 1%", {"sensor.nonuniformity=0.01"}},
      {"response 1%, flat field", {"sensor.nonuniformity=0.01", flat[0], flat[1]}},
      {"dark pattern 30 e-", {"sensor.dark_nonuniformity=30.0"}},
      {"peak over full well (led.peak = 2)", {"led.peak=2.0"}},
      {"the same, blooming 0.3", {"led.peak=2.0", "sensor.blooming=0.3"}},
      {"residual charge 0.5%", {"sensor.residual=0.005"}},
      {"residual charge 2%", {"sensor.residual=0.02"}},
      {"ambient light, flicker 30%",
       {"ambient.level=1.5e6", "ambient.slope=0.2", "ambient.flicker=0.3"}},
      {"a lamp in view, half an LED, flicker 30%",
       {"lamp.door.position=[0.3, 0.2, -0.4]", "lamp.door.brightness=0.5",
        "lamp.door.flicker=0.3"}},
      {"LED half angle 60 degrees", {"led.half_angle=1.05"}},
      {"LED one tenth as bright", {"led.peak=0.05"}},
      {"a pane that mirrors 8%", pane},
      {"an arm that hides some views",
       {"occluder.arm.centre=[0.4, 0.4, 1.2]", "occluder.arm.normal=[0.0, 0.0, 1.0]",
        "occluder.arm.radius=0.15"}},
      {"biconvex lens", {"lens.curved=both", "lens.radius=0.032"}},
  };
  fmt::print(
      "\n| effect | adds to the time [us] | bias rms [px] | bias largest [px] | error rms [px] | "
      "error / "
      "stated "
      "| lost [%] | second spot [%] |\n|---|---|---|---|---|---|---|---|\n");
  Outcome base;
  for (const Effect& effect : effects) {
    const Outcome o = Run(effect.settings, false, lines);
    const Outcome still = Run(effect.settings, true, lines);
    double with, without;
    Time(effect.settings, &with, &without);
    if (base.error.empty()) {
      fmt::print("(without any: {:.1f} us per camera and line)\n", without);
    }
    if (base.error.empty()) base = still;
    std::vector<double> error, bias;
    double largest = 0.0;
    for (std::size_t i = 0; i < o.error.size(); ++i) {
      if (!std::isnan(o.error[i])) error.push_back(o.error[i]);
      if (std::isnan(still.error[i]) || std::isnan(base.error[i])) continue;
      bias.push_back(still.error[i] - base.error[i]);
      largest = std::max(largest, std::abs(bias.back()));
    }
    fmt::print("| {} | {:+.1f} | {:.4f} | {:.4f} | {:.4f} | {:.2f} | {:.1f} | {:.1f} |\n",
               effect.name, with - without, Rms(bias), largest, Rms(error), Rms(o.whitened),
               100.0 * o.lost, 100.0 * o.second);
    std::fflush(stdout);
  }
}

}  // namespace

int main(int argc, char** argv) {
  try {
    Table(argc > 1 ? static_cast<std::size_t>(std::atol(argv[1])) : 1000);
  } catch (const unfurl::Error& error) {
    std::fprintf(stderr, "effects_bench: %s\n", error.what());
    return unfurl::kExitBadInput;
  }
  return 0;
}
