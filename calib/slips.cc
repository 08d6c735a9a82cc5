#include "calib/slips.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <optional>

#include "base/length.h"
#include "base/statistics.h"
#include "measure/camera_model.h"

namespace unfurl::calib {
namespace {

// Of the misfit as written: noise, a bumped camera or a displaced point never leave so little.
constexpr double kPlainlyLess = 0.05;
// Of the row: a slip of a whole file moves points by a share of the field, a bumped camera its
// readings by far less [-].
constexpr double kLeastMisfit = 0.01;
// Lengths of one unit: no bar and no survey is as wrong as this; units are further apart [-].
constexpr double kLengthsAlike = 0.05;
constexpr std::size_t kFewest = 3;  // points: fewer may be anywhere in another frame
// From the cameras to the volume's middle [m]: an LED is lost to a line sensor beyond some hundred
// metres, and a lens stands further off than some centimetres.
constexpr double kFarthest = 500.0, kNearest = 5e-3;

// A change of all coordinates: place a of the changed point is sign(a) p(from(a)), in another unit.
struct Change {
  std::array<int, 3> from = {0, 1, 2};
  std::array<double, 3> sign = {1.0, 1.0, 1.0};
  UnitSlip unit = {};

  Eigen::Vector3d Of(const Eigen::Vector3d& p) const {
    return unit.factor *
           Eigen::Vector3d(sign[0] * p(from[0]), sign[1] * p(from[1]), sign[2] * p(from[2]));
  }
};

// Units that coordinates are tried in: exchanged or reversed ones in millimetres alone, as a file
// is seldom wrong in two ways.
std::vector<UnitSlip> UnitsOf(bool as_they_stand) {
  std::vector<UnitSlip> out = {{}};
  for (const UnitSlip& slip : UnitSlips()) {
    if (as_they_stand || slip.factor == 1e-3 || slip.factor == 1e3) out.push_back(slip);
  }
  return out;
}

// What a reading should have been: of a point by a camera of the rig.
using Reader = std::function<bool(const Reading&, std::size_t* camera, Eigen::Vector3d* p)>;

// Median misfit over the row; readings that no point of that kind gives count as a whole row.
double MedianMisfit(const data::Rig& rig, const Observations& data, const Reader& of) {
  std::vector<double> misfit;
  for (const Reading& r : data.readings) {
    std::size_t camera = 0;
    Eigen::Vector3d p;
    if (!of(r, &camera, &p)) continue;
    double u = 0.0;
    const double row = std::max(1, rig.cameras[camera].pixels);
    const bool seen = measure::Project(rig.cameras[camera], p, &u);
    misfit.push_back(seen ? std::abs(r.u_px - u) / row : 1.0);
  }
  return misfit.empty() ? 1.0 : Median(misfit);
}

std::string WordsOf(const Change& change) {
  constexpr const char* kAxis = "xyz";
  std::vector<std::string> words;
  if (change.unit.found) words.push_back(UnitSubject(ScaleFrom::kSurvey) + " " + change.unit.what);
  std::string order;
  for (const int a : change.from) order += kAxis[a];
  if (order == "yzx" || order == "zxy") {
    words.push_back(
        fmt::format("the columns x, y, z hold {}, {}, {}", order[0], order[1], order[2]));
  } else if (order != "xyz") {
    const std::array<const char*, 3> pairs = {"y and z", "x and z", "x and y"};
    for (std::size_t a = 0; a < 3; ++a) {
      if (change.from[a] == static_cast<int>(a)) {
        words.push_back(fmt::format("{} are exchanged", pairs[a]));
      }
    }
  }
  for (std::size_t a = 0; a < 3; ++a) {
    if (change.sign[a] < 0.0) words.push_back(fmt::format("{} has the wrong sign", kAxis[a]));
  }
  std::string out;
  for (const std::string& word : words) out += (out.empty() ? "" : ", ") + word;
  return out;
}

// Every change of coordinates but none at all, the simple ones first.
std::vector<Change> Changes() {
  std::vector<std::pair<int, Change>> all;
  std::array<int, 3> from = {0, 1, 2};
  do {
    for (int signs = 0; signs < 8; ++signs) {
      const bool as_they_stand = signs == 0 && from == std::array<int, 3>{0, 1, 2};
      for (const UnitSlip& unit : UnitsOf(as_they_stand)) {
        Change change{from, {1.0, 1.0, 1.0}, unit};
        int steps = unit.found ? 1 : 0;
        for (std::size_t a = 0; a < 3; ++a) {
          if ((signs >> a & 1) != 0) change.sign[a] = -1.0;
          steps += (signs >> a & 1) + (from[a] == static_cast<int>(a) ? 0 : 1);
        }
        if (steps > 0) all.emplace_back(steps, change);
      }
    }
  } while (std::next_permutation(from.begin(), from.end()));
  std::stable_sort(all.begin(), all.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<Change> out;
  out.reserve(all.size());
  for (const auto& [steps, change] : all) out.push_back(change);
  return out;
}

// The slip that explains most, a less simple one only where it is again plainly better.
class Slips {
 public:
  Slips(const data::Rig& rig, const Observations& data, const std::vector<std::size_t>& match)
      : rig_(rig), data_(data), match_(match) {
    const double as_written = MisfitOf([&](const Reading& r) -> std::optional<Eigen::Vector3d> {
      return Eigen::Vector3d(data_.p.col(r.point));
    });
    // Where all misfit by a row or more a twentieth of that is still no fit: every point drawn
    // together in one place lies amid the rows.
    least_ = as_written < kLeastMisfit ? 0.0 : std::min(kLeastMisfit, kPlainlyLess * as_written);
  }

  void TryCoordinates() {
    for (const Change& change : Changes()) {
      const double misfit = MisfitOf([&](const Reading& r) -> std::optional<Eigen::Vector3d> {
        return change.Of(data_.p.col(r.point));
      });
      Propose(misfit, WordsOf(change),
              change.unit.found
                  ? UnitRemedy(ScaleFrom::kSurvey, change.unit)
                  : "put the columns right: x, y, z of the frame in which the rig was surveyed, "
                    "right-handed (or name them E, N, H)");
    }
  }

  void TryRows() {
    for (const int by : {-1, 1}) {
      const double misfit = MisfitOf([&](const Reading& r) -> std::optional<Eigen::Vector3d> {
        if (r.point + by < 0 || r.point + by >= data_.points()) return std::nullopt;
        return Eigen::Vector3d(data_.p.col(r.point + by));
      });
      Propose(misfit,
              fmt::format("each point's readings belong to the point {} it",
                          by < 0 ? "before" : "after"),
              "shift the columns of the readings by one row");
    }
  }

  // Two cameras' columns: judged by their own readings.
  void TryCameras() {
    for (std::size_t a = 0; a < match_.size() && !slip_.found; ++a) {
      for (std::size_t b = a + 1; b < match_.size() && !slip_.found; ++b) {
        if (!Plainly(OwnMisfit(a, b, false), OwnMisfit(a, b, true))) continue;
        slip_ = {true,
                 fmt::format("the readings of cameras \"{}\" and \"{}\" are exchanged",
                             rig_.cameras[match_[a]].name, rig_.cameras[match_[b]].name),
                 "exchange their columns, or their names in \"# cameras:\""};
      }
    }
  }

  // One camera's row from its other end, wherever that is (decision 296): reading and prediction
  // have one sum, a row less one.
  void TryEnds() {
    for (std::size_t c = 0; c < match_.size() && !slip_.found; ++c) {
      const data::RigCamera& camera = rig_.cameras[match_[c]];
      std::vector<double> sum, off;
      for (const Reading& r : data_.readings) {
        double u = 0.0;
        if (static_cast<std::size_t>(r.camera) != c ||
            !measure::Project(camera, data_.p.col(r.point), &u)) {
          continue;
        }
        sum.push_back(r.u_px + u);
      }
      if (sum.size() <= kFewest) continue;
      const double end = Median(sum);
      off.reserve(sum.size());
      for (const double one : sum) off.push_back(std::abs(one - end) / std::max(1, camera.pixels));
      if (!Plainly(OwnMisfit(c, c, false), Median(off))) continue;
      slip_ = {true, RowSlipOf(camera.name), RowSlipRemedy(static_cast<int>(std::lround(end)) + 1)};
    }
  }

  const Slip& found() const { return slip_; }

 private:
  static bool Plainly(double before, double after) {
    return before >= kLeastMisfit && after < std::min(kLeastMisfit, kPlainlyLess * before);
  }
  // Of all readings, each at the place that `place` gives, or left aside.
  template <typename Place>
  double MisfitOf(const Place& place) const {
    return MedianMisfit(rig_, data_,
                        [&](const Reading& r, std::size_t* camera, Eigen::Vector3d* p) {
                          *camera = match_[static_cast<std::size_t>(r.camera)];
                          const std::optional<Eigen::Vector3d> at = place(r);
                          if (at) *p = *at;
                          return at.has_value();
                        });
  }
  double OwnMisfit(std::size_t a, std::size_t b, bool exchanged) const {
    return MedianMisfit(rig_, data_,
                        [&](const Reading& r, std::size_t* camera, Eigen::Vector3d* p) {
                          const auto j = static_cast<std::size_t>(r.camera);
                          if (j != a && j != b) return false;
                          *camera = match_[exchanged ? a + b - j : j];
                          *p = data_.p.col(r.point);
                          return true;
                        });
  }
  void Propose(double misfit, const std::string& what, const std::string& remedy) {
    if (!(misfit < least_)) return;
    least_ = kPlainlyLess * misfit;
    slip_ = {true, what, remedy};
  }

  const data::Rig& rig_;
  const Observations& data_;
  const std::vector<std::size_t>& match_;
  double least_ = 0.0;
  Slip slip_;
};

}  // namespace

std::string RowSlipOf(const std::string& camera) {
  return fmt::format("the row of camera \"{}\" is read from its other end", camera);
}

std::string RowSlipRemedy(int pixels) {
  return fmt::format("write {} less the reading", pixels - 1);
}

Slip FindSlip(const data::Rig& rig, const Observations& data,
              const std::vector<std::size_t>& match) {
  if (data.points() < static_cast<int>(kFewest)) return {};
  Slips slips(rig, data, match);
  slips.TryCoordinates();
  slips.TryRows();
  slips.TryCameras();
  slips.TryEnds();
  return slips.found();
}

Slip FindUnitSlip(const data::Rig& rig, ScaleFrom from) {
  const Eigen::Vector3d middle = 0.5 * (rig.volume_low + rig.volume_high);
  std::vector<double> distance;
  for (const data::RigCamera& camera : rig.cameras) {
    distance.push_back((camera.p_WC - middle).norm());
  }
  if (distance.empty()) return {};
  const double typical = Median(distance);
  if (typical <= kFarthest && typical >= kNearest) return {};
  // Of a thousand times too large or too small, which is what makes so much of a room.
  const UnitSlip slip = FindUnitSlipOf(typical > kFarthest ? 1e3 : 1e-3, kLengthsAlike);
  return {true,
          fmt::format("the cameras come out {} from the points: {} {}", LengthText(typical),
                      UnitSubject(from), slip.what),
          UnitRemedy(from, slip)};
}

Slip FindScaleSlip(const Eigen::Matrix3Xd& stated, const Eigen::Matrix3Xd& found) {
  std::vector<double> ratio;
  for (Eigen::Index i = 0; i < stated.cols(); ++i) {
    for (Eigen::Index j = 0; j < i; ++j) {
      const double own = (found.col(i) - found.col(j)).norm();
      if (own > 0.0 && std::isfinite(own)) {
        ratio.push_back((stated.col(i) - stated.col(j)).norm() / own);
      }
    }
  }
  if (ratio.size() < 3) return {};
  const double times = Median(ratio);
  const UnitSlip slip = FindUnitSlipOf(times, kLengthsAlike);
  if (!slip.found) return {};
  return {
      true,
      fmt::format("are {:.3g} times as far apart as the cameras find them: {}", times, slip.what),
      fmt::format("state the unit in their header, as \"x [{}]\"", slip.unit)};
}

}  // namespace unfurl::calib
