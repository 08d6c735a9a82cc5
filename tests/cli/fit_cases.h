#pragma once

#include <string>
#include <vector>

#include "tests/cli/program.h"

namespace unfurl::cli {

// Studies of the single latching pendulum, cheap enough to be run again and again.
class FitVerbTest : public ProgramTest {
 protected:
  // Simulates the pendulum with these settings and writes its marks with noise as tracks.
  void MakeTracks(const std::string& name, const std::vector<std::string>& settings,
                  std::uint64_t seed, double sigma = 2e-4) const;
  // The marks of truth.h5 with noise as tracks.
  void NoisyTracks(const std::string& name, std::uint64_t seed, double sigma) const;
  // A study of clearance and spring stiffness of it; `more` is added at the end.
  void MakeStudy(const std::string& name, const std::string& trials,
                 const std::string& more = {}) const;
  // Kills a fit at `kills` random moments, resumes each, and expects the bytes of one that was left
  // alone.
  void ExpectResumes(int kills, std::uint64_t seed) const;
  void ExpectResumesOf(const std::string& study, int kills, std::uint64_t seed) const;
  Outcome Good(const std::vector<std::string>& arguments) const;
};

}  // namespace unfurl::cli
