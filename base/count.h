#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace unfurl {

// "1 sample", "2 samples": a number and the plural of an English noun that takes an s.
std::string Counted(std::size_t count, std::string_view noun);

}  // namespace unfurl
