#pragma once

#include <string>
#include <vector>

#include "data/h5_handle.h"

namespace unfurl::data {

// A file may come from anybody: nothing in it is believed before it has been looked at. What these
// functions refuse: files that are no regular files or whose header is damaged; links to other
// places and other files; data kept in other files (external storage, virtual datasets); filters
// beyond those of the library that every reader has (deflate, shuffle, fletcher32); shapes and
// chunks larger than what the file holds of them can unpack to.

// A schema as people call it, and the verb that writes it: "a run (of `unfurl simulate`)".
std::string H5SchemaWords(const std::string& schema);

// Read-only; also a streamed file that is growing or whose writer was killed. Throws Error.
H5Handle H5OpenChecked(const std::string& path);

// True when `object` ("/group/name") is there. Throws Error for a soft or external link on the way.
bool H5HasChecked(hid_t file, const std::string& path, const std::string& object);

// Throws Error unless all of the dataset can be read from this file alone, in memory that is in
// proportion to what the file holds.
void H5CheckStorage(hid_t dataset, const std::string& where);

// Throws Error unless `type` is a plain number of at most 8 bytes.
void H5CheckNumber(hid_t type, const std::string& where);

// Whether an attribute or dataset holds exactly one value.
bool H5IsOne(hid_t space);

// A text attribute of fixed length; empty when absent, not text, or several. Throws Error for one
// of variable length: damaged, such text sends HDF5 1.10 round for ever. `where` is the object's
// place.
std::string H5ReadText(hid_t object, const std::string& name, const std::string& where);

// Throws Error for text of variable length.
void H5CheckText(hid_t type, const std::string& where);

// Names of the links of a group, by creation order where the file has an index of it, else by name.
std::vector<std::string> H5LinkNames(hid_t group, const std::string& where);

}  // namespace unfurl::data
