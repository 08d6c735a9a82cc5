#pragma once

#include <string>
#include <vector>

#include "data/expression.h"

namespace unfurl::data {

inline constexpr int kExpressionDepth = 64;                // values on the stack at once
inline constexpr std::size_t kExpressionLongest = 10'000;  // characters

// The program of an expression, with its constant parts worked out. Throws Error with `where` and
// the column.
std::vector<Expression::Instruction> ParseExpression(const std::string& text,
                                                     const std::string& where);

}  // namespace unfurl::data
