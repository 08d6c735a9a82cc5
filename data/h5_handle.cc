#include "data/h5_handle.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <cstring>

namespace unfurl::data {

void H5Quiet() {
  static const bool once = [] {
    // The library's own clean-up at exit writes again what a full disk has refused, and crashes.
    H5dont_atexit();
    H5open();
    H5PLset_loading_state(0);  // a file must not choose code to be loaded
    return true;
  }();
  // Each thread has an error stack of its own, which prints unless it is told not to.
  thread_local const bool quiet = [] {
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
    return true;
  }();
  (void)once;
  (void)quiet;
}

std::string H5LastMessage(int* error_number) {
  struct Found {
    std::string message;
    int error_number = 0;
  } found;
  H5Ewalk2(
      H5E_DEFAULT, H5E_WALK_DOWNWARD,
      [](unsigned, const H5E_error2_t* entry, void* data) -> herr_t {
        auto* out = static_cast<Found*>(data);
        if (entry->desc == nullptr) return 0;
        out->message = entry->desc;
        if (const char* at = std::strstr(entry->desc, "errno = ")) {
          out->error_number = std::atoi(at + 8);
        }
        return 0;
      },
      &found);
  if (error_number != nullptr) *error_number = found.error_number;
  return found.message;
}

H5Handle H5Text(std::size_t width) {
  H5Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
  H5Tset_size(type.get(), std::max<std::size_t>(1, width));
  H5Tset_cset(type.get(), H5T_CSET_UTF8);
  H5Tset_strpad(type.get(), H5T_STR_NULLPAD);
  return type;
}

}  // namespace unfurl::data
