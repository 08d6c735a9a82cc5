#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "data/provenance.h"
#include "data/run.h"
#include "data/scene.h"
#include "sim/methods/simulate.h"

namespace unfurl::sim {

class Certificate;
class RunRecorder;

/// How a scene is run and what is kept of it.
struct RecordOptions {
  std::optional<SimulateOptions> simulate;  ///< none: SolverOptions of the scene
  std::vector<std::string> quantities;  ///< names to keep, * and ? standing for letters; empty: all
  /// Beam shapes in the file per second, 0: none; nothing: 50, or as many as give the run two
  /// hundred [1/s].
  std::optional<double> shape_rate;
  bool progress = false;        ///< a line on the terminal
  data::Provenance provenance;  ///< of the file
  /// Called, where given, with everything that the run meets, before it is kept.
  Observer* observer = nullptr;
  /// Of this run, from Certificate::Make; its errors become columns. Null: none.
  std::shared_ptr<Certificate> certificate;

  /// Throws Error naming the field.
  void Check() const;
};

/// Default options, with what the scene's [solver] says; where it gives no rate, UsualRate of
/// `duration` [s], of the scene's where that is 0.
SimulateOptions SolverOptions(const data::Scene& scene, double duration = 0.0);

/// A run that was recorded, whole or as far as it came.
struct Recording {
  std::shared_ptr<const Model> model;
  std::shared_ptr<const RunRecorder> recorder;  ///< peaks, margins, energies of the run
  SimulateReport report;                        ///< without steps where it was interrupted
  SimulateOptions options;                      ///< as they were used
  /// "good"; a numerical failure by name; "not certified" where the certificate leaves nothing
  /// known of a quantity; "interrupted"; or "stopped" by an Error on the way.
  std::string status = "good";
  std::string message;  ///< why, if not good
  std::string path;     ///< the file: NAME, or NAME.partial where the run did not end
  data::Run run;        ///< where no file was asked for

  /// The end was reached, and nothing speaks against the run.
  bool Usable() const { return status == "good"; }
};

/// Runs a scene and keeps every quantity in time, in memory or, where `path` is given, in a file
/// that grows in constant memory as NAME.partial and gets its name when the run has ended. Ctrl-C
/// (InstallInterruptHandler) ends it with what was reached. Throws Error for a scene that does not
/// fit together, bad options, and a disk that is too small or fails.
Recording Record(const data::Scene& scene, const RecordOptions& options = {},
                 const std::string& path = {});
/// The same of a model that is compiled already; `scene_text` is kept with the run.
Recording Record(std::shared_ptr<const Model> model, const RecordOptions& options,
                 const std::string& path = {}, const std::string& scene_text = {});

/// Status of a run whose certificate leaves nothing known of a quantity.
inline constexpr const char* kNotCertified = "not certified";

/// Bytes that the file of such a run will take, events apart.
double RecordingSize(const Model& model, const RecordOptions& options);
/// "3.4 GB".
std::string SizeText(double bytes);

}  // namespace unfurl::sim
