#include "sim/record/record.h"

#include <fmt/format.h>
#include <sys/statvfs.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

#include "base/error.h"
#include "base/progress.h"
#include "data/atomic_file.h"
#include "sim/record/certificate.h"
#include "sim/record/run_recorder.h"

namespace unfurl::sim {
namespace {

// Passes everything on to two observers.
class Both : public Observer {
 public:
  Both(Observer* first, Observer* second) : first_(first), second_(second) {}
  void OnSample(double t, double* state, const std::vector<LatchMode>& modes) override {
    if (first_ != nullptr) first_->OnSample(t, state, modes);
    second_->OnSample(t, state, modes);
  }
  void OnWay(const Motion& motion, const std::vector<LatchMode>& modes) override {
    if (first_ != nullptr) first_->OnWay(motion, modes);
    second_->OnWay(motion, modes);
  }
  void OnEvent(const Event& event) override {
    if (first_ != nullptr) first_->OnEvent(event);
    second_->OnEvent(event);
  }
  void OnProgress(double fraction) override {
    if (first_ != nullptr) first_->OnProgress(fraction);
    second_->OnProgress(fraction);
  }
  void OnSlow(const std::string& text) override {
    if (first_ != nullptr) first_->OnSlow(text);
    second_->OnSlow(text);
  }

 private:
  Observer* first_;
  Observer* second_;
};

SimulateOptions OptionsFor(const RecordOptions& options) {
  return options.simulate.value_or(SimulateOptions());
}

double ShapeRateOf(const RecordOptions& options, const SimulateOptions& simulate,
                   const Model& model) {
  constexpr double kUsual = 50.0, kPictures = 200.0;  // [1/s]; of a run, eight seconds of a film
  return options.shape_rate.value_or(std::max(kUsual, kPictures / DurationOf(simulate, model)));
}

double SizeOf(const RunRecorder& recorder, const data::RunLayout& layout,
              const SimulateOptions& options, const Model& model) {
  const double samples = std::floor(DurationOf(options, model) * options.rate) + 1.0;
  const int every = recorder.shape_every();
  return data::RunWriter::FileSize(layout, samples, every > 0 ? std::ceil(samples / every) : 0.0);
}

void RefuseTooLarge(const std::string& path, double bytes, double rate) {
  const std::string folder = std::filesystem::path(path).parent_path().string();
  struct statvfs disk = {};
  if (statvfs(folder.empty() ? "." : folder.c_str(), &disk) != 0) return;  // the writer will say
  const double room = static_cast<double>(disk.f_bavail) * static_cast<double>(disk.f_frsize);
  if (bytes <= room) return;
  throw Error(fmt::format("the run would take {} and the disk has {} left", SizeText(bytes),
                          SizeText(room)),
              path,
              fmt::format("sample less often than --rate {:g}, choose --quantities, shorten "
                          "--duration, or name another disk with -o",
                          rate),
              ErrorKind::kMachine);
}

// Runs the model; what stops it becomes the recording's status. Bad input that shows only on the
// way is such a stop, too.
void Run(RunRecorder* recorder, const RecordOptions& options, Recording* out) {
  Both both(options.observer, recorder);
  try {
    out->report = Simulate(*out->model, out->options, &both);
  } catch (const Interrupted&) {
    out->status = out->message = "interrupted";
    return;
  } catch (const Error& error) {
    if (error.kind() == ErrorKind::kMachine || recorder->samples() <= 1) throw;
    out->status = "stopped";
    out->message = error.what();
    return;
  }
  out->status = StatusName(out->report.status);
  out->message = out->report.message;
  if (!out->Usable() || !options.certificate) return;
  out->message = options.certificate->Doubt(out->report);
  if (!out->message.empty()) out->status = kNotCertified;
  const std::string warning = options.certificate->Warning(out->report);
  if (!warning.empty()) out->report.warnings.push_back(warning);
}

void RunIntoFile(const std::string& path, const RecordOptions& options,
                 const data::RunLayout& layout, RunRecorder* recorder, Recording* out) {
  RefuseTooLarge(path, SizeOf(*recorder, layout, out->options, *out->model), out->options.rate);
  data::RunWriter writer(path, options.provenance, layout);
  recorder->SetSink(&writer);
  try {
    Run(recorder, options, out);
    recorder->Finish(out->report, out->status, out->message, out->options.profile);
    out->Usable() ? writer.Commit() : writer.Keep();
    out->path = out->Usable() ? path : writer.partial();
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::kMachine || !writer.holds_samples()) throw;
    writer.Abandon();
    throw Error(fmt::format("{}; what got to the disk by t = {:.6g} s is in {}", error.what(),
                            recorder->last_time(), writer.partial()),
                {}, {}, ErrorKind::kMachine);
  }
  recorder->SetSink(nullptr);
}

}  // namespace

void RecordOptions::Check() const {
  if (simulate) simulate->Check();
  if (shape_rate && (!(*shape_rate >= 0.0) || !std::isfinite(*shape_rate))) {
    throw Error(fmt::format("{} is not a rate", *shape_rate), "option shape-rate",
                "use shapes per second, or 0 for none");
  }
}

SimulateOptions SolverOptions(const data::Scene& scene, double duration) {
  SimulateOptions options;
  options.duration = duration;
  if (scene.solver.method) options.method = MethodOf(*scene.solver.method);
  options.rtol = scene.solver.rtol.value_or(options.rtol);
  options.rate = scene.solver.rate.value_or(UsualRate(duration > 0.0 ? duration : scene.duration));
  return options;
}

Recording Record(std::shared_ptr<const Model> model, const RecordOptions& options,
                 const std::string& path, const std::string& scene_text) {
  options.Check();
  Recording out;
  out.model = std::move(model);
  out.options = OptionsFor(options);
  const auto recorder = std::make_shared<RunRecorder>(*out.model, options.quantities,
                                                      ShapeRateOf(options, out.options, *out.model),
                                                      out.options.rate, options.progress);
  out.recorder = recorder;
  if (options.certificate && options.certificate->problem().empty()) {
    recorder->SetCertificate(options.certificate.get());
  }
  const data::RunLayout layout = recorder->Layout(scene_text, out.options.profile);
  if (!path.empty()) {
    RunIntoFile(path, options, layout, recorder.get(), &out);
    return out;
  }
  data::RunInMemory memory(layout);
  recorder->SetSink(&memory);
  Run(recorder.get(), options, &out);
  recorder->Finish(out.report, out.status, out.message, out.options.profile);
  recorder->SetSink(nullptr);
  out.run = memory.Take();
  return out;
}

Recording Record(const data::Scene& scene, const RecordOptions& options, const std::string& path) {
  RecordOptions filled = options;
  if (!filled.simulate) filled.simulate = SolverOptions(scene);
  filled.Check();
  const bool is_file = std::filesystem::is_regular_file(scene.path);  // not text parsed in memory
  return Record(CompileModel(scene), filled, path, is_file ? data::ReadTextFile(scene.path) : "");
}

std::string SizeText(double bytes) {
  constexpr const char* kUnits[] = {"kB", "MB", "GB", "TB"};
  double value = bytes / 1e3;
  int unit = 0;
  while (value >= 999.5 && unit < 3) value /= 1e3, ++unit;
  return fmt::format("{:.3g} {}", value, kUnits[unit]);
}

double RecordingSize(const Model& model, const RecordOptions& options) {
  const SimulateOptions simulate = OptionsFor(options);
  const RunRecorder recorder(model, options.quantities, ShapeRateOf(options, simulate, model),
                             simulate.rate, false);
  return SizeOf(recorder, recorder.Layout("", simulate.profile), simulate, model);
}

}  // namespace unfurl::sim
