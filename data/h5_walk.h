#pragma once

#include <string>
#include <vector>

namespace unfurl::data {

// Paths of all datasets in an HDF5 file, group by group; each object once, however many names lead
// to it. Throws Error for a file that H5Reader would refuse, for links to other places, and for
// groups that nest deeper than 32.
std::vector<std::string> H5ListDatasets(const std::string& path);

}  // namespace unfurl::data
