#pragma once

#include <string>

#include "calib/wand_fit.h"

namespace unfurl::calib {

// Marks of a bar that one camera calls by each other's names.
struct ExchangedMarks {
  int camera = -1;  // -1: none
  int first = 0, second = 0;

  std::string Words(const WandData& data) const;  // a sentence
};

// Where the search for cameras leads nowhere: whether they do with two marks of one camera
// exchanged in every pose. Of three cameras nothing tells which.
ExchangedMarks FindExchanged(const WandData& data, const WandFitOptions& options,
                             const std::string& where);

}  // namespace unfurl::calib
