#include "calib/wand_data.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <set>

#include "base/error.h"
#include "base/length.h"
#include "base/text.h"
#include "calib/copies.h"

namespace unfurl::calib {
namespace {

// Survey readings by the wand's cameras.
Observations PointsOf(const data::Survey& survey, const std::vector<std::string>& cameras,
                      const std::string& where) {
  Observations out = FromSurvey(survey, where);
  if (!out.set_ups.empty()) {
    throw Error(
        fmt::format("names {} set-ups, and the frame of a bar is one's", out.set_ups.size()),
        where + ":set_up", "give the points of one set-up, or leave the column out");
  }
  std::vector<int> number;
  for (const std::string& name : out.cameras) {
    const auto found = std::find(cameras.begin(), cameras.end(), name);
    if (found == cameras.end()) {
      throw Error(fmt::format("camera \"{}\" of the points has no readings of the bar", name),
                  where, "use the same names for the cameras in both files");
    }
    number.push_back(static_cast<int>(found - cameras.begin()));
  }
  for (Reading& r : out.readings) r.camera = number[static_cast<std::size_t>(r.camera)];
  std::stable_sort(out.readings.begin(), out.readings.end(),
                   [](const Reading& a, const Reading& b) {
                     return a.point != b.point ? a.point < b.point : a.camera < b.camera;
                   });
  std::vector<int> pixels(cameras.size(), 0);
  std::vector<double> pitch(cameras.size(), 0.0);
  for (std::size_t j = 0; j < number.size(); ++j) {
    const auto to = static_cast<std::size_t>(number[j]);
    if (j < out.pixels.size()) pixels[to] = out.pixels[j];
    if (j < out.pitch.size()) pitch[to] = out.pitch[j];
  }
  out.cameras = cameras;
  out.pixels = pixels;
  out.pitch = pitch;
  return out;
}

// A flash's pose and mark by number.
struct Numbered {
  std::vector<std::string> poses, marks;
  std::vector<int> pose, mark;
};
Numbered Number(const data::WandReadings& readings) {
  Numbered out;
  std::map<std::string, int> pose;
  for (const std::string& name : readings.pose) {
    const auto [at, fresh] = pose.insert({name, static_cast<int>(out.poses.size())});
    if (fresh) out.poses.push_back(name);
    out.pose.push_back(at->second);
  }
  const std::set<std::string> marks(readings.mark.begin(), readings.mark.end());
  out.marks.assign(marks.begin(), marks.end());
  for (const std::string& name : readings.mark) {
    out.mark.push_back(static_cast<int>(std::distance(marks.begin(), marks.find(name))));
  }
  return out;
}

// Of each pose, in the order of the file: when its flashes are, and its number in the order of
// time.
struct PoseTimes {
  std::vector<double> mean, first, last;  // [s]
  std::vector<int> number;
};
PoseTimes TimesOf(const data::WandReadings& readings, const Numbered& flash) {
  const std::size_t poses = flash.poses.size();
  PoseTimes out{std::vector<double>(poses, 0.0),
                std::vector<double>(poses, INFINITY),
                std::vector<double>(poses, -INFINITY),
                {}};
  std::vector<double> count(poses, 0.0);
  for (std::size_t f = 0; f < readings.time.size(); ++f) {
    const auto k = static_cast<std::size_t>(flash.pose[f]);
    out.mean[k] += readings.time[f];
    count[k] += 1.0;
    out.first[k] = std::min(out.first[k], readings.time[f]);
    out.last[k] = std::max(out.last[k], readings.time[f]);
  }
  for (std::size_t k = 0; k < poses; ++k) out.mean[k] /= std::max(1.0, count[k]);
  return out;
}

// A column that somebody filled with one number is no time.
void RefuseOneTime(const PoseTimes& times, const std::string& where) {
  if (times.first.size() < 2) return;
  const auto [least, any] = std::minmax_element(times.first.begin(), times.first.end());
  const double last = *std::max_element(times.last.begin(), times.last.end());
  if (!(*least == *any && last == *least) || !std::isfinite(last)) return;
  throw Error(fmt::format("all flashes have the same time, {} s", last), where,
              "give each its own; or leave the column out, if the bar stood still in every pose");
}

// Puts the poses in the order of time, where one is stated.
PoseTimes OrderPoses(const data::WandReadings& readings, const Numbered& flash,
                     const std::string& where, WandData* out) {
  PoseTimes times = TimesOf(readings, flash);
  const std::size_t poses = flash.poses.size();
  RefuseOneTime(times, where);
  std::vector<std::size_t> order(poses);
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return times.mean[a] < times.mean[b]; });
  times.number.resize(poses);
  for (std::size_t k = 0; k < poses; ++k) {
    times.number[order[k]] = static_cast<int>(k);
    out->poses.push_back(flash.poses[order[k]]);
    out->time.push_back(times.mean[order[k]]);
    const bool timed = !readings.time.empty() && k > 0;
    if (!timed || times.first[order[k]] > times.last[order[k - 1]]) continue;
    throw Error(fmt::format("poses \"{}\" and \"{}\" overlap in time", flash.poses[order[k - 1]],
                            flash.poses[order[k]]),
                where, "give the flashes of one round one pose, and the next round another");
  }
  return times;
}

void AddReadings(const data::WandReadings& readings, const Numbered& flash, const PoseTimes& times,
                 WandData* out) {
  for (std::size_t f = 0; f < readings.size(); ++f) {
    const auto k = static_cast<std::size_t>(flash.pose[f]);
    const bool still = readings.time.empty() || times.first[k] == times.last[k];
    const double after = still ? 0.0 : readings.time[f] - times.mean[k];
    const auto row = static_cast<Eigen::Index>(f);
    for (Eigen::Index j = 0; j < readings.u_px.cols(); ++j) {
      if (std::isnan(readings.u_px(row, j))) continue;
      out->readings.push_back({times.number[k], flash.mark[f], static_cast<int>(j),
                               readings.u_px(row, j), readings.s_px(row, j), after});
    }
  }
  std::stable_sort(out->readings.begin(), out->readings.end(),
                   [](const WandReading& a, const WandReading& b) {
                     if (a.pose != b.pose) return a.pose < b.pose;
                     return a.mark != b.mark ? a.mark < b.mark : a.camera < b.camera;
                   });
}

void RefuseRepeated(const WandData& data, const std::string& where) {
  for (std::size_t k = 1; k < data.readings.size(); ++k) {
    const WandReading &a = data.readings[k - 1], &b = data.readings[k];
    if (a.pose != b.pose || a.mark != b.mark || a.camera != b.camera) continue;
    throw Error(fmt::format("camera \"{}\" has two readings of mark \"{}\" in pose \"{}\"",
                            data.cameras[static_cast<std::size_t>(a.camera)],
                            data.marks[static_cast<std::size_t>(a.mark)],
                            data.poses[static_cast<std::size_t>(a.pose)]),
                where, "make each round of flashes a pose of its own");
  }
}

// Of each pose mark, camera and reading in turn.
MeasuredRows PoseRows(const WandData& data) {
  MeasuredRows out{"pose", "the readings", data.poses, {}, kFewestOfABar};
  out.rows.resize(data.poses.size());
  for (const WandReading& r : data.readings) {
    std::vector<double>& of = out.rows[static_cast<std::size_t>(r.pose)];
    of.insert(of.end(), {static_cast<double>(r.mark), static_cast<double>(r.camera), r.u_px});
  }
  return out;
}

}  // namespace

WandBar ParseBar(const std::string& text, const std::string& where) {
  const auto refuse = [&](const std::string& what) {
    throw Error(what, where,
                "give the length and how well it is known, as 0.7501m+-0.1mm; of more than two "
                "marks the distances from the first, as 0.25m,0.75m+-0.1mm");
  };
  std::string plain = text;
  for (const std::string sign : {"+/-", "\u00b1"}) {
    const std::size_t at = plain.find(sign);
    if (at != std::string::npos) plain.replace(at, sign.size(), "+-");
  }
  const std::size_t at = plain.find("+-");
  if (at == std::string::npos) refuse(fmt::format("'{}' does not say how well it is known", text));
  WandBar out;
  if (!ParseLength(Trim(plain.substr(at + 2)), &out.sigma) || !(out.sigma > 0.0)) {
    refuse(fmt::format("'{}' is no standard deviation", plain.substr(at + 2)));
  }
  for (const std::string& part : Split(plain.substr(0, at), ',')) {
    double place = 0.0;
    if (!ParseLength(Trim(part), &place) || place == 0.0 || !std::isfinite(place)) {
      refuse(fmt::format("'{}' is no length", part));
    }
    if (!(out.sigma < std::abs(place))) refuse("the bar is known no better than its length");
    out.places.push_back(place);
  }
  return out;
}

WandData MakeWandData(const data::WandReadings& readings, const WandBar& bar,
                      const data::Survey* points, const std::string& where,
                      const std::string& points_where) {
  const Numbered flash = Number(readings);
  if (flash.marks.size() != bar.places.size() + 1) {
    throw Error(fmt::format("holds {} marks ({}), but the bar has {}", flash.marks.size(),
                            JoinWords(flash.marks), bar.places.size() + 1),
                where, "give --bar one distance for each mark but the first");
  }
  WandData out;
  out.cameras = readings.cameras;
  out.pixels = readings.pixels;
  out.marks = flash.marks;
  out.place.setZero(static_cast<Eigen::Index>(flash.marks.size()));
  for (std::size_t m = 0; m < bar.places.size(); ++m) {
    out.place(static_cast<Eigen::Index>(m) + 1) = bar.places[m];
  }
  out.place_sigma = bar.sigma;
  AddReadings(readings, flash, OrderPoses(readings, flash, where, &out), &out);
  RefuseRepeated(out, where);
  RefuseCopiedRows(PoseRows(out), where);
  if (points != nullptr) out.points = PointsOf(*points, out.cameras, points_where);
  return out;
}

bool WandData::Moves() const {
  return std::any_of(readings.begin(), readings.end(),
                     [](const WandReading& r) { return r.after != 0.0; });
}

Observations AsPoints(const WandData& data, double spread) {
  Observations out;
  out.cameras = data.cameras;
  out.pixels = data.pixels;
  out.pitch = data.pitch;
  const int marks = data.mark_count(), points = marks * data.pose_count();
  out.p.setZero(3, points);
  out.cov.assign(static_cast<std::size_t>(points), spread * spread * Eigen::Matrix3d::Identity());
  for (const std::string& pose : data.poses) {
    for (const std::string& mark : data.marks) out.ids.push_back(pose + mark);
  }
  for (const WandReading& r : data.readings) {
    out.readings.push_back({r.pose * marks + r.mark, r.camera, r.u_px, r.s_px});
  }
  return out;
}

WandData AtPoseTimes(const WandData& data) {
  WandData out = data;
  // Readings of each camera and mark, in the order of poses.
  std::vector<std::vector<std::size_t>> of(data.cameras.size() * data.marks.size());
  for (std::size_t k = 0; k < data.readings.size(); ++k) {
    const WandReading& r = data.readings[k];
    of[static_cast<std::size_t>(r.camera) * data.marks.size() + static_cast<std::size_t>(r.mark)]
        .push_back(k);
  }
  const auto at = [&](std::size_t k) {
    const WandReading& r = data.readings[k];
    return data.time[static_cast<std::size_t>(r.pose)] + r.after;
  };
  for (const std::vector<std::size_t>& series : of) {
    for (std::size_t i = 0; i < series.size(); ++i) {
      const std::size_t before = series[i == 0 ? i : i - 1];
      const std::size_t after = series[i + 1 == series.size() ? i : i + 1];
      const double span = at(after) - at(before);
      if (!(span > 0.0)) continue;
      const double slope = (data.readings[after].u_px - data.readings[before].u_px) / span;
      out.readings[series[i]].u_px -= slope * data.readings[series[i]].after;
    }
  }
  for (WandReading& r : out.readings) r.after = 0.0;
  return out;
}

WandData SelectPoses(const WandData& all, const std::vector<int>& keep) {
  WandData out = all;
  out.poses.clear();
  out.time.clear();
  out.readings.clear();
  std::vector<int> renumbered(all.poses.size(), -1);
  for (const int k : keep) {
    renumbered[static_cast<std::size_t>(k)] = out.pose_count();
    out.poses.push_back(all.poses[static_cast<std::size_t>(k)]);
    out.time.push_back(all.time[static_cast<std::size_t>(k)]);
  }
  for (WandReading r : all.readings) {
    r.pose = renumbered[static_cast<std::size_t>(r.pose)];
    if (r.pose >= 0) out.readings.push_back(r);
  }
  return out;
}

}  // namespace unfurl::calib
