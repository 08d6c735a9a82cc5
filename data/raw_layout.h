#pragma once

#include <string>
#include <vector>

#include "data/trial.h"

namespace unfurl::data {

// How raw lines of a frame grabber lie in files, as a person describes it in TOML (docs/formats.md
// lists the keys): what becomes a trial by `unfurl convert LAYOUT.toml TRIAL.h5`, or, with a table
// [survey], a survey.
struct RawLayout {
  enum class Format { kBinary, kCsv, kPng, kHdf5 };

  std::string path;  // of the description
  Format format = Format::kBinary;
  TrialHeader header;               // cameras, distinct slots, sensor, line rate
  std::vector<std::int32_t> cycle;  // what is lit line by line, in turn: index into header.slots
  std::size_t first_slot = 0;       // of the first line, in `cycle`
  double start = 0.0;               // stamp of the first line [s]
  std::string stamps;  // CSV of stamps (and slots), one row a line; empty: from the rate

  // Of a survey: its points [CSV], and which line shows which: as many lines for each, in the
  // points' order and the slots' turn beginning anew with each; or a CSV with a row a line, `id`
  // and, where the turn was not kept, `slot`.
  struct Survey {
    std::string points;  // empty: this is a trial
    std::string ids;     // empty: lines_each
    int lines_each = 0;
  };
  Survey survey;

  // One for each camera, or a single one whose lines hold all cameras side by side.
  struct Files {
    std::string where;               // "layout.toml:12:camera.door.files"
    std::vector<std::string> lines;  // in order; names as the program can open them
    std::vector<std::string> flat;   // evenly lit lines, for the flat field; may be empty
    std::vector<std::string> flat_dark;
    std::string dataset;  // of HDF5: the lines' name in each file, "/entry/lines"
  };
  std::vector<Files> files;
  bool together() const { return files.size() == 1 && header.cameras.size() > 1; }
  // Counts in one line of the f-th files.
  std::size_t Width(std::size_t f) const {
    return together() ? header.line_counts() : header.format.Of(f).elements();
  }

  // Binary only.
  int bytes = 2;  // of a count
  bool big_endian = false;
  int shift = 0;                 // bits below a count's lowest one (left-aligned counts)
  std::size_t file_header = 0;   // bytes before the first line of each file
  std::size_t line_header = 0;   // before the counts of each line
  std::size_t line_trailer = 0;  // and after them
};

// Throws Error with file:line:key for what is missing, unknown or impossible, also for files that
// are not there.
RawLayout ReadRawLayout(const std::string& path);

}  // namespace unfurl::data
