#pragma once

#include <string>

#include "calib/observations.h"

namespace unfurl::calib {

// Throws Error for a point that lies further from every other one than three times as far as those
// lie apart: a wrong coordinate (a lost decimal point, another unit) that no camera's view of the
// others reaches, and that would make all of the survey look like a line.
void RefuseStray(const Observations& data, const std::string& where);

}  // namespace unfurl::calib
