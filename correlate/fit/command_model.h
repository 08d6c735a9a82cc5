#pragma once

#include <string>
#include <vector>

#include "correlate/model.h"

namespace unfurl::correlate {

// Any program as a model to be fitted. For each evaluation a fresh folder is made, with
//   parameters.json   {"NAME": value, ...}
//   stamps.csv        mark, t [s]: what will be asked of the marks
// and copies of `files` in which {{NAME}} stands for a parameter's value. The command runs there;
// in its words {NAME} is a parameter's value, {folder} the folder, {study} that of the study,
// {parameters} and {stamps} the two files. It leaves `tracks` in the folder: a run (.h5), or a CSV
// with a column `t [s]` and either `mark`, `x [m]`, `y [m]` (and `z [m]`, velocities `vx [m/s]`
// ..), or MARK.x, MARK.y (MARK.z, MARK.vx ..) for each mark, at times of its own choosing.
// The tracks are interpolated by cubics at the stamps; before t = 0 the marks stand still.
struct CommandModelOptions {
  std::vector<std::string> parameters;  // names, in order
  std::vector<std::string> words;
  std::vector<std::string> files;  // paths
  std::string tracks = "tracks.csv";
  std::string study_folder;
  double timeout = 600.0;  // [s]
  int retries = 0;         // after a failure
};

// A program that does not start, that ends with another code than 0, that takes too long, or whose
// tracks cannot be used is a failed evaluation, with the reason and the last line of its standard
// error in words.
class CommandModel : public Model {
 public:
  // Throws Error for an unknown {placeholder} or a file that cannot be read.
  explicit CommandModel(CommandModelOptions options);
  Prediction Evaluate(std::span<const double> theta, const Stamps& stamps) const override;

 private:
  Prediction Once(std::span<const double> theta, const Stamps& stamps) const;

  CommandModelOptions options_;
  std::vector<std::pair<std::string, std::string>> files_;  // name, text
};

// Tracks that a program wrote, and quantities (of a run file alone), as a record that can be asked
// at any stamp. Throws Error.
class SampledModel;
SampledModel ReadProgramTracks(const std::string& path, const std::vector<std::string>& marks,
                               const std::vector<std::string>& quantities = {});

}  // namespace unfurl::correlate
