#include "cli/start_places.h"

#include "data/csv.h"

namespace unfurl::cli {

std::map<std::string, Eigen::Vector3d> ReadStart(const std::string& path) {
  const data::CsvTable table = data::CsvTable::Load(path);
  const int mark = table.Require("mark", "");
  const int at[] = {table.Require("x", "m"), table.Require("y", "m"), table.Require("z", "m")};
  std::map<std::string, Eigen::Vector3d> start;
  for (std::size_t i = 0; i < table.rows(); ++i) {
    start[table.Text(i, mark)] = {table.Number(i, at[0]), table.Number(i, at[1]),
                                  table.Number(i, at[2])};
  }
  return start;
}

}  // namespace unfurl::cli
