#include "calib/serial_openmp.h"

#include <dlfcn.h>

namespace unfurl::calib {
namespace {

// Of OpenMP's runtime, which CHOLMOD brings or not, and of which clang has no header.
template <typename F>
F* OpenMpFunction(const char* name) {
  return reinterpret_cast<F*>(dlsym(RTLD_DEFAULT, name));
}

int OpenMpLevels() {
  const auto get = OpenMpFunction<int()>("omp_get_max_active_levels");
  return get != nullptr ? get() : 0;
}

void SetOpenMpLevels(int levels) {
  if (const auto set = OpenMpFunction<void(int)>("omp_set_max_active_levels")) set(levels);
}

}  // namespace

SerialOpenMp::SerialOpenMp() : before_(OpenMpLevels()) { SetOpenMpLevels(0); }

SerialOpenMp::~SerialOpenMp() { SetOpenMpLevels(before_); }

}  // namespace unfurl::calib
