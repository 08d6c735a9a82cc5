#include "data/survey.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>

#include "base/error.h"
#include "base/text.h"
#include "data/atomic_file.h"
#include "data/csv.h"
#include "data/h5.h"
#include "data/line_format_io.h"
#include "data/survey_points.h"

namespace unfurl::data {

namespace {

constexpr std::array<const char*, 6> kSurveyCovariance = {"cxx", "cxy", "cxz", "cyy", "cyz", "czz"};
constexpr std::array<const char*, 3> kPosition = {"x", "y", "z"};

bool IsHdf5(const std::string& path) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored)) return false;  // a pipe is read once
  std::ifstream file(path, std::ios::binary);
  char signature[8] = {};
  file.read(signature, sizeof signature);
  return file.gcount() == 8 && std::string(signature, 8) == "\x89HDF\r\n\x1a\n";
}

// A covariance that no instrument states: not positive.
bool Possible(const Eigen::Matrix<double, 6, 1>& c) {
  const double minor = c(0) * c(3) - c(1) * c(1);
  const double det = c(0) * (c(3) * c(5) - c(4) * c(4)) - c(1) * (c(1) * c(5) - c(4) * c(2)) +
                     c(2) * (c(1) * c(4) - c(3) * c(2));
  return c(0) > 0.0 && minor > 0.0 && det > 0.0;
}

Survey ReadSurveyCsv(const std::string& path) {
  const CsvTable table = LoadSurveyTable(path);
  Survey survey;
  if (!ReadSurveyPoints(table, &survey)) {
    throw Error("states no uncertainty of its points", path,
                "add columns 'sx [m]', 'sy [m]' and 'sz [m]'");
  }
  const Eigen::Index n = survey.p.cols();
  ReadingColumns columns = FindReadingColumns(table);
  NameCameras(table, &columns);
  survey.cameras = columns.cameras;
  survey.pixels = columns.pixels;
  if (columns.u.empty()) {
    throw Error("holds no readings", path, "add columns 'u1 [px]', 's1 [px]', ...");
  }
  const Eigen::Index cameras = static_cast<Eigen::Index>(columns.u.size());
  survey.u_px.resize(n, cameras);
  survey.s_px.resize(n, cameras);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index c = 0; c < cameras; ++c) {
      const auto k = static_cast<std::size_t>(c);
      const CellReading cell = ReadReading(table, static_cast<std::size_t>(i), columns.u[k],
                                           columns.s[k], PixelsOf(columns, k));
      survey.u_px(i, c) = cell.u_px;
      survey.s_px(i, c) = cell.s_px;
    }
  }
  return survey;
}

void CheckSize(const H5Reader& file, const char* name, const std::vector<std::size_t>& expected) {
  if (file.Dims(name) == expected) return;
  file.Fail("does not have the size that the points and cameras ask for", name,
            "make the file again");
}

// A standard deviation, where the file states it.
void ReadStated(const H5Reader& file, const char* name, const char* unit, double* sigma) {
  if (!file.Has(name)) return;
  const std::vector<double> values = file.ReadDoubles(name, unit);
  if (values.size() != 1 || !std::isfinite(values[0]) || values[0] < 0.0) {
    file.Fail("is not one number of 0 or more", name, "make the file again");
  }
  *sigma = values[0];
}

void ReadLines(const H5Reader& file, Survey* survey) {
  const std::size_t n = survey->size(), cameras = survey->cameras.size();
  survey->format = ReadLineFormats(file, "/lit", cameras);
  std::vector<std::size_t> dims = LineDims(survey->format, cameras);
  dims.insert(dims.begin(), n);
  CheckSize(file, "/lit", dims);
  CheckSize(file, "/dark", dims);
  survey->lit.resize(n * survey->line_counts());
  survey->dark.resize(survey->lit.size());
  file.ReadRows("/lit", 0, n, std::span<std::uint16_t>(survey->lit));
  file.ReadRows("/dark", 0, n, std::span<std::uint16_t>(survey->dark));
  survey->response = ReadResponse(file, cameras, survey->format);
}

void ReadSetUpNames(const H5Reader& file, Survey* survey) {
  survey->set_up = file.ReadStrings("/set_up");
  if (survey->set_up.size() == survey->size() &&
      std::find(survey->set_up.begin(), survey->set_up.end(), "") == survey->set_up.end()) {
    return;
  }
  file.Fail("is not a set-up's name for each point", "/set_up", "make the file again");
}

void RefuseReadings(const H5Reader& file, const Survey& survey) {
  for (Eigen::Index i = 0; i < survey.u_px.rows(); ++i) {
    for (Eigen::Index c = 0; c < survey.u_px.cols(); ++c) {
      const double u = survey.u_px(i, c), s = survey.s_px(i, c);
      if (std::isnan(u)) continue;
      const auto k = static_cast<std::size_t>(c);
      const int pixels = survey.pixels.empty() ? 0 : survey.pixels[k];
      if (OnRow(u, pixels) && IsReadingSigma(s)) continue;
      file.Fail(
          fmt::format("camera '{}' reads {} +- {} px of point '{}', which {}", survey.cameras[k], u,
                      s, survey.id[static_cast<std::size_t>(i)],
                      OnRow(u, pixels) ? "no reading is known to" : "is on no pixel of its row"),
          "/u", "mend the reading, or make it NaN");
    }
  }
}

Survey ReadSurveyH5(const std::string& path) {
  const H5Reader file(path, kSurveySchema, kSurveyVersion);
  Survey survey;
  survey.id = file.ReadStrings("/id");
  survey.cameras = file.ReadStrings("/cameras");
  const std::size_t n = survey.size();
  const std::size_t cameras = survey.cameras.size();
  CheckSize(file, "/p", {n, 3});
  CheckSize(file, "/cov", {n, 6});
  survey.p = file.ReadMatrix("/p", "m").transpose();
  survey.cov = file.ReadMatrix("/cov", "m^2").transpose();
  if (file.Has("/set_up")) ReadSetUpNames(file, &survey);
  if (!survey.p.allFinite()) file.Fail("holds a number that is not finite", "/p", "mend the point");
  for (Eigen::Index i = 0; i < survey.cov.cols(); ++i) {
    if (!survey.cov.col(i).allFinite() || !Possible(survey.cov.col(i))) {
      file.Fail(fmt::format("the covariance of point '{}' is not positive definite",
                            survey.id[static_cast<std::size_t>(i)]),
                "/cov", "mend the point");
    }
  }
  if (file.Has("/station")) {
    const std::vector<double> station = file.ReadDoubles("/station", "m");
    if (station.size() != 3) file.Fail("is not three numbers", "/station", "make the file again");
    survey.station = Eigen::Vector3d::Map(station.data());
  }
  ReadStated(file, "/station_errors/distance_offset", "m", &survey.station_errors.distance_offset);
  ReadStated(file, "/station_errors/distance_scale", "1", &survey.station_errors.distance_scale);
  ReadStated(file, "/station_errors/zenith", "rad", &survey.station_errors.zenith);
  if (file.Has("/u")) {
    CheckSize(file, "/u", {n, cameras});
    CheckSize(file, "/s", {n, cameras});
    survey.u_px = file.ReadMatrix("/u", "px");
    survey.s_px = file.ReadMatrix("/s", "px");
  }
  if (file.Has("/lit")) ReadLines(file, &survey);
  // Of lines their layout says it; of readings, files before version 2 did not.
  if (file.Has("/pixels")) {
    for (const std::int32_t pixels : file.ReadInts("/pixels")) survey.pixels.push_back(pixels);
    if (survey.pixels.size() != cameras ||
        *std::min_element(survey.pixels.begin(), survey.pixels.end()) < 0) {
      file.Fail("is not a number of pixels for each camera", "/pixels", "make the file again");
    }
  }
  RefuseReadings(file, survey);
  if (survey.u_px.size() == 0 && survey.lit.empty()) {
    file.Fail("holds neither readings nor lines", "/u", "make the file again");
  }
  return survey;
}

}  // namespace

bool IsSurveyH5(const std::string& path) { return IsHdf5(path); }

Survey ReadSurvey(const std::string& path) {
  return IsHdf5(path) ? ReadSurveyH5(path) : ReadSurveyCsv(path);
}

Survey ReadPointsCsv(const std::string& path) {
  Survey survey;
  ReadSurveyPoints(LoadSurveyTable(path), &survey);
  return survey;
}

void WriteSurvey(const std::string& path, const Survey& survey, const Provenance& provenance) {
  // A reader that knows nothing of set-ups refuses a file with some, and reads any other.
  const int version = survey.set_up.empty() ? kSurveyVersion - 1 : kSurveyVersion;
  H5Writer file(path, kSurveySchema, version, provenance);
  file.Write({"/id", "1", "points' ids"}, survey.id);
  if (!survey.set_up.empty()) {
    file.Write({"/set_up", "1", "set-up of the station that measured it", {"/id"}}, survey.set_up);
  }
  file.Write({"/cameras", "1", "cameras' names"}, survey.cameras);
  if (!survey.pixels.empty()) {
    file.Write({"/pixels", "1", "of each camera's row; 0: not stated", {"/cameras"}},
               std::vector<std::int32_t>(survey.pixels.begin(), survey.pixels.end()));
  }
  WriteAxisNames(file);
  WriteComponentNames(file);
  file.Write({"/p", "m", "x, y, z in the station's frame", {"/id", kAxisNames}},
             survey.p.transpose());
  file.Write({"/cov", "m^2", "covariance: xx, xy, xz, yy, yz, zz", {"/id", kComponentNames}},
             survey.cov.transpose());
  if (survey.station.allFinite()) {
    file.Write({"/station", "m", "where the total station stood", {kAxisNames}},
               std::vector<double>(survey.station.data(), survey.station.data() + 3));
  }
  const auto stated = [&](const char* name, const char* unit, const char* what, double sigma) {
    if (sigma > 0.0) file.Write({name, unit, what}, std::vector<double>{sigma});
  };
  const StationErrors& errors = survey.station_errors;
  stated("/station_errors/distance_offset", "m", "sigma, common to all points",
         errors.distance_offset);
  stated("/station_errors/distance_scale", "1", "sigma, common to all points",
         errors.distance_scale);
  stated("/station_errors/zenith", "rad", "sigma of the vertical circle's index", errors.zenith);
  if (survey.u_px.size() > 0) {
    file.Write({"/u", "px", "readings, point x camera; NaN: not seen", {"/id", "/cameras"}},
               survey.u_px);
    file.Write({"/s", "px", "their standard deviations", {"/id", "/cameras"}}, survey.s_px);
  }
  if (survey.has_lines()) {
    const std::vector<std::size_t> row = LineDims(survey.format, survey.cameras.size());
    H5Series lit = file.Series({"/lit", "count", "LED lit: point x camera x element"},
                               H5Type::kUint16, row, 16, 1);
    H5Series dark = file.Series({"/dark", "count", "LED dark: point x camera x element"},
                                H5Type::kUint16, row, 16, 1);
    lit.Append(std::span<const std::uint16_t>(survey.lit));
    dark.Append(std::span<const std::uint16_t>(survey.dark));
    WriteLineFormats(file, "/lit", survey.format);
    WriteResponse(file, survey.response, survey.cameras.size(), survey.format);
  }
  file.Commit();
}

namespace {

// What is true of all points: cameras, their pixels, the station and its common errors.
void WriteComments(const Survey& survey, CsvWriter* writer) {
  writer->Comment(fmt::format("cameras: {}", fmt::join(survey.cameras, ", ")));
  if (survey.has_lines() || !survey.pixels.empty()) {
    std::vector<int> pixels = survey.pixels;
    for (std::size_t c = 0; survey.has_lines() && c < survey.cameras.size(); ++c) {
      pixels.resize(survey.cameras.size());
      pixels[c] = survey.format.Of(c).active;
    }
    writer->Comment(fmt::format("pixels: {}", fmt::join(pixels, ", ")));
  }
  if (survey.station.allFinite()) {
    writer->Comment(fmt::format("station: {}, {}, {}", survey.station.x(), survey.station.y(),
                                survey.station.z()));
  }
  const StationErrors& errors = survey.station_errors;
  if (errors.distance_offset > 0.0 || errors.distance_scale > 0.0) {
    writer->Comment(
        fmt::format("distance error: {}, {}", errors.distance_offset, errors.distance_scale));
  }
  if (errors.zenith > 0.0) writer->Comment(fmt::format("zenith error: {}", errors.zenith));
}

}  // namespace

void WriteSurveyCsv(const std::string& path, const Survey& survey) {
  if (survey.u_px.size() == 0) {
    throw Error("holds raw lines, which a CSV cannot", path,
                "write HDF5, or find the readings first");
  }
  std::vector<CsvColumn> columns = {{"id", ""}};
  if (!survey.set_up.empty()) columns.push_back({"set_up", ""});
  for (const char* name : kPosition) columns.push_back({name, "m"});
  for (const char* name : kSurveyCovariance) columns.push_back({name, "m^2"});
  for (std::size_t c = 1; c <= survey.cameras.size(); ++c) {
    columns.push_back({fmt::format("u{}", c), "px"});
    columns.push_back({fmt::format("s{}", c), "px"});
  }
  CsvWriter writer(columns);
  WriteComments(survey, &writer);
  const auto cell = [](double v) { return std::isnan(v) ? std::string() : fmt::format("{}", v); };
  for (Eigen::Index i = 0; i < survey.p.cols(); ++i) {
    std::vector<std::string> cells = {survey.id[static_cast<std::size_t>(i)]};
    if (!survey.set_up.empty()) cells.push_back(survey.set_up[static_cast<std::size_t>(i)]);
    for (Eigen::Index k = 0; k < 3; ++k) cells.push_back(cell(survey.p(k, i)));
    for (Eigen::Index k = 0; k < 6; ++k) cells.push_back(cell(survey.cov(k, i)));
    for (Eigen::Index c = 0; c < survey.u_px.cols(); ++c) {
      cells.push_back(cell(survey.u_px(i, c)));
      cells.push_back(cell(survey.s_px(i, c)));
    }
    writer.Row(cells);
  }
  WriteTextFile(path, writer.text());
}

}  // namespace unfurl::data
