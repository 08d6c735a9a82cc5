#include "data/h5_writer_impl.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <stdexcept>

#include "base/error.h"

namespace unfurl::data {

namespace {

// Whole where it is small, else slabs of the first dimensions.
std::vector<hsize_t> ChunkOf(std::vector<hsize_t> size, std::size_t bytes_each) {
  constexpr std::size_t kLargest = std::size_t{1} << 20;  // bytes
  std::size_t bytes = bytes_each;
  for (const hsize_t d : size) bytes *= d;
  for (hsize_t& d : size) {
    if (bytes <= kLargest) break;
    bytes /= d;  // of one slab
    d = std::max<hsize_t>(1, kLargest / std::max<std::size_t>(1, bytes));
    bytes *= d;
  }
  return size;
}

std::vector<hsize_t> ToHsize(const std::vector<std::size_t>& dims) {
  return std::vector<hsize_t>(dims.begin(), dims.end());
}

}  // namespace

H5Writer::Impl::Impl(const std::string& p, bool stream)
    : path(p),
      file(p, stream ? AtomicFile::Temporary::kPartial : AtomicFile::Temporary::kHidden),
      streamed(stream) {}

void H5Writer::Impl::Fail(const std::string& object) {
  int number = 0;
  const std::string message = H5LastMessage(&number);
  if (number != 0) ThrowWriteError(path, number);
  throw Error(fmt::format("cannot write {}: {}", object, message), path,
              "check the disk and try again", ErrorKind::kMachine);
}

void H5Writer::Impl::MakeGroups(const std::string& object) {
  std::string group;
  std::size_t slash = 0;
  while ((slash = object.find('/', slash + 1)) != std::string::npos)
    MakeGroup(object.substr(0, slash));
}

void H5Writer::Impl::MakeGroup(const std::string& group) {
  if (group.empty() || group == "/" || H5Lexists(handle.get(), group.c_str(), H5P_DEFAULT) > 0)
    return;
  H5Handle properties(H5Pcreate(H5P_GROUP_CREATE), H5Pclose);
  H5Pset_link_creation_order(properties.get(), H5P_CRT_ORDER_TRACKED | H5P_CRT_ORDER_INDEXED);
  H5Pset_obj_track_times(properties.get(), 0);
  H5Handle made(H5Gcreate2(handle.get(), group.c_str(), H5P_DEFAULT, properties.get(), H5P_DEFAULT),
                H5Gclose);
  if (!made.valid()) Fail(group);
}

H5Handle H5Writer::Impl::Open(const std::string& object) {
  if (object != "/" && H5Lexists(handle.get(), object.c_str(), H5P_DEFAULT) <= 0) {
    MakeGroups(object);
    MakeGroup(object);
  }
  return H5Handle(H5Oopen(handle.get(), object.c_str(), H5P_DEFAULT), H5Oclose);
}

void H5Writer::Impl::PutAttribute(hid_t object, const std::string& name, hid_t disk, hid_t memory,
                                  const void* value) {
  H5Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  if (H5Aexists(object, name.c_str()) > 0) H5Adelete(object, name.c_str());
  H5Handle attribute(H5Acreate2(object, name.c_str(), disk, space.get(), H5P_DEFAULT, H5P_DEFAULT),
                     H5Aclose);
  if (!attribute.valid() || H5Awrite(attribute.get(), memory, value) < 0) Fail(name);
}

void H5Writer::Impl::PutText(hid_t object, const std::string& name, const std::string& value) {
  const H5Handle type = H5Text(value.size());
  const std::string padded = value.empty() ? std::string(1, '\0') : value;
  PutAttribute(object, name, type.get(), type.get(), padded.data());
}

H5Handle H5Writer::Impl::Create(const H5Field& field, hid_t disk, hid_t space, hid_t properties) {
  MakeGroups(field.path);
  H5Pset_obj_track_times(properties, 0);
  H5Handle access(H5Pcreate(H5P_DATASET_ACCESS), H5Pclose);
  // Writers of many series append whole chunks: a cache for each would only hold memory.
  if (streamed) H5Pset_chunk_cache(access.get(), 1, 0, 1.0);
  H5Handle set(H5Dcreate2(handle.get(), field.path.c_str(), disk, space, H5P_DEFAULT, properties,
                          access.get()),
               H5Dclose);
  if (!set.valid()) Fail(field.path);
  PutText(set.get(), "units", field.units);
  PutText(set.get(), "description", field.description);
  if (!field.scales.empty()) {
    // Of text, letters are the last dimension, and labelled by AttachScales.
    const int letters = H5Tget_class(disk) == H5T_STRING ? 1 : 0;
    const H5Handle extent(H5Dget_space(set.get()), H5Sclose);
    const int dims = H5Sget_simple_extent_ndims(extent.get()) - letters;
    if (dims != static_cast<int>(field.scales.size())) {
      throw std::logic_error("H5Writer: not one scale for each dimension of " + field.path);
    }
    labelled.push_back({field.path, field.scales});
  }
  return set;
}

H5Series H5Writer::Impl::Grow(const H5Field& field, hid_t disk,
                              const std::vector<std::size_t>& row_dims, std::size_t chunk_rows,
                              int deflate, std::size_t chunk_columns) {
  std::vector<hsize_t> size = {0}, limit = {H5S_UNLIMITED}, chunk = {chunk_rows};
  for (std::size_t d : row_dims) {
    size.push_back(d);
    limit.push_back(d);
    const bool cut = chunk.size() == 1 && chunk_columns > 0;
    chunk.push_back(cut ? std::min(d, chunk_columns) : d);
  }
  H5Handle space(H5Screate_simple(static_cast<int>(size.size()), size.data(), limit.data()),
                 H5Sclose);
  H5Handle properties(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  H5Pset_chunk(properties.get(), static_cast<int>(chunk.size()), chunk.data());
  // A writer that was stopped may leave room for rows that never came: they read as no number.
  if (H5Tequal(disk, H5T_IEEE_F64LE) > 0) {
    constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
    H5Pset_fill_value(properties.get(), H5T_NATIVE_DOUBLE, &kNone);
  }
  if (deflate > 0) {
    H5Pset_shuffle(properties.get());
    H5Pset_deflate(properties.get(), static_cast<unsigned>(deflate));
  }
  H5Pset_fletcher32(properties.get());
  series.push_back(Create(field, disk, space.get(), properties.get()));
  H5Series out;
  out.dataset_ = series.back().get();
  out.path_ = field.path;
  out.row_ = row_dims;
  if (deflate > 0 && chunk_columns == 0 && !streamed) out.packed_rows_ = chunk_rows;
  return out;
}

void H5Writer::Impl::WriteAll(const H5Field& field, hid_t disk, hid_t memory, const void* values,
                              std::size_t count, std::vector<std::size_t> dims) {
  if (dims.empty()) dims = {count};
  const std::vector<hsize_t> size = ToHsize(dims);
  H5Handle space(H5Screate_simple(static_cast<int>(size.size()), size.data(), nullptr), H5Sclose);
  H5Handle properties(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  if (count > 0) {
    // Only chunks carry checksums.
    const std::vector<hsize_t> chunk = ChunkOf(size, H5Tget_size(disk));
    H5Pset_chunk(properties.get(), static_cast<int>(chunk.size()), chunk.data());
    H5Pset_fletcher32(properties.get());
  }
  H5Handle set = Create(field, disk, space.get(), properties.get());
  if (count > 0 && H5Dwrite(set.get(), memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, values) < 0) {
    Fail(field.path);
  }
  if (!set.Close()) Fail(field.path);
}

}  // namespace unfurl::data
