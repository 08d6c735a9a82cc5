#include "data/survey.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <fstream>
#include <set>

#include "base/error.h"
#include "base/text.h"
#include "data/atomic_file.h"
#include "data/csv.h"
#include "data/h5.h"
#include "data/line_format_io.h"

namespace unfurl::data {

namespace {

constexpr std::array<const char*, 6> kCovariance = {"cxx", "cxy", "cxz", "cyy", "cyz", "czz"};
constexpr std::array<const char*, 3> kSigma = {"sx", "sy", "sz"};
constexpr std::array<const char*, 3> kPosition = {"x", "y", "z"};

bool IsHdf5(const std::string& path) {
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

// id, x, y, z, and the covariance in either form where it is there.
bool ReadPoints(const CsvTable& table, Survey* survey) {
  const std::size_t n = table.rows();
  if (n == 0) {
    throw Error("holds no point", table.path(), "give one line per surveyed point");
  }
  const Eigen::Index count = static_cast<Eigen::Index>(n);
  const int id = table.Require("id", "");
  std::array<int, 3> xyz, sigma;
  std::array<int, 6> cov;
  for (std::size_t k = 0; k < 3; ++k) xyz[k] = table.Require(kPosition[k], "m");
  const bool has_sigma = table.Find("sx") >= 0;
  const bool has_cov = table.Find("cxx") >= 0;
  if (has_sigma && has_cov) {
    throw Error("states both sigmas and covariances", table.path(), "leave one of them out");
  }
  for (std::size_t k = 0; has_sigma && k < 3; ++k) sigma[k] = table.Require(kSigma[k], "m");
  for (std::size_t k = 0; has_cov && k < 6; ++k) cov[k] = table.Require(kCovariance[k], "m^2");

  survey->p.resize(3, count);
  survey->cov.setZero(6, count);
  std::set<std::string> seen;
  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::Index col = static_cast<Eigen::Index>(i);
    survey->id.push_back(table.Text(i, id));
    if (survey->id.back().empty() || !seen.insert(survey->id.back()).second) {
      throw Error(fmt::format("the id '{}' is {}", survey->id.back(),
                              survey->id.back().empty() ? "empty" : "there twice"),
                  table.Where(i, id), "give each point an id of its own");
    }
    for (std::size_t k = 0; k < 3; ++k) {
      survey->p(static_cast<Eigen::Index>(k), col) = table.Number(i, xyz[k]);
    }
    for (std::size_t k = 0; has_sigma && k < 3; ++k) {
      const double s = table.Number(i, sigma[k]);
      if (s <= 0.0) {
        throw Error(fmt::format("a sigma of {} is impossible", s), table.Where(i, sigma[k]),
                    "give a standard deviation above 0");
      }
      constexpr std::array<Eigen::Index, 3> kDiagonal = {0, 3, 5};
      survey->cov(kDiagonal[k], col) = s * s;
    }
    for (std::size_t k = 0; has_cov && k < 6; ++k) {
      survey->cov(static_cast<Eigen::Index>(k), col) = table.Number(i, cov[k]);
    }
    if (has_cov && !Possible(survey->cov.col(col))) {
      throw Error("the covariance is not positive definite", table.Where(i, cov[0]),
                  "correct the line");
    }
  }
  return has_sigma || has_cov;
}

Survey ReadCsv(const std::string& path) {
  const CsvTable table = CsvTable::Load(path);
  Survey survey;
  if (!ReadPoints(table, &survey)) {
    throw Error("states no uncertainty of its points", path,
                "add columns 'sx [m]', 'sy [m]' and 'sz [m]'");
  }
  const Eigen::Index n = survey.p.cols();
  std::vector<int> u, s;
  for (int c = 1; table.Find(fmt::format("u{}", c)) >= 0; ++c) {
    u.push_back(table.Require(fmt::format("u{}", c), "px"));
    s.push_back(table.Require(fmt::format("s{}", c), "px"));
    survey.cameras.push_back(fmt::format("camera{}", c));
  }
  // "# cameras: a, b" names them; without it they are numbered.
  for (const std::string& comment : table.comments()) {
    if (!comment.starts_with("cameras:")) continue;
    std::vector<std::string> names;
    for (const std::string& name : Split(comment.substr(8), ',')) names.emplace_back(Trim(name));
    if (names.size() != u.size()) {
      throw Error(fmt::format("names {} cameras, but holds readings of {}", names.size(), u.size()),
                  path, "name as many as there are columns u1, u2, ...");
    }
    survey.cameras = names;
  }
  if (u.empty()) {
    throw Error("holds no readings", path, "add columns 'u1 [px]', 's1 [px]', ...");
  }
  const Eigen::Index cameras = static_cast<Eigen::Index>(u.size());
  survey.u_px.resize(n, cameras);
  survey.s_px.resize(n, cameras);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index c = 0; c < cameras; ++c) {
      const std::size_t row = static_cast<std::size_t>(i);
      const int u_column = u[static_cast<std::size_t>(c)];
      const int s_column = s[static_cast<std::size_t>(c)];
      survey.u_px(i, c) = table.NumberOrNan(row, u_column);
      survey.s_px(i, c) = table.NumberOrNan(row, s_column);
      if (std::isnan(survey.u_px(i, c)) != std::isnan(survey.s_px(i, c))) {
        throw Error("a reading without its sigma, or a sigma without a reading",
                    table.Where(row, s_column), "fill in both cells, or leave both empty");
      }
      if (survey.s_px(i, c) <= 0.0) {
        throw Error(fmt::format("a sigma of {} is impossible", survey.s_px(i, c)),
                    table.Where(row, s_column), "give a standard deviation above 0");
      }
    }
  }
  return survey;
}

Survey ReadH5(const std::string& path) {
  const H5Reader file(path, kSurveySchema, kSurveyVersion);
  Survey survey;
  survey.id = file.ReadStrings("/id");
  survey.cameras = file.ReadStrings("/cameras");
  const std::size_t n = survey.size();
  const std::size_t cameras = survey.cameras.size();
  const auto check = [&](const char* name, const std::vector<std::size_t>& expected) {
    if (file.Dims(name) != expected) {
      file.Fail("does not have the size that the points and cameras ask for", name,
                "make the file again");
    }
  };
  check("/p", {n, 3});
  check("/cov", {n, 6});
  survey.p = file.ReadMatrix("/p", "m").transpose();
  survey.cov = file.ReadMatrix("/cov", "m^2").transpose();
  if (!survey.p.allFinite()) file.Fail("holds a number that is not finite", "/p", "mend the point");
  for (Eigen::Index i = 0; i < survey.cov.cols(); ++i) {
    if (!survey.cov.col(i).allFinite() || !Possible(survey.cov.col(i))) {
      file.Fail(fmt::format("the covariance of point '{}' is not positive definite",
                            survey.id[static_cast<std::size_t>(i)]),
                "/cov", "mend the point");
    }
  }
  if (file.Has("/u")) {
    check("/u", {n, cameras});
    check("/s", {n, cameras});
    survey.u_px = file.ReadMatrix("/u", "px");
    survey.s_px = file.ReadMatrix("/s", "px");
  }
  if (file.Has("/lit")) {
    const std::vector<std::size_t> dims = file.Dims("/lit");
    survey.format = ReadLineFormat(file, "/lit", dims.empty() ? 0 : dims.back());
    check("/lit", {n, cameras, survey.format.elements()});
    check("/dark", {n, cameras, survey.format.elements()});
    survey.lit.resize(n * cameras * survey.format.elements());
    survey.dark.resize(survey.lit.size());
    file.ReadRows("/lit", 0, n, std::span<std::uint16_t>(survey.lit));
    file.ReadRows("/dark", 0, n, std::span<std::uint16_t>(survey.dark));
    survey.response = ReadResponse(file, cameras, survey.format);
  }
  if (survey.u_px.size() == 0 && survey.lit.empty()) {
    file.Fail("holds neither readings nor lines", "/u", "make the file again");
  }
  return survey;
}

}  // namespace

Survey ReadSurvey(const std::string& path) { return IsHdf5(path) ? ReadH5(path) : ReadCsv(path); }

Survey ReadPointsCsv(const std::string& path) {
  Survey survey;
  ReadPoints(CsvTable::Load(path), &survey);
  return survey;
}

void WriteSurvey(const std::string& path, const Survey& survey, const Provenance& provenance) {
  H5Writer file(path, kSurveySchema, kSurveyVersion, provenance);
  file.Write({"/id", "1", "points' ids"}, survey.id);
  file.Write({"/cameras", "1", "cameras' names"}, survey.cameras);
  file.Write({"/p", "m", "x, y, z in the station's frame"}, survey.p.transpose());
  file.Write({"/cov", "m^2", "covariance: xx, xy, xz, yy, yz, zz"}, survey.cov.transpose());
  if (survey.u_px.size() > 0) {
    file.Write({"/u", "px", "readings, point x camera; NaN: not seen"}, survey.u_px);
    file.Write({"/s", "px", "their standard deviations"}, survey.s_px);
  }
  if (survey.has_lines()) {
    const std::size_t elements = survey.format.elements();
    const std::vector<std::size_t> row = {survey.cameras.size(), elements};
    H5Series lit = file.Series({"/lit", "count", "LED lit: point x camera x element"},
                               H5Type::kUint16, row, 16, 1);
    H5Series dark = file.Series({"/dark", "count", "LED dark: point x camera x element"},
                                H5Type::kUint16, row, 16, 1);
    lit.Append(std::span<const std::uint16_t>(survey.lit));
    dark.Append(std::span<const std::uint16_t>(survey.dark));
    WriteLineFormat(file, "/lit", survey.format);
    WriteLineFormat(file, "/dark", survey.format);
    WriteResponse(file, survey.response, survey.cameras.size(), survey.format);
  }
  file.Commit();
}

void WriteSurveyCsv(const std::string& path, const Survey& survey) {
  if (survey.u_px.size() == 0) {
    throw Error("holds raw lines, which a CSV cannot", path,
                "write HDF5, or find the readings first");
  }
  std::vector<CsvColumn> columns = {{"id", ""}};
  for (const char* name : kPosition) columns.push_back({name, "m"});
  for (const char* name : kCovariance) columns.push_back({name, "m^2"});
  for (std::size_t c = 1; c <= survey.cameras.size(); ++c) {
    columns.push_back({fmt::format("u{}", c), "px"});
    columns.push_back({fmt::format("s{}", c), "px"});
  }
  CsvWriter writer(std::move(columns));
  writer.Comment(fmt::format("cameras: {}", fmt::join(survey.cameras, ", ")));
  const auto cell = [](double v) { return std::isnan(v) ? std::string() : fmt::format("{}", v); };
  for (Eigen::Index i = 0; i < survey.p.cols(); ++i) {
    std::vector<std::string> cells = {survey.id[static_cast<std::size_t>(i)]};
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
