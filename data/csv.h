#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace unfurl::data {

// A table as a person or an instrument wrote it: comma-separated, a header line of `name` or
// `name [unit]`, lines that start with # are comments, blank lines are passed over.
struct CsvColumn {
  std::string name;
  std::string unit;  // empty when the header gives none
};

/// A CSV file in memory: comment lines, a header whose columns state their units, cells.
class CsvTable {
 public:
  /// Throws Error naming the line for what is no such table.
  static CsvTable Load(const std::string& path);

  const std::string& path() const { return path_; }                       ///< as it was loaded
  const std::vector<CsvColumn>& columns() const { return columns_; }      ///< of the header
  std::size_t rows() const { return lines_.size(); }                      ///< below the header
  const std::vector<std::string>& comments() const { return comments_; }  ///< without their #

  int Find(std::string_view name) const;  // -1 when absent
  // The column's index; throws when absent, without a unit or with another one than `unit`
  // (empty `unit`: a column that has none, such as an id).
  int Require(std::string_view name, std::string_view unit) const;
  std::string Text(std::size_t row, int column) const;  // trimmed
  bool Empty(std::size_t row, int column) const;
  double Number(std::size_t row, int column) const;       // finite, or throws
  double NumberOrNan(std::size_t row, int column) const;  // NaN for an empty cell
  std::string Where(std::size_t row, int column) const;   // "points.csv:12:sx"

  // Puts the rows in the order of a column's numbers, equal ones as they stand. Each keeps the line
  // that it was read from.
  void SortBy(int column);

 private:
  std::string path_;
  std::vector<CsvColumn> columns_;
  std::vector<std::vector<std::string>> cells_;
  std::vector<int> lines_;
  std::vector<std::string> comments_;
};

// Writes numbers so that they read back exactly; NaN as an empty cell.
class CsvWriter {
 public:
  explicit CsvWriter(const std::vector<CsvColumn>& columns);
  void Row(const std::vector<std::string>& cells);  ///< a cell for each column
  void Row(const std::vector<double>& values);      ///< a value for each column
  void Comment(const std::string& text);            ///< a line of its own, after #
  std::string text() const;                         // for WriteTextFile
  // What there is so far, for long tables: from then on the writer holds what comes after it.
  std::string Take();

 private:
  std::string header_;
  std::string comments_;
  std::string body_;
};

}  // namespace unfurl::data
