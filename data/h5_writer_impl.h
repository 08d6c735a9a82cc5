#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "data/atomic_file.h"
#include "data/h5.h"
#include "data/h5_handle.h"
#include "data/h5_scales.h"

namespace unfurl::data {

// Attribute of rows of letters, so that netCDF4 makes words of them.
inline constexpr char kTextEncoding[] = "_Encoding";

// What H5Writer and its series share: the open file, and the calls of HDF5 that make objects in it.
struct H5Writer::Impl {
  std::string path;
  AtomicFile file;
  H5Handle handle;
  std::vector<H5Handle> series;
  std::vector<H5Labelled> labelled;          // by scales that are still to be attached
  std::set<std::string> bare;                // scales
  std::map<std::string, std::size_t> texts;  // letters of each entry
  std::map<std::string, std::string>
      letters_of;  // of a text that is a scale or has one: their scale
  bool streamed;

  Impl(const std::string& path, bool stream);

  // Throws Error: the last message of HDF5, or of the system.
  [[noreturn]] void Fail(const std::string& object);
  void MakeGroups(const std::string& object);  // those above it
  void MakeGroup(const std::string& group);
  H5Handle Open(const std::string& object);  // a group is made where there is nothing
  void PutAttribute(hid_t object, const std::string& name, hid_t disk, hid_t memory,
                    const void* value);
  void PutText(hid_t object, const std::string& name, const std::string& value);
  H5Handle Create(const H5Field& field, hid_t disk, hid_t space, hid_t properties);
  H5Series Grow(const H5Field& field, hid_t disk, const std::vector<std::size_t>& row_dims,
                std::size_t chunk_rows, int deflate, std::size_t chunk_columns);
  void WriteAll(const H5Field& field, hid_t disk, hid_t memory, const void* values,
                std::size_t count, std::vector<std::size_t> dims);
};

}  // namespace unfurl::data
