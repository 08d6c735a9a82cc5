#include "base/count.h"

#include <fmt/format.h>

namespace unfurl {

std::string Counted(std::size_t count, std::string_view noun) {
  return fmt::format("{} {}{}", count, noun, count == 1 ? "" : "s");
}

}  // namespace unfurl
