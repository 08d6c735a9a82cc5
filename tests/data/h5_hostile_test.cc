// HDF5 files that nobody should believe: made with the library itself, as a stranger would.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <functional>
#include <sstream>

#include "base/error.h"
#include "data/h5.h"
#include "data/h5_walk.h"
#include "tests/own_folder.h"
#include "errors.h"

namespace unfurl::data::h5_hostile_test {
namespace {

using ::testing::HasSubstr;

constexpr char kSchema[] = "unfurl/sample";

class H5Hostile : public ::testing::Test {
 protected:

  // A whole file of ours.
  void WriteGood() const {
    H5Writer writer(path_, kSchema, 1, {.program = "unfurl test", .command = "unfurl test "});
    std::vector<double> numbers(300);
    for (std::size_t i = 0; i < numbers.size(); ++i)
      numbers[i] = 1.0 + 0.01 * static_cast<double>(i);
    writer.Write({"/numbers", "m", "some"}, numbers, {100, 3});
    writer.Write({"/names", "1", "words"}, std::vector<std::string>{"one", "two"});
    H5Series series = writer.Series({"/deep/series", "px", "grown"}, H5Type::kUint16, {4}, 8, 1);
    const std::vector<std::uint16_t> rows(64, 513);
    series.Append(rows);
    writer.Attribute("/deep", "pitch", 14e-6);
    // More links and attributes than a header holds: these lie in heaps and trees of their own.
    for (int k = 0; k < 12; ++k) {
      writer.Write({"/many/" + std::to_string(k), "1", "one of many"},
                   std::vector<double>{1.0 * k});
      writer.Attribute("/many", "attribute" + std::to_string(k), 1.0 * k);
    }
    writer.Commit();
  }

  // All that a reader can get out of it, as text.
  std::string ReadAll() const {
    std::ostringstream text;
    text.precision(17);
    const H5Reader reader(path_, kSchema, 1);
    for (const std::string& set : H5ListDatasets(path_)) {
      text << set << reader.Units(set) << reader.Description(set);
      for (const std::size_t d : reader.Dims(set)) text << ' ' << d;
    }
    for (const double v : reader.ReadDoubles("/numbers", "m")) text << ' ' << v;
    for (const std::string& v : reader.ReadStrings("/names")) text << ' ' << v;
    for (const std::int32_t v : reader.ReadInts("/deep/series")) text << ' ' << v;
    text << reader.DoubleAttribute("/deep", "pitch");
    for (const char* object : {"/", "/many"}) {
      for (const auto& [name, value] : reader.Attributes(object)) text << name << value;
    }
    for (const std::string& name : reader.Children("/many")) {
      text << name << reader.ReadDoubles("/many/" + name).at(0);
    }
    return text.str();
  }

  // The good file, changed through the library.
  void Change(const std::function<void(hid_t)>& change) const {
    WriteGood();
    const hid_t access = H5Pcreate(H5P_FILE_ACCESS);
    H5Pset_libver_bounds(access, H5F_LIBVER_V110, H5F_LIBVER_V110);
    const hid_t file = H5Fopen(path_.c_str(), H5F_ACC_RDWR, access);
    ASSERT_GE(file, 0);
    change(file);
    H5Fclose(file);
    H5Pclose(access);
  }

  void Remake(
      hid_t file, const char* name, hid_t type, std::vector<hsize_t> dims,
      const std::function<void(hid_t)>& set = [](hid_t) {}) const {
    H5Ldelete(file, name, H5P_DEFAULT);
    const hid_t space = H5Screate_simple(static_cast<int>(dims.size()), dims.data(), nullptr);
    const hid_t properties = H5Pcreate(H5P_DATASET_CREATE);
    set(properties);
    const hid_t made = H5Dcreate2(file, name, type, space, H5P_DEFAULT, properties, H5P_DEFAULT);
    EXPECT_GE(made, 0);
    H5Dclose(made);
    H5Pclose(properties);
    H5Sclose(space);
  }

  std::string Refusal() const {
    return ErrorOf([&] { ReadAll(); });
  }

  OwnFolder folder_;
  std::string path_ = folder_.File("a.h5");
};

TEST_F(H5Hostile, WhatIsGoodIsRead) {
  WriteGood();
  EXPECT_THAT(ReadAll(), HasSubstr("two"));
  EXPECT_EQ(H5ListDatasets(path_).size(), 16u);
}

TEST_F(H5Hostile, AnArrayWhereOneNumberBelongs) {
  for (const auto& [object, name] :
       {std::pair{"/", "schema_version"}, std::pair{"/deep", "pitch"}}) {
    Change([&, object = object, name = name](hid_t file) {
      H5Adelete_by_name(file, object, name, H5P_DEFAULT);
      const hsize_t many = 4000;
      const hid_t space = H5Screate_simple(1, &many, nullptr);
      const hid_t attribute = H5Acreate_by_name(file, object, name, H5T_NATIVE_DOUBLE, space,
                                                H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
      const std::vector<double> values(many, 1.0);
      H5Awrite(attribute, H5T_NATIVE_DOUBLE, values.data());
      H5Aclose(attribute);
      H5Sclose(space);
    });
    EXPECT_THAT(Refusal(), HasSubstr("is not one number"));
  }
}

TEST_F(H5Hostile, AnArrayWhereOneTextBelongs) {
  for (const bool variable : {false, true}) {
    Change([&](hid_t file) {
      H5Adelete_by_name(file, "/numbers", "units", H5P_DEFAULT);
      const hsize_t many = 4000;
      const hid_t space = H5Screate_simple(1, &many, nullptr);
      const hid_t type = H5Tcopy(H5T_C_S1);
      H5Tset_size(type, variable ? H5T_VARIABLE : 1);
      const hid_t attribute = H5Acreate_by_name(file, "/numbers", "units", type, space, H5P_DEFAULT,
                                                H5P_DEFAULT, H5P_DEFAULT);
      const std::vector<const char*> words(many, "m");
      const std::string letters(many, 'm');
      if (variable) {
        H5Awrite(attribute, type, words.data());
      } else {
        H5Awrite(attribute, type, letters.data());
      }
      H5Aclose(attribute);
      H5Tclose(type);
      H5Sclose(space);
    });
    EXPECT_THAT(
        Refusal(),
        HasSubstr(variable ? "a.h5:/numbers@units: is text of variable length, which is not read"
                           : "is in [], not [m]"));
  }
}

// As h5py and others write text unless they are asked not to.
TEST_F(H5Hostile, TextOfVariableLength) {
  const hid_t variable = H5Tcopy(H5T_C_S1);
  H5Tset_size(variable, H5T_VARIABLE);
  const auto attribute = [&](hid_t file, const char* object, const char* name) {
    if (H5Aexists_by_name(file, object, name, H5P_DEFAULT) > 0) {
      H5Adelete_by_name(file, object, name, H5P_DEFAULT);
    }
    const hid_t space = H5Screate(H5S_SCALAR);
    const hid_t made = H5Acreate_by_name(file, object, name, variable, space, H5P_DEFAULT,
                                         H5P_DEFAULT, H5P_DEFAULT);
    const char* text = kSchema;
    H5Awrite(made, variable, &text);
    H5Aclose(made);
    H5Sclose(space);
  };
  Change([&](hid_t file) { attribute(file, "/", "schema"); });
  EXPECT_THAT(Refusal(), HasSubstr("a.h5:/@schema: is text of variable length, which is not read"));
  EXPECT_THAT(ErrorOf([&] { H5Reader::SchemaOf(path_); }), HasSubstr("fixed length"));
  Change([&](hid_t file) { Remake(file, "/names", variable, {2}); });
  EXPECT_THAT(Refusal(), HasSubstr("a.h5:/names: is text of variable length, which is not read"));
  // One that no reader wants takes nothing away.
  Change([&](hid_t file) { attribute(file, "/", "comment"); });
  EXPECT_THAT(ReadAll(), HasSubstr("comment(text of variable length, not read)"));
  H5Tclose(variable);
}

TEST_F(H5Hostile, DataInOtherFiles) {
  Change([&](hid_t file) {
    Remake(file, "/numbers", H5T_NATIVE_UCHAR, {64},
           [](hid_t properties) { H5Pset_external(properties, "/etc/passwd", 0, 64); });
  });
  EXPECT_THAT(Refusal(), HasSubstr("a.h5:/numbers: keeps its data in another file"));
  Change([&](hid_t file) {
    Remake(file, "/numbers", H5T_NATIVE_DOUBLE, {64}, [](hid_t properties) {
      const hsize_t many = 64;
      const hid_t space = H5Screate_simple(1, &many, nullptr);
      H5Pset_virtual(properties, space, "other.h5", "/x", space);
      H5Sclose(space);
    });
  });
  EXPECT_THAT(Refusal(), HasSubstr("keeps its data in another file"));
}

TEST_F(H5Hostile, LinksElsewhere) {
  WriteGood();
  std::filesystem::copy_file(path_, folder_.path() / "other.h5");
  Change([&](hid_t file) {
    H5Ldelete(file, "/deep", H5P_DEFAULT);
    H5Lcreate_external("other.h5", "/deep", file, "/deep", H5P_DEFAULT, H5P_DEFAULT);
  });
  EXPECT_THAT(Refusal(), HasSubstr("a.h5:/deep: is a link to another file"));
  Change([&](hid_t file) {
    H5Lmove(file, "/numbers", file, "/others", H5P_DEFAULT, H5P_DEFAULT);
    H5Lcreate_soft("/others", file, "/numbers", H5P_DEFAULT, H5P_DEFAULT);
  });
  EXPECT_THAT(Refusal(), HasSubstr("a.h5:/numbers: is a link to another place"));
}

TEST_F(H5Hostile, GroupsInACircleAndTooDeep) {
  Change([&](hid_t file) {
    H5Lcreate_hard(file, "/", file, "/deep/again", H5P_DEFAULT, H5P_DEFAULT);
    H5Lcreate_hard(file, "/deep", file, "/deep/self", H5P_DEFAULT, H5P_DEFAULT);
    H5Lcreate_hard(file, "/deep", file, "/deep/myself", H5P_DEFAULT, H5P_DEFAULT);
    H5Lcreate_hard(file, "/numbers", file, "/deep/numbers", H5P_DEFAULT, H5P_DEFAULT);
  });
  EXPECT_EQ(H5ListDatasets(path_).size(), 16u);
  Change([&](hid_t file) {
    std::string group;
    for (int depth = 0; depth < 40; ++depth) {
      group += "/g";
      H5Gclose(H5Gcreate2(file, group.c_str(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT));
    }
  });
  EXPECT_THAT(Refusal(), HasSubstr("groups nest deeper than 32"));
}

TEST_F(H5Hostile, FiltersOfOthers) {
  Change([&](hid_t file) {
    Remake(file, "/numbers", H5T_NATIVE_DOUBLE, {64}, [](hid_t properties) {
      const hsize_t chunk = 64;
      H5Pset_chunk(properties, 1, &chunk);
      H5Pset_filter(properties, 32015, H5Z_FLAG_OPTIONAL, 0, nullptr);
    });
  });
  EXPECT_THAT(Refusal(), HasSubstr("is packed by filter 32015, which is not run here"));
}

TEST_F(H5Hostile, MoreThanTheFileHolds) {
  constexpr hsize_t kHuge = hsize_t{1} << 40;
  for (const bool chunked : {false, true}) {
    Change([&](hid_t file) {
      Remake(file, "/numbers", H5T_NATIVE_DOUBLE, {kHuge, 3}, [&](hid_t properties) {
        const hsize_t chunk[] = {1024, 3};
        if (chunked) {
          H5Pset_chunk(properties, 2, chunk);
          H5Pset_deflate(properties, 1);
        }
      });
    });
    EXPECT_THAT(Refusal(), HasSubstr("and the file holds 0"));
  }
}

TEST_F(H5Hostile, TypesThatAreNoNumbers) {
  const hid_t pair = H5Tcreate(H5T_COMPOUND, 16);
  H5Tinsert(pair, "a", 0, H5T_NATIVE_DOUBLE);
  const hid_t list = H5Tvlen_create(H5T_NATIVE_DOUBLE);
  const hsize_t many = 1000;
  const hid_t block = H5Tarray_create2(H5T_NATIVE_DOUBLE, 1, &many);
  for (const hid_t type : {pair, list, block, H5T_NATIVE_LDOUBLE, H5T_STD_REF_OBJ}) {
    Change([&](hid_t file) { Remake(file, "/numbers", type, {4}); });
    EXPECT_THAT(ErrorOf([&] { H5Reader(path_, kSchema, 1).ReadDoubles("/numbers"); }),
                HasSubstr("a.h5:/numbers: does not hold plain numbers"));
  }
  H5Tclose(pair);
  H5Tclose(list);
  H5Tclose(block);
}

// Every bit of the header, and of the rest so many that the test stays short: what is read is what
// was written, or nothing. A reader once waited for ever on every third flip in the header.
TEST_F(H5Hostile, FlippedBitsAreNoticed) {
  WriteGood();
  std::string bytes;
  {
    std::ifstream stream(path_, std::ios::binary);
    std::ostringstream all;
    all << stream.rdbuf();
    bytes = all.str();
  }
  const std::string good = ReadAll();
  constexpr std::size_t kHeaderBits = 8 * 48, kStep = 127;
  int refused = 0, same = 0;
  double longest = 0.0;
  for (std::size_t bit = 0; bit < 8 * bytes.size(); bit += bit < kHeaderBits ? 1 : kStep) {
    std::string flipped = bytes;
    flipped[bit / 8] = static_cast<char>(flipped[bit / 8] ^ (1 << (bit % 8)));
    std::ofstream(path_, std::ios::binary) << flipped;
    const auto start = std::chrono::steady_clock::now();
    try {
      EXPECT_EQ(ReadAll(), good) << "bit " << bit;
      ++same;
    } catch (const Error&) {
      ++refused;
    }
    longest = std::max(
        longest, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  }
  std::printf("found: %d flips refused, %d without effect, the longest took %.3f s\n", refused,
              same, longest);
  EXPECT_GT(refused, 100);
}

}  // namespace
}  // namespace unfurl::data::h5_hostile_test
