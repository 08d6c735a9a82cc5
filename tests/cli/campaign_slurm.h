#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>

#include "tests/cli/program.h"
#include "tests/source_dir.h"

namespace unfurl::cli {

// A toy cluster of its own for each test (scripts/toy-slurm); skipped where Slurm is not there.
template <typename Base>
class OnToyCluster : public Base {
 protected:
  void SetUp() override {
    Base::SetUp();
    if (std::system("command -v slurmctld slurmd sbatch >/dev/null 2>&1") != 0) {
      GTEST_SKIP() << "there is no Slurm here";
    }
    toy_ = this->folder_.string() + ".slurm";
  }
  void TearDown() override {
    if (!toy_.empty()) {
      Toy("stop");
      unsetenv("SLURM_CONF");
      std::filesystem::remove_all(toy_);
    }
    Base::TearDown();
  }
  bool Toy(const std::string& action, const std::string& more = {}) const {
    const std::string command = std::string(UNFURL_SOURCE_DIR "/scripts/toy-slurm ") + action +
                                " '" + toy_ + "' " + more + " >/dev/null";
    return std::system(command.c_str()) == 0;
  }
  // So many nodes of so many processors each.
  void Start(int nodes, int cpus) const {
    ASSERT_TRUE(Toy("start", std::to_string(nodes) + " " + std::to_string(cpus)));
    setenv("SLURM_CONF", (toy_ + "/slurm.conf").c_str(), 1);
  }
  std::string toy_;
};

class CampaignSlurm : public OnToyCluster<ProgramTest> {};

}  // namespace unfurl::cli
