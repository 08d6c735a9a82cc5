#include <stdexcept>

#include "data/h5_packed.h"
#include "data/h5_writer_impl.h"

namespace unfurl::data {

namespace {

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

}  // namespace

H5Series H5Writer::Series(const H5Field& field, H5Type type,
                          const std::vector<std::size_t>& row_dims, std::size_t chunk_rows,
                          int deflate, std::size_t chunk_columns) {
  H5Series series =
      impl_->Grow(field, DiskType(type), row_dims, chunk_rows, deflate, chunk_columns);
  series.writer_ = this;
  series.type_ = type;
  return series;
}

H5Series H5Writer::TextSeries(const H5Field& field, std::size_t width, std::size_t chunk_rows) {
  const H5Handle type = H5Text(1);
  H5Series series = impl_->Grow(field, type.get(), {width}, chunk_rows, 0, 0);
  Attribute(field.path, kTextEncoding, std::string("utf-8"));
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
  std::vector<hsize_t> total = {rows_ + added};
  total.insert(total.end(), row_.begin(), row_.end());
  if (H5Dset_extent(dataset_, total.data()) < 0) writer_->impl_->Fail(path_);
  std::ptrdiff_t packed = 0;
  if (packed_rows_ > 0 && rows_ % packed_rows_ == 0 && added >= packed_rows_) {
    packed = H5Packer(dataset_, memory_type).Write(rows_, added, values);
  }
  if (packed < 0) writer_->impl_->Fail(path_);
  const auto whole = static_cast<std::size_t>(packed);
  if (whole < added) WriteRows(values, rows_, whole, added, memory_type);
  rows_ += added;
}

// Rows [from, to) of `values`, as rows `first` + from and on.
void H5Series::WriteRows(const void* values, std::size_t first, std::size_t from, std::size_t to,
                         std::int64_t memory_type) {
  std::vector<hsize_t> all = {to}, extent = {to - from}, start = {from}, there = {first + from};
  for (const std::size_t d : row_) {
    all.push_back(d);
    extent.push_back(d);
    start.push_back(0);
    there.push_back(0);
  }
  const H5Handle space(H5Dget_space(dataset_), H5Sclose);
  H5Sselect_hyperslab(space.get(), H5S_SELECT_SET, there.data(), nullptr, extent.data(), nullptr);
  const H5Handle memory(H5Screate_simple(static_cast<int>(all.size()), all.data(), nullptr),
                        H5Sclose);
  H5Sselect_hyperslab(memory.get(), H5S_SELECT_SET, start.data(), nullptr, extent.data(), nullptr);
  if (H5Dwrite(dataset_, memory_type, memory.get(), space.get(), H5P_DEFAULT, values) < 0) {
    writer_->impl_->Fail(path_);
  }
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

}  // namespace unfurl::data
