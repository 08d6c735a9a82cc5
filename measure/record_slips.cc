#include "measure/record_slips.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <numeric>

#include "base/statistics.h"
#include "measure/camera_model.h"

namespace unfurl::measure {

namespace {

// Of the misfit as named: noise or a camera that moved never leave so little; as for surveys
// (calib/slips.cc) [-].
constexpr double kPlainly = 0.05;
// Of the row: below, a camera may have moved by as much [-].
constexpr double kLeastMisfit = 0.01;
// Their median is then no matter of some reflections.
constexpr std::size_t kFewestFlashes = 8;
constexpr std::size_t kRecordSlipsMost = 256;  // flashes that are tried; more tell nothing new

// Camera c reads what is named camera `of[c]`, from the other end of its row where bit c is set.
struct Naming {
  std::vector<std::size_t> of;
  std::uint32_t reversed = 0;
  std::string what, remedy;
};

std::vector<Naming> NamingsOf(const data::Rig& rig) {
  const std::size_t n = rig.cameras.size();
  std::vector<std::size_t> as_is(n);
  std::iota(as_is.begin(), as_is.end(), std::size_t{0});
  std::vector<Naming> out = {{as_is, 0, "", ""}};
  for (std::size_t c = 0; c < n; ++c) {
    out.push_back({as_is, 1U << c,
                   fmt::format("camera '{}' is read from the other end of its row than when the "
                               "rig was calibrated",
                               rig.cameras[c].name),
                   "reverse its pixels, or calibrate with the rows as they are now"});
  }
  out.push_back({as_is, (1U << n) - 1U,
                 "all rows are read from the other end than when the rig was calibrated",
                 "reverse the pixels, or calibrate with the rows as they are now"});
  for (std::size_t a = 0; a < n; ++a) {
    for (std::size_t b = a + 1; b < n; ++b) {
      out.push_back({as_is, 0,
                     fmt::format("cameras '{}' and '{}' are exchanged, here or in the rig",
                                 rig.cameras[a].name, rig.cameras[b].name),
                     "exchange their names where they are wrong"});
      std::swap(out.back().of[a], out.back().of[b]);
    }
  }
  for (std::size_t by = 1; by < n && n > 2; ++by) {
    out.push_back({as_is, 0,
                   fmt::format("the cameras' names are moved on by {}: '{}' is what the rig calls "
                               "'{}', and so on",
                               by, rig.cameras[by].name, rig.cameras[0].name),
                   "name them as the rig does"});
    std::rotate(out.back().of.begin(), out.back().of.begin() + static_cast<std::ptrdiff_t>(by),
                out.back().of.end());
  }
  return out;
}

// By how much a flash's readings miss each other, over the row; a whole row where they give no
// point in the volume [-].
double MisfitOf(const FlashReadings& flash, const Naming& naming,
                const Triangulator& triangulator) {
  const std::size_t n = triangulator.cameras();
  FlashReadings u{}, s{};
  double row = 1.0;
  for (std::size_t c = 0; c < n; ++c) {
    const double pixels = triangulator.rig().cameras[c].pixels;
    const double read = flash[naming.of[c]];
    u[c] = (naming.reversed >> c & 1U) != 0 ? pixels - 1.0 - read : read;
    s[c] = 1.0;
    row = std::max(row, pixels);
  }
  const PointSolution point =
      triangulator.Solve({u.data(), n}, {s.data(), n}, triangulator.centre());
  const bool there =
      point.outcome == PointOutcome::kSolved || point.outcome == PointOutcome::kDisagree;
  if (!there || point.readings < 4) return 1.0;
  return std::min(1.0, std::sqrt(point.chi_square / (point.readings - 3)) / row);
}

using Flashes = std::vector<const FlashReadings*>;

double MedianOff(const std::vector<double>& x) {
  const double middle = Median(x);
  std::vector<double> off;
  off.reserve(x.size());
  for (const double one : x) off.push_back(std::abs(one - middle));
  return Median(off);
}

// A row that is read from an end that nobody knows: a survey as a table need not state how many
// pixels it has, and its end is then a guess.
struct FreeEnd {
  std::size_t camera = 0;
  double last_px = 0.0;    // a reading u is last_px - u when counted as in the rig
  double share = kUntold;  // that this leaves, of what a mere shift of the readings does [-]

  static constexpr double kUntold = 1e300;  // the marks move too little to tell [-]
  bool Contradicts() const { return share < kUntold && share > kPlainly; }
};

// The three others predict what a camera reads. That it falls as the readings rise no shift of the
// camera explains, whatever it is.
FreeEnd FreeEndOf(const Flashes& flashes, std::size_t camera, const Triangulator& triangulator) {
  const std::size_t n = triangulator.cameras();
  const data::RigCamera& mine = triangulator.rig().cameras[camera];
  const FlashReadings s = [] {
    FlashReadings out;
    out.fill(1.0);
    return out;
  }();
  std::vector<double> sum, difference;
  for (const FlashReadings* flash : flashes) {
    if (std::isnan((*flash)[camera])) continue;
    const PointSolution point = triangulator.Solve({flash->data(), n}, {s.data(), n},
                                                   triangulator.centre(), ~(1U << camera));
    double u = 0.0;
    if (point.outcome != PointOutcome::kSolved || !Project(mine, point.p, &u)) continue;
    sum.push_back(u + (*flash)[camera]);
    difference.push_back(u - (*flash)[camera]);
  }
  if (sum.size() < kFewestFlashes) return {camera};
  const double shifted = MedianOff(difference);
  if (!(shifted > kLeastMisfit * mine.pixels)) return {camera};
  return {camera, Median(sum), MedianOff(sum) / shifted};
}

}  // namespace

RecordSlip FindCameraSlip(std::span<const FlashReadings> flashes,
                          const Triangulator& triangulator) {
  std::vector<const FlashReadings*> seen;
  for (const FlashReadings& flash : flashes) {
    const auto readings = std::count_if(
        flash.begin(), flash.begin() + static_cast<std::ptrdiff_t>(triangulator.cameras()),
        [](double u) { return !std::isnan(u); });
    if (readings >= 4) seen.push_back(&flash);
  }
  if (seen.size() < kFewestFlashes) return {};
  const std::size_t every = (seen.size() + kRecordSlipsMost - 1) / kRecordSlipsMost;
  Flashes some;
  for (std::size_t i = 0; i < seen.size(); i += every) some.push_back(seen[i]);
  const std::vector<Naming> namings = NamingsOf(triangulator.rig());
  const auto misfit_of = [&](const Naming& naming) {
    std::vector<double> misfit;
    for (const FlashReadings* flash : some) {
      misfit.push_back(MisfitOf(*flash, naming, triangulator));
    }
    return Median(misfit);
  };
  const double as_named = misfit_of(namings.front());
  if (as_named < kLeastMisfit) return {};
  std::vector<FreeEnd> ends;
  for (std::size_t c = 0; c < triangulator.cameras(); ++c) {
    ends.push_back(FreeEndOf(some, c, triangulator));
  }
  const auto contradicted = [&](const Naming& naming) {
    return std::has_single_bit(naming.reversed) &&
           ends[static_cast<std::size_t>(std::countr_zero(naming.reversed))].Contradicts();
  };
  double least = kPlainly * as_named;
  const Naming* best = &namings.front();
  for (const Naming& naming : namings) {
    const double misfit = misfit_of(naming);
    if (!(misfit < least) || contradicted(naming)) continue;
    least = misfit;
    best = &naming;
  }
  // Whichever explains more.
  const auto end =
      std::min_element(ends.begin(), ends.end(),
                       [](const FreeEnd& a, const FreeEnd& b) { return a.share < b.share; });
  if (!(end->share < least / as_named)) return {best->what, best->remedy};
  return {fmt::format("camera '{}' is read from the other end of its row than when the rig was "
                      "calibrated",
                      triangulator.rig().cameras[end->camera].name),
          fmt::format("write {:.0f} - u in place of each of its readings u, or calibrate with the "
                      "rows as they are now",
                      end->last_px)};
}

namespace {

// Of a dark slot's lines that show a light, of another's that do not: all but what passes by [-].
constexpr double kNearlyAll = 0.95;
constexpr std::size_t kLeastStretches = 3;  // of a record that begins as it should
// Of the brightest lines' light: a mark's LED is not fainter beside others, as
// ReconstructOptions::least_share has it; registers' patterns are [-].
constexpr double kLight = 0.1, kBright = 0.9;

// By slot: its lines, and those that show a light.
struct Shares {
  std::vector<double> lines, light;
};

bool Slipped(const Shares& shares, const std::vector<bool>& dark, std::size_t* without) {
  bool shown = false, none = false;
  for (std::size_t k = 0; k < dark.size(); ++k) {
    if (shares.lines[k] < 1.0) continue;
    const double share = shares.light[k] / shares.lines[k];
    if (dark[k] && share >= kNearlyAll) shown = true;
    if (!dark[k] && share <= 1.0 - kNearlyAll) {
      none = true;
      *without = k;
    }
  }
  return shown && none;
}

// By how many lines the names are late, the fewest that explain what is lit; 0: by no number.
int LagOf(std::span<const NamedLines> stretches, const std::vector<bool>& dark, double threshold) {
  int best = 0;
  double most = kNearlyAll;
  const int furthest = static_cast<int>(dark.size());
  for (int step = 1; step <= 2 * furthest; ++step) {
    const int lag = (step % 2 == 1 ? 1 : -1) * ((step + 1) / 2);
    double agree = 0.0, all = 0.0;
    for (const NamedLines& lines : stretches) {
      const auto n = static_cast<int>(lines.slot.size());
      for (int i = std::max(0, -lag); i < std::min(n, n - lag); ++i) {
        const auto slot = static_cast<std::size_t>(lines.slot[static_cast<std::size_t>(i + lag)]);
        agree += dark[slot] != (lines.flux[static_cast<std::size_t>(i)] > threshold) ? 1.0 : 0.0;
        all += 1.0;
      }
    }
    if (all < 1.0 || agree <= most * all) continue;
    best = lag;
    most = agree / all;
  }
  return best;
}

}  // namespace

RecordSlip FindSlotSlip(std::span<const NamedLines> stretches, std::span<const std::string> names,
                        const std::vector<bool>& dark) {
  std::vector<double> flux;
  for (const NamedLines& lines : stretches) {
    flux.insert(flux.end(), lines.flux.begin(), lines.flux.end());
  }
  if (flux.empty()) return {};
  const double threshold = kLight * Quantile(flux, kBright);
  std::size_t first = stretches.size(), without = 0;
  while (first > 0) {
    const NamedLines& lines = stretches[first - 1];
    Shares shares{std::vector<double>(dark.size(), 0.0), std::vector<double>(dark.size(), 0.0)};
    for (std::size_t i = 0; i < lines.slot.size(); ++i) {
      const auto slot = static_cast<std::size_t>(lines.slot[i]);
      shares.lines[slot] += 1.0;
      shares.light[slot] += lines.flux[i] > threshold ? 1.0 : 0.0;
    }
    if (!Slipped(shares, dark, &without)) break;
    --first;
  }
  const std::size_t slipped = stretches.size() - first;
  if (slipped == 0 || (first > 0 && slipped < kLeastStretches)) return {};
  const int lag = LagOf(stretches.subspan(first), dark, threshold);
  const std::string when =
      first == 0 ? "" : fmt::format("from about {:.4g} s on ", stretches[first].t);
  const std::string by =
      lag == 0 ? ""
               : fmt::format(": the slots are {} by {} line{}", lag > 0 ? "late" : "early",
                             std::abs(lag), std::abs(lag) == 1 ? "" : "s");
  return {fmt::format("{}lines named dark show a light, and those of '{}' none{}", when,
                      names[without], by),
          lag == 0 ? "name the slots in the order in which they are lit"
                   : fmt::format("write the slot of line k {:+d} at line k (a line was dropped or "
                                 "doubled, or the slots are listed in another order)",
                                 lag)};
}

}  // namespace unfurl::measure
