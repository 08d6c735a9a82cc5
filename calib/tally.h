#pragma once

#include <string>
#include <vector>

#include "data/rig.h"

namespace unfurl::calib {

/// Reasons by what they do to a rig's verdict.
struct Tally {
  std::vector<std::string> no, care, fine;
};

/// The rig's verdict and reasons, the worst first.
void Conclude(Tally tally, data::Rig* rig);

}  // namespace unfurl::calib
