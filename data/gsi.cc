#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>
#include <set>
#include <string>

#include "base/error.h"
#include "base/text.h"
#include "data/atomic_file.h"
#include "data/survey_points.h"

namespace unfurl::data {

namespace {

// One word: index of two digits, four places of information (the last: the unit), a sign, 8 or 16
// places of data.
struct Word {
  int index = 0;
  char unit = '0';
  std::string data;  // with its sign
};

bool ParseWord(const std::string& text, std::size_t digits, Word* word) {
  if (text.size() != 7 + digits || !std::isdigit(static_cast<unsigned char>(text[0])) ||
      !std::isdigit(static_cast<unsigned char>(text[1])) || (text[6] != '+' && text[6] != '-')) {
    return false;
  }
  word->index = (text[0] - '0') * 10 + (text[1] - '0');
  word->unit = text[5];
  word->data = text.substr(6);
  return true;
}

// Its value in metres or radians.
double GsiValue(const Word& word, const std::string& where) {
  double value = 0.0;
  if (!ParseDouble(word.data[0] == '+' ? word.data.substr(1) : word.data, &value)) {
    throw Error(fmt::format("'{}' is not a number", word.data), where, "export the file again");
  }
  constexpr double kFoot = 0.3048, kGon = std::numbers::pi / 200.0;  // [m], [rad]
  switch (word.unit) {
    case '0':
      return 1e-3 * value;
    case '1':
      return 1e-3 * kFoot * value;
    case '2':
      return 1e-5 * kGon * value;
    case '3':
      return 1e-5 * std::numbers::pi / 180.0 * value;
    case '4': {  // dddmmss with a decimal of a second
      const double sign = value < 0.0 ? -1.0 : 1.0, v = std::abs(value);
      const double degrees = std::floor(v / 1e5), rest = v - 1e5 * degrees;
      const double minutes = std::floor(rest / 1e3), seconds = (rest - 1e3 * minutes) / 10.0;
      return sign * (degrees + minutes / 60.0 + seconds / 3600.0) * std::numbers::pi / 180.0;
    }
    case '5':
      return 1e-4 * std::numbers::pi / 3200.0 * value;
    case '6':
      return 1e-4 * value;
    case '7':
      return 1e-4 * kFoot * value;
    case '8':
      return 1e-5 * value;
    default:
      throw Error(fmt::format("the unit '{}' of word {} is not known", word.unit, word.index),
                  where, "export in metres and gon");
  }
}

std::string PointId(const std::string& data) {
  const std::size_t first = data.find_first_not_of("0+");
  return first == std::string::npos ? "0" : std::string(Trim(data.substr(first)));
}

}  // namespace

bool LooksLikeGsi(const std::string& path) {
  const std::string text = ReadTextFile(path);
  const std::size_t start = text.find_first_not_of(" \r\n");
  if (start == std::string::npos) return false;
  const bool wide = text[start] == '*';
  Word word;
  const std::size_t at = start + (wide ? 1 : 0), digits = wide ? 16 : 8;
  return text.size() >= at + 7 + digits && ParseWord(text.substr(at, 7 + digits), digits, &word);
}

namespace {

// The words of one line, by index.
class GsiLine {
 public:
  // `line` is not empty.
  GsiLine(std::string line, const std::string& where) : where_(where) {
    const bool wide = line[0] == '*';
    if (wide) line.erase(0, 1);
    for (const std::string& text : Split(line, ' ')) {
      if (Trim(text).empty()) continue;
      Word word;
      if (!ParseWord(std::string(Trim(text)), wide ? 16 : 8, &word)) {
        throw Error(fmt::format("'{}' is not a GSI-{} word", Trim(text), wide ? 16 : 8), where,
                    "export the file again");
      }
      words_[word.index] = word;
    }
  }

  bool Has(std::initializer_list<int> indices) const {
    return std::all_of(indices.begin(), indices.end(), [&](int i) { return words_.contains(i); });
  }
  double Number(int index) const { return GsiValue(words_.at(index), where_); }
  Eigen::Vector3d Numbers(int x, int y, int z) const { return {Number(x), Number(y), Number(z)}; }
  std::string Id() const { return PointId(words_.at(11).data); }

 private:
  std::string where_;
  std::map<int, Word> words_;
};

struct GsiPoint {
  Eigen::Vector3d p;
  Eigen::Matrix3d cov;
};

// The point of a line: words 81 to 83, or angles and a distance from the station, which becomes the
// origin where the file does not say where it stands. None where the line has neither.
std::optional<GsiPoint> PointOf(const GsiLine& line, const std::string& path,
                                const StationSigmas& sigmas, Eigen::Vector3d* station) {
  if (line.Has({81, 82, 83})) {
    if (!(sigmas.coordinate > 0.0)) {
      throw Error("states no uncertainty of its points", path, "give --sigma [m]");
    }
    return GsiPoint{line.Numbers(81, 82, 83),
                    sigmas.coordinate * sigmas.coordinate * Eigen::Matrix3d::Identity()};
  }
  if (!line.Has({21, 22, 31})) return std::nullopt;
  if (!(sigmas.angle > 0.0) || !(sigmas.distance > 0.0)) {
    throw Error("holds angles and distances without their uncertainty", path,
                "give --angle-sigma [rad] and --distance-sigma [m]");
  }
  Eigen::Matrix3d J;
  const Eigen::Vector3d way = FromPolar(line.Number(21), line.Number(22), line.Number(31), &J);
  const Eigen::Vector3d s(sigmas.angle, sigmas.angle, sigmas.distance);
  GsiPoint point{station->allFinite() ? Eigen::Vector3d(*station + way) : way,
                 J * s.cwiseAbs2().asDiagonal() * J.transpose()};
  if (!station->allFinite()) station->setZero();
  return point;
}

}  // namespace

Survey ReadGsi(const std::string& path, const StationSigmas& sigmas) {
  Survey survey;
  std::vector<GsiPoint> points;
  std::set<std::string> seen;
  Eigen::Vector3d station = Eigen::Vector3d::Constant(NAN);
  int number = 0;
  for (const std::string& raw : Split(ReadTextFile(path), '\n')) {
    ++number;
    const std::string text(Trim(raw));
    if (text.empty()) continue;
    const std::string where = fmt::format("{}:{}", path, number);
    const GsiLine line(text, where);
    if (line.Has({84, 85, 86})) station = line.Numbers(84, 85, 86);
    if (!line.Has({11})) continue;  // codes and the station's own line
    const std::optional<GsiPoint> point = PointOf(line, path, sigmas, &station);
    if (!point) continue;
    points.push_back(*point);
    survey.id.push_back(line.Id());
    if (!seen.insert(survey.id.back()).second) {
      throw Error(fmt::format("the id '{}' is there twice", survey.id.back()), where,
                  "give each point an id of its own");
    }
  }
  if (points.empty()) {
    throw Error("holds no point with coordinates, or with angles and a distance", path,
                "export words 11, 81, 82, 83 or 11, 21, 22, 31");
  }
  const auto n = static_cast<Eigen::Index>(points.size());
  survey.p.resize(3, n);
  survey.cov.resize(6, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const GsiPoint& point = points[static_cast<std::size_t>(i)];
    const Eigen::Matrix3d& c = point.cov;
    survey.p.col(i) = point.p;
    survey.cov.col(i) << c(0, 0), c(0, 1), c(0, 2), c(1, 1), c(1, 2), c(2, 2);
  }
  survey.station = station;
  survey.notes.push_back("words 81, 82, 83 are E, N, H: read as x, y, z, right-handed");
  return survey;
}

}  // namespace unfurl::data
