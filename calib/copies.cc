#include "calib/copies.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>

#include "base/error.h"
#include "base/statistics.h"

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

void RefuseStillCameras(const Observations& data, const std::string& where) {
  // Of the row, what nine tenths of the readings lie within: a mark that is moved as little by all
  // places tells no camera [-].
  constexpr double kStill = 1e-3;
  constexpr std::size_t kTelling = 7;  // readings, as many as a pinhole has unknowns
  std::vector<std::vector<double>> u(data.cameras.size());
  for (const Reading& r : data.readings) u[static_cast<std::size_t>(r.camera)].push_back(r.u_px);
  for (std::size_t c = 0; c < u.size(); ++c) {
    if (u[c].size() < kTelling) continue;
    const double within = Quantile(u[c], 0.95) - Quantile(u[c], 0.05);
    if (!(within < kStill * data.RowOf(static_cast<int>(c)))) continue;
    throw Error(
        fmt::format("camera \"{}\" reads {:.1f} px wherever the points are (nine tenths of "
                    "its readings lie within {:.2g} px)",
                    data.cameras[c], Median(u[c]), within),
        where,
        "it follows a lamp, a reflection or a bad pixel, or is stuck: measure again, or leave "
        "its readings out");
  }
}

}  // namespace unfurl::calib
