#pragma once

#include <cstddef>
#include <new>
#include <vector>

namespace unfurl::sim {

// Arrays that the vector loops walk through start on a cache line.
template <typename T>
struct CacheLineAllocator {
  using value_type = T;
  static constexpr std::align_val_t kAlignment{64};
  CacheLineAllocator() = default;
  template <typename U>
  CacheLineAllocator(const CacheLineAllocator<U>&) {}
  T* allocate(std::size_t n) { return static_cast<T*>(::operator new(n * sizeof(T), kAlignment)); }
  void deallocate(T* p, std::size_t) { ::operator delete(p, kAlignment); }
  template <typename U>
  bool operator==(const CacheLineAllocator<U>&) const {
    return true;
  }
};

using Array = std::vector<double, CacheLineAllocator<double>>;

// Vector loops run over whole blocks of this many entries.
inline constexpr int kBlock = 8;
inline int PaddedSize(int n) { return (n + kBlock - 1) / kBlock * kBlock; }

}  // namespace unfurl::sim
