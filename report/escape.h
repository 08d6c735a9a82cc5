#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace unfurl::report {

// Plain text as HTML, in an element or in a quoted attribute. Control characters are dropped.
std::string EscapeHtml(std::string_view text);

// JSON as the content of a <script> element: no '<' is left, so nothing in it can end the element
// or open a comment. The result is still the same JSON.
std::string EscapeJsonForScript(std::string_view json);

// Bytes as base64, for data URIs.
std::string Base64(std::span<const std::uint8_t> bytes);

// Values as 32-bit floats in base64.
std::string Floats(std::span<const double> values);

}  // namespace unfurl::report
