// Packed datasets, unpacked without HDF5, against what HDF5 itself was given to pack and unpacks.
#include "data/h5_packed.h"

#include <gtest/gtest.h>

#include <numeric>

#include "base/random.h"
#include "data/h5.h"
#include "tests/own_folder.h"

namespace unfurl::data::h5_packed_test {
namespace {

struct Shape {
  std::vector<hsize_t> extent, chunk;
  std::vector<H5Z_filter_t> filters;
};

const std::vector<H5Z_filter_t> kOurs = {H5Z_FILTER_SHUFFLE, H5Z_FILTER_DEFLATE,
                                         H5Z_FILTER_FLETCHER32};

class H5Packs : public ::testing::Test {
 protected:
  template <typename T>
  std::vector<T> Written(hid_t type, const Shape& shape) {
    Close();
    std::size_t count = 1;
    for (const hsize_t n : shape.extent) count *= n;
    std::vector<T> values(count);
    Rng rng(7);
    for (T& v : values) v = static_cast<T>(900.0 + 40.0 * rng.Normal());
    const int rank = static_cast<int>(shape.extent.size());
    const H5Handle file(H5Fcreate(path_.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT),
                        H5Fclose);
    const H5Handle made(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
    H5Pset_chunk(made.get(), rank, shape.chunk.data());
    for (const H5Z_filter_t filter : shape.filters) {
      if (filter == H5Z_FILTER_SHUFFLE) H5Pset_shuffle(made.get());
      if (filter == H5Z_FILTER_DEFLATE) H5Pset_deflate(made.get(), 4);
      if (filter == H5Z_FILTER_FLETCHER32) H5Pset_fletcher32(made.get());
    }
    const std::vector<hsize_t> most(shape.extent.size(), H5S_UNLIMITED);
    const H5Handle space(H5Screate_simple(rank, shape.extent.data(), most.data()), H5Sclose);
    const H5Handle set(
        H5Dcreate2(file.get(), "lines", type, space.get(), H5P_DEFAULT, made.get(), H5P_DEFAULT),
        H5Dclose);
    H5Dwrite(set.get(), type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data());
    return values;
  }

  void Close() {
    packed_.reset();
    file_.Close();
  }

  void Open(hid_t type) {
    Close();
    file_ = H5Handle(H5Fopen(path_.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
    packed_ = std::make_unique<H5Packed>(
        H5Handle(H5Dopen2(file_.get(), "lines", H5P_DEFAULT), H5Dclose), type);
  }

  template <typename T>
  void Expect(hid_t type, const Shape& shape) {
    const std::vector<T> values = Written<T>(type, shape);
    Open(type);
    const std::size_t rows = shape.extent[0], wide = values.size() / rows;
    Rng rng(3);
    for (int k = 0; k < 60; ++k) {
      const auto first = static_cast<std::size_t>(rng.Uniform(0.0, static_cast<double>(rows)));
      const auto most = static_cast<double>(k % 3 == 0 ? 2 : rows - first + 1);
      const std::size_t count =
          std::min(rows - first, static_cast<std::size_t>(rng.Uniform(1.0, most)));
      std::vector<T> out(count * wide, T{});
      ASSERT_TRUE(packed_->Read(first, count, out.data()));
      const auto from = values.begin() + static_cast<std::ptrdiff_t>(first * wide);
      ASSERT_TRUE(std::equal(out.begin(), out.end(), from)) << first << " " << count;
    }
  }

  OwnFolder folder_;
  std::string path_ = folder_.File("packed.h5");
  H5Handle file_;
  std::unique_ptr<H5Packed> packed_;
};

class H5PacksOf : public H5Packs, public ::testing::WithParamInterface<Shape> {};

TEST_P(H5PacksOf, AnyRowsAreThoseThatWerePacked) {
  Expect<std::uint16_t>(H5T_NATIVE_UINT16, GetParam());
  Expect<std::int32_t>(H5T_NATIVE_INT32, GetParam());
  Expect<double>(H5T_NATIVE_DOUBLE, GetParam());
}

INSTANTIATE_TEST_SUITE_P(
    Shapes, H5PacksOf,
    ::testing::Values(Shape{{100, 4, 300}, {16, 4, 300}, kOurs},  // as ours
                      Shape{{103, 4, 300}, {16, 4, 300}, kOurs},  // the last chunk is not full
                      Shape{{50, 3, 257}, {7, 2, 100}, kOurs},    // split in every dimension
                      Shape{{50, 257}, {64, 1000}, {H5Z_FILTER_DEFLATE}},  // larger than the whole
                      Shape{{200}, {33}, {H5Z_FILTER_FLETCHER32}},
                      Shape{{90, 11}, {1, 11}, {H5Z_FILTER_DEFLATE, H5Z_FILTER_SHUFFLE}},
                      Shape{{90, 11}, {8, 5}, {H5Z_FILTER_FLETCHER32, H5Z_FILTER_DEFLATE}}),
    [](const auto& shape) { return "N" + std::to_string(shape.index); });

// HDF5 refuses a chunk whose checksum is another: ours agrees with its, on sizes of any kind.
TEST_F(H5Packs, FletchersChecksumIsHDF5s) {
  for (const hsize_t size : {1, 2, 3, 719, 720, 721, 9001, 70000}) {
    const Shape shape{{size}, {size}, {H5Z_FILTER_FLETCHER32}};
    for (const std::uint8_t all : {0, 255}) {
      std::vector<std::uint8_t> values = Written<std::uint8_t>(H5T_NATIVE_UINT8, shape), out(size);
      if (all > 0) {
        Close();
        std::fill(values.begin(), values.end(), all);
        const H5Handle file(H5Fopen(path_.c_str(), H5F_ACC_RDWR, H5P_DEFAULT), H5Fclose);
        const H5Handle set(H5Dopen2(file.get(), "lines", H5P_DEFAULT), H5Dclose);
        H5Dwrite(set.get(), H5T_NATIVE_UINT8, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data());
      }
      Open(H5T_NATIVE_UINT8);
      ASSERT_TRUE(packed_->Read(0, size, out.data())) << size;
      EXPECT_EQ(out, values) << size;
    }
  }
}

TEST_F(H5Packs, WhatIsDamagedOrStoredInAnotherWayIsLeftToHDF5) {
  const Shape shape{{64, 50}, {16, 50}, kOurs};
  std::vector<std::uint16_t> out(64 * 50);
  Written<std::uint16_t>(H5T_NATIVE_UINT16, shape);
  Open(H5T_NATIVE_DOUBLE);  // another type in memory
  EXPECT_FALSE(packed_->Read(0, 64, out.data()));
  Open(H5T_NATIVE_UINT16);
  ASSERT_TRUE(packed_->Read(0, 64, out.data()));
  haddr_t at = 0;
  hsize_t size = 0;
  std::uint32_t mask = 0;
  const std::vector<hsize_t> third = {32, 0};
  {
    const H5Handle set(H5Dopen2(file_.get(), "lines", H5P_DEFAULT), H5Dclose);
    ASSERT_GE(H5Dget_chunk_info_by_coord(set.get(), third.data(), &mask, &at, &size), 0);
  }
  Close();
  std::string bytes = folder_.Get("packed.h5");
  bytes[at + size / 2] = static_cast<char>(bytes[at + size / 2] ^ 4);
  folder_.Put("packed.h5", bytes);
  Open(H5T_NATIVE_UINT16);
  EXPECT_TRUE(packed_->Read(0, 32, out.data()));
  EXPECT_FALSE(packed_->Read(40, 2, out.data()));
  EXPECT_FALSE(packed_->Read(0, 64, out.data()));
  EXPECT_TRUE(packed_->Read(48, 16, out.data()));
}

// Appended in pieces of any size, some of whole chunks, as HDF5 itself reads it again.
TEST_F(H5Packs, WhatIsPackedHereHDF5Unpacks) {
  const std::vector<std::size_t> row = {3, 50};
  Rng rng(5);
  std::vector<std::uint16_t> all;
  std::vector<double> numbers;
  {
    H5Writer writer(path_, "unfurl/sample", 1, {.program = "unfurl test", .command = "test"});
    H5Series lines = writer.Series({"/lines", "count", "lines"}, H5Type::kUint16, row, 16, 1);
    H5Series plain = writer.Series({"/plain", "m", "numbers"}, H5Type::kDouble, {2}, 8, 6);
    for (const std::size_t rows : {16, 5, 3, 40, 1, 15, 32, 7, 64, 9, 200}) {
      std::vector<std::uint16_t> some(rows * 150);
      for (std::uint16_t& v : some) v = static_cast<std::uint16_t>(900.0 + 40.0 * rng.Normal());
      lines.Append(some);
      all.insert(all.end(), some.begin(), some.end());
      std::vector<double> more(rows * 2);
      for (double& v : more) v = rng.Normal();
      plain.Append(more);
      numbers.insert(numbers.end(), more.begin(), more.end());
    }
    writer.Commit();
  }
  const H5Handle file(H5Fopen(path_.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
  const H5Handle lines(H5Dopen2(file.get(), "lines", H5P_DEFAULT), H5Dclose);
  const H5Handle plain(H5Dopen2(file.get(), "plain", H5P_DEFAULT), H5Dclose);
  std::vector<std::uint16_t> read(all.size());
  std::vector<double> numbers_read(numbers.size());
  ASSERT_GE(H5Dread(lines.get(), H5T_NATIVE_UINT16, H5S_ALL, H5S_ALL, H5P_DEFAULT, read.data()), 0);
  ASSERT_GE(
      H5Dread(plain.get(), H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, numbers_read.data()),
      0);
  EXPECT_EQ(read, all);
  EXPECT_EQ(numbers_read, numbers);
}

}  // namespace
}  // namespace unfurl::data::h5_packed_test
