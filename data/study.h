#pragma once

#include <optional>
#include <string>
#include <vector>

#include "data/toml.h"

namespace unfurl::data {

// What is to be learnt from which trial with which model, as a person wrote it; every key is in
// docs/study.md. Paths are relative to the study's own folder.
struct StudyParameter {
  std::string name;
  std::string unit;               // as the scene's keys have it
  std::vector<std::string> keys;  // of the scene; all get the parameter's value
  double start = 0.0;             // where the search begins [unit]
  double low = 0.0, high = 0.0;   // bounds [unit]
  bool log = false;               // the solver moves the logarithm
  // What is known of the parameter beforehand.
  struct Prior {
    double mean = 0.0, sigma = 0.0;  // of a normal density [unit]
  };
  std::optional<Prior> prior;
  std::string where;  // file:line:key, for messages
};

// A time measured independently of the marks, for example by a latch's switch.
struct StudyEvent {
  std::string kind;    // "latch", "contact_start", "contact_end", "watch"
  std::string where;   // joint or watch of the scene
  int count = 1;       // the first, the second.. of its kind there
  double time = 0.0;   // on the tracks' clock [s]
  double sigma = 0.0;  // [s]
  std::string at;      // file:line:key, for messages
};

// What is known beforehand of a number: of a trial's clock, of an instrument.
struct StudyKnowledge {
  /// Nothing was said; it is fitted; it is fitted with a density; it is not fitted.
  enum class Kind { kUnsaid, kFree, kNormal, kKnown };
  Kind kind = Kind::kUnsaid;
  double mean = 0.0, sigma = 0.0;  // of a normal density; the known value is the mean [its unit]
};

// What an instrument recorded beside the marks, and what is known of the instrument.
struct StudyChannel {
  std::string name;
  std::string file;         // path
  std::string column;       // its name there
  std::string quantity;     // of the model's run; empty: a switch
  std::string unit;         // of the readings; empty: the file tells
  double sigma = 0.0;       // of a reading where the file tells none [unit]; 0: found by the fit
  double resolution = 0.0;  // of the instrument [unit]; 0: as the readings show it
  double window_low = 0.0, window_high = 0.0;  // on its own clock [s]; equal: all
  StudyKnowledge gain;                         // [unit of the readings over that of the quantity]
  StudyKnowledge bias;                         // [unit]
  StudyKnowledge delay, drift;                 // of its clock to the tracks' [s], [-]
  // The instrument's low pass.
  struct Filter {
    std::string kind;                  // "butterworth", "bessel", "average"; empty: none
    int order = 0;                     // of the first two
    double cutoff = 0.0, width = 0.0;  // [Hz]; of an average [s]
  };
  Filter filter;
  // A switch instead: the event that its edges are times of.
  std::string event;    // "latch", ...; empty: none
  std::string joint;    // or watch
  bool rising = true;   // which edges
  double bounce = 0.0;  // changes that follow one another within it are one switching [s]
  int count = 0;        // the one edge that counts, as the event of that number; 0: all
  std::string at;       // file:line:key, for messages
};

// The same of its frame: where the scene's frame lies in the tracks'.
struct StudyFrame {
  StudyKnowledge::Kind kind = StudyKnowledge::Kind::kUnsaid;
  std::vector<double> rotation = {0.0, 0.0, 0.0};  // vector [rad]
  std::vector<double> shift = {0.0, 0.0, 0.0};     // of the scene's origin [m]
  double sigma_rotation = 0.0, sigma_shift = 0.0;  // of each axis [rad, m]
};

// One recorded trial and what of it counts.
struct StudyTrial {
  std::string name;       // "trial", or "trial 2" of several
  std::string tracks;     // path; empty: channels alone
  std::string tracks_at;  // file:line:key, for messages
  double sigma = 0.0;     // of one axis where the tracks tell none (.c3d, .uff) [m]; 0: they must
  std::vector<std::string> marks;              // empty: all of the tracks
  double window_low = 0.0, window_high = 0.0;  // on the tracks' clock [s]; equal: all
  std::vector<std::string> set;                // overrides of the scene for this trial
  // Factors on marks' sigmas: 2 lets a mark count a quarter.
  std::vector<std::pair<std::string, double>> sigma_factors;
  std::vector<StudyEvent> events;
  std::vector<StudyChannel> channels;
  StudyKnowledge offset;  // what the tracks' clock shows at the scene's start [s]
  StudyKnowledge drift;   // by which it runs fast [-]
  StudyFrame frame;
  std::string where;
};

// A program that computes the marks, in place of the simulator; docs/study.md.
struct StudyCommand {
  std::vector<std::string> words;  // program and arguments, with {placeholders}
  std::vector<std::string> files;  // paths, copied to where it runs with {{NAME}} filled in
  std::string tracks;              // what it writes, relative to where it runs
  double timeout = 600.0;          // of one evaluation [s]
  int retries = 0;                 // after a failure
  std::vector<std::string> finer;  // the same with less error of its own; empty: none
  std::string where;
};

// The rungs of a study's ladder, coarse to fine; docs/study.md. Without any the program makes them
// from the scene.
struct StudyFidelity {
  bool wanted = true;
  // One version of the scene. What is 0 or empty is as the scene has it.
  struct Rung {
    std::string name;              // in words; empty: by what it sets
    int segments = 0;              // of every beam
    int order = 0;                 // of every beam, which is then a smooth one
    std::vector<std::string> set;  // overrides of the scene
    double error = 0.0;            // relative to the first rung's [-]; 0: not known
  };
  std::vector<Rung> rungs;
};

/// Whether the trials are deployments that differ, and which parameters differ; docs/study.md.
struct StudyRepeat {
  bool wanted = false;
  std::vector<std::string> parameters;  ///< that scatter; empty: all. The others have one value
  std::string where;                    ///< file:line:key, for messages
};

// A study as read and checked.
struct Study {
  std::string name;
  std::string path;              // of the study itself
  std::string scene;             // path; empty with a command
  std::string scene_at;          // file:line:key, for messages
  std::vector<std::string> set;  // overrides of the scene, "dotted.key=value"
  std::optional<StudyCommand> command;
  std::vector<StudyTrial> trials;
  std::vector<StudyParameter> parameters;
  double rtol = 0.0;               // of the simulator [-]; 0: chosen by the data
  std::vector<double> stages;      // ends of a growing horizon on the run's clock [s], rising
  bool stages_by_impacts = false;  // instead: by the impacts that the data show
  int max_iterations = 25;         // per stage
  std::vector<std::vector<std::string>> free;  // by stage: parameters that it moves; empty: all
  int screened = -1;  // points of a Latin hypercube, beside the start; -1: as needed
  int starts = 1;     // that are carried on
  int seed = 1;       // of the hypercube
  bool whiten = true;
  std::vector<double> profile_levels = {1.0, 2.0};  // in standard errors [-]; empty: no profiles
  int profile_evaluations = 400;                    // at most
  StudyFidelity fidelity;
  StudyRepeat repeat;
};

// Throws Error (file:line:key).
Study ReadStudy(const std::string& path, const std::vector<std::string>& overrides = {});
Study ParseStudy(const std::string& text, const std::string& name);

}  // namespace unfurl::data
