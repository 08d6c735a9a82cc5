#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <numeric>
#include <set>

#include "base/error.h"
#include "data/atomic_file.h"
#include "data/h5.h"
#include "data/h5_handle.h"
#include "data/h5_scales.h"

namespace unfurl::data {

namespace {

// Of letters, so that netCDF4 makes words of them.
constexpr char kEncoding[] = "_Encoding";

hid_t DiskType(H5Type type) {
  switch (type) {
    case H5Type::kDouble:
      return H5T_IEEE_F64LE;
    case H5Type::kFloat:
      return H5T_IEEE_F32LE;
    case H5Type::kInt32:
      return H5T_STD_I32LE;
    case H5Type::kUint16:
      return H5T_STD_U16LE;
    case H5Type::kUint8:
      return H5T_STD_U8LE;
  }
  return -1;
}

hid_t MemoryType(H5Type type) {
  switch (type) {
    case H5Type::kDouble:
      return H5T_NATIVE_DOUBLE;
    case H5Type::kFloat:
      return H5T_NATIVE_FLOAT;
    case H5Type::kInt32:
      return H5T_NATIVE_INT32;
    case H5Type::kUint16:
      return H5T_NATIVE_UINT16;
    case H5Type::kUint8:
      return H5T_NATIVE_UINT8;
  }
  return -1;
}

// Names of files may be no UTF-8.
std::string Dump(const nlohmann::ordered_json& json) {
  return json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

// The last net under cli/verb_files.h: a result never takes the place of what it was made from.
void RefuseInput(const Provenance& provenance, const std::string& path) {
  for (const InputFile& input : provenance.inputs) {
    std::error_code failed;
    if (!std::filesystem::equivalent(input.path, path, failed)) continue;
    throw Error("is an input of this result, and would be replaced by it", path,
                "name another output");
  }
}

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

  Impl(const std::string& p, bool stream)
      : path(p),
        file(p, stream ? AtomicFile::Temporary::kPartial : AtomicFile::Temporary::kHidden),
        streamed(stream) {}

  [[noreturn]] void Fail(const std::string& object) {
    int number = 0;
    const std::string message = H5LastMessage(&number);
    if (number != 0) ThrowWriteError(path, number);
    throw Error(fmt::format("cannot write {}: {}", object, message), path,
                "check the disk and try again", ErrorKind::kMachine);
  }

  void MakeGroups(const std::string& object) {
    std::string group;
    std::size_t slash = 0;
    while ((slash = object.find('/', slash + 1)) != std::string::npos)
      MakeGroup(object.substr(0, slash));
  }

  void MakeGroup(const std::string& group) {
    if (group.empty() || group == "/" || H5Lexists(handle.get(), group.c_str(), H5P_DEFAULT) > 0)
      return;
    H5Handle properties(H5Pcreate(H5P_GROUP_CREATE), H5Pclose);
    H5Pset_link_creation_order(properties.get(), H5P_CRT_ORDER_TRACKED | H5P_CRT_ORDER_INDEXED);
    H5Pset_obj_track_times(properties.get(), 0);
    H5Handle made(
        H5Gcreate2(handle.get(), group.c_str(), H5P_DEFAULT, properties.get(), H5P_DEFAULT),
        H5Gclose);
    if (!made.valid()) Fail(group);
  }

  H5Handle Open(const std::string& object) {
    if (object != "/" && H5Lexists(handle.get(), object.c_str(), H5P_DEFAULT) <= 0) {
      MakeGroups(object);
      MakeGroup(object);
    }
    return H5Handle(H5Oopen(handle.get(), object.c_str(), H5P_DEFAULT), H5Oclose);
  }

  void PutAttribute(hid_t object, const std::string& name, hid_t disk, hid_t memory,
                    const void* value) {
    H5Handle space(H5Screate(H5S_SCALAR), H5Sclose);
    if (H5Aexists(object, name.c_str()) > 0) H5Adelete(object, name.c_str());
    H5Handle attribute(
        H5Acreate2(object, name.c_str(), disk, space.get(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
    if (!attribute.valid() || H5Awrite(attribute.get(), memory, value) < 0) Fail(name);
  }

  void PutText(hid_t object, const std::string& name, const std::string& value) {
    const H5Handle type = H5Text(value.size());
    const std::string padded = value.empty() ? std::string(1, '\0') : value;
    PutAttribute(object, name, type.get(), type.get(), padded.data());
  }

  H5Handle Create(const H5Field& field, hid_t disk, hid_t space, hid_t properties) {
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

  H5Series Grow(const H5Field& field, hid_t disk, const std::vector<std::size_t>& row_dims,
                std::size_t chunk_rows, int deflate) {
    std::vector<hsize_t> size = {0}, limit = {H5S_UNLIMITED}, chunk = {chunk_rows};
    for (std::size_t d : row_dims) {
      size.push_back(d);
      limit.push_back(d);
      chunk.push_back(d);
    }
    H5Handle space(H5Screate_simple(static_cast<int>(size.size()), size.data(), limit.data()),
                   H5Sclose);
    H5Handle properties(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
    H5Pset_chunk(properties.get(), static_cast<int>(chunk.size()), chunk.data());
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
    return out;
  }

  void WriteAll(const H5Field& field, hid_t disk, hid_t memory, const void* values,
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
};

H5Writer::H5Writer(const std::string& path, const std::string& schema, int schema_version,
                   const Provenance& provenance, Mode mode)
    : impl_(
          (RefuseInput(provenance, path), std::make_unique<Impl>(path, mode == Mode::kStreamed))) {
  H5Quiet();
  H5Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  // The layout of 1.10: streaming needs it, and its indexes of chunks carry checksums.
  H5Pset_libver_bounds(access.get(), H5F_LIBVER_V110, H5F_LIBVER_V110);
  H5Pset_fclose_degree(access.get(), H5F_CLOSE_STRONG);
  H5Handle creation(H5Pcreate(H5P_FILE_CREATE), H5Pclose);
  H5Pset_link_creation_order(creation.get(), H5P_CRT_ORDER_TRACKED | H5P_CRT_ORDER_INDEXED);
  H5Pset_obj_track_times(creation.get(), 0);
  impl_->handle = H5Handle(
      H5Fcreate(impl_->file.temporary().c_str(), H5F_ACC_TRUNC, creation.get(), access.get()),
      H5Fclose);
  if (!impl_->handle.valid()) impl_->Fail("the file");
  Attribute("/", "schema", schema);
  Attribute("/", "schema_version", static_cast<std::int64_t>(schema_version));
  Attribute("/", "program", provenance.program);
  Attribute("/", "command", provenance.command);
  nlohmann::ordered_json inputs = nlohmann::ordered_json::array();
  for (const InputFile& input : provenance.inputs) {
    inputs.push_back({{"path", input.path}, {"sha256", input.sha256}});
  }
  Attribute("/", "inputs", Dump(inputs));
  Attribute("/", "options", Dump(provenance.options));
  if (provenance.seed) Attribute("/", "seed", std::to_string(*provenance.seed));
}

H5Writer::~H5Writer() = default;

void H5Writer::Write(const H5Field& field, std::span<const double> values,
                     std::vector<std::size_t> dims) {
  impl_->WriteAll(field, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, values.data(), values.size(),
                  std::move(dims));
}

void H5Writer::Write(const H5Field& field, std::span<const std::int32_t> values,
                     std::vector<std::size_t> dims) {
  impl_->WriteAll(field, H5T_STD_I32LE, H5T_NATIVE_INT32, values.data(), values.size(),
                  std::move(dims));
}

void H5Writer::Write(const H5Field& field, std::span<const std::uint16_t> values,
                     std::vector<std::size_t> dims) {
  impl_->WriteAll(field, H5T_STD_U16LE, H5T_NATIVE_UINT16, values.data(), values.size(),
                  std::move(dims));
}

void H5Writer::Write(const H5Field& field, const Eigen::MatrixXd& matrix) {
  const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> rows = matrix;
  Write(field, std::span<const double>(rows.data(), static_cast<std::size_t>(rows.size())),
        {static_cast<std::size_t>(rows.rows()), static_cast<std::size_t>(rows.cols())});
}

void H5Writer::Write(const H5Field& field, const std::vector<std::string>& values) {
  std::size_t width = 1;
  for (const std::string& value : values) width = std::max(width, value.size() + 1);
  std::string packed(width * std::max<std::size_t>(1, values.size()), '\0');
  for (std::size_t i = 0; i < values.size(); ++i) values[i].copy(packed.data() + i * width, width);
  const H5Handle type = H5Text(1);
  impl_->WriteAll(field, type.get(), type.get(), packed.data(), values.size() * width,
                  {values.size(), width});
  Attribute(field.path, kEncoding, std::string("utf-8"));
  impl_->texts[field.path] = width;
}

H5Series H5Writer::Series(const H5Field& field, H5Type type, std::vector<std::size_t> row_dims,
                          std::size_t chunk_rows, int deflate) {
  H5Series series = impl_->Grow(field, DiskType(type), row_dims, chunk_rows, deflate);
  series.writer_ = this;
  series.type_ = type;
  return series;
}

H5Series H5Writer::TextSeries(const H5Field& field, std::size_t width, std::size_t chunk_rows) {
  const H5Handle type = H5Text(1);
  H5Series series = impl_->Grow(field, type.get(), {width}, chunk_rows, 0);
  Attribute(field.path, kEncoding, std::string("utf-8"));
  impl_->texts[field.path] = width;
  series.writer_ = this;
  series.width_ = width;
  return series;
}

void H5Series::AppendRaw(const void* values, std::size_t count, H5Type type) {
  if (type != type_ || width_ > 0) {
    throw std::logic_error("H5Series: appended another type to " + path_);
  }
  AppendRows(values, count, MemoryType(type));
}

void H5Series::Append(const std::vector<std::string>& values) {
  if (width_ == 0) throw std::logic_error("H5Series: appended text to numbers " + path_);
  std::string packed(width_ * values.size(), '\0');
  for (std::size_t i = 0; i < values.size(); ++i) {
    values[i].copy(packed.data() + i * width_, width_);
  }
  const H5Handle type = H5Text(1);
  AppendRows(packed.data(), packed.size(), type.get());
}

void H5Series::AppendRows(const void* values, std::size_t count, std::int64_t memory_type) {
  std::size_t row_size = 1;
  for (std::size_t d : row_) row_size *= d;
  if (count == 0) return;
  if (count % row_size != 0) throw std::logic_error("H5Series: half a row appended to " + path_);
  const std::size_t added = count / row_size;
  std::vector<hsize_t> total = {rows_ + added}, start = {rows_}, extent = {added};
  for (std::size_t d : row_) {
    total.push_back(d);
    start.push_back(0);
    extent.push_back(d);
  }
  if (H5Dset_extent(dataset_, total.data()) < 0) writer_->impl_->Fail(path_);
  H5Handle space(H5Dget_space(dataset_), H5Sclose);
  H5Sselect_hyperslab(space.get(), H5S_SELECT_SET, start.data(), nullptr, extent.data(), nullptr);
  H5Handle memory(H5Screate_simple(static_cast<int>(extent.size()), extent.data(), nullptr),
                  H5Sclose);
  if (H5Dwrite(dataset_, memory_type, memory.get(), space.get(), H5P_DEFAULT, values) < 0) {
    writer_->impl_->Fail(path_);
  }
  rows_ += added;
}

void H5Series::Append(std::span<const double> v) { AppendRaw(v.data(), v.size(), H5Type::kDouble); }
void H5Series::Append(std::span<const float> v) { AppendRaw(v.data(), v.size(), H5Type::kFloat); }
void H5Series::Append(std::span<const std::int32_t> v) {
  AppendRaw(v.data(), v.size(), H5Type::kInt32);
}
void H5Series::Append(std::span<const std::uint16_t> v) {
  AppendRaw(v.data(), v.size(), H5Type::kUint16);
}
void H5Series::Append(std::span<const std::uint8_t> v) {
  AppendRaw(v.data(), v.size(), H5Type::kUint8);
}

void H5Writer::Attribute(const std::string& object, const std::string& name,
                         const std::string& value) {
  impl_->PutText(impl_->Open(object).get(), name, value);
}

void H5Writer::Attribute(const std::string& object, const std::string& name, double value) {
  impl_->PutAttribute(impl_->Open(object).get(), name, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, &value);
}

void H5Writer::Attribute(const std::string& object, const std::string& name, std::int64_t value) {
  impl_->PutAttribute(impl_->Open(object).get(), name, H5T_STD_I64LE, H5T_NATIVE_INT64, &value);
}

void H5Writer::BareScale(const std::string& path, std::size_t size) {
  std::vector<std::int32_t> places(size);
  std::iota(places.begin(), places.end(), 0);
  Write({path, "1", "places"}, std::span<const std::int32_t>(places));
  impl_->bare.insert(path);
}

// Names the letters of every text: all dimensions have scales, or none.
void H5Writer::LabelLetters() {
  for (const auto& [path, width] : impl_->texts) {
    const std::string letters = fmt::format("/letters_{}", width);
    if (!impl_->bare.contains(letters)) BareScale(letters, width);
    impl_->letters_of[path] = letters;
  }
  for (H5Labelled& dataset : impl_->labelled) {
    if (impl_->texts.contains(dataset.path))
      dataset.scales.push_back(impl_->letters_of[dataset.path]);
  }
  impl_->texts.clear();
}

void H5Writer::AttachScales() {
  LabelLetters();
  if (!H5AttachScales(impl_->handle.get(), impl_->labelled, impl_->letters_of, impl_->bare))
    impl_->Fail("the scales");
  impl_->labelled.clear();
  impl_->letters_of.clear();
}

void H5Writer::StartStreaming() {
  if (!impl_->streamed) throw std::logic_error("H5Writer: made to be written whole");
  AttachScales();
  if (H5Fstart_swmr_write(impl_->handle.get()) < 0) impl_->Fail("the file");
}

void H5Writer::Overwrite(const std::string& dataset, std::span<const double> values) {
  const H5Handle set(H5Dopen2(impl_->handle.get(), dataset.c_str(), H5P_DEFAULT), H5Dclose);
  if (!set.valid() ||
      H5Dwrite(set.get(), H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()) < 0) {
    impl_->Fail(dataset);
  }
}

void H5Writer::OverwriteText(const std::string& dataset, const std::string& value) {
  const H5Handle set(H5Dopen2(impl_->handle.get(), dataset.c_str(), H5P_DEFAULT), H5Dclose);
  if (!set.valid()) impl_->Fail(dataset);
  const H5Handle type(H5Dget_type(set.get()), H5Tclose);
  const H5Handle space(H5Dget_space(set.get()), H5Sclose);
  std::string padded = value;
  padded.resize(static_cast<std::size_t>(H5Sget_simple_extent_npoints(space.get())), '\0');
  if (H5Dwrite(set.get(), type.get(), H5S_ALL, H5S_ALL, H5P_DEFAULT, padded.data()) < 0) {
    impl_->Fail(dataset);
  }
}

void H5Writer::Flush() {
  if (H5Fflush(impl_->handle.get(), H5F_SCOPE_GLOBAL) < 0) impl_->Fail("the file");
}

void H5Writer::CloseAll() {
  AttachScales();
  for (H5Handle& set : impl_->series) {
    if (!set.Close()) impl_->Fail("a dataset");
  }
  Flush();
  if (!impl_->handle.Close()) impl_->Fail("the file");
}

void H5Writer::Commit() {
  CloseAll();
  impl_->file.Commit();
}

void H5Writer::Keep() {
  impl_->file.Keep();  // first: what is on disk by now stays even where closing fails
  CloseAll();
}

void H5Writer::Abandon() {
  impl_->file.Keep();
  // Closing would write again what the disk has refused, and leave metadata that points past the
  // end of the file. As the last Flush left it, it can be read: so it is left open until the
  // program ends.
  static auto* left_open = new std::vector<H5Handle>;
  for (H5Handle& set : impl_->series) left_open->push_back(std::move(set));
  left_open->push_back(std::move(impl_->handle));
  impl_->series.clear();
}

void WriteAxisNames(H5Writer& file) {
  file.Write({kAxisNames, "1", "of a point"}, std::vector<std::string>{"x", "y", "z"});
}

void WriteComponentNames(H5Writer& file) {
  file.Write({kComponentNames, "1", "of a covariance"},
             std::vector<std::string>{"xx", "xy", "xz", "yy", "yz", "zz"});
}

const std::string& H5Writer::temporary() const { return impl_->file.temporary(); }

}  // namespace unfurl::data
