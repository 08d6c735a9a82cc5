#pragma once

#include <functional>
#include <memory>

#include "data/raw_layout.h"
#include "data/trial.h"

namespace unfurl::measure {

// Raw lines of a frame grabber, block by block in constant memory (of PNG files one at a time is
// held). Throws Error with file:line or file:byte for what does not fit the layout: a line cut
// short, counts beyond the bits, cameras with different numbers of lines.
class RawLines {
 public:
  explicit RawLines(const data::RawLayout& layout);
  ~RawLines();

  // With the flat field, when there is one.
  const data::TrialHeader& header() const;
  // The next lines, at most `count`; false when there are none left.
  bool Read(std::size_t count, data::TrialBlock* block);
  // Share of the files' bytes that has been read [-].
  double done() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace unfurl::measure
