#include "data/h5_walk.h"

#include <fmt/format.h>

#include <set>
#include <utility>

#include "base/crash.h"
#include "base/error.h"
#include "data/h5_checks.h"
#include "data/h5_handle.h"

namespace unfurl::data {

namespace {

constexpr int kDeepest = 32;  // levels: own files have three, and the recursion stays short

void List(hid_t file, hid_t group, const std::string& path, const std::string& prefix, int depth,
          std::set<std::pair<unsigned long, haddr_t>>* seen, std::vector<std::string>* out) {
  if (depth > kDeepest) {
    throw Error(fmt::format("groups nest deeper than {}", kDeepest), path + ":" + prefix,
                "make the file again");
  }
  for (const std::string& name : H5LinkNames(group, fmt::format("{}:{}/", path, prefix))) {
    const std::string object = fmt::format("{}/{}", prefix, name);
    H5HasChecked(file, path, object);
    const H5Handle opened(H5Oopen(file, object.c_str(), H5P_DEFAULT), H5Oclose);
    H5O_info_t info;
    if (!opened.valid() || H5Oget_info1(opened.get(), &info) < 0) {
      throw Error(fmt::format("is damaged: {}", H5LastMessage(nullptr)),
                  fmt::format("{}:{}", path, object), "copy the file again, or make it again");
    }
    if (!seen->emplace(info.fileno, info.addr).second) continue;
    if (info.type == H5O_TYPE_DATASET) out->push_back(object);
    if (info.type == H5O_TYPE_GROUP) List(file, opened.get(), path, object, depth + 1, seen, out);
  }
}

}  // namespace

std::vector<std::string> H5ListDatasets(const std::string& path) {
  const ReadsForeign reads(path.c_str());
  const H5Handle file = H5OpenChecked(path);
  const H5Handle root(H5Gopen2(file.get(), "/", H5P_DEFAULT), H5Gclose);
  std::vector<std::string> all;
  std::set<std::pair<unsigned long, haddr_t>> seen;
  H5O_info_t info;
  if (H5Oget_info1(root.get(), &info) >= 0) seen.emplace(info.fileno, info.addr);
  List(file.get(), root.get(), path, "", 0, &seen, &all);
  return all;
}

}  // namespace unfurl::data
