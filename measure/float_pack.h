#pragma once

#include <cstdint>
#include <cstring>

// Packs go between functions of one file only, all of them inlined.
#pragma GCC diagnostic ignored "-Wpsabi"

namespace unfurl::measure {

// Sixteen values at once for what is done to every pixel of a line, in the compiler's own vectors.
inline constexpr int kFloats = 16;
using FloatPack = float __attribute__((vector_size(64)));
using CountPack = std::uint16_t __attribute__((vector_size(32)));

inline FloatPack Load(const float* from) {
  FloatPack pack;
  std::memcpy(&pack, from, sizeof pack);
  return pack;
}
inline FloatPack Load(const std::uint16_t* from) {
  CountPack pack;
  std::memcpy(&pack, from, sizeof pack);
  return __builtin_convertvector(pack, FloatPack);
}
inline void Store(const FloatPack& pack, float* to) { std::memcpy(to, &pack, sizeof pack); }
inline void Store(const FloatPack& pack, std::uint16_t* to) {
  const CountPack counts = __builtin_convertvector(pack, CountPack);
  std::memcpy(to, &counts, sizeof counts);
}
// a, b, a, b, ..: what odd and even pixels get.
inline FloatPack InTurn(float a, float b) {
  return FloatPack{a, b, a, b, a, b, a, b, a, b, a, b, a, b, a, b};
}
inline FloatPack Max(const FloatPack& a, const FloatPack& b) { return a > b ? a : b; }
inline FloatPack Min(const FloatPack& a, const FloatPack& b) { return a < b ? a : b; }
inline float Highest(const FloatPack& a) {
  float highest = a[0];
  for (int i = 1; i < kFloats; ++i) highest = a[i] > highest ? a[i] : highest;
  return highest;
}

}  // namespace unfurl::measure
