#include "data/run.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace unfurl::data {

namespace {

constexpr std::size_t kBlockRows = 65536;  // samples in memory at once

// A run that did not end may have lengths that differ: it is read as far as all of them go.
std::size_t Rows(const H5Reader& file, const std::vector<std::string>& datasets, bool ended) {
  std::size_t least = file.Dims(datasets.front()).at(0);
  for (const std::string& at : datasets) {
    const std::size_t rows = file.Dims(at).at(0);
    if (ended && rows != least) {
      file.Fail(fmt::format("has {} rows where {} has {}", rows, datasets.front(), least), at,
                "make the file again");
    }
    least = std::min(least, rows);
  }
  return least;
}

// Of a run that did not end: rows before the first that has no number, which was never written. It
// is sought in the last block alone: what came before the last flush is there.
std::size_t Written(const H5Reader& file, const std::string& at, std::size_t rows) {
  const std::size_t count = std::min(rows, kBlockRows), first = rows - count;
  std::vector<double> tail(count);
  if (count > 0) file.ReadRows(at, first, count, std::span<double>(tail));
  const auto none = std::find_if(tail.begin(), tail.end(), [](double v) { return std::isnan(v); });
  return first + static_cast<std::size_t>(none - tail.begin());
}

}  // namespace

RunReader::RunReader(const std::string& path) : file_(path, kRunSchema, kRunVersion) {
  if (file_.Has("/text/status")) {
    const std::vector<std::string> status = file_.ReadStrings("/text/status");
    ended_ = status.empty() || status[0] != kRunning;
  }
  std::vector<std::string> datasets = {"/t"};
  for (const std::string& name : file_.Children("/series")) {
    if ("/series/" + name == kSeriesTime) continue;
    datasets.push_back("/series/" + name);
    quantities_.push_back({name, file_.Units(datasets.back()), file_.Description(datasets.back())});
  }
  samples_ = Rows(file_, datasets, ended_);
  if (ended_) return;
  for (const std::string& at : datasets) samples_ = Written(file_, at, samples_);
}

void RunReader::Read(std::size_t first, std::size_t count, std::vector<double>* t,
                     std::vector<std::vector<double>>* columns) const {
  const std::size_t before = first > 0 ? 1 : 0;
  std::vector<double> times(count + before);
  file_.ReadRows("/t", first - before, count + before, std::span<double>(times));
  for (std::size_t i = 0; i < times.size(); ++i) {
    if (!std::isfinite(times[i]) || (i > 0 && times[i] <= times[i - 1])) {
      file_.Fail(fmt::format("sample {} does not come after the one before", first - before + i),
                 "/t", "make the file again");
    }
  }
  t->assign(times.begin() + static_cast<std::ptrdiff_t>(before), times.end());
  columns->resize(quantities_.size());
  for (std::size_t q = 0; q < quantities_.size(); ++q) {
    std::vector<double>& column = (*columns)[q];
    column.resize(count);
    const std::string at = "/series/" + quantities_[q].name;
    file_.ReadRows(at, first, count, std::span<double>(column));
    if (!std::all_of(column.begin(), column.end(), [](double v) { return std::isfinite(v); })) {
      file_.Fail("holds a value that is not finite", at, "make the file again");
    }
  }
}

int Run::Find(const std::string& name) const {
  const auto found = std::find_if(quantities.begin(), quantities.end(),
                                  [&](const Quantity& q) { return q.name == name; });
  return found == quantities.end() ? -1 : static_cast<int>(found - quantities.begin());
}

const std::vector<double>& Run::Column(const std::string& name) const {
  const int index = Find(name);
  if (index < 0) {
    throw Error(fmt::format("the run has no quantity '{}'", name), "run",
                "`unfurl info` lists what it has");
  }
  return columns[static_cast<std::size_t>(index)];
}

RunInMemory::RunInMemory(const RunLayout& layout) {
  run_.quantities = layout.quantities;
  run_.columns.resize(layout.quantities.size());
  run_.marks = layout.marks;
  run_.summary_quantities = layout.summary;
  for (const BeamShape& shape : layout.shapes) {
    run_.shapes.push_back({shape.name, shape.at, {}, shape.kind});
  }
  for (const auto& [name, text] : layout.text) RunInMemory::SetText(name, text);
}

void RunInMemory::Append(double t, std::span<const double> values) {
  run_.t.push_back(t);
  for (std::size_t q = 0; q < values.size(); ++q) run_.columns[q].push_back(values[q]);
}

const char* ShapeGroup(ShapeKind kind) {
  constexpr const char* kGroups[] = {"/beam_shape", "/outline", "/pin"};
  return kGroups[static_cast<int>(kind)];
}

void RunInMemory::AppendShapes(double t, std::span<const double> points) {
  run_.shape_t.push_back(t);
  for (BeamMotion& beam : run_.shapes) {
    const auto own = points.first(2 * beam.at.size());
    beam.xy.insert(beam.xy.end(), own.begin(), own.end());
    points = points.subspan(own.size());
  }
}

void RunInMemory::SetText(const std::string& name, const std::string& text) {
  if (!text.empty()) run_.text[name] = text;
}

namespace {

void ReadEvents(const H5Reader& file, bool ended, Run* run) {
  std::vector<std::string> datasets = {"/events/t", "/events/kind", "/events/where"};
  const std::vector<std::string> names = file.Children("/events/data");
  for (const std::string& name : names) datasets.push_back("/events/data/" + name);
  std::size_t rows = Rows(file, datasets, ended);
  if (!ended) rows = Written(file, "/events/t", rows);
  const std::vector<double> times = file.ReadDoubles("/events/t", "s");
  const std::vector<std::string> kinds = file.ReadStrings("/events/kind");
  const std::vector<std::string> places = file.ReadStrings("/events/where");
  for (std::size_t i = 0; i < rows; ++i) run->events.push_back({times[i], kinds[i], places[i], {}});
  for (const std::string& name : names) {
    const std::string at = "/events/data/" + name;
    const std::vector<double> column = file.ReadDoubles(at);
    const std::string key = fmt::format("{} [{}]", name, file.Units(at));
    for (std::size_t i = 0; i < rows; ++i) {
      if (!std::isnan(column[i])) run->events[i].data[key] = column[i];
    }
  }
}

void ReadShapes(const H5Reader& file, bool ended, Run* run) {
  if (!file.Has(kShapeTime)) return;
  std::vector<std::string> datasets = {kShapeTime};
  constexpr ShapeKind kKinds[] = {ShapeKind::kBeam, ShapeKind::kBody, ShapeKind::kPin};
  for (const ShapeKind kind : kKinds) {
    const std::string group = ShapeGroup(kind);
    if (!file.Has(group)) continue;  // of earlier versions
    for (const std::string& name : file.Children(group)) {
      datasets.push_back(fmt::format("{}/{}", group, name));
      run->shapes.push_back({name, {}, {}, kind});
    }
  }
  std::size_t rows = Rows(file, datasets, ended);
  if (!ended) rows = Written(file, kShapeTime, rows);
  run->shape_t = file.ReadDoubles(kShapeTime, "s");
  run->shape_t.resize(rows);
  for (std::size_t i = 0; i < run->shapes.size(); ++i) {
    BeamMotion& shape = run->shapes[i];
    const std::string& at = datasets[i + 1];
    const std::vector<std::size_t> dims = file.Dims(at);
    if (dims.size() != 3 || dims[2] != 2) {
      file.Fail("does not hold x, y of points in time", at, "make the file again");
    }
    shape.at.assign(dims[1], 0.0);
    if (shape.kind == ShapeKind::kBeam) {
      shape.at = file.ReadDoubles("/beam_place/" + shape.name, "m");
    }
    if (shape.at.size() != dims[1]) {
      file.Fail(fmt::format("does not hold x, y of {} points", shape.at.size()), at,
                "make the file again");
    }
    shape.xy = file.ReadDoubles(at, "m");
    shape.xy.resize(rows * dims[1] * dims[2]);
  }
}

}  // namespace

Run ReadRun(const std::string& path, bool with_shapes) {
  const RunReader reader(path);
  const H5Reader& file = reader.file();
  Run run;
  run.quantities = reader.quantities();
  run.columns.resize(run.quantities.size());
  std::vector<double> t;
  std::vector<std::vector<double>> block;
  for (std::size_t first = 0; first < reader.samples(); first += kBlockRows) {
    const std::size_t count = std::min(kBlockRows, reader.samples() - first);
    reader.Read(first, count, &t, &block);
    run.t.insert(run.t.end(), t.begin(), t.end());
    for (std::size_t q = 0; q < block.size(); ++q) {
      run.columns[q].insert(run.columns[q].end(), block[q].begin(), block[q].end());
    }
  }
  run.marks = file.ReadStrings("/marks");
  for (const std::string& mark : run.marks) {
    for (const char* part : {".x", ".y"}) {
      if (run.Find(mark + part) < 0) {
        file.Fail("is missing", "/series/" + mark + part, "make the file again");
      }
    }
  }
  ReadEvents(file, reader.ended(), &run);
  if (with_shapes) ReadShapes(file, reader.ended(), &run);
  for (const std::string& name : file.Children("/summary")) {
    const std::string at = "/summary/" + name;
    const std::vector<double> value = file.ReadDoubles(at);
    run.summary_quantities.push_back({name, file.Units(at), file.Description(at)});
    if (value.size() == 1 && !std::isnan(value[0])) run.summary[name] = value[0];
  }
  for (const std::string& name : file.Children("/text")) {
    const std::vector<std::string> text = file.ReadStrings("/text/" + name);
    if (text.size() == 1 && !text[0].empty()) run.text[name] = text[0];
  }
  return run;
}

}  // namespace unfurl::data
