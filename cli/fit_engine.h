// Who carries the evaluations of `unfurl fit` out.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "correlate/fit/workers.h"

namespace CLI {
class App;
}

namespace unfurl::cli {

class VerbFiles;

struct FitEngineArguments {
  std::string engine = "local", folder, serve;
  std::vector<std::string> sbatch;
  std::size_t workers = 0;

  bool Shares() const { return engine != "local"; }
};

void AddFitEngine(CLI::App* app, FitEngineArguments* a);
// Throws Error for options that do not go together.
void Check(const FitEngineArguments& a);

// Workers in other processes, from when the problems are known to the end of the fit.
class FitEngine {
 public:
  // `words`: of the command that serves, but for the folder. `output`: of the fit.
  FitEngine(FitEngineArguments arguments, std::vector<std::string> words, const std::string& output,
            bool talk);
  ~FitEngine();

  correlate::Workers* Begin(const std::vector<const correlate::FitProblem*>& problems,
                            const std::string& identity);
  // The fit has ended well: what workers said is not needed any more.
  void Finish();

 private:
  struct Parts;
  FitEngineArguments arguments_;
  std::vector<std::string> words_;
  bool talk_;
  std::unique_ptr<Parts> parts_;
};

}  // namespace unfurl::cli
