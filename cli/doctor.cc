// What this machine lacks for the program, and what of it is slow.
#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/subprocess.h"
#include "base/table.h"
#include "base/worker_pool.h"
#include "cli/starts.h"
#include "cli/verb.h"
#include "data/scene.h"
#include "sim/record/record.h"

namespace unfurl::cli {

namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

enum class Health { kGood, kSlow, kLacking, kOptional };
const char* Name(Health health) {
  constexpr const char* kNames[] = {"good", "slow", "LACKING", "not there"};
  return kNames[static_cast<int>(health)];
}

struct Finding {
  std::string what;
  Health health = Health::kGood;
  std::string found, remedy;
};

double DoctorSeconds(const std::function<void()>& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

// Work that leaves no memory behind: what several threads should do at once.
double Churn(std::size_t seed) {
  double x = 0.3 + 1e-3 * static_cast<double>(seed);
  for (int i = 0; i < 20'000'000; ++i) x = 3.7 * x * (1.0 - x);
  return x;
}

Finding Cores() {
  const std::size_t cores = WorkerCount(0);
  if (cores < 2) return {"cores", Health::kSlow, "1", "fits and reconstructions use all there are"};
  volatile double sink = 0.0;
  const double one = DoctorSeconds([&] { sink = sink + Churn(0); });
  const double two = DoctorSeconds([&] {
    std::vector<double> out(2);
    ParallelFor(2, 2, [&](std::size_t i) { out[i] = Churn(i); });
    sink = sink + out[0] + out[1];
  });
  const double speedup = 2.0 * one / two;
  // Two idle cores give 2. Less than half of the second one: another program, or a limit.
  const bool shared = speedup < 1.5;
  return {"cores", shared ? Health::kSlow : Health::kGood,
          fmt::format("{}; two do {:.1f} times the work of one", cores, speedup),
          shared ? "other programs use them, or a container limits them" : ""};
}

Finding Memory() {
  // A fit of the shipped size takes 0.2 GB; a survey's raw lines twice their file.
  constexpr double kLeast = 1e9;
  const double pages = static_cast<double>(sysconf(_SC_AVPHYS_PAGES));
  std::ifstream info("/proc/meminfo");
  std::string word;
  double bytes = pages * static_cast<double>(sysconf(_SC_PAGESIZE));
  while (info >> word) {
    if (word != "MemAvailable:") continue;
    info >> bytes;
    bytes *= 1024.0;
    break;
  }
  return {"memory", bytes < kLeast ? Health::kSlow : Health::kGood, sim::SizeText(bytes) + " free",
          bytes < kLeast ? "long records and large fits want more" : ""};
}

// Writes, syncs and removes a file.
Finding Folder(const std::string& what, const fs::path& folder) {
  constexpr std::size_t kBytes = 16 << 20;  // long enough beside a disk's own caches and seeks
  const fs::path file = folder / fmt::format(".unfurl-doctor-{}", getpid());
  struct statvfs space = {};
  const double free = statvfs(folder.c_str(), &space) == 0 ? static_cast<double>(space.f_bavail) *
                                                                 static_cast<double>(space.f_frsize)
                                                           : 0.0;
  bool written = false;
  const double seconds = DoctorSeconds([&] {
    std::FILE* stream = std::fopen(file.c_str(), "wbx");
    if (stream == nullptr) return;
    const std::vector<char> block(kBytes, 'x');
    written = std::fwrite(block.data(), 1, kBytes, stream) == kBytes && std::fflush(stream) == 0 &&
              fsync(fileno(stream)) == 0;
    written = std::fclose(stream) == 0 && written;
    std::remove(file.c_str());
  });
  const std::string name = folder.string();
  if (!written) {
    return {what, Health::kLacking, name + " takes no file",
            what == "temporary folder" ? "set TMPDIR to a folder that does"
                                       : "work where you may write"};
  }
  constexpr double kSlow = 20e6;  // a trial of 30 MB then takes seconds to write
  const double rate = static_cast<double>(kBytes) / seconds;
  return {
      what, rate < kSlow ? Health::kSlow : Health::kGood,
      fmt::format("{}: {}/s to the disk, {} free", name, sim::SizeText(rate), sim::SizeText(free)),
      rate < kSlow ? "a local disk is faster than one over a network" : ""};
}

Finding Simulator() {
  data::Scene scene = data::ParseScene(std::string(kBoomScene), "boom");
  sim::RecordOptions options;
  options.simulate = sim::SolverOptions(scene);
  options.simulate->duration = 0.5;
  double evaluations = 0.0;
  const double seconds = DoctorSeconds([&] {
    const sim::Recording recording = sim::Record(scene, options);
    evaluations = static_cast<double>(recording.report.evaluations);
  });
  const double each = 1e6 * seconds / std::max(evaluations, 1.0);
  // 19 bodies: 0.6 us on a desktop of 2020.
  constexpr double kSlow = 3.0;
  return {"simulator", each > kSlow ? Health::kSlow : Health::kGood,
          fmt::format("{:.2f} us an evaluation of the boom of `unfurl new`", each),
          each > kSlow ? "another program uses the processor, or the build has no optimisation: "
                         "cmake --preset release"
                       : ""};
}

// Whether a program runs, and its first line. Its words go to memory: in the temporary folder,
// which may be what lacks, others could lay a link by the file's name, or a module for Python to
// import.
Finding Program(const std::string& what, const std::vector<std::string>& words,
                const std::string& remedy) {
  constexpr double kPatience = 10.0;  // [s]
  Finding missing = {what, Health::kOptional, "", remedy};
  const int log = memfd_create("log", MFD_CLOEXEC);
  if (log < 0) return missing;
  const std::string path = fmt::format("/proc/self/fd/{}", log);
  ProgramOutcome outcome;
  std::string line;
  try {
    outcome = RunProgram(words, "/", path, path, kPatience);
    std::ifstream stream(path);
    std::getline(stream, line);
  } catch (const Error&) {
  }
  close(log);
  if (!outcome.started || outcome.code != 0) return missing;
  return {what, Health::kGood, line, ""};
}

int RunDoctor(const Common& common) {
  std::error_code failed;
  const fs::path temporary = fs::temp_directory_path(failed);
  const std::vector<Finding> findings = {
      {"program", Health::kGood, data::ProgramVersion(), ""},
      Cores(),
      Memory(),
      Folder("this folder", fs::current_path()),
      Folder("temporary folder", failed ? fs::path("/tmp") : temporary),
      Simulator(),
      Program("Python package", {"python3", "-c", "import unfurl; print(unfurl.__version__)"},
              "for scripts: docs/python.md tells how it is installed")};
  ordered_json summary = {{"findings", ordered_json::array()}};
  std::vector<std::vector<std::string>> rows = {{"", "what", "found"}};
  const Finding* lacking = nullptr;  // the first
  std::string remedies;
  for (const Finding& f : findings) {
    summary["findings"].push_back(
        {{"what", f.what}, {"health", Name(f.health)}, {"found", f.found}, {"remedy", f.remedy}});
    rows.push_back({Name(f.health), f.what, f.found});
    if (lacking == nullptr && f.health == Health::kLacking) lacking = &f;
    if (!f.remedy.empty()) remedies += fmt::format("{}: {}\n", f.what, f.remedy);
  }
  summary["usable"] = lacking == nullptr;
  if (lacking != nullptr) summary["message"] = "this machine lacks what the program needs";
  Finish(common, summary, AlignedTable(rows) + remedies);
  return lacking == nullptr ? kExitGood
                            : NotUsable(lacking->what, lacking->found + "; " + lacking->remedy);
}

}  // namespace

Verb AddDoctor(CLI::App& program, Common& common) {
  Verb verb = DeclareVerb(program, common, "doctor",
                          "What this machine lacks, and what of it is slow", "unfurl doctor");
  verb.run = [&common] { return RunDoctor(common); };
  return verb;
}

}  // namespace unfurl::cli
