/// What `scripts/planted-faults` writes into the sources it copies: each planted site asks here
/// whether its fault is switched on. The environment variable UNFURL_FAULT holds the number of the
/// one fault that is on; without it every expression keeps its value. No part of the product
/// includes this header.

#pragma once

#include <cstdio>
#include <cstdlib>
#include <type_traits>

// A planted expression may earn warnings that its original does not; they are no errors here.
#pragma GCC diagnostic ignored "-Wsign-compare"
#pragma GCC diagnostic ignored "-Wbool-compare"
#pragma GCC diagnostic ignored "-Wint-in-bool-context"
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#pragma GCC diagnostic ignored "-Wunused"
#pragma GCC diagnostic ignored "-Wunused-value"
#pragma GCC diagnostic ignored "-Wnarrowing"
#pragma GCC diagnostic ignored "-Wparentheses"
#pragma GCC diagnostic ignored "-Wmisleading-indentation"
#pragma GCC diagnostic ignored "-Wstrict-overflow"
#pragma GCC diagnostic ignored "-Warray-bounds"
#pragma GCC diagnostic ignored "-Wstringop-overflow"
#pragma GCC diagnostic ignored "-Waggressive-loop-optimizations"
#pragma GCC diagnostic ignored "-Wdangling-else"

namespace planted {

inline constexpr int kMostFaults = 4096;
inline int active = -1;
inline unsigned char reached[kMostFaults] = {};
inline bool started = false;

/// True where fault `k` is on. Notes that the site was reached.
inline bool On(int k) {
  reached[k] = 1;
  return k == active;
}

/// Appends the numbers of the sites reached to the file named in UNFURL_FAULT_REACHED, one line a
/// process.
inline void WriteReached() {
  const char* path = std::getenv("UNFURL_FAULT_REACHED");
  std::FILE* file = path ? std::fopen(path, "a") : nullptr;
  if (!file) return;
  static char line[kMostFaults * 5];
  char* end = line;
  for (int k = 0; k < kMostFaults; ++k) {
    if (reached[k]) end += std::snprintf(end, 6, "%d ", k);
  }
  *end++ = '\n';
  std::fwrite(line, 1, static_cast<std::size_t>(end - line), file);
  std::fclose(file);
}

/// Before the initialisation of any object, so that constants may carry faults too.
[[gnu::constructor(101)]] static void Start() {
  if (started) return;
  started = true;
  if (const char* number = std::getenv("UNFURL_FAULT")) active = std::atoi(number);
  if (std::getenv("UNFURL_FAULT_REACHED")) std::atexit(WriteReached);
}

/// `planted::Sign(k) * x` is x, or -x where the fault is on; `planted::Keep(k) * x` is x, or 0.
/// Written before the first factor of a term, either acts on the whole term.
struct Weight {
  bool on;
  double when_on;
};
template <typename T>
auto operator*(Weight weight, const T& x) {
  if constexpr (std::is_arithmetic_v<T>) {
    return weight.on ? static_cast<T>(weight.when_on == 0.0 ? T(0) : T(T(0) - x)) : x;
  } else {
    return (weight.on ? weight.when_on : 1.0) * x;
  }
}
inline Weight Sign(int k) { return {On(k), -1.0}; }
inline Weight Keep(int k) { return {On(k), 0.0}; }

/// The factor of `x *= factor`, or 1.
template <typename T>
T Factor(int k, const T& factor) {
  return On(k) ? T(1) : factor;
}

/// A number, or the number times `scale`.
inline double Scale(int k, double scale, double x) { return On(k) ? scale * x : x; }

/// A comparison. With the fault on, that of integers is off by one (< for <=), any other is
/// reversed.
template <char kOp, bool kOrEqual, typename A, typename B>
bool Compare(int k, const A& a, const B& b) {
  constexpr bool kInteger = std::is_integral_v<A> && std::is_integral_v<B>;
  constexpr bool kLess = kOp == '<';
  if (!On(k)) {
    if constexpr (kLess) return kOrEqual ? a <= b : a < b;
    return kOrEqual ? a >= b : a > b;
  }
  if constexpr (kInteger) {
    if constexpr (kLess) return kOrEqual ? a < b : a <= b;
    return kOrEqual ? a > b : a >= b;
  } else {
    if constexpr (kLess) return kOrEqual ? a > b : a >= b;
    return kOrEqual ? a < b : a <= b;
  }
}

/// std::max and std::min, exchanged where the fault is on; std::abs, forgotten.
template <typename T>
T Max(int k, const T& a, const T& b) {
  const bool less = a < b;
  return less == On(k) ? a : b;
}
template <typename T>
T Min(int k, const T& a, const T& b) {
  const bool less = b < a;
  return less == On(k) ? a : b;
}
template <typename T>
T Abs(int k, const T& x) {
  return x < T(0) && !On(k) ? T(-x) : x;
}

}  // namespace planted
