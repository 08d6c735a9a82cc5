// The target of libFuzzer; which reader it is comes from the environment: UNFURL_READER=tracks_csv.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>

#include "tests/fuzz/readers.h"

namespace {

const unfurl::fuzz::Reader& Chosen() {
  const char* name = std::getenv("UNFURL_READER");
  const auto& readers = unfurl::fuzz::Readers();
  const auto found = std::find_if(readers.begin(), readers.end(), [&](const auto& reader) {
    return name != nullptr && reader.name == name;
  });
  if (found != readers.end()) return *found;
  std::fprintf(stderr, "set UNFURL_READER to one of:\n");
  for (const auto& reader : readers) std::fprintf(stderr, "  %s\n", reader.name.c_str());
  std::exit(2);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  static const unfurl::fuzz::Reader& reader = Chosen();
  unfurl::fuzz::Try(reader, {reinterpret_cast<const char*>(bytes), size});
  return 0;
}
