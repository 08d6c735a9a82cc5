#pragma once

#include <memory>
#include <string>

#include "data/trial.h"

namespace unfurl::measure {

// A line camera's record is a streak image, time by pixels. This draws those of a trial, one panel
// per camera, time to the right, pixels upward, one colour per mark; what the eye needs to see at
// once: marks that leave the sensor, reflections, lost light. Constant memory.
class StreakPicture {
 public:
  // `lines` is the trial's length.
  StreakPicture(const data::TrialHeader& header, std::size_t lines);
  ~StreakPicture();

  // Blocks must follow each other from line 0.
  void Add(const data::TrialBlock& block);

  // Tone-maps, labels and writes a PNG.
  void Write(const std::string& path) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace unfurl::measure
