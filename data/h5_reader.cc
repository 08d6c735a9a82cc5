#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>

#include "base/crash.h"
#include "base/error.h"
#include "data/h5.h"
#include "data/h5_checks.h"
#include "data/h5_handle.h"
#include "data/h5_packed.h"
#include "data/h5_scales.h"

namespace unfurl::data {

namespace {

constexpr char kGiveOurs[] =
    "give a file that an unfurl verb wrote; in one of your own, text is of fixed width "
    "(numpy.bytes_ with h5py; docs/formats.md)";

}  // namespace

struct H5Reader::Impl {
  std::string path;
  H5Handle file;
  int version = 0;
  mutable std::set<std::string> checked;
  mutable std::map<std::pair<std::string, hid_t>, H5Packed> packed;  // by name and type in memory

  ~Impl() {
    const ReadsForeign reads(path.c_str());
    packed.clear();
    file.Close();
  }

  std::string Where(const std::string& object) const { return path + ":" + object; }

  H5Handle Dataset(const H5Reader& owner, const std::string& name) const {
    H5Handle set;
    if (owner.Has(name)) set = H5Handle(H5Dopen2(file.get(), name.c_str(), H5P_DEFAULT), H5Dclose);
    if (!set.valid()) {
      owner.Fail("has no such dataset", name, "make the file again with this version of unfurl");
    }
    if (!checked.contains(name)) {  // once: looking up what is stored walks all chunks
      H5CheckStorage(set.get(), Where(name));
      checked.insert(name);
    }
    return set;
  }

  std::vector<hsize_t> Size(hid_t set) const {
    const H5Handle space(H5Dget_space(set), H5Sclose);
    const int rank = H5Sget_simple_extent_ndims(space.get());
    std::vector<hsize_t> size(static_cast<std::size_t>(std::max(rank, 0)));
    if (rank > 0) H5Sget_simple_extent_dims(space.get(), size.data(), nullptr);
    return size;
  }

  H5Packed& Packed(const H5Reader& owner, const std::string& name, hid_t memory_type) const {
    const auto key = std::make_pair(name, memory_type);
    auto found = packed.find(key);
    if (found == packed.end()) {
      found = packed.try_emplace(key, Dataset(owner, name), memory_type).first;
    }
    return found->second;
  }

  template <typename T>
  std::vector<T> ReadAll(const H5Reader& owner, const std::string& name, hid_t memory) const {
    const ReadsForeign reads(path.c_str());
    const H5Handle set = Dataset(owner, name);
    const H5Handle type(H5Dget_type(set.get()), H5Tclose);
    H5CheckNumber(type.get(), Where(name));
    std::size_t count = 1;
    for (hsize_t d : Size(set.get())) count *= d;
    std::vector<T> values(count);
    if (count > 0 && H5Dread(set.get(), memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()) < 0) {
      owner.Fail(fmt::format("cannot be read: {}", H5LastMessage(nullptr)), name,
                 "copy the file again, or make it again");
    }
    return values;
  }

  // All columns, or one of a matrix.
  void ReadRows(const H5Reader& owner, const std::string& name, std::size_t first,
                std::size_t count, hid_t memory_type, void* out, std::size_t out_size,
                std::optional<std::size_t> column = {}) const {
    const ReadsForeign reads(path.c_str());
    const H5Handle set = Dataset(owner, name);
    const H5Handle type(H5Dget_type(set.get()), H5Tclose);
    H5CheckNumber(type.get(), Where(name));
    std::vector<hsize_t> size = Size(set.get());
    std::vector<hsize_t> start(size.size(), 0);
    if (size.empty() || first > size[0] || count > size[0] - first) {
      owner.Fail(fmt::format("holds fewer than {} rows", first + count), name,
                 "make the file again");
    }
    start[0] = first;
    size[0] = count;
    if (column) {
      if (size.size() != 2 || *column >= size[1]) {
        owner.Fail(fmt::format("has no column {}", *column), name, "make the file again");
      }
      start[1] = *column;
      size[1] = 1;
    }
    std::size_t needed = 1;
    for (hsize_t d : size) needed *= d;
    if (needed > out_size) throw std::logic_error("H5Reader::ReadRows: buffer too small");
    if (needed == 0) return;
    if (!column && Packed(owner, name, memory_type).Read(first, count, out)) return;
    const H5Handle space(H5Dget_space(set.get()), H5Sclose);
    H5Sselect_hyperslab(space.get(), H5S_SELECT_SET, start.data(), nullptr, size.data(), nullptr);
    const H5Handle memory(H5Screate_simple(static_cast<int>(size.size()), size.data(), nullptr),
                          H5Sclose);
    if (H5Dread(set.get(), memory_type, memory.get(), space.get(), H5P_DEFAULT, out) < 0) {
      owner.Fail(fmt::format("cannot be read: {}", H5LastMessage(nullptr)), name,
                 "copy the file again, or make it again");
    }
  }

  H5Handle Object(const H5Reader& owner, const std::string& object) const {
    H5Handle opened;
    if (owner.Has(object)) {
      opened = H5Handle(H5Oopen(file.get(), object.c_str(), H5P_DEFAULT), H5Oclose);
    }
    if (!opened.valid()) owner.Fail("has no such object", object, "make the file again");
    return opened;
  }

  template <typename T>
  T Number(const H5Reader& owner, const std::string& object, const std::string& name,
           hid_t memory) const {
    const ReadsForeign reads(path.c_str());
    const H5Handle opened = Object(owner, object);
    T value{};
    if (H5Aexists(opened.get(), name.c_str()) <= 0) {
      owner.Fail("has no such attribute", object + "@" + name, "make the file again");
    }
    const H5Handle attribute(H5Aopen(opened.get(), name.c_str(), H5P_DEFAULT), H5Aclose);
    const H5Handle type(H5Aget_type(attribute.get()), H5Tclose);
    const H5Handle space(H5Aget_space(attribute.get()), H5Sclose);
    if (!attribute.valid() || !H5IsOne(space.get())) {
      owner.Fail("is not one number", object + "@" + name, "make the file again");
    }
    H5CheckNumber(type.get(), Where(object + "@" + name));
    if (H5Aread(attribute.get(), memory, &value) < 0) {
      owner.Fail("is not a number", object + "@" + name, "make the file again");
    }
    return value;
  }
};

H5Reader::H5Reader(const std::string& path, const std::string& schema, int newest_version)
    : impl_(std::make_unique<Impl>()) {
  impl_->path = path;
  const ReadsForeign reads(impl_->path.c_str());
  impl_->file = H5OpenChecked(path);
  const H5Handle root(H5Oopen(impl_->file.get(), "/", H5P_DEFAULT), H5Oclose);
  const std::string found = H5ReadText(root.get(), "schema", path + ":/");
  if (!schema.empty() && found != schema) {
    Fail(
        found.empty()
            ? "is not a file of ours: it names no schema"
            : fmt::format("is {}, where {} is needed", H5SchemaWords(found), H5SchemaWords(schema)),
        "", found.empty() ? kGiveOurs : "give the other file (`unfurl info` shows what a file is)");
  }
  if (schema.empty()) return;
  impl_->version = static_cast<int>(IntAttribute("/", "schema_version"));
  if (impl_->version > newest_version) {
    Fail(fmt::format("was written in version {} of '{}'; this program reads up to {}",
                     impl_->version, schema, newest_version),
         "", "use a newer unfurl");
  }
}

H5Reader::~H5Reader() = default;

std::string H5Reader::SchemaOf(const std::string& path) {
  const ReadsForeign reads(path.c_str());
  const H5Handle file = H5OpenChecked(path);
  const H5Handle root(H5Oopen(file.get(), "/", H5P_DEFAULT), H5Oclose);
  std::string schema = H5ReadText(root.get(), "schema", path + ":/");
  if (schema.empty()) {
    throw Error("is not a file of ours: it names no schema", path, kGiveOurs);
  }
  return schema;
}

const std::string& H5Reader::path() const { return impl_->path; }
int H5Reader::schema_version() const { return impl_->version; }

Provenance H5Reader::ReadProvenance() const {
  const ReadsForeign reads(impl_->path.c_str());
  const H5Handle root = impl_->Object(*this, "/");
  Provenance provenance;
  provenance.program = H5ReadText(root.get(), "program", impl_->Where("/"));
  provenance.command = H5ReadText(root.get(), "command", impl_->Where("/"));
  const auto parse = [&](const char* name) {
    return nlohmann::json::parse(H5ReadText(root.get(), name, impl_->Where("/")), nullptr, false);
  };
  const nlohmann::json inputs = parse("inputs");
  if (inputs.is_array()) {
    for (const auto& input : inputs) {
      if (!input.is_object()) continue;
      const auto word = [&](const char* key) {
        const auto found = input.find(key);
        return found != input.end() && found->is_string() ? found->get<std::string>() : "";
      };
      provenance.inputs.push_back({word("path"), word("sha256")});
    }
  }
  const nlohmann::json options = parse("options");
  if (options.is_object()) {
    for (const auto& [key, value] : options.items()) {
      if (value.is_string()) provenance.options[key] = value.get<std::string>();
    }
  }
  const std::string seed = H5ReadText(root.get(), "seed", impl_->Where("/"));
  if (!seed.empty()) provenance.seed = std::strtoull(seed.c_str(), nullptr, 10);
  return provenance;
}

bool H5Reader::Has(const std::string& path) const {
  const ReadsForeign reads(impl_->path.c_str());
  return H5HasChecked(impl_->file.get(), impl_->path, path);
}

std::vector<std::string> H5Reader::Children(const std::string& group) const {
  const ReadsForeign reads(impl_->path.c_str());
  if (group != "/" && !Has(group)) return {};
  return H5LinkNames(impl_->Object(*this, group).get(), impl_->Where(group));
}

bool H5Reader::IsDataset(const std::string& path) const {
  const ReadsForeign reads(impl_->path.c_str());
  return Has(path) && H5Iget_type(impl_->Object(*this, path).get()) == H5I_DATASET;
}

std::vector<std::size_t> H5Reader::Dims(const std::string& dataset) const {
  const ReadsForeign reads(impl_->path.c_str());
  const std::vector<hsize_t> size = impl_->Size(impl_->Dataset(*this, dataset).get());
  return std::vector<std::size_t>(size.begin(), size.end());
}

std::string H5Reader::Units(const std::string& dataset) const {
  const ReadsForeign reads(impl_->path.c_str());
  return H5ReadText(impl_->Dataset(*this, dataset).get(), "units", impl_->Where(dataset));
}

std::string H5Reader::Description(const std::string& dataset) const {
  const ReadsForeign reads(impl_->path.c_str());
  return H5ReadText(impl_->Dataset(*this, dataset).get(), "description", impl_->Where(dataset));
}

std::vector<double> H5Reader::ReadDoubles(const std::string& dataset,
                                          const std::string& units) const {
  if (!units.empty() && Has(dataset) && Units(dataset) != units) {
    Fail(fmt::format("is in [{}], not [{}]", Units(dataset), units), dataset,
         "convert it, and state the unit in its attribute `units`");
  }
  return impl_->ReadAll<double>(*this, dataset, H5T_NATIVE_DOUBLE);
}

std::vector<std::int32_t> H5Reader::ReadInts(const std::string& dataset) const {
  return impl_->ReadAll<std::int32_t>(*this, dataset, H5T_NATIVE_INT32);
}

std::vector<std::string> H5Reader::ReadStrings(const std::string& dataset) const {
  const ReadsForeign reads(impl_->path.c_str());
  const H5Handle set = impl_->Dataset(*this, dataset);
  const H5Handle type(H5Dget_type(set.get()), H5Tclose);
  H5CheckText(type.get(), impl_->Where(dataset));
  if (H5Tget_class(type.get()) != H5T_STRING) {
    Fail("does not hold fixed-width text", dataset, "make the file again");
  }
  const std::vector<std::size_t> dims = Dims(dataset);
  std::size_t count = 1;
  for (std::size_t d : dims) count *= d;
  std::size_t width = H5Tget_size(type.get());
  if (width == 1 && dims.size() == 2) {  // letters, row by row
    count = dims[0];
    width = dims[1];
  }
  std::string packed(width * std::max<std::size_t>(1, count), '\0');
  if (count > 0 &&
      H5Dread(set.get(), type.get(), H5S_ALL, H5S_ALL, H5P_DEFAULT, packed.data()) < 0) {
    Fail("cannot be read", dataset, "copy the file again, or make it again");
  }
  std::vector<std::string> values(count);
  for (std::size_t i = 0; i < count; ++i) {
    const char* text = packed.data() + i * width;
    values[i].assign(text, strnlen(text, width));
  }
  return values;
}

Eigen::MatrixXd H5Reader::ReadMatrix(const std::string& dataset, const std::string& units) const {
  const std::vector<double> values = ReadDoubles(dataset, units);
  const std::vector<std::size_t> dims = Dims(dataset);
  if (dims.size() != 2) Fail("is not a matrix", dataset, "make the file again");
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  return Eigen::Map<const RowMajor>(values.data(), static_cast<Eigen::Index>(dims[0]),
                                    static_cast<Eigen::Index>(dims[1]));
}

void H5Reader::ReadRows(const std::string& dataset, std::size_t first, std::size_t count,
                        std::span<double> out) const {
  impl_->ReadRows(*this, dataset, first, count, H5T_NATIVE_DOUBLE, out.data(), out.size());
}
void H5Reader::ReadRows(const std::string& dataset, std::size_t first, std::size_t count,
                        std::span<std::uint16_t> out) const {
  impl_->ReadRows(*this, dataset, first, count, H5T_NATIVE_UINT16, out.data(), out.size());
}
void H5Reader::ReadRows(const std::string& dataset, std::size_t first, std::size_t count,
                        std::span<std::int32_t> out) const {
  impl_->ReadRows(*this, dataset, first, count, H5T_NATIVE_INT32, out.data(), out.size());
}

void H5Reader::ReadColumn(const std::string& dataset, std::size_t column, std::size_t first,
                          std::span<double> out) const {
  impl_->ReadRows(*this, dataset, first, out.size(), H5T_NATIVE_DOUBLE, out.data(), out.size(),
                  column);
}

std::vector<std::pair<std::string, std::string>> H5Reader::Attributes(
    const std::string& object) const {
  const ReadsForeign reads(impl_->path.c_str());
  const H5Handle opened = impl_->Object(*this, object);
  std::vector<std::string> names;
  const herr_t listed = H5Aiterate2(
      opened.get(), H5_INDEX_NAME, H5_ITER_NATIVE, nullptr,
      [](hid_t, const char* name, const H5A_info_t*, void* out) -> herr_t {
        static_cast<std::vector<std::string>*>(out)->emplace_back(name);
        return 0;
      },
      &names);
  if (listed < 0) Fail("its attributes cannot be listed", object, "copy the file again");
  std::sort(names.begin(), names.end());  // not by the library: see H5LinkNames
  std::vector<std::pair<std::string, std::string>> all;
  for (const std::string& name : names) {
    if (H5IsScaleAttribute(name)) continue;
    const H5Handle attribute(H5Aopen(opened.get(), name.c_str(), H5P_DEFAULT), H5Aclose);
    const H5Handle type(H5Aget_type(attribute.get()), H5Tclose);
    const H5Handle space(H5Aget_space(attribute.get()), H5Sclose);
    const H5T_class_t kind = H5Tget_class(type.get());
    std::string value;  // others may have added what is none of ours: named, and not refused
    if (kind == H5T_STRING && H5Tis_variable_str(type.get()) > 0) {
      value = "(text of variable length, not read)";
    } else if (!H5IsOne(space.get())) {
      value = "(not one value)";
    } else if (kind == H5T_STRING) {
      value = H5ReadText(opened.get(), name, impl_->Where(object));
    } else if (kind == H5T_INTEGER) {
      value = std::to_string(IntAttribute(object, name));
    } else if (kind == H5T_FLOAT) {
      value = fmt::format("{}", DoubleAttribute(object, name));
    } else {
      value = "(neither text nor a number)";
    }
    all.emplace_back(name, value);
  }
  return all;
}

bool H5Reader::HasAttribute(const std::string& object, const std::string& name) const {
  const ReadsForeign reads(impl_->path.c_str());
  return H5Aexists(impl_->Object(*this, object).get(), name.c_str()) > 0;
}

std::string H5Reader::StringAttribute(const std::string& object, const std::string& name) const {
  const ReadsForeign reads(impl_->path.c_str());
  const H5Handle opened = impl_->Object(*this, object);
  if (H5Aexists(opened.get(), name.c_str()) <= 0) {
    Fail("has no such attribute", object + "@" + name, "make the file again");
  }
  const H5Handle attribute(H5Aopen(opened.get(), name.c_str(), H5P_DEFAULT), H5Aclose);
  const H5Handle type(H5Aget_type(attribute.get()), H5Tclose);
  if (H5Tget_class(type.get()) != H5T_STRING) {
    Fail("is not text", object + "@" + name, "make the file again");
  }
  return H5ReadText(opened.get(), name, impl_->Where(object));
}

double H5Reader::DoubleAttribute(const std::string& object, const std::string& name) const {
  return impl_->Number<double>(*this, object, name, H5T_NATIVE_DOUBLE);
}

std::int64_t H5Reader::IntAttribute(const std::string& object, const std::string& name) const {
  return impl_->Number<std::int64_t>(*this, object, name, H5T_NATIVE_INT64);
}

void H5Reader::Fail(const std::string& what, const std::string& object,
                    const std::string& remedy) const {
  throw Error(what, object.empty() ? impl_->path : impl_->path + ":" + object, remedy);
}

}  // namespace unfurl::data
