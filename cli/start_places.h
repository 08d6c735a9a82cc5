#pragma once

#include <Eigen/Core>
#include <map>
#include <string>

namespace unfurl::cli {

// Where marks are at the start [m], by name, from a CSV file of columns mark, x, y, z.
std::map<std::string, Eigen::Vector3d> ReadStart(const std::string& path);

}  // namespace unfurl::cli
