#pragma once

#include <cfenv>

namespace unfurl {

/// While a test runs, an invalid operation, a division by zero or an overflow stops it (traps.cc).
/// While one of these lives they do not: for tests that hand on a NaN to see it refused, since an
/// ordered comparison with a NaN is an invalid operation too, and for steps that run away and are
/// given up because what they return is not finite.
class NoTraps {
 public:
  NoTraps() : saved_(fedisableexcept(FE_ALL_EXCEPT)) {}
  ~NoTraps() {
    std::feclearexcept(FE_ALL_EXCEPT);
    feenableexcept(saved_);
  }
  NoTraps(const NoTraps&) = delete;
  NoTraps& operator=(const NoTraps&) = delete;

 private:
  int saved_;
};

}  // namespace unfurl
