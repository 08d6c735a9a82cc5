// Runs as they lie in files: of this version, and of the first, with a dataset for each quantity.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "base/error.h"
#include "data/run.h"
#include "data/run_rows.h"
#include "data/run_tables.h"

namespace unfurl::data {

namespace {

// At least the rows of the longest chunk.
constexpr std::size_t kTailRows = 2048;

constexpr const char kAgain[] = "make the file again";

}  // namespace

std::size_t CommonRows(const H5Reader& file, const std::vector<std::string>& datasets, bool ended) {
  std::size_t least = file.Dims(datasets.front()).at(0);
  for (const std::string& at : datasets) {
    const std::vector<std::size_t> dims = file.Dims(at);
    const std::size_t rows = dims.empty() ? 0 : dims[0];
    if (ended && rows != least) {
      file.Fail(fmt::format("has {} rows where {} has {}", rows, datasets.front(), least), at,
                kAgain);
    }
    least = std::min(least, rows);
  }
  return least;
}

std::size_t WrittenRows(const H5Reader& file, const std::string& at, std::size_t rows) {
  const std::size_t count = std::min(rows, kTailRows), first = rows - count;
  std::size_t width = 1;
  const std::vector<std::size_t> dims = file.Dims(at);
  for (std::size_t d = 1; d < dims.size(); ++d) width *= dims[d];
  std::vector<double> tail(count * width);
  if (tail.empty()) return rows;
  file.ReadRows(at, first, count, std::span<double>(tail));
  const auto none = std::find_if(tail.begin(), tail.end(), [](double v) { return std::isnan(v); });
  return first + static_cast<std::size_t>(none - tail.begin()) / width;
}

RunReader::RunReader(const std::string& path) : file_(path, kRunSchema, kRunVersion) {
  if (file_.Has("/text/status")) {
    const std::vector<std::string> status = file_.ReadStrings("/text/status");
    ended_ = status.empty() || status[0] != kRunning;
  }
  const std::vector<std::string> datasets =
      file_.schema_version() == 1 ? FindSeries() : FindTables();
  samples_ = CommonRows(file_, datasets, ended_);
  if (!ended_) {
    for (const std::string& at : datasets) samples_ = WrittenRows(file_, at, samples_);
  }
  if (file_.schema_version() == 1) {
    FindShapesOfVersion1();
  } else {
    FindShapes();
  }
}

std::vector<std::string> RunReader::FindSeries() {
  std::vector<std::string> datasets = {"/t"};
  for (const std::string& name : file_.Children("/series")) {
    const std::string at = "/series/" + name;
    if (at == kSeriesTime) continue;
    datasets.push_back(at);
    of_table_[at] = {quantities_.size()};
    places_.push_back({at, -1});
    quantities_.push_back({name, file_.Units(at), file_.Description(at)});
  }
  return datasets;
}

std::vector<std::string> RunReader::FindTables() {
  std::vector<std::string> datasets = {"/t"};
  const std::vector<std::string> names = file_.ReadStrings(kQuantityNames);
  std::map<std::string, std::size_t> place;
  for (const std::string& name : names) {
    if (!place.emplace(name, place.size()).second) {
      file_.Fail(fmt::format("names '{}' twice", name), kQuantityNames, kAgain);
    }
  }
  quantities_.resize(names.size());
  places_.resize(names.size());
  std::size_t found = 0;
  for (const std::string& child : file_.Children("/series")) {
    const std::string at = "/series/" + child;
    if (!file_.HasAttribute(at, kTableKind)) continue;
    const std::string kind = file_.StringAttribute(at, kTableKind);
    const std::vector<std::string> owners = file_.ReadStrings(OwnersPath(at));
    const std::vector<std::size_t> dims = file_.Dims(at);
    if (dims.size() != 2 || dims[1] != owners.size()) {
      file_.Fail(fmt::format("does not have {} columns", owners.size()), at, kAgain);
    }
    datasets.push_back(at);
    const Quantity of{"", file_.Units(at), file_.Description(at)};
    std::vector<std::size_t>& columns = of_table_[at];
    for (std::size_t c = 0; c < owners.size(); ++c) {
      const std::string name = JoinedName(owners[c], kind);
      const auto known = place.find(name);
      if (known == place.end() || !quantities_[known->second].name.empty()) {
        file_.Fail(fmt::format("holds '{}', which {} does not name once", name, kQuantityNames), at,
                   kAgain);
      }
      quantities_[known->second] = {name, of.units, of.description};
      places_[known->second] = {at, static_cast<int>(c)};
      columns.push_back(known->second);
      ++found;
    }
  }
  if (found != names.size()) {
    file_.Fail(fmt::format("names {} quantities, and {} are there", names.size(), found),
               kQuantityNames, kAgain);
  }
  return datasets;
}

void RunReader::FindShapes() {
  if (!file_.Has(kShapeTime)) return;
  const std::vector<std::string> names = file_.ReadStrings("/shapes/name"),
                                 kinds = file_.ReadStrings("/shapes/kind");
  const std::vector<std::int32_t> points = file_.ReadInts("/shapes/points");
  const std::vector<double> at = file_.ReadDoubles("/shapes/at", "m");
  const std::vector<std::size_t> dims = file_.Dims(kShapePoints);
  std::size_t all = 0;
  bool fits = kinds.size() == names.size() && points.size() == names.size();
  for (std::size_t k = 0; fits && k < names.size(); ++k) {
    fits = points[k] >= 0 && static_cast<std::size_t>(points[k]) <= at.size() - all;
    if (!fits) break;
    BeamShape shape{names[k], {}, ShapeKind::kBeam};
    for (const ShapeKind kind : {ShapeKind::kBody, ShapeKind::kPin}) {
      if (kinds[k] == ShapeKindName(kind)) shape.kind = kind;
    }
    const auto begin = at.begin() + static_cast<std::ptrdiff_t>(all);
    shape.at.assign(begin, begin + points[k]);
    all += shape.at.size();
    shapes_.push_back(std::move(shape));
  }
  if (!fits || all != at.size() || dims.size() != 3 || dims[1] != all || dims[2] != 2) {
    file_.Fail("does not hold x, y of the points that its group names", kShapePoints, kAgain);
  }
  std::size_t rows = CommonRows(file_, {kShapeTime, kShapePoints}, ended_);
  if (!ended_) rows = WrittenRows(file_, kShapeTime, WrittenRows(file_, kShapePoints, rows));
  shape_t_ = file_.ReadDoubles(kShapeTime, "s");
  shape_t_.resize(rows);
}

namespace {

constexpr char kShapeTime1[] = "/beam_shape_t";

std::string ShapePath1(const BeamShape& shape) {
  constexpr const char* kGroups[] = {"/beam_shape", "/outline", "/pin"};
  return fmt::format("{}/{}", kGroups[static_cast<int>(shape.kind)], shape.name);
}

}  // namespace

void RunReader::FindShapesOfVersion1() {
  if (!file_.Has(kShapeTime1)) return;
  std::vector<std::string> datasets = {kShapeTime1};
  for (const ShapeKind kind : {ShapeKind::kBeam, ShapeKind::kBody, ShapeKind::kPin}) {
    const std::string path = ShapePath1({"", {}, kind});
    const std::string group = path.substr(0, path.size() - 1);
    if (!file_.Has(group)) continue;
    for (const std::string& name : file_.Children(group)) {
      BeamShape shape{name, {}, kind};
      const std::string at = ShapePath1(shape);
      const std::vector<std::size_t> dims = file_.Dims(at);
      if (dims.size() != 3 || dims[2] != 2) {
        file_.Fail("does not hold x, y of points in time", at, kAgain);
      }
      shape.at.assign(dims[1], 0.0);
      if (kind == ShapeKind::kBeam) shape.at = file_.ReadDoubles("/beam_place/" + name, "m");
      if (shape.at.size() != dims[1]) {
        file_.Fail(fmt::format("does not hold x, y of {} points", shape.at.size()), at, kAgain);
      }
      datasets.push_back(at);
      shapes_.push_back(std::move(shape));
    }
  }
  std::size_t rows = CommonRows(file_, datasets, ended_);
  if (!ended_) rows = WrittenRows(file_, kShapeTime1, rows);
  shape_t_ = file_.ReadDoubles(kShapeTime1, "s");
  shape_t_.resize(rows);
}

void RunReader::ReadShapes(std::size_t first, std::size_t count, std::vector<double>* xy) const {
  std::size_t all = 0;
  for (const BeamShape& shape : shapes_) all += 2 * shape.at.size();
  xy->resize(count * all);
  if (xy->empty()) return;
  if (file_.schema_version() != 1) {
    return file_.ReadRows(kShapePoints, first, count, std::span<double>(*xy));
  }
  std::size_t before = 0;
  std::vector<double> own;
  for (const BeamShape& shape : shapes_) {
    const std::size_t width = 2 * shape.at.size();
    own.resize(count * width);
    file_.ReadRows(ShapePath1(shape), first, count, std::span<double>(own));
    for (std::size_t i = 0; i < count; ++i) {
      std::copy_n(own.begin() + static_cast<std::ptrdiff_t>(i * width), width,
                  xy->begin() + static_cast<std::ptrdiff_t>(i * all + before));
    }
    before += width;
  }
}

int RunReader::Find(const std::string& name) const {
  const auto found = std::find_if(quantities_.begin(), quantities_.end(),
                                  [&](const Quantity& q) { return q.name == name; });
  return found == quantities_.end() ? -1 : static_cast<int>(found - quantities_.begin());
}

void RunReader::ReadColumn(int quantity, std::size_t first, std::span<double> out) const {
  const Place& place = places_.at(static_cast<std::size_t>(quantity));
  if (place.column < 0) return file_.ReadRows(place.path, first, out.size(), out);
  file_.ReadColumn(place.path, static_cast<std::size_t>(place.column), first, out);
}

void RunReader::ReadTable(const std::string& path, std::size_t first, std::size_t count,
                          std::vector<std::vector<double>>* columns) const {
  const std::vector<std::size_t>& of = of_table_.at(path);
  std::vector<double> block(count * of.size());
  file_.ReadRows(path, first, count, std::span<double>(block));
  if (!std::all_of(block.begin(), block.end(), [](double v) { return std::isfinite(v); })) {
    file_.Fail("holds a value that is not finite", path, kAgain);
  }
  for (std::size_t c = 0; c < of.size(); ++c) {
    std::vector<double>& column = (*columns)[of[c]];
    column.resize(count);
    for (std::size_t i = 0; i < count; ++i) column[i] = block[i * of.size() + c];
  }
}

void RunReader::Read(std::size_t first, std::size_t count, std::vector<double>* t,
                     std::vector<std::vector<double>>* columns) const {
  const std::size_t before = first > 0 ? 1 : 0;
  std::vector<double> times(count + before);
  file_.ReadRows("/t", first - before, count + before, std::span<double>(times));
  for (std::size_t i = 0; i < times.size(); ++i) {
    if (!std::isfinite(times[i]) || (i > 0 && times[i] <= times[i - 1])) {
      file_.Fail(fmt::format("sample {} does not come after the one before", first - before + i),
                 "/t", kAgain);
    }
  }
  t->assign(times.begin() + static_cast<std::ptrdiff_t>(before), times.end());
  columns->resize(quantities_.size());
  for (const auto& [path, of] : of_table_) ReadTable(path, first, count, columns);
}

}  // namespace unfurl::data
