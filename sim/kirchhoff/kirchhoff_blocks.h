#pragma once

#include "sim/model/aligned.h"

namespace unfurl::sim {

// A block of a table's row. Written as one vector because compilers do not keep arrays of sums in
// registers; every row starts on a cache line.
typedef double Block __attribute__((vector_size(kBlock * sizeof(double)), may_alias));
inline const Block* Blocks(const double* row) { return reinterpret_cast<const Block*>(row); }
inline Block* Blocks(double* row) { return reinterpret_cast<Block*>(row); }

}  // namespace unfurl::sim
