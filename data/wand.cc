#include "data/wand.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <utility>

#include "base/error.h"
#include "data/atomic_file.h"
#include "data/csv.h"
#include "data/h5.h"
#include "data/survey.h"
#include "data/survey_points.h"

namespace unfurl::data {
namespace {

constexpr double kWandNone = std::numeric_limits<double>::quiet_NaN();

// Columns that say which flash a row is of.
struct FlashColumns {
  int id = -1, pose = -1, mark = -1, time = -1;
};

FlashColumns FindFlashColumns(const CsvTable& table) {
  FlashColumns out;
  if (table.Find("pose") >= 0 || table.Find("id") < 0) {
    out.pose = table.Require("pose", "");
    out.mark = table.Require("mark", "");
  } else {
    out.id = table.Require("id", "");
  }
  if (table.Find("time") >= 0) out.time = table.Require("time", "s");
  return out;
}

struct Flash {
  std::string pose, mark;
  double time = 0.0;
  auto operator<=>(const Flash&) const = default;
};

Flash FlashOf(const CsvTable& table, std::size_t row, const FlashColumns& columns) {
  Flash out;
  if (columns.id >= 0) {
    const std::string id = table.Text(row, columns.id);
    if (id.size() < 2) {
      throw Error(fmt::format("'{}' is not a pose and a mark", id), table.Where(row, columns.id),
                  "give ids as 12a: mark a of pose 12, or columns 'pose' and 'mark'");
    }
    out.pose = id.substr(0, id.size() - 1);
    out.mark = id.substr(id.size() - 1);
  } else {
    out.pose = table.Text(row, columns.pose);
    out.mark = table.Text(row, columns.mark);
    if (out.pose.empty() || out.mark.empty()) {
      throw Error("a flash without its pose or its mark", table.Where(row, columns.pose),
                  "name both");
    }
  }
  if (columns.time >= 0) out.time = table.Number(row, columns.time);
  return out;
}

void AddFlash(const Flash& flash, bool timed, WandReadings* out) {
  out->pose.push_back(flash.pose);
  out->mark.push_back(flash.mark);
  if (timed) out->time.push_back(flash.time);
}

// A row for each flash.
WandReadings ReadWide(const CsvTable& table, const FlashColumns& flashes) {
  WandReadings out;
  ReadingColumns columns = FindReadingColumns(table);
  if (columns.u.empty()) {
    throw Error("holds no readings", table.path(),
                "add columns 'u1 [px]', 's1 [px]', ..., or 'camera', 'u [px]', 's [px]'");
  }
  NameCameras(table, &columns);
  out.cameras = columns.cameras;
  out.pixels = columns.pixels;
  const auto n = static_cast<Eigen::Index>(table.rows());
  const auto c = static_cast<Eigen::Index>(columns.u.size());
  out.u_px.resize(n, c);
  out.s_px.resize(n, c);
  std::map<Flash, std::size_t> seen;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const Flash flash = FlashOf(table, row, flashes);
    if (!seen.insert({flash, row}).second) {
      throw Error(fmt::format("mark '{}' of pose '{}' comes twice", flash.mark, flash.pose),
                  table.Where(row, flashes.id >= 0 ? flashes.id : flashes.pose),
                  "give each flash one row");
    }
    AddFlash(flash, flashes.time >= 0, &out);
    for (Eigen::Index j = 0; j < c; ++j) {
      const auto k = static_cast<std::size_t>(j);
      const CellReading cell =
          ReadReading(table, row, columns.u[k], columns.s[k], PixelsOf(columns, k));
      out.u_px(static_cast<Eigen::Index>(row), j) = cell.u_px;
      out.s_px(static_cast<Eigen::Index>(row), j) = cell.s_px;
    }
  }
  return out;
}

// A row for each reading.
WandReadings ReadLong(const CsvTable& table, const FlashColumns& flashes) {
  WandReadings out;
  const int camera = table.Require("camera", "");
  const int u = table.Require("u", "px"), s = table.Require("s", "px");
  std::map<Flash, Eigen::Index> number;
  std::map<std::pair<Eigen::Index, Eigen::Index>, CellReading> cells;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const Flash flash = FlashOf(table, row, flashes);
    const auto [at, fresh] = number.insert({flash, static_cast<Eigen::Index>(number.size())});
    if (fresh) AddFlash(flash, flashes.time >= 0, &out);
    const std::string name = table.Text(row, camera);
    const auto known = std::find(out.cameras.begin(), out.cameras.end(), name);
    const auto j = known - out.cameras.begin();
    if (known == out.cameras.end()) out.cameras.push_back(name);
    const CellReading cell = ReadReading(table, row, u, s);
    if (std::isnan(cell.u_px)) continue;
    if (!cells.insert({{at->second, j}, cell}).second) {
      throw Error(fmt::format("camera '{}' has two readings of mark '{}' in pose '{}'", name,
                              flash.mark, flash.pose),
                  table.Where(row, u), "give each flash one reading of each camera");
    }
  }
  const auto n = static_cast<Eigen::Index>(out.size());
  const auto c = static_cast<Eigen::Index>(out.cameras.size());
  out.u_px.setConstant(n, c, kWandNone);
  out.s_px.setConstant(n, c, kWandNone);
  for (const auto& [at, cell] : cells) {
    out.u_px(at.first, at.second) = cell.u_px;
    out.s_px(at.first, at.second) = cell.s_px;
  }
  out.pixels = ReadPixels(table, out.cameras.size());
  return out;
}

void RefuseSizes(const H5Reader& file, const WandReadings& wand) {
  const auto n = static_cast<Eigen::Index>(wand.size());
  const auto c = static_cast<Eigen::Index>(wand.cameras.size());
  const auto matrix = [&](const Eigen::MatrixXd& m) { return m.rows() == n && m.cols() == c; };
  const auto refuse = [&](bool whole, const char* name) {
    if (whole) return;
    file.Fail("does not have the size that the flashes and cameras ask for", name,
              "make the file again");
  };
  refuse(wand.mark.size() == wand.size(), "/mark");
  refuse(wand.time.empty() || wand.time.size() == wand.size(), "/time");
  refuse(wand.pixels.empty() || wand.pixels.size() == wand.cameras.size(), "/pixels");
  refuse(matrix(wand.u_px), "/u");
  refuse(matrix(wand.s_px), "/s");
}

void RefuseNumbers(const H5Reader& file, const WandReadings& wand) {
  for (std::size_t i = 0; i < wand.time.size(); ++i) {
    if (std::isfinite(wand.time[i])) continue;
    file.Fail(fmt::format("flash {} is at {} s", i + 1, wand.time[i]), "/time",
              "give each flash its time, or leave /time out where the bar stood still");
  }
  for (Eigen::Index i = 0; i < wand.u_px.rows(); ++i) {
    for (Eigen::Index j = 0; j < wand.u_px.cols(); ++j) {
      const double u = wand.u_px(i, j), s = wand.s_px(i, j);
      if (std::isnan(u) && std::isnan(s)) continue;
      if (std::isfinite(u) && IsReadingSigma(s)) continue;
      file.Fail(fmt::format("flash {}, camera '{}': reading {} px with sigma {} px", i + 1,
                            wand.cameras[static_cast<std::size_t>(j)], u, s),
                "/s", "give each reading its standard deviation in pixels, or NaN for both");
    }
  }
}

void RefuseRepeated(const H5Reader& file, const WandReadings& wand) {
  std::set<Flash> seen;
  for (std::size_t i = 0; i < wand.size(); ++i) {
    const double time = wand.time.empty() ? 0.0 : wand.time[i];
    if (seen.insert({wand.pose[i], wand.mark[i], time}).second) continue;
    file.Fail(fmt::format("mark '{}' of pose '{}' comes twice", wand.mark[i], wand.pose[i]),
              "/pose", "make each round of flashes a pose of its own");
  }
}

WandReadings ReadWandH5(const std::string& path) {
  const H5Reader file(path, kWandSchema, kWandVersion);
  WandReadings out;
  out.pose = file.ReadStrings("/pose");
  out.mark = file.ReadStrings("/mark");
  out.cameras = file.ReadStrings("/cameras");
  if (file.Has("/time")) out.time = file.ReadDoubles("/time", "s");
  if (file.Has("/pixels")) {
    for (const std::int32_t pixels : file.ReadInts("/pixels")) out.pixels.push_back(pixels);
  }
  out.u_px = file.ReadMatrix("/u", "px");
  out.s_px = file.ReadMatrix("/s", "px");
  RefuseSizes(file, out);
  RefuseNumbers(file, out);
  RefuseRepeated(file, out);
  return out;
}

}  // namespace

WandReadings ReadWand(const std::string& path) {
  WandReadings out;
  if (IsSurveyH5(path)) {
    out = ReadWandH5(path);
  } else {
    const CsvTable table = CsvTable::Load(path);
    const FlashColumns flashes = FindFlashColumns(table);
    out = table.Find("camera") >= 0 ? ReadLong(table, flashes) : ReadWide(table, flashes);
  }
  if (out.size() == 0) throw Error("holds no flashes", path, "add rows below the header");
  return out;
}

void WriteWand(const std::string& path, const WandReadings& wand, const Provenance& provenance) {
  H5Writer file(path, kWandSchema, kWandVersion, provenance);
  file.Write({"/pose", "1", "of each flash, the bar's pose"}, wand.pose);
  file.Write({"/mark", "1", "of each flash, the mark"}, wand.mark);
  file.Write({"/cameras", "1", "cameras' names"}, wand.cameras);
  if (!wand.time.empty()) {
    file.Write({"/time", "s", "of each flash, its middle", {"/pose"}}, wand.time);
  }
  if (!wand.pixels.empty()) {
    file.Write({"/pixels", "1", "of each camera's row; 0: not stated", {"/cameras"}},
               std::vector<std::int32_t>(wand.pixels.begin(), wand.pixels.end()));
  }
  file.Write({"/u", "px", "readings, flash x camera; NaN: not seen", {"/pose", "/cameras"}},
             wand.u_px);
  file.Write({"/s", "px", "their standard deviations", {"/pose", "/cameras"}}, wand.s_px);
  file.Commit();
}

void WriteWandCsv(const std::string& path, const WandReadings& wand) {
  std::vector<CsvColumn> columns = {{"pose", ""}, {"mark", ""}};
  if (!wand.time.empty()) columns.push_back({"time", "s"});
  std::string names, pixels;
  for (std::size_t j = 0; j < wand.cameras.size(); ++j) {
    columns.push_back({fmt::format("u{}", j + 1), "px"});
    columns.push_back({fmt::format("s{}", j + 1), "px"});
    names += (j > 0 ? ", " : "") + wand.cameras[j];
    if (!wand.pixels.empty()) pixels += fmt::format("{}{}", j > 0 ? ", " : "", wand.pixels[j]);
  }
  CsvWriter writer(columns);
  writer.Comment("cameras: " + names);
  if (!pixels.empty()) writer.Comment("pixels: " + pixels);
  const auto cell = [](double value) {
    return std::isnan(value) ? std::string() : fmt::format("{}", value);
  };
  for (std::size_t i = 0; i < wand.size(); ++i) {
    std::vector<std::string> cells = {wand.pose[i], wand.mark[i]};
    if (!wand.time.empty()) cells.push_back(fmt::format("{}", wand.time[i]));
    for (Eigen::Index j = 0; j < wand.u_px.cols(); ++j) {
      cells.push_back(cell(wand.u_px(static_cast<Eigen::Index>(i), j)));
      cells.push_back(cell(wand.s_px(static_cast<Eigen::Index>(i), j)));
    }
    writer.Row(cells);
  }
  WriteTextFile(path, writer.text());
}

}  // namespace unfurl::data
