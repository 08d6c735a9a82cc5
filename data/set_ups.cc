#include "data/set_ups.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <string>

#include "base/error.h"

namespace unfurl::data {

namespace {

constexpr char kSetUpColumn[] = "set_up";

// A column that means the same and would be passed over: "setup", "Set-up", "SET UP".
void RefuseOtherSpelling(const CsvTable& table) {
  for (const CsvColumn& column : table.columns()) {
    std::string letters;
    for (const char c : column.name) {
      if (std::isalpha(static_cast<unsigned char>(c)) == 0) continue;
      letters += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    }
    if (letters != "setup" || column.name == kSetUpColumn) continue;
    throw Error(fmt::format("the column '{}' is not read", column.name),
                table.path() + ":" + column.name, "name it 'set_up'");
  }
}

void RefuseWhatOneStationMeasures(const CsvTable& table, std::size_t set_ups) {
  for (const char* name : {"hz", "v", "d"}) {
    if (table.Find(name) < 0) continue;
    throw Error(fmt::format("is measured about one station's place, and the points from {} set-ups",
                            set_ups),
                table.path() + ":" + name,
                "give coordinates (x, y, z or E, N, H) in one frame and leave hz, v, d out");
  }
  for (const std::string& comment : table.comments()) {
    if (!comment.starts_with("prism offset:")) continue;
    throw Error(
        fmt::format("lies along lines from one station, and the points were measured from {} "
                    "set-ups",
                    set_ups),
        table.path() + ": # prism offset", "add it to the coordinates, and leave the comment out");
  }
}

}  // namespace

std::vector<std::string> SetUpNames(const Survey& survey) {
  std::vector<std::string> names;
  for (const std::string& name : survey.set_up) {
    if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  }
  return names;
}

void ReadSetUps(const CsvTable& table, Survey* survey) {
  if (table.Find(kSetUpColumn) < 0) {
    RefuseOtherSpelling(table);
    return;
  }
  const int column = table.Require(kSetUpColumn, "");
  survey->set_up.clear();
  for (std::size_t i = 0; i < table.rows(); ++i) {
    survey->set_up.push_back(table.Text(i, column));
    if (survey->set_up.back().empty()) {
      throw Error("names no set-up", table.Where(i, column),
                  "write the set-up's name or number in each line, or leave the column out");
    }
  }
  if (const std::size_t n = SetUpNames(*survey).size(); n > 1) {
    RefuseWhatOneStationMeasures(table, n);
  }
}

}  // namespace unfurl::data
