#include "data/h5_checks.h"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>

#include "base/error.h"
#include "data/inputs.h"

namespace unfurl::data {

namespace {

// The most that deflate packs: 258 bytes of output for 2 bits of input [RFC 1951].
constexpr double kMostDeflate = 1032.0;
// Rows that a killed writer announced and did not write.
constexpr double kAnnounced = 1 << 20;  // bytes
// Of a reader beside a writer; the library waits 1 ns and twice as long each time, and its own 100
// attempts at a damaged file would outlast the universe.
constexpr unsigned kReadAttempts = 24;

// Superblock 3: signature (8 bytes), version, size of offsets, size of lengths, flags, ...
constexpr std::size_t kVersionAt = 8, kFlagsAt = 11, kHeaderSize = 12;
constexpr unsigned char kOpenForWriting = 0x01, kOpenForStreaming = 0x04;

// Whether the header says that a streaming writer has the file open, or had when it was killed.
bool IsStreaming(const std::string& path) {
  std::array<char, kHeaderSize> header{};
  std::ifstream stream(path, std::ios::binary);
  if (!stream.read(header.data(), header.size())) return false;
  return header[kVersionAt] == 3 && (header[kFlagsAt] & (kOpenForWriting | kOpenForStreaming)) != 0;
}

// `message` becomes what the library says where it fails; every later call to it clears that.
H5Handle Open(const std::string& path, unsigned flags, std::string* message) {
  H5Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  if ((flags & H5F_ACC_SWMR_READ) != 0) H5Pset_metadata_read_attempts(access.get(), kReadAttempts);
  H5Handle file(H5Fopen(path.c_str(), flags, access.get()), H5Fclose);
  if (!file.valid() && message->empty()) *message = H5LastMessage(nullptr);
  return file;
}

struct Extent {
  double bytes = 0.0;
  double chunk = 0.0;  // 0: not in chunks
};

Extent ExtentOf(hid_t dataset, hid_t properties) {
  const H5Handle space(H5Dget_space(dataset), H5Sclose);
  const H5Handle type(H5Dget_type(dataset), H5Tclose);
  const auto size = static_cast<double>(H5Tget_size(type.get()));
  std::array<hsize_t, H5S_MAX_RANK> dims{}, chunk{};
  const int rank = H5Sget_simple_extent_dims(space.get(), dims.data(), nullptr);
  Extent extent{size, 0.0};
  for (int k = 0; k < rank; ++k) {
    extent.bytes *= static_cast<double>(dims[static_cast<std::size_t>(k)]);
  }
  if (H5Pget_layout(properties) != H5D_CHUNKED) return extent;
  const int chunk_rank = H5Pget_chunk(properties, H5S_MAX_RANK, chunk.data());
  extent.chunk = size;
  for (int k = 0; k < chunk_rank; ++k) {
    extent.chunk *= static_cast<double>(chunk[static_cast<std::size_t>(k)]);
  }
  return extent;
}

}  // namespace

std::string H5SchemaWords(const std::string& schema) {
  struct Words {
    const char *schema, *words;
  };
  constexpr Words kWords[] = {
      {"unfurl/run", "a run (of `unfurl simulate`)"},
      {"unfurl/modes", "a file of modes (of `unfurl modes`)"},
      {"unfurl/survey", "a survey (of `unfurl expose --survey` or `unfurl convert`)"},
      {"unfurl/trial", "a trial (of `unfurl convert` or `unfurl expose`)"},
      {"unfurl/rig", "a rig (of `unfurl calibrate`)"},
      {"unfurl/tracks", "tracks (of `unfurl reconstruct`)"},
      {"unfurl/fit", "a fit (of `unfurl fit`)"},
      {"unfurl/campaign", "a campaign's record (of `unfurl campaign`)"}};
  for (const Words& known : kWords) {
    if (schema == known.schema) return known.words;
  }
  return "'" + schema + "'";
}

H5Handle H5OpenChecked(const std::string& path) {
  H5Quiet();
  struct stat info = {};
  if (stat(path.c_str(), &info) != 0) {
    if (errno == EACCES) {
      throw Error("cannot read: Permission denied", path, "ask for permission to read it",
                  ErrorKind::kMachine);
    }
    throw Error("no such file", path, "check the name");
  }
  if (S_ISDIR(info.st_mode)) throw Error("is a folder, not a file", path, "name a file");
  if (!S_ISREG(info.st_mode)) {
    throw Error("is a device or pipe, and HDF5 must be read from a file", path, "name a file");
  }
  if (access(path.c_str(), R_OK) != 0) {
    throw Error(fmt::format("cannot read: {}", std::strerror(errno)), path,
                "ask for permission to read it", ErrorKind::kMachine);
  }
  if (H5Fis_hdf5(path.c_str()) <= 0) {
    throw Error(info.st_size == 0 ? "is empty" : "is not an HDF5 file", path,
                "give a file that an unfurl verb wrote");
  }
  std::string message;
  H5Handle file = Open(path, H5F_ACC_RDONLY, &message);
  if (file.valid()) {
    NoteOpened(path);
    return file;
  }
  if (IsStreaming(path)) {
    file = Open(path, H5F_ACC_RDONLY | H5F_ACC_SWMR_READ, &message);
    if (file.valid()) return file;
  }
  const bool truncated = message.find("truncated") != std::string::npos;
  throw Error(truncated ? "is truncated: the end of the file is missing"
                        : fmt::format("is damaged: {}", message),
              path, "copy it again, or make it again");
}

bool H5HasChecked(hid_t file, const std::string& path, const std::string& object) {
  for (std::size_t slash = 0; slash != std::string::npos;) {
    slash = object.find('/', slash + 1);
    const std::string part = object.substr(0, slash);
    if (part.empty() || part == "/") continue;
    H5L_info_t link;
    if (H5Lexists(file, part.c_str(), H5P_DEFAULT) <= 0 ||
        H5Lget_info(file, part.c_str(), &link, H5P_DEFAULT) < 0) {
      return false;
    }
    if (link.type != H5L_TYPE_HARD) {
      throw Error(fmt::format("is a link to {}, which is not followed",
                              link.type == H5L_TYPE_SOFT ? "another place" : "another file"),
                  fmt::format("{}:{}", path, part), "write the data itself in its place");
    }
  }
  return true;
}

void H5CheckStorage(hid_t dataset, const std::string& where) {
  const H5Handle properties(H5Dget_create_plist(dataset), H5Pclose);
  if (H5Pget_layout(properties.get()) == H5D_VIRTUAL ||
      H5Pget_external_count(properties.get()) > 0) {
    throw Error("keeps its data in another file, which is not opened", where,
                "write the data into this file");
  }
  bool deflated = false;
  const int filters = H5Pget_nfilters(properties.get());
  for (int k = 0; k < filters; ++k) {
    unsigned flags = 0;
    std::size_t values = 0;
    const H5Z_filter_t filter = H5Pget_filter2(properties.get(), static_cast<unsigned>(k), &flags,
                                               &values, nullptr, 0, nullptr, nullptr);
    if (filter != H5Z_FILTER_DEFLATE && filter != H5Z_FILTER_SHUFFLE &&
        filter != H5Z_FILTER_FLETCHER32) {
      throw Error(fmt::format("is packed by filter {}, which is not run here", filter), where,
                  "write it with gzip, shuffle and fletcher32 only, or none");
    }
    deflated = deflated || filter == H5Z_FILTER_DEFLATE;
  }
  const Extent extent = ExtentOf(dataset, properties.get());
  const auto stored = static_cast<double>(H5Dget_storage_size(dataset));
  const double most = (deflated ? kMostDeflate : 1.0) * stored + kAnnounced;
  if (extent.bytes > most || (extent.bytes > 0.0 && extent.chunk > most)) {
    throw Error(fmt::format("claims {:.3g} bytes in chunks of {:.3g}, and the file holds {:.3g}",
                            extent.bytes, extent.chunk, stored),
                where, "copy the file again, or make it again");
  }
}

void H5CheckNumber(hid_t type, const std::string& where) {
  const H5T_class_t kind = H5Tget_class(type);
  if ((kind != H5T_INTEGER && kind != H5T_FLOAT) || H5Tget_size(type) > 8) {
    throw Error(kind == H5T_STRING ? "holds text, not numbers" : "does not hold plain numbers",
                where, "write numbers of at most 8 bytes");
  }
}

bool H5IsOne(hid_t space) {
  const H5S_class_t kind = H5Sget_simple_extent_type(space);
  return (kind == H5S_SCALAR || kind == H5S_SIMPLE) && H5Sget_simple_extent_npoints(space) == 1;
}

void H5CheckText(hid_t type, const std::string& where) {
  if (H5Tget_class(type) != H5T_STRING || H5Tis_variable_str(type) <= 0) return;
  throw Error("is text of variable length, which is not read", where,
              "write it with a fixed length (in h5py: numpy.bytes_(text))");
}

std::string H5ReadText(hid_t object, const std::string& name, const std::string& where) {
  if (H5Aexists(object, name.c_str()) <= 0) return {};
  const H5Handle attribute(H5Aopen(object, name.c_str(), H5P_DEFAULT), H5Aclose);
  if (!attribute.valid()) return {};
  const H5Handle type(H5Aget_type(attribute.get()), H5Tclose);
  const H5Handle space(H5Aget_space(attribute.get()), H5Sclose);
  H5CheckText(type.get(), where + "@" + name);
  if (H5Tget_class(type.get()) != H5T_STRING || !H5IsOne(space.get())) return {};
  // What an attribute claims is what its header holds.
  const std::size_t size = H5Tget_size(type.get());
  if (size == 0 || size > H5Aget_storage_size(attribute.get())) return {};
  std::string value(size, '\0');
  if (H5Aread(attribute.get(), type.get(), value.data()) < 0) return {};
  value.resize(strnlen(value.c_str(), size));
  return value;
}

std::vector<std::string> H5LinkNames(hid_t group, const std::string& where) {
  std::vector<std::string> names;
  const auto collect = [](hid_t, const char* name, const H5L_info_t*, void* out) -> herr_t {
    static_cast<std::vector<std::string>*>(out)->emplace_back(name);
    return 0;
  };
  const H5Handle properties(H5Gget_create_plist(group), H5Pclose);
  unsigned order = 0;
  H5Pget_link_creation_order(properties.get(), &order);
  const bool indexed = (order & H5P_CRT_ORDER_INDEXED) != 0;
  // In native order, which is that of the index: for any other the library first makes a table, and
  // frees what it never set where a damaged file stops that (1.10.8).
  if (H5Literate(group, indexed ? H5_INDEX_CRT_ORDER : H5_INDEX_NAME, H5_ITER_NATIVE, nullptr,
                 collect, &names) < 0) {
    throw Error("its members cannot be listed", where, "copy the file again, or make it again");
  }
  if (!indexed) std::sort(names.begin(), names.end());
  return names;
}

}  // namespace unfurl::data
