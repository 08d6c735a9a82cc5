#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "data/line_format.h"
#include "data/provenance.h"

namespace unfurl::data {

// What the cameras recorded: per line a time stamp (the middle of its flash, on the recorder's own
// clock, which starts at 0), what was lit, and each camera's counts.
struct TrialHeader {
  std::vector<std::string> cameras;  // c names
  std::vector<std::string> slots;    // what may be lit: mark names and "dark"
  LineFormats format;
  double line_rate = 0.0;  // [1/s]
  // Flat field: response of each active pixel relative to its camera's mean [-], camera after
  // camera; empty: none was recorded.
  std::vector<float> response;

  // Counts of one line, all cameras.
  std::size_t line_counts() const { return format.ElementsBefore(cameras.size()); }
};

// What a slot lights: its name, or several joined by '+' ("mark1+mark2"); none for "dark".
std::vector<std::string> MarksOfSlot(const std::string& slot);

inline constexpr char kTrialSchema[] = "unfurl/trial";
inline constexpr int kTrialVersion = 1;

// A block of consecutive lines, its buffers kept from block to block.
struct TrialBlock {
  std::vector<double> t;              // n [s]
  std::vector<std::int32_t> slot;     // n, index into the header's slots
  std::vector<std::uint16_t> counts;  // n x (elements of each camera in turn)

  // Number of lines.
  std::size_t size() const { return t.size(); }
  // Room for so many lines; allocates only when it grows.
  void Resize(std::size_t lines, const TrialHeader& header);
  // One camera's line.
  std::span<const std::uint16_t> Line(const TrialHeader& header, std::size_t line,
                                      std::size_t camera) const {
    return {&counts[line * header.line_counts() + header.format.ElementsBefore(camera)],
            header.format.Of(camera).elements()};
  }
};

// Streams lines to disk in constant memory; the file gets its name on Commit.
class TrialWriter {
 public:
  TrialWriter(const std::string& path, const TrialHeader& header, const Provenance& provenance);
  ~TrialWriter();
  // Lines go on where the last block ended. Throws Error when the disk is full.
  void Append(const TrialBlock& block);
  // Gives the file its name. Call once, last.
  void Commit();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// Reads them back in blocks. Throws Error for a file that contradicts itself.
class TrialReader {
 public:
  explicit TrialReader(const std::string& path);
  ~TrialReader();

  // The file, and what stands before its lines.
  const std::string& path() const;
  const TrialHeader& header() const;
  std::size_t size() const;  // lines
  // Who made the file, from what.
  Provenance ReadProvenance() const;
  // Lines [first, first + count).
  void Read(std::size_t first, std::size_t count, TrialBlock* block) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace unfurl::data
