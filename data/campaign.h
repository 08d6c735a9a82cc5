#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "data/toml.h"

namespace unfurl::data {

/// How a number of a job scatters; every key is in docs/campaign.md.
struct CampaignDistribution {
  /// Mean and sigma; low and high; median and factor; low and high; low, mode and high; values with
  /// weights; samples of it.
  enum class Kind { kNormal, kUniform, kLogNormal, kLogUniform, kTriangular, kTable, kSamples };
  Kind kind = Kind::kNormal;
  std::vector<double> numbers;  ///< the above, of the first five [unit of the variable]
  std::vector<double> values;   ///< of a table, or samples [unit of the variable]
  std::vector<double> weights;  ///< of a table's values, positive [-]
  double low = -std::numeric_limits<double>::infinity();  ///< cut off below [unit]
  double high = std::numeric_limits<double>::infinity();  ///< cut off above [unit]
};

/// A number of the job that differs from run to run.
struct CampaignVariable {
  std::string name;
  std::string unit;               ///< in words; empty: none was given
  std::vector<std::string> keys;  ///< of the scene; all get the value
  CampaignDistribution distribution;
  int levels = 0;     ///< in a grid; 0: as many as a table has values
  std::string where;  ///< file:line:key, for messages
};

/// Two variables that go together.
struct CampaignCorrelation {
  std::string first, second;
  double value = 0.0;  ///< of their normal scores, in (-1, 1) [-]
  std::string where;   ///< file:line:key, for messages
};

/// A number that every run gives.
struct CampaignResponse {
  std::string name, unit;
  /// Of a scene's run: what is looked at.
  enum class Source { kQuantity, kEvent, kExpression, kStep };
  Source source = Source::kQuantity;
  std::string quantity;  ///< of the run, "hub.x"
  std::string event;     ///< kind, "latch"
  std::string joint;     ///< where the event happens; empty: all joints (or watches) of the scene
  int count = 1;         ///< the first, the second .. of its kind there
  /// Of a quantity "largest", "smallest", "peak", "range", "mean", "rms", "final", "at"; of an
  /// event "happened", "time", "number".
  std::string of;
  double at = 0.0;                                      ///< with "at" [s]
  double from = 0.0;                                    ///< [s]
  double to = std::numeric_limits<double>::infinity();  ///< [s]
  std::string expression;                               ///< of variables and responses before it
  int step = 0;                                         ///< that says it; from 0
  std::string pointer;                                  ///< into what that step prints as JSON
  std::optional<double> above, below;  ///< yes where it is; the response is yes or no
  bool yes_no = false;                 ///< 1 and 0, nothing else
  std::string where;                   ///< file:line:key, for messages
};

/// What is run each time: a scene, or steps of this program and of others.
struct CampaignJob {
  std::string scene;             ///< path; empty: steps
  std::vector<std::string> set;  ///< overrides of the scene
  double rtol = 1e-6;            ///< of the simulator [-]
  double duration = 0.0;         ///< [s]; 0: the scene's
  double rate = 0.0;             ///< of the samples that responses are taken from [1/s]; 0: as
                                 ///< many as a run has where nobody asks
  /// One command, with {VARIABLE} in place of values; the word `unfurl` first means this program.
  std::vector<std::vector<std::string>> steps;
  std::vector<std::string> files;  ///< paths, copied to where steps run, {{VARIABLE}} filled in
  double timeout = 600.0;          ///< of one step [s]
  std::string where;               ///< file:line:key, for messages
};

/// How runs are chosen.
struct CampaignDesign {
  /// The kinds of design.
  enum class Kind { kRandom, kLatin, kSobol, kGrid, kFile, kSaltelli, kMorris, kRare };
  Kind kind = Kind::kRandom;
  std::uint64_t runs = 1000;  ///< of those that have a number of runs
  std::uint64_t seed = 1;
  int blocks = 16;    ///< independent ones, of "latin" and "sobol", whose scatter gives the errors
  int levels = 4;     ///< of "morris"
  std::string until;  ///< "P(latched) +- 0.002": more runs until then; empty: `runs`
  std::uint64_t most = 1'000'000;  ///< with `until`
  std::string failure;             ///< the response of "rare", whose negative values are failures
  std::vector<std::vector<double>> rows;  ///< of "file": a value for each variable, run by run
};

/// A campaign as a person wrote it; docs/campaign.md.
struct Campaign {
  std::string name;
  std::string path;  ///< of the plan itself
  CampaignJob job;
  CampaignDesign design;
  double confidence = 0.95;  ///< of all intervals [-]
  std::vector<CampaignVariable> variables;
  std::vector<CampaignCorrelation> correlations;
  std::vector<CampaignResponse> responses;
  std::vector<std::string> inputs;  ///< files that runs depend on, beside those that a scene names
  std::vector<std::string> slurm;   ///< options of sbatch, each as it stands
};

/// Throws Error (file:line:key) for what is no plan, and for what does not fit together.
Campaign ReadCampaign(const std::string& path, const std::vector<std::string>& overrides = {});
/// The same of a text; files that it names are still read.
Campaign ParseCampaign(const std::string& text, const std::string& name);

/// A plan with all that it read from other files, for records; and that back. `where` is for
/// messages. Throws Error for what is not from CampaignJson.
std::string CampaignJson(const Campaign& plan);
Campaign CampaignFromJson(const std::string& text, const std::string& where);

}  // namespace unfurl::data
