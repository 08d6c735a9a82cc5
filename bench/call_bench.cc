// What single calls of the library take, for call_bench.py to compare with the same calls from Python:
//   call_bench SETS REPEATS    (the folder data/sets)
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <functional>
#include <vector>

#include "correlate/compare/comparison.h"
#include "data/rig.h"
#include "data/scene.h"
#include "sim/record/record.h"

namespace {

// The median of the repeats [ms].
double Milliseconds(int repeats, const std::function<void()>& call) {
  std::vector<double> times;
  for (int k = 0; k < repeats; ++k) {
    const auto start = std::chrono::steady_clock::now();
    call();
    times.push_back(
        1e3 * std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  }
  std::nth_element(times.begin(), times.begin() + repeats / 2, times.end());
  return times[static_cast<std::size_t>(repeats / 2)];
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
  const data::Run run = sim::Record(model, options).run;
  report("read_scene", [&] { data::ReadScene(scene_path); });
  report("load_rig", [&] { data::ReadRig(rig_path); });
  report("simulate", [&] { sim::Record(model, options); });
  report("compare", [&] { correlate::Compare(run, run); });
}
