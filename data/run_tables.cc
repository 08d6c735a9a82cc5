#include "data/run_tables.h"

#include <fmt/format.h>

#include <map>
#include <set>
#include <tuple>

namespace unfurl::data {

std::vector<RunTable> TablesOf(const std::vector<Quantity>& quantities) {
  std::vector<RunTable> tables;
  std::map<std::tuple<std::string, std::string, std::string>, std::size_t> known;
  std::set<std::string> taken = {kSeriesTime};
  for (std::size_t q = 0; q < quantities.size(); ++q) {
    const Quantity& of = quantities[q];
    const std::size_t dot = of.name.rfind('.');
    const std::string kind = dot == std::string::npos ? of.name : of.name.substr(dot + 1);
    const auto [found, is_new] = known.try_emplace({kind, of.units, of.description}, tables.size());
    if (is_new) {
      std::string path = "/series/" + kind;
      for (int n = 2; taken.contains(path) || taken.contains(OwnersPath(path)); ++n) {
        path = fmt::format("/series/{}_{}", kind, n);
      }
      taken.insert(path);
      taken.insert(OwnersPath(path));
      tables.push_back({path, kind, of.units, of.description, {}, {}});
    }
    RunTable& table = tables[found->second];
    table.owners.push_back(dot == std::string::npos ? "" : of.name.substr(0, dot));
    table.places.push_back(q);
  }
  return tables;
}

std::string OwnersPath(const std::string& table) { return table + "_of"; }

std::string JoinedName(const std::string& owner, const std::string& kind) {
  return owner.empty() ? kind : owner + "." + kind;
}

}  // namespace unfurl::data
