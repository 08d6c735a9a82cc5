#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace unfurl::data {

// Who made a file, from what. Stored as the root attributes of every HDF5 file. There is no time
// stamp on purpose: the same inputs, options and seed give the same bytes.
struct InputFile {
  std::string path;
  std::string sha256;  // of the file's bytes, in hex
};

// What a file says about its making.
struct Provenance {
  std::string program;  // "unfurl 0.1.0"
  std::string command;  // the verb and its arguments, as typed
  std::vector<InputFile> inputs;
  std::map<std::string, std::string> options;  // settings that shaped the result, by key
  std::optional<std::uint64_t> seed;

  // Hashes the file; throws Error when it cannot be read.
  void AddInput(const std::string& path);
};

// SHA-256 of a file's bytes in hex; throws Error when it cannot be read.
std::string FileSha256(const std::string& path);

/// The same of a text.
std::string TextSha256(const std::string& text);

// "unfurl 0.1.0".
std::string ProgramVersion();

}  // namespace unfurl::data
