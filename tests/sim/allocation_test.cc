#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <new>

#include "effects.h"
#include "sim/methods/simulate.h"

// Counts every allocation of this program. The sanitizers bring their own, so not under them.
#if !defined(__SANITIZE_ADDRESS__)
namespace {
std::atomic<long> allocations{0};
}
void* operator new(std::size_t size) {
  ++allocations;
  if (void* p = std::malloc(size)) return p;
  throw std::bad_alloc();
}
void* operator new(std::size_t size, std::align_val_t alignment) {
  ++allocations;
  const auto a = static_cast<std::size_t>(alignment);
  if (void* p = std::aligned_alloc(a, (size + a - 1) / a * a)) return p;
  throw std::bad_alloc();
}
// Not inlined: the compiler would see free() of what it believes the usual operator new gave.
[[gnu::noinline]] void operator delete(void* p) noexcept { std::free(p); }
[[gnu::noinline]] void operator delete(void* p, std::size_t) noexcept { std::free(p); }
[[gnu::noinline]] void operator delete(void* p, std::align_val_t) noexcept { std::free(p); }
[[gnu::noinline]] void operator delete(void* p, std::size_t, std::align_val_t) noexcept {
  std::free(p);
}
#endif

namespace unfurl::sim::allocation_test {
namespace {

TEST(Simulate, TheLoopAllocatesNothing) {
#if defined(__SANITIZE_ADDRESS__)
  GTEST_SKIP() << "the sanitizer counts allocations for itself";
#else
  data::Scene scene = data::ReadScene(DeploymentPath("suspension"));
  for (auto& beam : scene.beams) beam.segments = 4;
  const auto count = [](const Model& model, double duration, Method method) {
    SimulateOptions options;
    options.duration = duration;
    options.method = method;
    options.rtol = 1e-4;
    const long before = allocations;
    EXPECT_TRUE(Simulate(model, options, nullptr).Usable());
    return allocations - before;
  };
  const Model deployment = Compile(scene), everything = ModelFrom(EverythingScene());
  for (const Method method : {Method::kProjected, Method::kImplicit}) {
    EXPECT_GT(count(deployment, 0.01, method), 0);  // the arrays of the run: so the counter counts
    // Neither ends after the first latch, so no event is recorded.
    EXPECT_EQ(count(deployment, 0.2, method), count(deployment, 0.5, method));
    EXPECT_EQ(count(everything, 0.2, method), count(everything, 0.5, method));
  }
  for (auto& beam : scene.beams) beam.model = data::BeamModel::kKirchhoff;
  const Model smooth = Compile(scene);
  EXPECT_EQ(count(smooth, 0.2, Method::kProjected), count(smooth, 0.5, Method::kProjected));
#endif
}

}  // namespace
}  // namespace unfurl::sim::allocation_test
