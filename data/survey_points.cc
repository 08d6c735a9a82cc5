#include "data/survey_points.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <set>

#include "base/dense.h"
#include "base/error.h"
#include "base/text.h"
#include "data/set_ups.h"
#include "data/units.h"

namespace unfurl::data {

namespace {

constexpr std::array<const char*, 6> kSurveyPointsCovariance = {"cxx", "cxy", "cxz",
                                                                "cyy", "cyz", "czz"};
constexpr std::array<const char*, 3> kSurveyPointsSigma = {"sx", "sy", "sz"};
constexpr std::array<const char*, 3> kSigmaEnh = {"sE", "sN", "sH"};
constexpr std::array<const char*, 3> kSigmaPolar = {"shz", "sv", "sd"};

int FindAny(const CsvTable& table, std::initializer_list<const char*> names) {
  for (const char* name : names) {
    if (const int column = table.Find(name); column >= 0) return column;
  }
  return -1;
}

std::array<int, 3> FindEnh(const CsvTable& table) {
  return {FindAny(table, {"E", "e", "east", "East", "easting", "Easting"}),
          FindAny(table, {"N", "n", "north", "North", "northing", "Northing"}),
          FindAny(table, {"H", "h", "height", "Height", "elevation", "Elevation"})};
}

bool AllThere(const std::array<int, 3>& columns) {
  return std::all_of(columns.begin(), columns.end(), [](int c) { return c >= 0; });
}

// [rad] or [m] of one unit of a column.
double AngleUnit(const CsvTable& table, int column) {
  const std::string& unit = table.columns()[static_cast<std::size_t>(column)].unit;
  if (const auto radians = UnitsPer("rad", unit)) return *radians;
  throw Error(
      fmt::format("the unit '{}' is none of an angle", unit),
      fmt::format("{}:{}", table.path(), table.columns()[static_cast<std::size_t>(column)].name),
      "give rad, gon, mgon, deg or arcsec");
}

// A column of lengths, or of their squares, and what makes metres of it.
struct LengthColumn {
  int at = -1;
  double unit = 1.0;
};
LengthColumn RequireLength(const CsvTable& table, const std::string& name, bool squared = false) {
  const int at = table.Find(name);
  const std::string given = at < 0 ? "" : table.columns()[static_cast<std::size_t>(at)].unit;
  const char* metres = squared ? "m^2" : "m";
  const auto unit = UnitsPer(metres, given);
  return unit ? LengthColumn{at, *unit} : LengthColumn{table.Require(name, metres), 1.0};
}

// "station: 1, 2, 3" of the comments; false when there is none.
// `length`: it may state a unit, "[mm]".
bool Note(const CsvTable& table, const std::string& name, std::size_t count, bool length,
          std::vector<double>* values) {
  for (const std::string& comment : table.comments()) {
    if (!comment.starts_with(name + ":")) continue;
    std::string text = comment.substr(name.size() + 1);
    double scale = 1.0;
    if (const std::size_t open = text.find('['); open != std::string::npos) {
      const std::size_t close = std::min(text.find(']', open), text.size());
      if (length) scale = UnitsPer("m", text.substr(open + 1, close - open - 1)).value_or(0.0);
      if (scale == 0.0) {
        throw Error("has a unit that is no length's", fmt::format("{}: # {}", table.path(), name),
                    "write it in [m] or [mm]");
      }
      text.resize(open);
    }
    values->clear();
    for (const std::string& part : Split(text, ',')) {
      double value = 0.0;
      if (!ParseDouble(Trim(part), &value) || !std::isfinite(value)) {
        throw Error(fmt::format("'{}' is not a number", Trim(part)),
                    fmt::format("{}: # {}", table.path(), name), "write it as a number in metres");
      }
      values->push_back(scale * value);
    }
    if (values->size() != count) {
      throw Error(fmt::format("holds {} numbers", values->size()),
                  fmt::format("{}: # {}", table.path(), name), fmt::format("give {}", count));
    }
    return true;
  }
  return false;
}

void ReadStationErrors(const CsvTable& table, Survey* survey) {
  std::vector<double> values;
  const auto read = [&](const char* name, std::size_t count) {
    if (!Note(table, name, count, false, &values)) return false;
    for (const double value : values) {
      if (value < 0.0) {
        throw Error(fmt::format("a sigma of {} is impossible", value),
                    fmt::format("{}: # {}", table.path(), name), "give standard deviations");
      }
    }
    return true;
  };
  if (read("distance error", 2)) {
    survey->station_errors.distance_offset = values[0];
    survey->station_errors.distance_scale = values[1];
  }
  if (read("zenith error", 1)) survey->station_errors.zenith = values[0];
}

// A covariance that no instrument states: not positive.
bool Possible(const Eigen::Matrix3d& c) {
  return c(0, 0) > 0.0 && c.topLeftCorner<2, 2>().determinant() > 0.0 && c.determinant() > 0.0;
}

void Store(const Eigen::Matrix3d& c, Eigen::Index i, Survey* survey) {
  survey->cov.col(i) << c(0, 0), c(0, 1), c(0, 2), c(1, 1), c(1, 2), c(2, 2);
}
Eigen::Matrix3d Load(const Survey& survey, Eigen::Index i) {
  const auto c = survey.cov.col(i);
  Eigen::Matrix3d out;
  out << c(0), c(1), c(2), c(1), c(3), c(4), c(2), c(4), c(5);
  return out;
}

double PositiveSigma(const CsvTable& table, std::size_t row, int column) {
  const double s = table.Number(row, column);
  if (s <= 0.0) {
    throw Error(fmt::format("a sigma of {} is impossible", s), table.Where(row, column),
                "give a standard deviation above 0");
  }
  return s;
}

void ReadIds(const CsvTable& table, Survey* survey) {
  if (table.Find("id") < 0 && table.Find("pose") >= 0) {
    throw Error("holds readings of a bar, and no surveyed points", table.path(),
                "calibrate by it with --wand (in Python calibrate_wand)");
  }
  const int id = table.Require("id", "");
  std::set<std::string> seen;
  for (std::size_t i = 0; i < table.rows(); ++i) {
    survey->id.push_back(table.Text(i, id));
    if (survey->id.back().empty() || !seen.insert(survey->id.back()).second) {
      throw Error(fmt::format("the id '{}' is {}", survey->id.back(),
                              survey->id.back().empty() ? "empty" : "there twice"),
                  table.Where(i, id), "give each point an id of its own");
    }
  }
}

// Sigmas per axis or a covariance; whether there were any.
bool ReadSpread(const CsvTable& table, const std::array<const char*, 3>& names, Survey* survey) {
  const bool has_sigma = table.Find(names[0]) >= 0, has_cov = table.Find("cxx") >= 0;
  if (has_sigma && has_cov) {
    throw Error("states both sigmas and covariances", table.path(), "leave one of them out");
  }
  for (std::size_t k = 0; has_sigma && k < 3; ++k) {
    const LengthColumn column = RequireLength(table, names[k]);
    for (std::size_t i = 0; i < table.rows(); ++i) {
      const double s = column.unit * PositiveSigma(table, i, column.at);
      constexpr std::array<Eigen::Index, 3> kDiagonal = {0, 3, 5};
      survey->cov(kDiagonal[k], static_cast<Eigen::Index>(i)) = s * s;
    }
  }
  for (std::size_t k = 0; has_cov && k < 6; ++k) {
    const LengthColumn column = RequireLength(table, kSurveyPointsCovariance[k], true);
    for (std::size_t i = 0; i < table.rows(); ++i) {
      survey->cov(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(i)) =
          column.unit * table.Number(i, column.at);
    }
  }
  for (std::size_t i = 0; has_cov && i < table.rows(); ++i) {
    if (!Possible(Load(*survey, static_cast<Eigen::Index>(i)))) {
      throw Error("the covariance is not positive definite", table.Where(i, table.Find("cxx")),
                  "correct the line");
    }
  }
  return has_sigma || has_cov;
}

bool HasAngles(const CsvTable& table) { return table.Find("hz") >= 0 && table.Find("v") >= 0; }

// Coordinates from hz, v, d about the station, with the covariance that their sigmas give.
bool ReadPolar(const CsvTable& table, const Eigen::Vector3d& station, double prism_offset,
               Eigen::Matrix3Xd* p, Survey* with_spread) {
  const int hz = table.Find("hz"), v = table.Find("v");
  const LengthColumn d = RequireLength(table, "d");
  const double hz_unit = AngleUnit(table, hz), v_unit = AngleUnit(table, v);
  std::array<int, 3> sigma;
  for (std::size_t k = 0; k < 3; ++k) sigma[k] = table.Find(kSigmaPolar[k]);
  const bool has_sigma = AllThere(sigma);
  const LengthColumn sd = has_sigma ? RequireLength(table, "sd") : LengthColumn{};
  p->resize(3, static_cast<Eigen::Index>(table.rows()));
  for (std::size_t i = 0; i < table.rows(); ++i) {
    const auto column = static_cast<Eigen::Index>(i);
    const double distance = d.unit * table.Number(i, d.at) + prism_offset;
    if (!(distance > 0.0)) {
      throw Error("the distance is not positive", table.Where(i, d.at),
                  "give metres from the station");
    }
    Eigen::Matrix3d J;
    p->col(column) = station + FromPolar(hz_unit * table.Number(i, hz), v_unit * table.Number(i, v),
                                         distance, &J);
    if (!has_sigma || !with_spread) continue;
    const Eigen::Vector3d s(PositiveSigma(table, i, sigma[0]) * AngleUnit(table, sigma[0]),
                            PositiveSigma(table, i, sigma[1]) * AngleUnit(table, sigma[1]),
                            PositiveSigma(table, i, sd.at) * sd.unit);
    Store(J * s.cwiseAbs2().asDiagonal() * J.transpose(), column, with_spread);
  }
  return has_sigma;
}

// +1: the coordinates turn as the angles do; -1: they are mirrored; 0: neither fits.
int Handedness(const Eigen::Matrix3Xd& p, const Eigen::Matrix3Xd& polar) {
  const Eigen::Matrix3Xd a = p.colwise() - p.rowwise().mean();
  const Eigen::Matrix3Xd b = polar.colwise() - polar.rowwise().mean();
  // Kabsch without the condition on the determinant: the sign of what fits best.
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(a * b.transpose(),
                                              Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Matrix3d R = svd.matrixU() * svd.matrixV().transpose();
  const double left = (a - R * b).squaredNorm(), all = a.squaredNorm();
  if (!(left < 0.01 * all) || svd.singularValues()(2) < 1e-3 * svd.singularValues()(0)) return 0;
  return R.determinant() > 0.0 ? 1 : -1;
}

// The columns of x, y, z: by these names, or E, N, H in whatever order.
std::array<LengthColumn, 3> CoordinateColumns(const CsvTable& table, Survey* survey) {
  if (table.Find("x") >= 0) {
    return {RequireLength(table, "x"), RequireLength(table, "y"), RequireLength(table, "z")};
  }
  const std::array<int, 3> enh = FindEnh(table);
  std::array<LengthColumn, 3> out;
  for (std::size_t k = 0; k < 3; ++k) {
    out[k] = RequireLength(table, table.columns()[static_cast<std::size_t>(enh[k])].name);
  }
  if (enh[1] < enh[0]) {
    survey->notes.push_back(
        "the columns stand in the order N, E, H, which is left-handed: read as x = E, y = N, "
        "z = H");
  }
  return out;
}

// Where a table has both coordinates and angles, the angles show whether the coordinates are
// right-handed; N, E, H under other names are not, and exchanging the first two makes them so.
void CompareWithAngles(const CsvTable& table, Survey* survey) {
  const Eigen::Index n = survey->p.cols();
  Eigen::Matrix3Xd polar;
  ReadPolar(table, Eigen::Vector3d::Zero(), 0.0, &polar, nullptr);
  const int handedness = Handedness(survey->p, polar);
  if (handedness == 0 && n >= 4) {
    throw Error("coordinates and angles do not belong together, whichever way round", table.path(),
                "leave out the wrong ones");
  }
  if (handedness >= 0) return;
  survey->p.row(0).swap(survey->p.row(1));
  for (Eigen::Index i = 0; i < n; ++i) {
    Eigen::Matrix3d exchange = Eigen::Matrix3d::Identity();
    exchange.col(0).swap(exchange.col(1));
    Store(exchange * Load(*survey, i) * exchange.transpose(), i, survey);
  }
  survey->notes.push_back(
      "the angles show that the coordinates are left-handed (N, E, H): the first two were "
      "exchanged");
}

// Adds the prism's offset to each distance from the station.
void AddPrismOffset(const CsvTable& table, double prism_offset, Survey* survey) {
  if (!survey->station.allFinite()) {
    throw Error("a prism offset without the station's place", table.path() + ": # prism offset",
                "add a comment '# station: E, N, H'");
  }
  for (Eigen::Index i = 0; i < survey->p.cols(); ++i) {
    const Eigen::Vector3d way = survey->p.col(i) - survey->station;
    survey->p.col(i) += prism_offset * way.normalized();
  }
}

// Returns whether the table states uncertainties, as ReadPolar does.
bool ReadCoordinates(const CsvTable& table, double prism_offset, Survey* survey) {
  const std::array<LengthColumn, 3> columns = CoordinateColumns(table, survey);
  for (Eigen::Index i = 0; i < survey->p.cols(); ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      survey->p(static_cast<Eigen::Index>(k), i) =
          columns[k].unit * table.Number(static_cast<std::size_t>(i), columns[k].at);
    }
  }
  const bool spread =
      ReadSpread(table, table.Find("x") >= 0 ? kSurveyPointsSigma : kSigmaEnh, survey);
  if (HasAngles(table)) CompareWithAngles(table, survey);
  if (prism_offset != 0.0) AddPrismOffset(table, prism_offset, survey);
  return spread;
}

}  // namespace

Eigen::Vector3d FromPolar(double hz, double v, double d, Eigen::Matrix3d* derivative) {
  const double sh = std::sin(hz), ch = std::cos(hz), sv = std::sin(v), cv = std::cos(v);
  if (derivative) {
    *derivative << d * sv * ch, d * cv * sh, sv * sh,  //
        -d * sv * sh, d * cv * ch, sv * ch,            //
        0.0, -d * sv, cv;
  }
  return d * Eigen::Vector3d(sv * sh, sv * ch, cv);
}

bool TellsHandedness(const std::string& path) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored)) return false;  // a pipe is read once
  if (IsSurveyH5(path)) return false;
  if (LooksLikeGsi(path)) return true;
  const CsvTable table = CsvTable::Load(path);
  return HasAngles(table) || (table.Find("x") < 0 && AllThere(FindEnh(table)));
}

CsvTable LoadSurveyTable(const std::string& path) {
  CsvTable table = CsvTable::Load(path);
  if (table.Find("time") >= 0) table.SortBy(table.Require("time", "s"));
  return table;
}

bool ReadSurveyPoints(const CsvTable& table, Survey* survey) {
  if (table.rows() == 0) {
    throw Error("holds no point", table.path(), "give one line per surveyed point");
  }
  const auto n = static_cast<Eigen::Index>(table.rows());
  ReadIds(table, survey);
  ReadSetUps(table, survey);
  survey->p.resize(3, n);
  survey->cov.setZero(6, n);
  std::vector<double> values;
  if (Note(table, "station", 3, true, &values)) {
    survey->station = Eigen::Vector3d(values[0], values[1], values[2]);
  }
  ReadStationErrors(table, survey);
  double prism_offset = 0.0;
  if (Note(table, "prism offset", 1, true, &values)) prism_offset = values[0];

  bool spread = false;
  if (table.Find("x") >= 0 || AllThere(FindEnh(table))) {
    spread = ReadCoordinates(table, prism_offset, survey);
  } else if (HasAngles(table)) {
    if (!survey->station.allFinite()) survey->station.setZero();
    Eigen::Matrix3Xd p;
    spread = ReadPolar(table, survey->station, prism_offset, &p, survey);
    survey->p = p;
  } else {
    table.Require("x", "m");  // throws, naming it
  }
  if (prism_offset != 0.0) {
    survey->notes.push_back(
        fmt::format("{:+.1f} mm were added to every distance", 1e3 * prism_offset));
  }
  if (Note(table, "led offset", 3, true, &values)) {
    survey->p.colwise() += Eigen::Vector3d(values[0], values[1], values[2]);
    survey->notes.push_back(
        fmt::format("the LED stands ({:+.1f}, {:+.1f}, {:+.1f}) mm from the prism's centre: added",
                    1e3 * values[0], 1e3 * values[1], 1e3 * values[2]));
  }
  return spread;
}

}  // namespace unfurl::data
