// What single calls of the library take, for call_bench.py to compare with the same calls from
// Python:
//   call_bench SETS REPEATS    (the folder data/sets)
#include <fmt/format.h>

#include <algorithm>
#include <ctime>
#include <functional>
#include <string>

#include "correlate/compare/comparison.h"
#include "data/rig.h"
#include "data/scene.h"
#include "sim/record/record.h"

namespace {

// The least of the repeats, by the processor's clock: what the call itself takes [ms].
double Milliseconds(int repeats, const std::function<void()>& call) {
  double least = 1e300;
  for (int k = 0; k < repeats; ++k) {
    const std::clock_t start = std::clock();
    call();
    least = std::min(least, 1e3 * static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC);
  }
  return least;
}

}  // namespace

int main(int, char** argv) {
  using namespace unfurl;
  const std::string sets = argv[1];
  const int repeats = std::stoi(argv[2]);
  const std::string scene_path = sets + "/bouncing_latch/scene.toml";
  const std::string rig_path = sets + "/deployment/rig.h5";
  const auto report = [&](const char* name, const std::function<void()>& call) {
    fmt::print("{} {:.4f}\n", name, Milliseconds(repeats, call));
  };
  const auto model = sim::CompileModel(data::ReadScene(scene_path));
  sim::RecordOptions options;
  options.simulate.emplace();
  options.simulate->duration = 0.8;  // the first impacts [s]
  const data::Run run = sim::Record(model, options).run;
  report("read_scene", [&] { data::ReadScene(scene_path); });
  report("load_rig", [&] { data::ReadRig(rig_path); });
  report("simulate", [&] { sim::Record(model, options); });
  report("compare", [&] { correlate::Compare(run, run); });
}
