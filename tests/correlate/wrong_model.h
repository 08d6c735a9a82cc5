#pragma once

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "base/statistics.h"
#include "base/worker_pool.h"
#include "correlate/fit/fit.h"
#include "study/scene_model.h"
#include "tests/correlate/one_arm.h"
#include "tests/correlate/pendulum.h"
#include "tests/correlate/two_link.h"
#include "tests/source_dir.h"

namespace unfurl::correlate {

// What fits of a model to data of another make of it.
struct WrongModelCount {
  int trials = 0, usable = 0;
  std::array<int, 4> outcome = {};  // by Explained
  int determined = 0;               // parameters called so
  int determined_wrongly = 0;       // with a 95% interval that leaves the truth out
  std::vector<double> bias;         // mean (value - truth) / truth, by parameter
  std::vector<double> bias_sigmas;  // mean (value - truth) / sigma
  std::vector<double> scatter;      // of the latter
  int Outcome(Explained which) const { return outcome[static_cast<std::size_t>(which)]; }
  std::string Words(const std::vector<Parameter>& parameters) const {
    std::string words = fmt::format(
        "{} of {} usable; explained {}, as noise {}, by the mesh {}, not {}; determined {}, {} of "
        "them wrongly;",
        usable, trials, outcome[0], outcome[1], outcome[2], outcome[3], determined,
        determined_wrongly);
    for (std::size_t j = 0; j < bias.size(); ++j) {
      words += fmt::format(" {} off by {:+.2f}% ({:+.2f} sigma, scatter {:.2f})",
                           parameters[j].name, 100.0 * bias[j], bias_sigmas[j], scatter[j]);
    }
    return words;
  }
};

// A truth per seed and the fit to its data.
struct WrongModelFit {
  std::vector<double> truth;
  FitResult fit;
};

// `compared`: how many of the parameters mean the same in both models.
inline WrongModelCount CountWrong(const std::vector<WrongModelFit>& fits, std::size_t compared) {
  constexpr double k95 = 1.959964;
  WrongModelCount count;
  count.trials = static_cast<int>(fits.size());
  std::vector<std::vector<double>> z(compared);
  count.bias.assign(compared, 0.0);
  for (const WrongModelFit& one : fits) {
    if (!one.fit.Usable()) continue;
    ++count.usable;
    ++count.outcome[static_cast<std::size_t>(one.fit.trials[0].goodness.outcome)];
    for (std::size_t j = 0; j < compared; ++j) {
      const ParameterEstimate& e = one.fit.parameters[j];
      const double off = e.value - one.truth[j];
      count.bias[j] += off / one.truth[j];
      z[j].push_back(off / e.sigma);
      const bool known = e.verdict == Verdict::kDetermined || e.verdict == Verdict::kMeshLimited;
      count.determined += known ? 1 : 0;
      count.determined_wrongly += known && std::abs(off) > k95 * e.sigma ? 1 : 0;
    }
  }
  for (std::size_t j = 0; j < compared; ++j) {
    count.bias[j] /= std::max(1, count.usable);
    count.bias_sigmas.push_back(Mean(z[j]));
    count.scatter.push_back(std::sqrt(Variance(z[j])));
  }
  return count;
}

// Before the bounces make the motion answer to every last digit [s].
inline constexpr double kBouncing = 0.9;
// Looser, the solver's own scatter, which each impact magnifies, is as large as the marks' sigma,
// and the cost has hollows where there are none [-].
inline constexpr double kTolerance = 1e-7;

// The pendulum of the simulator fitted to data of `law`, from a start some per cent off.
inline std::vector<WrongModelFit> FitToLaw(StopLaw law, int trials, std::uint64_t first,
                                           double sigma = 2e-4) {
  std::vector<WrongModelFit> out(static_cast<std::size_t>(trials));
  ParallelFor(out.size(), 0, [&](std::size_t i) {
    Rng rng = Rng(first + i).Stream("law");
    auto about = [&](double value, double part) {
      return value * std::exp(rng.Uniform(-part, part));
    };
    out[i].truth = {about(0.0055, 0.2), law == StopLaw::kScene ? 0.85 : 0.95, about(3e-3, 0.3),
                    about(0.22, 0.1)};
    FitProblem problem;
    problem.parameters = Pendulum::Parameters();
    std::vector<double> start;
    for (std::size_t j = 0; j < problem.parameters.size(); ++j) {
      problem.parameters[j].start = j == 1 ? 0.85 : about(out[i].truth[j], 0.03);
      start.push_back(problem.parameters[j].start);
    }
    Trial recording = Pendulum::Recording(sigma);
    recording.duration = kBouncing;
    const Observations data = Record(OneArm(law), out[i].truth, Pendulum::Marks(), recording, rng);
    const study::SceneModel model(Pendulum::Binding(kTolerance), start);
    const study::SceneModel tighter(Pendulum::Binding(0.1 * kTolerance), start);
    problem.trials.resize(1);
    problem.trials[0].observations = &data;
    problem.trials[0].model = &model;
    problem.trials[0].tighter = &tighter;
    FitOptions options;
    options.stages_by_impacts = true;
    options.profile.wanted = false;
    options.workers = 1;
    out[i].fit = Fit(problem, options);
  });
  return out;
}

// The latching pendulum with a beam for its arm. Unknown: clearance, damping of the beam, stiffness
// of the spring.
struct FlexibleArm {
  static study::SceneModelOptions Binding(int segments, double rtol) {
    study::SceneModelOptions options;
    options.scene = std::string(UNFURL_SOURCE_DIR) + "/tests/correlate/flexible_arm.toml";
    options.set = {fmt::format("beam.arm.segments={}", segments)};
    options.keys = {{"joint.hinge.latch.theta_a", "joint.hinge.latch.theta_b"},
                    {"beam.arm.damping"},
                    {"joint.hinge.spring.stiffness"}};
    options.rtol = rtol;
    return options;
  }
  static std::vector<Parameter> Parameters() {
    std::vector<Parameter> all(3);
    all[0].name = "clearance", all[0].low = 0.002, all[0].high = 0.02, all[0].log = true;
    all[1].name = "damping", all[1].low = 1e-5, all[1].high = 2e-3, all[1].log = true;
    all[2].name = "stiffness", all[2].low = 0.15, all[2].high = 0.35, all[2].log = true;
    return all;
  }
};

// What made the data that a beam of 4 segments is fitted to.
struct BeamNature {
  int segments = 16;    // 0: a smooth beam in their place
  int order = 4;        // of that
  bool checked = true;  // a finer mesh is asked at the estimate
  bool profiles = false;
  bool ladder = false;  // instead: rungs of 6 and 8 segments, as a study finds them
  std::vector<std::string> faults = {};  // what the fit's scene does not know
  std::vector<std::string> Set() const {
    std::vector<std::string> set = faults;
    if (segments > 0) {
      set.push_back(fmt::format("beam.arm.segments={}", segments));
    } else {
      set.push_back("beam.arm.model=kirchhoff");
      set.push_back(fmt::format("beam.arm.order={}", order));
    }
    return set;
  }
};

inline std::vector<WrongModelFit> FitToBeam(const BeamNature& beam, int trials, std::uint64_t first,
                                            double sigma = 2e-4) {
  constexpr int kCoarse = 4, kFine = 6;
  std::vector<WrongModelFit> out(static_cast<std::size_t>(trials));
  ParallelFor(out.size(), 0, [&](std::size_t i) {
    Rng rng = Rng(first + i).Stream("mesh");
    auto about = [&](double value, double part) {
      return value * std::exp(rng.Uniform(-part, part));
    };
    out[i].truth = {about(0.0055, 0.2), about(2e-4, 0.3), about(0.22, 0.1)};
    FitProblem problem;
    problem.parameters = FlexibleArm::Parameters();
    std::vector<double> start;
    for (std::size_t j = 0; j < problem.parameters.size(); ++j) {
      problem.parameters[j].start = about(out[i].truth[j], 0.05);
      start.push_back(problem.parameters[j].start);
    }
    Trial recording = Pendulum::Recording(sigma);
    recording.duration = kBouncing;
    study::SceneModelOptions natural = FlexibleArm::Binding(kCoarse, kTolerance);
    for (const std::string& set : beam.Set()) natural.set.push_back(set);
    const study::SceneModel nature(natural, start);
    const Observations data = Record(nature, out[i].truth, {"mid", "tip"}, recording, rng);
    const study::SceneModel model(FlexibleArm::Binding(kCoarse, kTolerance), start);
    const study::SceneModel tighter(FlexibleArm::Binding(kCoarse, 0.1 * kTolerance), start);
    const study::SceneModel finer(FlexibleArm::Binding(kFine, 0.1 * kTolerance), start);
    problem.trials.resize(1);
    FitTrial& trial = problem.trials[0];
    trial.observations = &data;
    trial.model = &model;
    trial.tighter = &tighter;
    if (beam.checked) {
      constexpr double kGain = 1.0 * kFine * kFine / (kCoarse * kCoarse);
      trial.finer = &finer;
      trial.finer_factor = kGain / (kGain - 1.0);
    }
    const study::SceneModel middle(FlexibleArm::Binding(kFine, kTolerance), start);
    const study::SceneModel finest(FlexibleArm::Binding(2 * kCoarse, kTolerance), start);
    if (beam.ladder) {
      trial.finer = nullptr;
      trial.rungs = {{&middle, "6 segments", 4.0 / 9.0}, {&finest, "8 segments", 0.25}};
    }
    FitOptions options;
    options.stages_by_impacts = true;
    options.profile.wanted = beam.profiles;
    options.workers = 1;
    out[i].fit = Fit(problem, options);
  });
  return out;
}

// Fitted with 4 segments to data of `segments`; `checked`: a finer mesh is asked at the estimate.
inline std::vector<WrongModelFit> FitToMesh(int segments, bool checked, int trials,
                                            std::uint64_t first, double sigma = 2e-4) {
  return FitToBeam({segments, 0, checked, false}, trials, first, sigma);
}

}  // namespace unfurl::correlate
