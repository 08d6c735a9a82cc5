#pragma once

#if defined(__SSE2__)
#include <immintrin.h>
#endif

namespace unfurl::sim {

// While one of these lives, this thread's numbers below 2.2e-308 count as zero. In a folded state
// the couplings between rows at right angles are of rounding size, and eliminating along a beam
// multiplies them into denormals, each of which would cost a hundred cycles.
class FlushDenormals {
 public:
#if defined(__SSE2__)
  FlushDenormals() : saved_(_mm_getcsr()) { _mm_setcsr(saved_ | 0x8040u); }
  ~FlushDenormals() { _mm_setcsr(saved_); }
#else
  FlushDenormals() = default;
#endif
  FlushDenormals(const FlushDenormals&) = delete;
  FlushDenormals& operator=(const FlushDenormals&) = delete;

 private:
#if defined(__SSE2__)
  unsigned saved_;
#endif
};

}  // namespace unfurl::sim
