#pragma once

#include <cstdint>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

namespace unfurl::data {

// Records of long work in NAME.partial, so that a kill at any moment loses at most the record that
// was being written. Each record carries its length and a checksum; what follows the last whole one
// is cut off when the journal is opened again. One program at a time may hold it.
class Journal {
 public:
  // `identity` says what the records depend on (hashes of inputs, options). With `resume` the
  // records of an earlier program are kept; throws Error when they belong to another identity.
  // Without it an earlier journal that holds records is set aside as NAME.partial~.
  // Without an earlier one the journal starts empty.
  Journal(const std::string& result, const std::string& identity, bool resume);
  // Removes the file if it holds no record; else it stays.
  ~Journal();
  Journal(const Journal&) = delete;
  Journal& operator=(const Journal&) = delete;

  const std::string& path() const { return path_; }  ///< of its file
  std::size_t size() const;                     // records, old and new
  std::size_t found() const { return found_; }  // those of an earlier program
  std::string Read(std::size_t index) const;    // throws Error(kMachine) when it cannot
  // Whole on disk as far as the operating system goes when it returns. Safe from several threads.
  // Gives the index of the record.
  std::size_t Append(std::string_view bytes);
  // The work is done and its result has its name: the file goes.
  void Remove();

 private:
  struct Place {
    std::uint64_t offset = 0;
    std::uint64_t length = 0;
  };
  void Scan(const std::string& identity, bool resume);
  void SetAside();
  void FindRecords(std::uint64_t size);

  std::string path_;
  int file_ = -1;
  std::uint64_t end_ = 0;
  std::size_t found_ = 0;
  bool removed_ = false;
  std::vector<Place> places_;
  mutable std::mutex mutex_;
};

// FNV-1a, 64 bits: guards against torn and flipped bytes, not against malice.
std::uint64_t Checksum(std::string_view bytes, std::uint64_t seed = 14695981039346656037ull);

}  // namespace unfurl::data
