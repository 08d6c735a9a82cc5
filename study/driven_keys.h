#pragma once

#include <string>
#include <vector>

#include "data/study.h"

namespace unfurl::study {

/// Throws Error, placed at `where`, where an override of a trial sets a key that a parameter
/// drives: the parameter's value would stand, and the override do nothing.
void RefuseDrivenKeys(const std::vector<std::string>& set,
                      const std::vector<data::StudyParameter>& parameters,
                      const std::string& where);

}  // namespace unfurl::study
