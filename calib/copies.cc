#include "calib/copies.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>

#include "base/error.h"

namespace unfurl::calib {

void RefuseCopiedRows(const MeasuredRows& measured, const std::string& where) {
  const std::vector<std::vector<double>>& rows = measured.rows;
  std::vector<std::size_t> order(rows.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return rows[a] < rows[b]; });
  std::size_t copies = 0, first = 0, again = rows.size();
  for (std::size_t k = 1; k < order.size(); ++k) {
    const std::size_t a = order[k - 1], b = order[k];
    if (rows[a] != rows[b] || rows[a].size() < measured.fewest) continue;
    ++copies;
    if (b < again) first = a, again = b;
  }
  if (copies == 0) return;
  throw Error(
      fmt::format("{} \"{}\" has {} of {} \"{}\" to the last digit{}: it is a copy, and tells "
                  "nothing more",
                  measured.kind, measured.names[again], measured.what, measured.kind,
                  measured.names[first],
                  copies > 1 ? fmt::format(" ({} {}s are such)", copies, measured.kind) : ""),
      where, "give each measurement once");
}

}  // namespace unfurl::calib
