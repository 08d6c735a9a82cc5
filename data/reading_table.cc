#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>
#include <map>

#include "base/error.h"
#include "base/statistics.h"
#include "base/text.h"
#include "data/survey_points.h"

namespace unfurl::data {

namespace {

constexpr double kReadingTableNone = std::numeric_limits<double>::quiet_NaN();
constexpr double kNotable = 1.2;       // a widening of sigmas that is worth a word
constexpr std::size_t kTelling = 8;    // readings; a few may stand at their row's beginning
constexpr std::size_t kLooked = 1000;  // rows of a long table that are looked at

void Add(const CsvTable& table, std::size_t row, int u_column, int s_column, std::size_t point,
         std::size_t camera, ReadingRepeats* out, int pixels = 0) {
  const CellReading cell = ReadReading(table, row, u_column, s_column, pixels);
  if (!std::isnan(cell.u_px)) out->Add(point, camera, cell.u_px, cell.s_px);
}

// What a row's reading is of: its id, or a bar's pose and mark, 12 and a.
class RowNames {
 public:
  explicit RowNames(const CsvTable& table)
      : table_(table), pose_(table.Find("pose")), mark_(table.Find("mark")) {
    if (pose_ < 0 || mark_ < 0) id_ = table.Require("id", "");
  }
  std::string Of(std::size_t row) const {
    return id_ >= 0 ? table_.Text(row, id_) : table_.Text(row, pose_) + table_.Text(row, mark_);
  }

 private:
  const CsvTable& table_;
  int pose_, mark_, id_ = -1;
};

// Marks that flash one after another are in no one place of a bar that moves.
void RefuseMoving(const CsvTable& table) {
  const int pose = table.Find("pose"), time = table.Find("time");
  if (pose < 0 || time < 0) return;
  std::map<std::string, std::string> at;  // by pose
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const std::string& first =
        at.try_emplace(table.Text(row, pose), table.Text(row, time)).first->second;
    if (table.Text(row, time) == first) continue;
    throw Error("marks of one pose flash at different times, as of a bar that moves",
                table.Where(row, time),
                "give readings of a bar that stood still, without 'time', or flashed all at once");
  }
}

ReadingRepeats Collect(const CsvTable& table) {
  RefuseMoving(table);
  ReadingRepeats out;
  const RowNames names(table);
  if (table.Find("camera") >= 0) {
    const int camera = table.Require("camera", "");
    const int u = table.Require("u", "px"), s = table.Require("s", "px");
    for (std::size_t row = 0; row < table.rows(); ++row) {
      const std::size_t point = out.Point(names.Of(row));
      Add(table, row, u, s, point, out.Camera(table.Text(row, camera)), &out);
    }
    return out;
  }
  ReadingColumns columns = FindReadingColumns(table);
  if (columns.u.empty()) {
    throw Error("holds no readings", table.path(),
                "add columns 'u1 [px]', 's1 [px]', ..., or 'camera', 'u [px]', 's [px]'");
  }
  NameCameras(table, &columns);
  for (const std::string& name : columns.cameras) out.Camera(name);
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const std::size_t point = out.Point(names.Of(row));
    for (std::size_t c = 0; c < columns.u.size(); ++c) {
      Add(table, row, columns.u[c], columns.s[c], point, c, &out, PixelsOf(columns, c));
    }
  }
  return out;
}

// A mark is not seen to less than its place in the row: half of the readings are no smaller than
// half of the sigmas, unless the columns stand for each other.
void RefuseExchanged(const CsvTable& table, int u_column, int s_column) {
  std::vector<double> u, s;
  for (std::size_t row = 0; row < std::min(table.rows(), kLooked); ++row) {
    double reading = 0.0, sigma = 0.0;
    if (!ParseDouble(table.Text(row, u_column), &reading)) continue;
    if (!ParseDouble(table.Text(row, s_column), &sigma)) continue;
    u.push_back(std::abs(reading));
    s.push_back(sigma);
  }
  if (u.size() < kTelling || !(Median(s) > Median(u))) return;
  const auto name = [&](int column) {
    return table.columns()[static_cast<std::size_t>(column)].name;
  };
  throw Error(fmt::format("holds smaller numbers than '{}', which are its standard deviations",
                          name(s_column)),
              fmt::format("{}:{}", table.path(), name(u_column)), "exchange the two columns");
}

}  // namespace

ReadingColumns FindReadingColumns(const CsvTable& table) {
  ReadingColumns out;
  const auto other_case = [&](const std::string& name) {
    return std::any_of(table.columns().begin(), table.columns().end(), [&](const CsvColumn& one) {
      return one.name == std::string(1, static_cast<char>(std::toupper(name[0]))) + name.substr(1);
    });
  };
  for (int c = 1; table.Find(fmt::format("u{}", c)) >= 0; ++c) {
    out.u.push_back(table.Require(fmt::format("u{}", c), "px"));
    out.s.push_back(table.Require(fmt::format("s{}", c), "px"));
    out.cameras.push_back(fmt::format("camera{}", c));
    RefuseExchanged(table, out.u.back(), out.s.back());
  }
  const std::string next = fmt::format("u{}", out.u.size() + 1);
  if (other_case(next)) table.Require(next, "px");  // says what to rename
  return out;
}

std::vector<int> ReadPixels(const CsvTable& table, std::size_t cameras) {
  constexpr double kMost = 1e6;  // no row is longer
  for (const std::string& comment : table.comments()) {
    if (!comment.starts_with("pixels:")) continue;
    std::vector<int> pixels;
    for (const std::string& part : Split(comment.substr(7), ',')) {
      double value = 0.0;
      if (!ParseDouble(Trim(part), &value) || value != std::floor(value) || value < 1.0 ||
          value > kMost) {
        throw Error(fmt::format("'{}' is not a number of pixels", Trim(part)),
                    table.path() + ": # pixels",
                    "give whole numbers, as in '# pixels: 2160, 4096'");
      }
      pixels.push_back(static_cast<int>(value));
    }
    if (pixels.size() == 1) pixels.resize(cameras, pixels[0]);
    if (pixels.size() != cameras) {
      throw Error(fmt::format("states the pixels of {} cameras, but holds readings of {}",
                              pixels.size(), cameras),
                  table.path() + ": # pixels", "give one number for each camera, or one for all");
    }
    return pixels;
  }
  return {};
}

void NameCameras(const CsvTable& table, ReadingColumns* columns) {
  columns->pixels = ReadPixels(table, columns->u.size());
  for (const std::string& comment : table.comments()) {
    if (!comment.starts_with("cameras:")) continue;
    std::vector<std::string> names;
    for (const std::string& name : Split(comment.substr(8), ',')) names.emplace_back(Trim(name));
    if (names.size() != columns->u.size()) {
      throw Error(fmt::format("names {} cameras, but holds readings of {}", names.size(),
                              columns->u.size()),
                  table.path(), "name as many as there are columns u1, u2, ...");
    }
    columns->cameras = names;
  }
}

int PixelsOf(const ReadingColumns& columns, std::size_t camera) {
  return columns.pixels.empty() ? 0 : columns.pixels[camera];
}

bool OnRow(double u_px, int pixels) {
  constexpr double kLongest = 65536.0;  // twice the longest line sensors that are made [px]
  return u_px >= -0.5 && u_px <= (pixels > 0 ? pixels : kLongest) - 0.5;
}

bool IsReadingSigma(double s_px) {
  // A millionth of a pixel would take 1e12 electrons; a million pixels are no reading.
  constexpr double kLeast = 1e-6, kMost = 1e6;
  return s_px >= kLeast && s_px <= kMost;
}

CellReading ReadReading(const CsvTable& table, std::size_t row, int u_column, int s_column,
                        int pixels) {
  const CellReading cell = {table.NumberOrNan(row, u_column), table.NumberOrNan(row, s_column)};
  if (std::isnan(cell.u_px) != std::isnan(cell.s_px)) {
    throw Error("a reading without its sigma, or a sigma without a reading",
                table.Where(row, s_column), "fill in both cells, or leave both empty");
  }
  if (cell.s_px <= 0.0) {
    throw Error(fmt::format("a sigma of {} is impossible", cell.s_px), table.Where(row, s_column),
                "give a standard deviation above 0");
  }
  if (!std::isnan(cell.s_px) && !IsReadingSigma(cell.s_px)) {
    throw Error(fmt::format("a sigma of {} px, which no reading has", cell.s_px),
                table.Where(row, s_column), "give the reading's standard deviation in pixels");
  }
  if (!std::isnan(cell.u_px) && !OnRow(cell.u_px, pixels)) {
    throw Error(
        pixels > 0 ? fmt::format("a reading of {} px, but the row has {} pixels", cell.u_px, pixels)
                   : fmt::format("a reading of {} px, which is on no sensor's row", cell.u_px),
        table.Where(row, u_column),
        "correct the cell, or leave it and its sigma empty: pixels are counted from 0");
  }
  return cell;
}

std::size_t ReadingRepeats::Index(std::vector<std::string>* names, const std::string& name) {
  const auto found = std::find(names->begin(), names->end(), name);
  if (found != names->end()) return static_cast<std::size_t>(found - names->begin());
  names->push_back(name);
  return names->size() - 1;
}

void ReadingRepeats::Add(std::size_t point, std::size_t camera, double u_px, double s_px) {
  readings_[{point, camera}].push_back({u_px, s_px});
}

ReadingTable ReadReadingsCsv(const std::string& path) {
  const CsvTable table = CsvTable::Load(path);
  ReadingTable out = Collect(table).Average();
  out.pixels = ReadPixels(table, out.cameras.size());
  return out;
}

ReadingTable ReadingRepeats::Average() const {
  ReadingTable out;
  out.id = id_;
  out.cameras = cameras_;
  const auto n = static_cast<Eigen::Index>(id_.size());
  const auto c = static_cast<Eigen::Index>(cameras_.size());
  out.u_px.setConstant(n, c, kReadingTableNone);
  out.s_px.setConstant(n, c, kReadingTableNone);
  std::vector<double> squares(cameras_.size(), 0.0), spare(cameras_.size(), 0.0);
  for (const auto& [where, ones] : readings_) {
    double weight = 0.0, sum = 0.0;
    for (const CellReading& one : ones) {
      weight += 1.0 / (one.s_px * one.s_px);
      sum += one.u_px / (one.s_px * one.s_px);
    }
    const double mean = sum / weight;
    out.u_px(static_cast<Eigen::Index>(where.first), static_cast<Eigen::Index>(where.second)) =
        mean;
    out.s_px(static_cast<Eigen::Index>(where.first), static_cast<Eigen::Index>(where.second)) =
        1.0 / std::sqrt(weight);
    for (const CellReading& one : ones) {
      squares[where.second] += (one.u_px - mean) * (one.u_px - mean) / (one.s_px * one.s_px);
    }
    spare[where.second] += static_cast<double>(ones.size()) - 1.0;
  }
  for (std::size_t k = 0; k < cameras_.size(); ++k) {
    if (!(spare[k] > 0.0)) continue;
    const double factor = std::sqrt(squares[k] / spare[k]);
    // Widened only beyond what chance gives a factor from so few repeats (two of its sigmas).
    if (factor <= 1.0 + 2.0 / std::sqrt(2.0 * spare[k])) continue;
    out.s_px.col(static_cast<Eigen::Index>(k)) *= factor;
    if (factor > kNotable) {
      out.notes.push_back(
          fmt::format("camera {}: repeats scatter {:.2f} times their sigmas, which were widened",
                      cameras_[k], factor));
    }
  }
  return out;
}

void JoinReadings(const ReadingTable& readings, const std::string& where, Survey* survey) {
  std::map<std::string, Eigen::Index> row;
  for (std::size_t k = 0; k < readings.id.size(); ++k) {
    row[readings.id[k]] = static_cast<Eigen::Index>(k);
  }
  std::vector<Eigen::Index> points, rows;
  std::vector<std::string> ids, set_ups;
  for (std::size_t i = 0; i < survey->id.size(); ++i) {
    const auto found = row.find(survey->id[i]);
    if (found == row.end()) continue;
    points.push_back(static_cast<Eigen::Index>(i));
    rows.push_back(found->second);
    ids.push_back(survey->id[i]);
    if (!survey->set_up.empty()) set_ups.push_back(survey->set_up[i]);
  }
  if (ids.empty()) {
    throw Error("no reading has the id of a surveyed point", where,
                "use the same ids in both files");
  }
  const std::size_t lone_points = survey->id.size() - ids.size();
  const std::size_t lone_readings = readings.id.size() - ids.size();
  if (lone_points > 0) {
    survey->notes.push_back(fmt::format("{} surveyed points have no readings", lone_points));
  }
  if (lone_readings > 0) {
    survey->notes.push_back(fmt::format("readings of {} ids were not surveyed", lone_readings));
  }
  const Eigen::Matrix3Xd p = survey->p(Eigen::all, points);
  const Eigen::Matrix<double, 6, Eigen::Dynamic> cov = survey->cov(Eigen::all, points);
  survey->p = p;
  survey->cov = cov;
  survey->id = ids;
  survey->set_up = set_ups;
  survey->cameras = readings.cameras;
  survey->pixels = readings.pixels;
  survey->u_px = readings.u_px(rows, Eigen::all);
  survey->s_px = readings.s_px(rows, Eigen::all);
  survey->notes.insert(survey->notes.end(), readings.notes.begin(), readings.notes.end());
}

Survey ReadSurveyInParts(const std::string& path, const std::string& readings,
                         const StationSigmas& sigmas) {
  const bool gsi = !IsSurveyH5(path) && LooksLikeGsi(path);
  if (readings.empty()) {
    if (gsi) throw Error("holds no readings", path, "give them with --readings READINGS.csv");
    return ReadSurvey(path);
  }
  Survey survey;
  if (gsi) {
    survey = ReadGsi(path, sigmas);
  } else if (!ReadSurveyPoints(LoadSurveyTable(path), &survey)) {
    if (!(sigmas.coordinate > 0.0)) {
      throw Error("states no uncertainty of its points", path,
                  "add columns 'sx [m]', 'sy [m]' and 'sz [m]', or give --sigma");
    }
    const double variance = sigmas.coordinate * sigmas.coordinate;
    for (const Eigen::Index k : {0, 3, 5}) survey.cov.row(k).setConstant(variance);
  }
  JoinReadings(ReadReadingsCsv(readings), readings, &survey);
  return survey;
}

}  // namespace unfurl::data
