#pragma once

#include <bit>
#include <cstddef>

namespace unfurl::data {

// What the writer and the reader of C3D files share; private to them.
static_assert(std::endian::native == std::endian::little);

inline constexpr std::size_t kC3dBlock = 512;         // [byte]
inline constexpr std::size_t kC3dMostFrames = 65535;  // a 16-bit count

}  // namespace unfurl::data
