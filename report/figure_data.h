#pragma once

#include <string>

#include "report/page.h"

namespace unfurl::report {

// The numbers of a drawing as a block of data, for the button that saves them as CSV; empty where
// they would be too many for a page.
std::string PathsData(const Paths& paths);
std::string MapData(const Map& map);

}  // namespace unfurl::report
