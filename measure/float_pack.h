#pragma once

#include <cstdint>
#include <cstring>

// Packs go between functions of one file only, all of them inlined.
#pragma GCC diagnostic ignored "-Wpsabi"

namespace unfurl::measure {

// Sixteen values at once for what is done to every pixel of a line, in the compiler's own vectors.
inline constexpr int kFloats = 16;
using FloatPack = float __attribute__((vector_size(64)));
using IntPack = std::int32_t __attribute__((vector_size(64)));
using CountPack = std::uint16_t __attribute__((vector_size(32)));

inline FloatPack Load(const float* from) {
  FloatPack pack;
  std::memcpy(&pack, from, sizeof pack);
  return pack;
}
inline FloatPack Load(const std::uint16_t* from) {
  CountPack pack;
  std::memcpy(&pack, from, sizeof pack);
  // By way of int: the compiler knows no shorter one.
  return __builtin_convertvector(__builtin_convertvector(pack, IntPack), FloatPack);
}
inline void Store(const FloatPack& pack, float* to) { std::memcpy(to, &pack, sizeof pack); }
inline void Store(const FloatPack& pack, std::uint16_t* to) {
  const CountPack counts =
      __builtin_convertvector(__builtin_convertvector(pack, IntPack), CountPack);
  std::memcpy(to, &counts, sizeof counts);
}
// a, b, a, b, ..: what odd and even pixels get.
inline FloatPack InTurn(float a, float b) {
  return FloatPack{a, b, a, b, a, b, a, b, a, b, a, b, a, b, a, b};
}

// 32 counts at once.
inline constexpr int kCounts = 32;
using WidePack = std::uint16_t __attribute__((vector_size(64)));
inline WidePack LoadWide(const std::uint16_t* from) {
  WidePack pack;
  std::memcpy(&pack, from, sizeof pack);
  return pack;
}
inline WidePack Max(const WidePack& a, const WidePack& b) { return a > b ? a : b; }
// What a has above b, 0 where it has less.
inline WidePack Above(const WidePack& a, const WidePack& b) { return Max(a, b) - b; }
inline std::uint16_t Highest(WidePack a) {
  // Halves against each other, five times.
  a = Max(a, __builtin_shufflevector(a, a, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29,
                                     30, 31, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15));
  a = Max(a, __builtin_shufflevector(a, a, 8, 9, 10, 11, 12, 13, 14, 15, 0, 1, 2, 3, 4, 5, 6, 7, 8,
                                     9, 10, 11, 12, 13, 14, 15, 0, 1, 2, 3, 4, 5, 6, 7));
  a = Max(a, __builtin_shufflevector(a, a, 4, 5, 6, 7, 0, 1, 2, 3, 4, 5, 6, 7, 0, 1, 2, 3, 4, 5, 6,
                                     7, 0, 1, 2, 3, 4, 5, 6, 7, 0, 1, 2, 3));
  a = Max(a, __builtin_shufflevector(a, a, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0,
                                     1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1));
  return a[0] > a[1] ? a[0] : a[1];
}

inline FloatPack Max(const FloatPack& a, const FloatPack& b) { return a > b ? a : b; }
inline FloatPack Min(const FloatPack& a, const FloatPack& b) { return a < b ? a : b; }
inline float Highest(const FloatPack& a) {
  float highest = a[0];
  for (int i = 1; i < kFloats; ++i) highest = a[i] > highest ? a[i] : highest;
  return highest;
}

}  // namespace unfurl::measure
