#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "data/raw_layout.h"

namespace unfurl::measure {

// Lines of one list of files, in order.
class RawSource {
 public:
  virtual ~RawSource() = default;
  // Up to `count` lines of `layout.Width(which)` counts each into `out`; how many there were.
  virtual std::size_t Read(std::size_t count, std::uint16_t* out) = 0;
  virtual double done() const = 0;  // share of the files [-]
};

// `files` are lines, flat field or dark lines of the `which`-th of layout.files.
std::unique_ptr<RawSource> OpenRawSource(const data::RawLayout& layout, std::size_t which,
                                         const std::vector<std::string>& files);

}  // namespace unfurl::measure
