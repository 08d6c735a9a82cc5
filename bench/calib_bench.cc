// What a calibration costs and what it buys. Rays through the shipped lab's glass, unless said.
//   calib_bench time             processor time of one, model as generator
//   calib_bench points [RIGS]    number of survey points against error, bound and time
//   calib_bench order [RIGS]     order of the lens model against error and time
//   calib_bench region [RIGS]    error by region: RMS, 95%, largest, over the bound
//   calib_bench lost [RIGS]      error without each of the four cameras, over what is predicted
//   calib_bench gross [RIGS]     share of gross readings and points found, by their size
//   calib_bench detectable [RIGS]  redundancy of the data and the least errors that show
//   calib_bench efficiency [RIGS]  error over the bound, model as generator
#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "base/error.h"
#include "base/random_vector.h"
#include "base/statistics.h"
#include "base/worker_pool.h"
#include "cpu_time.h"
#include "tests/calib/fixtures.h"
#include "tests/calib/traced.h"

namespace {

using namespace unfurl;
using namespace unfurl::calib;

using calib::testing::FindCheckPoints;
using calib::testing::TracedLab;
using Errors = calib::testing::TracedErrors;

struct Sums {
  double squares = 0.0, bound = 0.0, n = 0.0, seconds = 0.0, floor = 0.0;
  void Add(const Errors& errors) {
    for (std::size_t k = 0; k < errors.error.size(); ++k) {
      squares += errors.error[k].squaredNorm();
      bound += errors.bound[k];
      n += 1.0;
    }
  }
  void Add(const Sums& other) {
    squares += other.squares;
    bound += other.bound;
    n += other.n;
    seconds += other.seconds;
    floor += other.floor;
  }
};

template <typename Each>
Sums OverRigs(std::size_t rigs, const Each& each) {
  std::vector<Sums> all(rigs);
  ParallelFor(rigs, 0, [&](std::size_t k) { all[k] = each(500 + k); });
  Sums sum;
  for (const Sums& one : all) sum.Add(one);
  sum.seconds /= static_cast<double>(rigs);
  sum.floor /= static_cast<double>(rigs);
  return sum;
}

void Time() {
  for (const int n : {60, 200, 600}) {
    const auto study = calib::testing::MakeStudy(1, n);
    double start = bench::ThreadSeconds();
    const RigFit fit = FitRig(study.data, {}, "bench");
    const double all = bench::ThreadSeconds() - start;
    start = bench::ThreadSeconds();
    GuessCameras(study.data, {}, "bench");
    const double guess = bench::ThreadSeconds() - start;
    CalibrateOptions options;
    options.workers = 1;
    start = bench::ThreadSeconds();
    Calibrate(study.data, options, "bench");
    fmt::print("{} points: fit {:.0f} ms (first guess {:.0f}); with orders and folds {:.0f} ms\n",
               n, 1e3 * all, 1e3 * guess, 1e3 * (bench::ThreadSeconds() - start));
  }
}

void Points(std::size_t rigs) {
  fmt::print("| survey points | error RMS [mm] | bound [mm] | ratio | processor [s] |\n");
  for (const int n : {12, 25, 50, 100, 200, 400}) {
    const Sums sum = OverRigs(rigs, [&](std::uint64_t seed) {
      Sums out;
      const TracedLab lab(seed);
      const Observations data = lab.Survey(n);
      const double start = bench::ThreadSeconds();
      try {
        const RigFit fit = FitRig(data, {}, "bench");
        out.seconds = bench::ThreadSeconds() - start;
        out.Add(FindCheckPoints(lab, fit.rig, 200));
      } catch (const std::exception& error) {
        fmt::print("  {} points, seed {}: {}\n", n, seed, error.what());
      }
      return out;
    });
    fmt::print("| {} | {:.3f} | {:.3f} | {:.3f} | {:.3f} |\n", n,
               1e3 * std::sqrt(sum.squares / sum.n), 1e3 * std::sqrt(sum.bound / sum.n),
               std::sqrt(sum.squares / sum.bound), sum.seconds);
    std::fflush(stdout);
  }
}

void Order(std::size_t rigs) {
  fmt::print(
      "| lens model | error RMS [mm] | predicted [mm] | largest floor [px] | processor [s] |\n");
  const auto orders = measure::OrdersOf(data::LensModel::kRectilinear);
  for (std::size_t order = 0; order < orders.size(); ++order) {
    const Sums sum = OverRigs(rigs, [&](std::uint64_t seed) {
      Sums out;
      const TracedLab lab(seed);
      const Observations data = lab.Survey(200);
      CalibrateOptions options;
      options.order = static_cast<int>(order);
      const double start = bench::ThreadSeconds();
      const RigFit fit = FitRig(data, options, "bench");
      out.seconds = bench::ThreadSeconds() - start;
      out.floor = fit.rig.model_floor_px;
      out.Add(FindCheckPoints(lab, fit.rig, 200));
      return out;
    });
    fmt::print("| {} | {:.3f} | {:.3f} | {:.3f} | {:.3f} |\n", orders[order].name,
               1e3 * std::sqrt(sum.squares / sum.n), 1e3 * std::sqrt(sum.bound / sum.n), sum.floor,
               sum.seconds);
    std::fflush(stdout);
  }
}

void Region(std::size_t rigs) {
  std::vector<Errors> all(rigs);
  ParallelFor(rigs, 0, [&](std::size_t k) {
    const TracedLab lab(500 + k);
    all[k] = FindCheckPoints(lab, FitRig(lab.Survey(200), {}, "bench").rig, 400);
  });
  struct Of {
    const char* name;
    double low, high;  // of the largest coordinate [m]
  };
  fmt::print("| where | points | RMS [mm] | bound [mm] | ratio | 95% [mm] | largest [mm] |\n");
  for (const Of& region :
       {Of{"within 0.5 m of the middle, by coordinate", 0.0, 0.5}, Of{"0.5 to 0.9 m", 0.5, 0.9},
        Of{"beyond 0.9 m", 0.9, 2.0}, Of{"all", 0.0, 2.0}}) {
    double squares = 0.0, bound = 0.0;
    std::vector<double> sizes;
    for (const Errors& errors : all) {
      for (std::size_t k = 0; k < errors.error.size(); ++k) {
        const double out = errors.at[k].cwiseAbs().maxCoeff();
        if (out < region.low || out >= region.high) continue;
        squares += errors.error[k].squaredNorm();
        bound += errors.bound[k];
        sizes.push_back(errors.error[k].norm());
      }
    }
    const auto n = static_cast<double>(sizes.size());
    fmt::print("| {} | {} | {:.3f} | {:.3f} | {:.3f} | {:.3f} | {:.3f} |\n", region.name,
               sizes.size(), 1e3 * std::sqrt(squares / n), 1e3 * std::sqrt(bound / n),
               std::sqrt(squares / bound), 1e3 * Quantile(sizes, 0.95), 1e3 * Quantile(sizes, 1.0));
  }
}

void Lost(std::size_t rigs) {
  std::vector<std::array<Sums, 4>> all(rigs);
  ParallelFor(rigs, 0, [&](std::size_t k) {
    const TracedLab lab(500 + k);
    const data::Rig rig = FitRig(lab.Survey(200), {}, "bench").rig;
    for (int c = 0; c < 4; ++c) {
      all[k][static_cast<std::size_t>(c)].Add(FindCheckPoints(lab, rig, 200, c));
    }
  });
  fmt::print("| lost camera | error RMS [mm] | predicted [mm] | ratio |\n");
  for (std::size_t c = 0; c < 4; ++c) {
    Sums sum;
    for (const auto& one : all) sum.Add(one[c]);
    fmt::print("| {} | {:.3f} | {:.3f} | {:.3f} |\n", c + 1, 1e3 * std::sqrt(sum.squares / sum.n),
               1e3 * std::sqrt(sum.bound / sum.n), std::sqrt(sum.squares / sum.bound));
  }
}

// One in ten readings, or points of the survey, wrong by `size` sigmas; model as generator.
void Gross(std::size_t rigs) {
  // Best: with the true cameras and the true sigmas, which no calibration has.
  fmt::print(
      "| size [sigmas] | readings found [%] | best [%] | false [%] | best [%] "
      "| points found [%] | best [%] | false [%] | best [%] |\n");
  for (const double size : {6.0, 10.0, 15.0, 20.0, 30.0, 100.0, 1000.0}) {
    std::vector<std::array<double, 12>> counts(rigs);
    ParallelFor(2 * rigs, 0, [&](std::size_t job) {
      const std::size_t k = job / 2;
      const bool survey = job % 2 == 1;
      auto study = calib::testing::MakeStudy(k + 1);
      Rng rng = Rng(k + 1).Stream("gross");
      std::vector<std::size_t> bad;
      const std::size_t n = survey ? study.data.ids.size() : study.data.readings.size();
      for (std::size_t i = 0; i < n; ++i) {
        if (rng.Uniform() > 0.1) continue;
        bad.push_back(i);
        if (survey) {
          const Eigen::Vector3d way = NormalVector(&rng);
          study.data.p.col(static_cast<Eigen::Index>(i)) += 3e-4 * size * way.normalized();
        } else {
          study.data.readings[i].u_px += (rng.Uniform() < 0.5 ? -0.05 : 0.05) * size;
        }
      }
      const RigFit fit = FitRig(study.data, {}, "bench");
      const Weighting best = calib::testing::BestGross(study.data, study.truth);
      for (const std::size_t i : bad) {
        const Weighting& w = fit.bundle.weighting;
        counts[k][survey ? 2 : 0] += survey ? !w.UsesSurvey(i) : !w.Uses(i);
        counts[k][survey ? 3 : 1] += 1.0;
        counts[k][survey ? 5 : 4] += survey ? !best.UsesSurvey(i) : !best.Uses(i);
      }
      // Of everything that is not: what is left out all the same.
      const Weighting& w = fit.bundle.weighting;
      double out = 0.0, out_best = 0.0;
      for (std::size_t i = 0; i < study.data.readings.size(); ++i) {
        out += !w.Uses(i);
        out_best += !best.Uses(i);
      }
      for (std::size_t i = 0; i < study.data.ids.size(); ++i) {
        out += !w.UsesSurvey(i);
        out_best += !best.UsesSurvey(i);
      }
      const auto good =
          static_cast<double>(study.data.readings.size() + study.data.ids.size() - bad.size());
      const std::size_t at = survey ? 9 : 6;
      counts[k][at] += out - counts[k][survey ? 2 : 0];
      counts[k][at + 1] += out_best - counts[k][survey ? 5 : 4];
      counts[k][at + 2] += good;
    });
    std::array<double, 12> sum{};
    for (const auto& one : counts) {
      for (std::size_t m = 0; m < sum.size(); ++m) sum[m] += one[m];
    }
    fmt::print("| {} | {:.1f} | {:.1f} | {:.2f} | {:.2f} | {:.1f} | {:.1f} | {:.2f} | {:.2f} |\n",
               size, 100.0 * sum[0] / sum[1], 100.0 * sum[4] / sum[1], 100.0 * sum[6] / sum[8],
               100.0 * sum[7] / sum[8], 100.0 * sum[2] / sum[3], 100.0 * sum[5] / sum[3],
               100.0 * sum[9] / sum[11], 100.0 * sum[10] / sum[11]);
    std::fflush(stdout);
  }
}

// What of an error its datum shows, and the least error that a test at `kTest` sigmas finds in 95%
// of the cases (minimal detectable bias, Baarda), by the number of survey points.
void Detectable(std::size_t rigs) {
  constexpr double kTest = 4.0, kPower = 1.645;
  fmt::print(
      "| survey points | redundancy of a reading, 10% / median / 90% | least error found "
      "[sigmas], 10% / median / 90% | below 10 sigmas [%] | of a survey's coordinate, median |\n");
  for (const int n : {12, 60, 200}) {
    std::vector<std::vector<double>> reading(rigs), point(rigs);
    ParallelFor(rigs, 0, [&](std::size_t k) {
      const TracedLab lab(500 + k);
      try {
        const RigFit fit = FitRig(lab.Survey(n), {}, "bench");
        reading[k] = fit.bundle.redundancy.reading;
        for (const double r : fit.bundle.redundancy.survey) point[k].push_back(r / 3.0);
      } catch (const Error&) {  // of twelve points a camera may see fewer
      }
    });
    std::vector<double> r, p, least;
    for (std::size_t k = 0; k < rigs; ++k) {
      r.insert(r.end(), reading[k].begin(), reading[k].end());
      p.insert(p.end(), point[k].begin(), point[k].end());
    }
    double below = 0.0;
    for (const double one : r) {
      least.push_back((kTest + kPower) / std::sqrt(std::max(one, 1e-12)));
      below += least.back() < 10.0;
    }
    fmt::print("| {} | {:.2f} / {:.2f} / {:.2f} | {:.1f} / {:.1f} / {:.1f} | {:.0f} | {:.1f} |\n",
               n, Quantile(r, 0.1), Median(r), Quantile(r, 0.9), Quantile(least, 0.1),
               Median(least), Quantile(least, 0.9),
               100.0 * below / static_cast<double>(least.size()),
               (kTest + kPower) / std::sqrt(std::max(Median(p), 1e-12)));
  }
}

void Efficiency(std::size_t rigs) {
  std::vector<std::array<double, 2>> all(rigs);
  ParallelFor(rigs, 0, [&](std::size_t k) {
    const auto study =
        calib::testing::MakeStudy(1000 + k, 200, {.f_spread = 0.1, .pose_error = 0.05});
    const auto check = calib::testing::CheckPoints(1000 + k);
    const auto errors =
        calib::testing::ErrorsOf(FitRig(study.data, {}, "bench").rig, study.truth, check);
    // The bound at the truth: what all of the survey says there, with nothing left out.
    BundleState state{study.truth, study.points};
    const auto priors = [&] {
      std::vector<CameraPrior> out;
      for (const auto& guess : GuessCameras(study.data, {}, "bench")) out.push_back(guess.prior);
      return out;
    }();
    data::Rig bound;
    bound.cameras = study.truth;
    bound.volume_low.setConstant(-1.1);
    bound.volume_high.setConstant(1.1);
    const std::vector<double> ones(study.data.readings.size(), 1.0),
        points(study.data.ids.size(), 1.0);
    bound.covariance =
        CameraCovariance(PriorInformation(priors) + DataInformation(study.data, priors,
                                                                    EqualWeighting(study.data, 0.0),
                                                                    false, state, ones, points));
    const auto best = calib::testing::ErrorsOf(bound, study.truth, check);
    all[k] = {errors.Rms() * errors.Rms(), best.PredictedRms() * best.PredictedRms()};
  });
  double squares = 0.0, bound = 0.0;
  for (const auto& one : all) {
    squares += one[0];
    bound += one[1];
  }
  const auto n = static_cast<double>(rigs);
  fmt::print("{} rigs: error {:.4f} mm RMS, bound {:.4f} mm, ratio {:.4f}\n", rigs,
             1e3 * std::sqrt(squares / n), 1e3 * std::sqrt(bound / n), std::sqrt(squares / bound));
}

}  // namespace

int main(int argc, char** argv) {
  const std::string what = argc > 1 ? argv[1] : "time";
  const std::size_t rigs = argc > 2 ? std::strtoul(argv[2], nullptr, 10) : 20;
  if (what == "time") Time();
  if (what == "points") Points(rigs);
  if (what == "order") Order(rigs);
  if (what == "region") Region(rigs);
  if (what == "lost") Lost(rigs);
  if (what == "gross") Gross(rigs);
  if (what == "detectable") Detectable(rigs);
  if (what == "efficiency") Efficiency(rigs);
  return 0;
}
