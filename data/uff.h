#pragma once

#include <array>
#include <string>
#include <vector>

namespace unfurl::data {

// Datasets 58 and 58b (function at nodal degree of freedom) and 164 (units) of a universal file
// [SDRC, "Universal File Datasets"]: as they stand in the file, nothing judged yet.

struct UffAxis {
  int type = 0;  // specific data type: 8 displacement, 11 velocity, 12 acceleration, 17 time, ...
  std::string label, units;
};

struct UffFunction {
  std::string where;  // "file:line" of its dataset
  std::array<std::string, 5> id;
  int type = 0;                 // 1 time response, 4 frequency response, ...
  int node = 0, direction = 0;  // -3 .. 3: along an axis, against it; 0: a scalar
  bool complex = false;         // then there are no values
  UffAxis abscissa, ordinate, denominator;
  std::vector<double> t, y;  // in the units of abscissa and ordinate [unit]
};

struct UffFile {
  std::vector<UffFunction> functions;
  double length_factor = 0.0;  // file's lengths per metre (dataset 164); 0: not stated [1/m]
};

// Values in E or D format or binary (58b: IEEE, either byte order). Throws Error with the line for
// what is cut off, no number, or counts more than the file holds.
UffFile ReadUff(const std::string& path);

// "acceleration", "frequency response": for messages.
std::string UffDataType(int type);
std::string UffFunctionType(int type);

}  // namespace unfurl::data
