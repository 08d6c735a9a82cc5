#pragma once

#include <string>
#include <vector>

#include "data/run.h"

namespace unfurl::data {

// How quantities lie in a run's file: those of one kind (".x" of all marks, say) side by side in a
// table of their own, so that a file of thousands of them has some dozens of datasets.
struct RunTable {
  std::string path;  // "/series/x"
  std::string kind;  // "x": what follows the last dot of a quantity's name; all of it without one
  std::string units, description;
  std::vector<std::string> owners;  // by column: what precedes that dot, "" without one
  std::vector<std::size_t> places;  // by column: the quantity's place among all
};

// Tables in the order in which their first quantity comes. Quantities that differ in unit or
// description share no table.
std::vector<RunTable> TablesOf(const std::vector<Quantity>& quantities);

// Where the columns' owners stand: "/series/x_of".
std::string OwnersPath(const std::string& table);

// "hub.x" of its two parts.
std::string JoinedName(const std::string& owner, const std::string& kind);

// Attribute of a table: its kind, which its name may follow by a number.
inline constexpr char kTableKind[] = "kind";
// The names of all quantities, in their order.
inline constexpr char kQuantityNames[] = "/quantities";

}  // namespace unfurl::data
