#pragma once

#include <string>
#include <vector>

namespace unfurl {

// A table for terminals, header row first: columns aligned, numbers right.
std::string AlignedTable(const std::vector<std::vector<std::string>>& rows);

}  // namespace unfurl
