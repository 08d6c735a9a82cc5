// One target of libFuzzer; UNFURL_READER is the reader's name.
#include <algorithm>
#include <cstdint>
#include <cstdlib>

#include "tests/fuzz/readers.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using unfurl::fuzz::Readers;
  static const auto found =
      std::find_if(Readers().begin(), Readers().end(),
                   [](const unfurl::fuzz::Reader& r) { return r.name == UNFURL_READER; });
  if (found == Readers().end()) std::abort();
  unfurl::fuzz::Try(*found, {reinterpret_cast<const char*>(bytes), size});
  return 0;
}
