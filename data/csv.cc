#include "data/csv.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <numeric>
#include <set>
#include <utility>

#include "base/count.h"
#include "base/error.h"
#include "base/text.h"
#include "data/atomic_file.h"
#include "data/csv_cell.h"

namespace unfurl::data {

namespace {

CsvColumn ParseHeaderCell(const std::string& cell) {
  const std::string_view text = Trim(cell);
  const std::size_t open = text.find('[');
  if (open == std::string_view::npos || text.back() != ']') return {std::string(text), ""};
  return {std::string(Trim(text.substr(0, open))),
          std::string(Trim(text.substr(open + 1, text.size() - open - 2)))};
}

// A spreadsheet runs a cell that begins like this [OWASP, "CSV injection"], if it is no number.
bool RunsInSpreadsheets(std::string_view cell) {
  const std::size_t quotes = std::min(cell.find_first_not_of('\''), cell.size());
  double value = 0.0;
  return quotes < cell.size() &&
         std::string_view("=+-@\t\r").find(cell[quotes]) != std::string_view::npos &&
         (quotes > 0 || !ParseDouble(cell, &value));
}

// The cells of a line; a cell in quotes may hold commas, and a quote doubled [RFC 4180].
std::vector<std::string> CellsOf(std::string_view line, const std::string& where) {
  std::vector<std::string> cells;
  for (std::size_t at = 0; at <= line.size();) {
    const std::size_t start = std::min(line.find_first_not_of(" \t", at), line.size());
    std::string cell;
    std::size_t end = 0;
    if (start < line.size() && line[start] == '"') {
      std::size_t from = start + 1, quote = 0;
      for (;;) {
        quote = line.find('"', from);
        if (quote == std::string_view::npos) {
          throw Error("a cell's quote is not closed on its line", where, "close it");
        }
        cell += line.substr(from, quote - from);
        if (quote + 1 >= line.size() || line[quote + 1] != '"') break;
        cell += '"';
        from = quote + 2;
      }
      end = std::min(line.find(',', quote), line.size());
      if (!Trim(line.substr(quote + 1, end - quote - 1)).empty()) {
        throw Error("a cell goes on after its closing quote", where, "double the quotes within it");
      }
    } else {
      end = std::min(line.find(',', at), line.size());
      cell = std::string(Trim(line.substr(at, end - at)));
    }
    if (cell.starts_with('\'') && RunsInSpreadsheets(cell)) cell.erase(0, 1);
    cells.push_back(std::move(cell));
    at = end + 1;
  }
  return cells;
}

void RefuseOtherSeparators(const std::vector<std::string>& cells, const std::string& where) {
  if (cells.size() > 1) return;
  for (const auto& [sign, name] : {std::pair{';', "semicolons"}, std::pair{'\t', "tabs"}}) {
    if (cells[0].find(sign) == std::string::npos) continue;
    throw Error(fmt::format("its cells are separated by {}", name), where,
                "save it with commas between cells and points in numbers");
  }
}

// A table whose first line is data would lose a row and be told of columns named "0.31". Whole
// numbers may be names, as of marks 1 to 4 beside a column of time.
void RefuseNumbersAsHeader(const std::vector<std::string>& cells, const std::string& where) {
  std::size_t numbers = 0, fractions = 0;
  for (const std::string& cell : cells) {
    double value = 0.0;
    if (!ParseDouble(cell, &value)) continue;
    ++numbers;
    fractions += value != std::floor(value) ? 1 : 0;
  }
  const bool data = numbers == cells.size() || (fractions > 0 && 2 * numbers > cells.size());
  if (!data) return;
  throw Error("holds numbers, where the header is looked for", where,
              "begin with a line of the columns' names and units, as docs/formats.md shows");
}

std::vector<CsvColumn> ColumnsOf(const std::vector<std::string>& cells, const std::string& where) {
  std::vector<CsvColumn> columns;
  std::set<std::string> names;
  for (const std::string& cell : cells) {
    columns.push_back(ParseHeaderCell(cell));
    const std::string& name = columns.back().name;
    if (!name.empty() && names.insert(name).second) continue;
    throw Error(fmt::format("column '{}' is {}", name, name.empty() ? "nameless" : "there twice"),
                where,
                cell.empty() && &cell == &cells.back()
                    ? "take the comma at the end of each line away, or name the column"
                    : "give each column a name of its own");
  }
  return columns;
}

// The column that differs from a name by capitals only: names are told apart by them.
std::string OtherCase(const std::vector<CsvColumn>& columns, std::string_view name) {
  const auto lower = [](std::string_view text) {
    std::string out(text);
    for (char& c : out) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    return out;
  };
  for (const CsvColumn& column : columns) {
    if (lower(column.name) == lower(name)) return column.name;
  }
  return {};
}

}  // namespace

std::string CsvCell(const std::string& text) {
  std::string cell = RunsInSpreadsheets(text) ? "'" + text : text;
  const bool plain = cell.find_first_of(",\"\n\r") == std::string::npos && cell == Trim(cell) &&
                     !cell.starts_with('#');
  if (plain) return cell;
  std::string quoted = "\"";
  for (const char c : cell) {
    // A table has one row a line.
    quoted += c == '"' ? "\"\"" : std::string(1, c == '\n' || c == '\r' ? ' ' : c);
  }
  return quoted + "\"";
}

CsvTable CsvTable::Load(const std::string& path) {
  CsvTable table;
  table.path_ = path;
  const std::string text = ReadTextFile(path);
  if (text.starts_with("\xff\xfe") || text.starts_with("\xfe\xff")) {
    throw Error("is UTF-16 text", path, "save it as UTF-8, in a spreadsheet \"CSV UTF-8\"");
  }
  if (text.find('\0') != std::string::npos) {
    throw Error("is not a text file", path, "give a CSV file with a header line");
  }
  int number = 0;
  // Spreadsheets of old Macintoshes end lines by a carriage return alone.
  const char end = text.find('\n') == std::string::npos ? '\r' : '\n';
  for (const std::string& line : Split(text, end)) {
    ++number;
    std::string_view content = Trim(line);
    if (number == 1 && content.starts_with("\xef\xbb\xbf")) content.remove_prefix(3);
    if (content.empty()) continue;
    if (content.front() == '#') {
      table.comments_.emplace_back(Trim(content.substr(1)));
      continue;
    }
    const std::string where = fmt::format("{}:{}", path, number);
    std::vector<std::string> cells = CellsOf(content, where);
    if (table.columns_.empty()) {
      RefuseOtherSeparators(cells, where);
      RefuseNumbersAsHeader(cells, where);
      table.columns_ = ColumnsOf(cells, where);
      continue;
    }
    // So spreadsheets save rows that were emptied, and some below the last.
    if (std::all_of(cells.begin(), cells.end(), [](const auto& cell) { return cell.empty(); })) {
      continue;
    }
    if (cells.size() != table.columns_.size()) {
      throw Error(fmt::format("{}, but the header names {}", Counted(cells.size(), "cell"),
                              table.columns_.size()),
                  where, "complete the line; a cell that holds a comma wants quotes");
    }
    table.cells_.push_back(std::move(cells));
    table.lines_.push_back(number);
  }
  if (table.columns_.empty()) {
    throw Error(Trim(text).empty() ? "is empty" : "holds no header line", path,
                "give a CSV file such as docs/formats.md shows");
  }
  return table;
}

int CsvTable::Find(std::string_view name) const {
  for (std::size_t i = 0; i < columns_.size(); ++i) {
    if (columns_[i].name == name) return static_cast<int>(i);
  }
  return -1;
}

int CsvTable::Require(std::string_view name, std::string_view unit) const {
  const int column = Find(name);
  if (column < 0) {
    const std::string other = OtherCase(columns_, name);
    throw Error(fmt::format("has no column '{}'", name), path_,
                fmt::format("{}{}",
                            other.empty() ? "add it to the header"
                                          : fmt::format("rename the column '{}'", other),
                            unit.empty() ? "" : fmt::format(" as '{} [{}]'", name, unit)));
  }
  const std::string& given = columns_[static_cast<std::size_t>(column)].unit;
  if (!unit.empty() && given != unit) {
    throw Error(given.empty() ? fmt::format("column '{}' has no unit", name)
                              : fmt::format("column '{}' is in [{}]", name, given),
                fmt::format("{}:{}", path_, name),
                fmt::format("convert it if need be and write '{} [{}]' in the header", name, unit));
  }
  return column;
}

std::string CsvTable::Text(std::size_t row, int column) const {
  return cells_[row][static_cast<std::size_t>(column)];
}

bool CsvTable::Empty(std::size_t row, int column) const {
  return cells_[row][static_cast<std::size_t>(column)].empty();
}

double CsvTable::Number(std::size_t row, int column) const {
  double value = 0.0;
  const std::string& cell = cells_[row][static_cast<std::size_t>(column)];
  if (!ParseDouble(cell, &value) || !std::isfinite(value)) {
    std::string with_point = cell;
    std::replace(with_point.begin(), with_point.end(), ',', '.');
    const bool comma = with_point != cell && ParseDouble(with_point, &value);
    throw Error(fmt::format("'{}' is not a finite number", cell), Where(row, column),
                comma ? "write a decimal point, not a comma" : "correct the cell");
  }
  return value;
}

double CsvTable::NumberOrNan(std::size_t row, int column) const {
  return Empty(row, column) ? std::nan("") : Number(row, column);
}

std::string CsvTable::Where(std::size_t row, int column) const {
  return fmt::format("{}:{}:{}", path_, lines_[row],
                     columns_[static_cast<std::size_t>(column)].name);
}

void CsvTable::SortBy(int column) {
  std::vector<double> key;
  for (std::size_t row = 0; row < rows(); ++row) key.push_back(Number(row, column));
  std::vector<std::size_t> order(rows());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return key[a] < key[b]; });
  std::vector<std::vector<std::string>> cells;
  std::vector<int> lines;
  for (const std::size_t row : order) {
    cells.push_back(std::move(cells_[row]));
    lines.push_back(lines_[row]);
  }
  cells_ = std::move(cells);
  lines_ = std::move(lines);
}

CsvWriter::CsvWriter(const std::vector<CsvColumn>& columns) {
  for (const CsvColumn& column : columns) {
    if (!header_.empty()) header_ += ',';
    header_ += CsvCell(column.unit.empty() ? column.name : column.name + " [" + column.unit + "]");
  }
  header_ += '\n';
}

void CsvWriter::Row(const std::vector<std::string>& cells) {
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (i > 0) body_ += ',';
    body_ += CsvCell(cells[i]);
  }
  body_ += '\n';
}

void CsvWriter::Row(const std::vector<double>& values) {
  auto out = std::back_inserter(body_);
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (i > 0) body_ += ',';
    if (!std::isnan(values[i])) fmt::format_to(out, "{}", values[i]);
  }
  body_ += '\n';
}

void CsvWriter::Comment(const std::string& text) {
  std::string line = text;
  std::replace(line.begin(), line.end(), '\n', ' ');
  comments_ += "# " + line + "\n";
}

std::string CsvWriter::Take() {
  std::string all = text();
  comments_.clear();
  header_.clear();
  body_.clear();
  return all;
}

std::string CsvWriter::text() const { return comments_ + header_ + body_; }

}  // namespace unfurl::data
