#pragma once

#include <string>

namespace unfurl::data {

// `text` as one cell of a CSV file: in quotes where it holds a comma, a quote or outer blanks; one
// that a spreadsheet would run (it begins with =, +, - or @ and is no number) gets a ' in front,
// which CsvTable takes off again. Line ends become blanks.
std::string CsvCell(const std::string& text);

}  // namespace unfurl::data
