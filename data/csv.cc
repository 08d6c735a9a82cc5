#include "data/csv.h"

#include <fmt/format.h>

#include <cmath>

#include "base/error.h"
#include "base/text.h"
#include "data/atomic_file.h"

namespace unfurl::data {

namespace {

CsvColumn ParseHeaderCell(const std::string& cell) {
  const std::string_view text = Trim(cell);
  const std::size_t open = text.find('[');
  if (open == std::string_view::npos || text.back() != ']') return {std::string(text), ""};
  return {std::string(Trim(text.substr(0, open))),
          std::string(Trim(text.substr(open + 1, text.size() - open - 2)))};
}

std::string HeaderCell(const CsvColumn& column) {
  return column.unit.empty() ? column.name : column.name + " [" + column.unit + "]";
}

}  // namespace

CsvTable CsvTable::Load(const std::string& path) {
  CsvTable table;
  table.path_ = path;
  const std::string text = ReadTextFile(path);
  if (text.find('\0') != std::string::npos) {
    throw Error("is not a text file", path, "give a CSV file with a header line");
  }
  int number = 0;
  for (const std::string& line : Split(text, '\n')) {
    ++number;
    std::string_view content = Trim(line);
    if (number == 1 && content.starts_with("\xef\xbb\xbf")) content.remove_prefix(3);
    if (content.empty()) continue;
    if (content.front() == '#') {
      table.comments_.emplace_back(Trim(content.substr(1)));
      continue;
    }
    std::vector<std::string> cells = Split(content, ',');
    for (std::string& cell : cells) {
      std::string_view trimmed = Trim(cell);
      if (trimmed.size() >= 2 && trimmed.front() == '"' && trimmed.back() == '"') {
        trimmed = trimmed.substr(1, trimmed.size() - 2);
      }
      cell = std::string(trimmed);
    }
    if (table.columns_.empty()) {
      for (const std::string& cell : cells) {
        const CsvColumn column = ParseHeaderCell(cell);
        if (column.name.empty() || table.Find(column.name) >= 0) {
          throw Error(fmt::format("column '{}' is {}", column.name,
                                  column.name.empty() ? "nameless" : "there twice"),
                      fmt::format("{}:{}", path, number), "give each column a name of its own");
        }
        table.columns_.push_back(column);
      }
      continue;
    }
    if (cells.size() != table.columns_.size()) {
      throw Error(
          fmt::format("{} cells, but the header names {}", cells.size(), table.columns_.size()),
          fmt::format("{}:{}", path, number), "complete the line");
    }
    table.cells_.push_back(std::move(cells));
    table.lines_.push_back(number);
  }
  if (table.columns_.empty()) {
    throw Error("holds no header line", path, "give a CSV file such as docs/formats.md shows");
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
    throw Error(fmt::format("has no column '{}'", name), path_,
                fmt::format("add it to the header{}",
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
    throw Error(fmt::format("'{}' is not a finite number", cell), Where(row, column),
                "correct the cell");
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

CsvWriter::CsvWriter(const std::vector<CsvColumn>& columns) {
  for (const CsvColumn& column : columns) {
    if (!header_.empty()) header_ += ',';
    header_ += HeaderCell(column);
  }
  header_ += '\n';
}

void CsvWriter::Row(const std::vector<std::string>& cells) {
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (i > 0) body_ += ',';
    body_ += cells[i];
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

void CsvWriter::Comment(const std::string& text) { comments_ += "# " + text + "\n"; }

std::string CsvWriter::Take() {
  std::string all = text();
  comments_.clear();
  header_.clear();
  body_.clear();
  return all;
}

std::string CsvWriter::text() const { return comments_ + header_ + body_; }

}  // namespace unfurl::data
