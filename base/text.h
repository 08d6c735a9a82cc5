#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace unfurl {

// The known name nearest to `name` by edit distance, or empty when none is near enough to be meant.
std::string NearestName(std::string_view name, std::span<const std::string> known);

// "a, b and c".
std::string JoinWords(std::span<const std::string> words);

std::vector<std::string> Split(std::string_view text, char separator);
std::string_view Trim(std::string_view text);

// The whole of `text` as a number, or nothing. Locale-free; takes inf and nan, so test for finite.
bool ParseDouble(std::string_view text, double* value);
// Likewise as a whole number, without a sign.
bool ParseWhole(std::string_view text, std::uint64_t* value);

}  // namespace unfurl
