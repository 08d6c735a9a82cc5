#include "data/h5_scales.h"

#include <fmt/format.h>

#include <cstddef>
#include <map>

namespace unfurl::data {

namespace {

constexpr char kClass[] = "CLASS", kName[] = "NAME";
constexpr char kDimensionList[] = "DIMENSION_LIST", kReferenceList[] = "REFERENCE_LIST";
constexpr char kScaleClass[] = "DIMENSION_SCALE";
// What netCDF4 adds: a number for each scale, and those of a scale's own dimensions where it has
// more than one.
constexpr char kDimension[] = "_Netcdf4Dimid", kCoordinates[] = "_Netcdf4Coordinates";
constexpr char kBare[] = "This is a netCDF dimension but not a netCDF variable.";

// An entry of REFERENCE_LIST: who uses the scale, and for which of its dimensions.
struct BackReference {
  hobj_ref_t dataset;
  int dimension;
};

bool Put(hid_t object, const char* name, hid_t type, hid_t space, const void* value) {
  const H5Handle attribute(H5Acreate2(object, name, type, space, H5P_DEFAULT, H5P_DEFAULT),
                           H5Aclose);
  return attribute.valid() && H5Awrite(attribute.get(), type, value) >= 0;
}

// The specification wants these two null-terminated and as long as they are.
bool PutWord(hid_t object, const char* name, const std::string& word) {
  const H5Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
  H5Tset_size(type.get(), word.size() + 1);
  H5Tset_strpad(type.get(), H5T_STR_NULLTERM);
  const H5Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  return Put(object, name, type.get(), space.get(), word.c_str());
}

bool PutDimensionList(hid_t file, const H5Labelled& dataset,
                      const std::map<std::string, hobj_ref_t>& references) {
  std::vector<hobj_ref_t> labels;
  for (const std::string& scale : dataset.scales) {
    labels.push_back(references.at(scale));
  }
  std::vector<hvl_t> list;
  list.reserve(labels.size());
  for (hobj_ref_t& label : labels) list.push_back({1, &label});
  const H5Handle type(H5Tvlen_create(H5T_STD_REF_OBJ), H5Tclose);
  const hsize_t size = list.size();
  const H5Handle space(H5Screate_simple(1, &size, nullptr), H5Sclose);
  const H5Handle set(H5Dopen2(file, dataset.path.c_str(), H5P_DEFAULT), H5Dclose);
  return set.valid() && Put(set.get(), kDimensionList, type.get(), space.get(), list.data());
}

bool PutScale(hid_t file, const std::string& path, bool bare, const std::vector<int>& dimensions,
              const std::vector<BackReference>& users) {
  const H5Handle set(H5Dopen2(file, path.c_str(), H5P_DEFAULT), H5Dclose);
  std::string name = path.substr(path.rfind('/') + 1);
  if (bare) {
    const H5Handle extent(H5Dget_space(set.get()), H5Sclose);
    name = fmt::format("{}{:10d}", kBare, H5Sget_simple_extent_npoints(extent.get()));
  }
  if (!set.valid() || !PutWord(set.get(), kClass, kScaleClass) ||
      !PutWord(set.get(), kName, name)) {
    return false;
  }
  const H5Handle scalar(H5Screate(H5S_SCALAR), H5Sclose);
  if (!Put(set.get(), kDimension, H5T_NATIVE_INT, scalar.get(), dimensions.data())) return false;
  if (const hsize_t own = dimensions.size(); own > 1) {
    const H5Handle list(H5Screate_simple(1, &own, nullptr), H5Sclose);
    if (!Put(set.get(), kCoordinates, H5T_NATIVE_INT, list.get(), dimensions.data())) return false;
  }
  if (users.empty()) return true;
  const H5Handle type(H5Tcreate(H5T_COMPOUND, sizeof(BackReference)), H5Tclose);
  H5Tinsert(type.get(), "dataset", offsetof(BackReference, dataset), H5T_STD_REF_OBJ);
  H5Tinsert(type.get(), "dimension", offsetof(BackReference, dimension), H5T_NATIVE_INT);
  const H5Handle packed(H5Tcopy(type.get()), H5Tclose);
  H5Tpack(packed.get());  // on disk without the compiler's padding
  const hsize_t size = users.size();
  const H5Handle space(H5Screate_simple(1, &size, nullptr), H5Sclose);
  const H5Handle attribute(
      H5Acreate2(set.get(), kReferenceList, packed.get(), space.get(), H5P_DEFAULT, H5P_DEFAULT),
      H5Aclose);
  return attribute.valid() && H5Awrite(attribute.get(), type.get(), users.data()) >= 0;
}

}  // namespace

bool H5AttachScales(hid_t file, const std::vector<H5Labelled>& datasets,
                    const std::map<std::string, std::string>& letters,
                    const std::set<std::string>& bare) {
  std::map<std::string, hobj_ref_t> references;
  const auto refer = [&](const std::string& path) {
    return references.contains(path) ||
           H5Rcreate(&references[path], file, path.c_str(), H5R_OBJECT, -1) >= 0;
  };
  std::map<std::string, std::vector<BackReference>> users;
  for (const H5Labelled& dataset : datasets) {
    if (!refer(dataset.path)) return false;
    for (std::size_t k = 0; k < dataset.scales.size(); ++k) {
      if (!refer(dataset.scales[k])) return false;
      users[dataset.scales[k]].push_back({references[dataset.path], static_cast<int>(k)});
    }
  }
  for (const H5Labelled& dataset : datasets) {
    if (!PutDimensionList(file, dataset, references)) return false;
  }
  std::map<std::string, int> number;
  std::set<std::string> labelled;
  for (const H5Labelled& dataset : datasets) labelled.insert(dataset.path);
  for (const auto& [path, scale] : letters) {
    users[scale];  // of a scale's own letters: no dataset uses it otherwise
    // A text without scales is one: netCDF4 would take any dimension of the same length for its
    // own, and where that is of letters xarray finds no words any more.
    if (!labelled.contains(path)) users[path];
  }
  for (const auto& [scale, of] : users) number.emplace(scale, static_cast<int>(number.size()));
  for (const auto& [scale, of] : users) {
    std::vector<int> dimensions = {number[scale]};
    if (letters.contains(scale)) dimensions.push_back(number[letters.at(scale)]);
    if (!PutScale(file, scale, bare.contains(scale), dimensions, of)) return false;
  }
  return true;
}

bool H5IsScaleAttribute(const std::string& name) {
  static const std::set<std::string> kNames = {
      kClass, kName, kDimensionList, kReferenceList, kDimension, kCoordinates, "_Encoding"};
  return kNames.contains(name);
}

}  // namespace unfurl::data
