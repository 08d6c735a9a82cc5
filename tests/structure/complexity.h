#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace unfurl::structure {

// A function's cyclomatic complexity: 1 plus its decisions (if, for, while, case, catch, ?, &&,
// ||), those of its lambdas included [McCabe, A Complexity Measure, IEEE Trans. Softw. Eng. 2
// (1976)].
struct FunctionComplexity {
  std::string name;
  int line = 0;  // of its opening brace
  int complexity = 1;
};

// Of every function with a body in C++ source text. Reads tokens and braces only; preprocessor
// lines are passed over.
std::vector<FunctionComplexity> ComplexityOf(std::string_view text);

}  // namespace unfurl::structure
