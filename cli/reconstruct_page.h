#pragma once

#include <array>
#include <string>

#include "cli/tracks_digest.h"
#include "data/provenance.h"
#include "data/rig.h"
#include "data/trial_health.h"
#include "measure/reconstruct.h"
#include "measure/smooth.h"

namespace unfurl::cli {

struct ReconstructPageInput {
  std::string trial, rig_path;
  const data::Rig* rig = nullptr;
  const measure::ReconstructSummary* summary = nullptr;
  const TracksDigest* digest = nullptr;
  const data::TrialHealth* health = nullptr;
  const measure::SmoothReport* smoothing = nullptr;             // null: not smoothed
  std::array<double, 3> sigma_readings{}, sigma_calibration{};  // medians by axis [m]
  int shared_rank = 0;
};

void WriteReconstructPage(const std::string& path, const ReconstructPageInput& input,
                          const data::Provenance& provenance);

}  // namespace unfurl::cli
