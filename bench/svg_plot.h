#pragma once

#include <string>
#include <vector>

namespace unfurl::bench {

// A still picture of curves over one axis, as a file of its own for the docs.
struct Curve {
  std::string name;
  std::vector<double> x, y;
  bool dashed = false;
};
struct Plot {
  std::string title, x_label, y_label;
  std::vector<Curve> curves;
};

// Throws Error when the file cannot be written.
void WriteSvg(const std::string& path, const Plot& plot);

}  // namespace unfurl::bench
