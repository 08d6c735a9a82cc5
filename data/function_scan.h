#pragma once

#include <vector>

namespace unfurl::data {

// A function of time, or a derivative of it, looked through for features that samples would miss:
// a partition of [0, duration] so fine that within none of its cells a pulse can hide from a cubic
// through the cell's ends. That is no matter of samples: bounds over the whole cell say so.
// TimeFunction::Scan makes it.
struct FunctionScan {
  struct Cell {
    double begin, end;  // [s]
    double hidden;      // bound of what integral a pulse within it may have, unseen [unit s]
  };
  std::vector<Cell> cells;       // in order; none of a table or constant
  double low = 0.0, high = 0.0;  // of the values at the cells' middles [unit]
  double area = 0.0;             // integral of its distance from its usual value [unit s]
  double hidden = 0.0;           // the largest of the cells [unit s]
};

}  // namespace unfurl::data
