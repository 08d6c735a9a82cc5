#include "calib/bar_slips.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>

#include "base/length.h"
#include "base/statistics.h"
#include "calib/check_points.h"
#include "calib/unit_slip.h"

namespace unfurl::calib {
namespace {

constexpr std::size_t kFewestPlacements = 3;  // fewer may fit anything
// Shares of the placements: a bumped camera spoils none of them so that a slip would mend them, and
// a slip of a whole file spoils all [-].
constexpr double kMended = 0.75, kSpoilt = 0.25;
// Of the length: what a slip does to lengths is of the bar's own size [-].
constexpr double kLengthAlike = 0.05;

// Of the placements those whose ends were found, as far apart as the bar is long.
double ShareWhole(const measure::Triangulator& triangulator, const Observations& data,
                  const std::vector<std::size_t>& match, const Bar& bar) {
  const std::vector<Found> found = FindPoints(triangulator, data, match);
  int whole = 0;
  for (std::size_t a = 0; a + 1 < found.size(); a += 2) {
    const measure::PointSolution &p = found[a].solution, &q = found[a + 1].solution;
    if (p.outcome != measure::PointOutcome::kSolved || q.outcome != measure::PointOutcome::kSolved)
      continue;
    whole += std::abs((p.p - q.p).norm() - bar.length) < kLengthAlike * bar.length ? 1 : 0;
  }
  return static_cast<double>(whole) / std::max<double>(1.0, 0.5 * data.points());
}

class BarSlips {
 public:
  BarSlips(const measure::Triangulator& triangulator, const Observations& data,
           const std::vector<std::size_t>& match, const Bar& bar)
      : triangulator_(triangulator),
        rig_(triangulator.rig()),
        data_(data),
        match_(match),
        bar_(bar) {}

  void TryEnds() {
    for (std::size_t c = 0; c < match_.size() && !slip_.found; ++c) {
      Try([&](Reading* r) { r->point ^= IsOf(*r, c) ? 1 : 0; },
          fmt::format("camera \"{}\" has the bar's two ends exchanged", NameOf(c)),
          "exchange that camera's readings of the two ends");
    }
  }
  void TryCameras() {
    for (std::size_t a = 0; a < match_.size(); ++a) {
      for (std::size_t b = a + 1; b < match_.size() && !slip_.found; ++b) {
        Try([&](Reading* r) { r->camera = static_cast<int>(Exchanged(*r, a, b)); },
            fmt::format("the readings of cameras \"{}\" and \"{}\" are exchanged", NameOf(a),
                        NameOf(b)),
            "exchange their columns, or their names in \"# cameras:\"");
      }
    }
  }
  void TryRows() {
    for (std::size_t c = 0; c < match_.size() && !slip_.found; ++c) {
      const int pixels = rig_.cameras[match_[c]].pixels;
      Try([&](Reading* r) { r->u_px = IsOf(*r, c) ? pixels - 1 - r->u_px : r->u_px; },
          RowSlipOf(NameOf(c)), RowSlipRemedy(pixels));
    }
  }
  void TryPlacements() {
    const int last = data_.points() - 1;
    for (const int by : {-2, 2}) {
      if (slip_.found) return;
      // A second end of the placement that is left over goes to the one at the other end.
      Try(
          [&](Reading* r) {
            if (r->point % 2 == 0) return;
            r->point += by;
            if (r->point < 0) r->point = last;
            if (r->point > last) r->point = 1;
          },
          fmt::format("each second end is that of the placement {} it",
                      by > 0 ? "after" : "before"),
          "shift the second ends' readings by one placement");
    }
  }
  const Slip& found() const { return slip_; }

 private:
  static bool IsOf(const Reading& r, std::size_t camera) {
    return static_cast<std::size_t>(r.camera) == camera;
  }
  static std::size_t Exchanged(const Reading& r, std::size_t a, std::size_t b) {
    const auto j = static_cast<std::size_t>(r.camera);
    return j == a ? b : j == b ? a : j;
  }
  const std::string& NameOf(std::size_t camera) const { return rig_.cameras[match_[camera]].name; }

  void Try(const std::function<void(Reading*)>& change, const std::string& what,
           const std::string& remedy) {
    Observations changed = data_;
    for (Reading& r : changed.readings) change(&r);
    std::stable_sort(changed.readings.begin(), changed.readings.end(),
                     [](const Reading& a, const Reading& b) { return a.point < b.point; });
    if (ShareWhole(triangulator_, changed, match_, bar_) < kMended) return;
    slip_ = {true, "fits the rig, but " + what, remedy};
  }

  const measure::Triangulator& triangulator_;
  const data::Rig& rig_;
  const Observations& data_;
  const std::vector<std::size_t>& match_;
  const Bar& bar_;
  Slip slip_;
};

}  // namespace

Slip FindBarSlip(const measure::Triangulator& triangulator, const Observations& data,
                 const std::vector<std::size_t>& match, const Bar& bar) {
  if (data.points() < 2 * static_cast<int>(kFewestPlacements)) return {};
  if (ShareWhole(triangulator, data, match, bar) >= kSpoilt) return {};
  BarSlips slips(triangulator, data, match, bar);
  slips.TryEnds();
  if (!slips.found().found) slips.TryCameras();
  if (!slips.found().found) slips.TryRows();
  if (!slips.found().found) slips.TryPlacements();
  return slips.found();
}

Slip FindBarUnitSlip(const std::vector<CheckedPoint>& placements, const Bar& bar) {
  std::vector<double> found;
  for (const CheckedPoint& one : placements) {
    if (std::isfinite(one.error)) found.push_back(bar.length + one.error);
  }
  if (found.size() < kFewestPlacements) return {};
  const double length = Median(found);
  const UnitSlip slip = FindUnitSlipOf(bar.length / length, kLengthAlike);
  if (!slip.found) return {};
  return {true,
          fmt::format("the bar was found {} long: {} {}", LengthText(length),
                      UnitSubject(ScaleFrom::kBar), slip.what),
          UnitRemedy(ScaleFrom::kBar, slip)};
}

}  // namespace unfurl::calib
