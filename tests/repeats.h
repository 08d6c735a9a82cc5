#pragma once

#include <cstdlib>

namespace unfurl {

// How many repeats of a random study a test makes: few in the quick tests, all of them where
// CTest's label `slow` runs it again (THOROUGH of unfurl_test; by hand UNFURL_THOROUGH=1). Bounds
// on what it counts follow from the number, so that fewer only see less.
inline int Repeats(int few, int all) {
  static const bool thorough = std::getenv("UNFURL_THOROUGH") != nullptr;
  return thorough ? all : few;
}

}  // namespace unfurl
