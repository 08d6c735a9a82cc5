#pragma once

#include <string>

namespace unfurl::report {

// What a page holds that needs scripts.
struct Moving {
  bool charts = false, drawings = false, motions = false, spaces = false, tables = false;
};

// The script elements of its end, with the notices that the libraries' licences ask for.
std::string ScriptsOf(const Moving& what);

}  // namespace unfurl::report
