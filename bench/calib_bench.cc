// What a calibration costs and what it buys.
//   calib_bench time
#include <fmt/format.h>

#include <chrono>
#include <cstdio>
#include <string>

#include "calib/calibrate.h"
#include "tests/calib/fixtures.h"

namespace {

using namespace unfurl;
using namespace unfurl::calib;

double Now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

void Time() {
  for (const int n : {60, 200, 600}) {
    const auto study = calib::testing::MakeStudy(1, n);
    double start = Now();
    const RigFit fit = FitRig(study.data, {}, "bench");
    const double all = Now() - start;
    start = Now();
    GuessCameras(study.data, {}, "bench");
    const double guess = Now() - start;
    start = Now();
    BundleState state = fit.bundle.state;
    const auto summary = SolveBundle(study.data, fit.priors, fit.bundle.weighting, {}, &state);
    const double again = Now() - start;
    CalibrateOptions options;
    options.workers = 1;
    start = Now();
    Calibrate(study.data, options, "bench");
    fmt::print(
        "{} points: FitRig {:.1f} ms (guess {:.1f}), bundle from its solution {:.1f} ms ({} "
        "iterations), Calibrate {:.1f} ms\n",
        n, 1e3 * all, 1e3 * guess, 1e3 * again, summary.iterations, 1e3 * (Now() - start));
  }
}

}  // namespace

int main(int argc, char** argv) {
  const std::string what = argc > 1 ? argv[1] : "time";
  if (what == "time") Time();
  return 0;
}
