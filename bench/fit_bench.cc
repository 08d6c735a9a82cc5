// What the accuracy of a fit costs: width of the 95% intervals against mesh, tolerance, number of
// simulations and length of the record, on a study of the deployment. docs/accuracy.md has the
// table.
//
//   fit_bench STUDY.toml TRACKS.h5 [ROW...]     rows by number, from 1; all without
#include <fmt/format.h>

#include <cstdlib>
#include <set>
#include <string>
#include <vector>

#include "base/error.h"
#include "bench/cpu_time.h"
#include "correlate/fit/fit.h"
#include "data/study.h"
#include "study/study_binding.h"

namespace unfurl::bench {
namespace {

struct Setting {
  std::string name;
  int segments = 8;
  std::vector<std::string> more;  // overrides of the study
};

std::string ForAllBeams(int segments) {
  std::string text;
  for (int beam = 1; beam <= 4; ++beam) {
    text += fmt::format("{}\"beam.beam{}.segments={}\"", beam == 1 ? "" : ", ", beam, segments);
  }
  return "study.set=[" + text + "]";
}

const std::vector<Setting> kSettings = {
    {"4 segments", 4, {}},
    {"8 segments, as shipped", 8, {}},
    {"12 segments", 12, {}},
    {"tolerance 1e-3", 8, {"model.rtol=1e-3"}},
    {"tolerance 1e-4", 8, {"model.rtol=1e-4"}},
    {"tolerance 1e-6", 8, {"model.rtol=1e-6"}},
    {"one step of the solver", 8, {"solver.max_iterations=1"}},
    {"without the mesh's check", 8, {"fidelity.wanted=false"}},
    {"with profiles", 8, {"profile.levels=[1.0, 2.0]"}},
    {"with profiles, 4 levels", 8, {"profile.levels=[0.5, 1.0, 1.5, 2.0]"}},
    {"8 points screened, 2 starts", 8, {"solver.screened=8", "solver.starts=2"}},
    {"1.3 s of the record", 8, {"trial.window=[0.0, 1.3]"}},
    {"2.5 s of the record", 8, {"trial.window=[0.0, 2.5]"}},
};

void Row(const Setting& setting, const std::string& study_path, const std::string& tracks) {
  std::vector<std::string> sets = {ForAllBeams(setting.segments), "profile.levels=[]"};
  sets.insert(sets.end(), setting.more.begin(), setting.more.end());
  const double start = CpuSeconds();
  study::BoundStudy bound = study::Bind(data::ReadStudy(study_path, sets), tracks);
  const correlate::FitResult fit = correlate::Fit(bound.problem, bound.options);
  const double seconds = CpuSeconds() - start;
  fmt::print("| {} | {} | {:.0f} |", setting.name, fit.evaluations.size(), seconds);
  if (!fit.Usable()) {
    fmt::print(" {} |\n", fit.message);
    return;
  }
  for (std::size_t j = 0; j < fit.parameters.size(); ++j) {
    const correlate::ParameterEstimate& e = fit.parameters[j];
    constexpr double k95 = 1.959964;
    const double percent = 100.0 * k95 / std::abs(e.value);
    fmt::print(" {:.5g} | {:.2g}% | {:.2g}% | {:.2g}% |", e.value, percent * e.sigma,
               percent * e.sigma_data, percent * e.sigma_model);
  }
  fmt::print(" {} |\n", fit.trials[0].model_error_rms > 0.0
                            ? fmt::format("{:.2g} mm", 1e3 * fit.trials[0].model_error_rms)
                            : std::string());
  std::fflush(stdout);
}

int Main(int argc, char** argv) {
  if (argc < 3) {
    fmt::print(stderr, "usage: fit_bench STUDY.toml TRACKS.h5 [ROW...]\n");
    return 2;
  }
  std::set<std::size_t> rows;
  for (int i = 3; i < argc; ++i) rows.insert(static_cast<std::size_t>(std::atoi(argv[i])));
  fmt::print(
      "| what | simulations | processor [s] | then by parameter: value, half width of the 95% "
      "interval, of the data alone, of the mesh alone | marks moved by the mesh |\n");
  for (std::size_t i = 0; i < kSettings.size(); ++i) {
    if (rows.empty() || rows.count(i + 1) > 0) Row(kSettings[i], argv[1], argv[2]);
  }
  return 0;
}

}  // namespace
}  // namespace unfurl::bench

int main(int argc, char** argv) {
  try {
    return unfurl::bench::Main(argc, argv);
  } catch (const unfurl::Error& e) {
    fmt::print(stderr, "fit_bench: {}\n", e.what());
    return 2;
  }
}
