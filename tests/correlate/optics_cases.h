#pragma once

#include "tests/correlate/deployment.h"

namespace unfurl::correlate {

// Optics that are wrong in a smooth way over half a metre: known to the tracks (directions common
// to all samples), or not.
struct OpticsCase {
  double rms = 0.0;  // of the displacement [m]
  bool claimed = true;
};

struct OpticsCount {
  int trials = 0, usable = 0;
  int unexplained = 0;      // the model does not explain the data
  int determined = 0;       // parameters called so
  int wrongly = 0;          // of them, with a 95% interval that leaves the truth out
  int clearance_found = 0;  // called determined, and within three standard errors
  int covered[3] = {0, 0, 0};
  double percent[3] = {0.0, 0.0, 0.0};  // largest standard error [% of the value]
  std::string words;
};

// Clearance, beam damping and stiffness from 1.6 s of the deployment, marks of 0.2 mm white noise.
inline OpticsCount CountOptics(const OpticsCase& which, int trials, std::uint64_t first) {
  constexpr double kDuration = 1.6, kLength = 0.5;  // [s, m]
  constexpr int kEach = 20;                         // directions for either axis
  using D = Deployment;
  const std::vector<D::Unknown> unknown = {D::kClearance, D::kDamping, D::kStiffness};
  std::vector<FitResult> fits(static_cast<std::size_t>(trials));
  std::vector<std::vector<double>> truths(fits.size());
  ParallelFor(fits.size(), 0, [&](std::size_t i) {
    Rng rng = Rng(first + i).Stream("optics");
    auto about = [&](double v, double part) { return v * std::exp(rng.Uniform(-part, part)); };
    truths[i] = {about(0.0052, 0.2), about(2e-4, 0.4), about(0.218, 0.05)};
    FitProblem problem;
    problem.parameters = D::Parameters(unknown);
    std::vector<double> start;
    for (const Parameter& p : problem.parameters) start.push_back(p.start);
    const study::SceneModel model(D::Binding(unknown, 1e-6), start);
    const study::SceneModel tighter(D::Binding(unknown, 1e-7), start);
    const Trial recording = D::Recording(kDuration);
    Observations data = Record(model, truths[i], D::Marks(), recording, rng);
    SmoothOptics(data, recording.X_WM, which.rms, kLength, kEach).Apply(which.claimed, rng, &data);
    problem.trials.resize(1);
    problem.trials[0].observations = &data;
    problem.trials[0].model = &model;
    problem.trials[0].tighter = &tighter;
    FitOptions options;
    options.stages = {1.0};
    options.profile.wanted = false;
    options.workers = 1;
    fits[i] = Fit(problem, options);
  });
  OpticsCount count;
  count.trials = trials;
  for (std::size_t i = 0; i < fits.size(); ++i) {
    const FitResult& fit = fits[i];
    count.words += fmt::format("seed {}: {}", first + i, fit.message);
    if (!fit.Usable()) {
      count.words += "\n";
      continue;
    }
    ++count.usable;
    count.unexplained += fit.trials[0].goodness.outcome == Explained::kNo ? 1 : 0;
    count.words += fmt::format(", residuals {:.3g} sigma", std::sqrt(fit.trials[0].chi2_per_dof));
    for (std::size_t j = 0; j < 3; ++j) {
      const ParameterEstimate& e = fit.parameters[j];
      const double off = e.value - truths[i][j];
      const bool known = e.verdict == Verdict::kDetermined || e.verdict == Verdict::kMeshLimited;
      const bool inside = std::abs(off) <= 1.959964 * e.sigma;
      count.determined += known ? 1 : 0;
      count.wrongly += known && !inside ? 1 : 0;
      count.covered[j] += inside ? 1 : 0;
      count.percent[j] = std::max(count.percent[j], 100.0 * e.sigma / std::abs(e.value));
      if (j == 0) count.clearance_found += known && std::abs(off) < 3.0 * e.sigma ? 1 : 0;
      count.words += fmt::format(
          "; {} {:.5g} ({:.2g}%), off by {:+.2f} sigma, {}", D::Parameters(unknown)[j].name,
          e.value, 100.0 * e.sigma / std::abs(e.value), off / e.sigma, Name(e.verdict));
    }
    count.words += "\n";
  }
  return count;
}

}  // namespace unfurl::correlate
