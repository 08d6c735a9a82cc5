#include "data/run.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "data/run_rows.h"

namespace unfurl::data {

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

const char* ShapeKindName(ShapeKind kind) {
  constexpr const char* kNames[] = {"beam", "body", "pin"};
  return kNames[static_cast<int>(kind)];
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
  std::size_t rows = CommonRows(file, datasets, ended);
  if (!ended) rows = WrittenRows(file, "/events/t", rows);
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

void ReadShapes(const RunReader& reader, Run* run) {
  run->shape_t = reader.shape_times();
  std::vector<double> xy;
  reader.ReadShapes(0, run->shape_t.size(), &xy);
  std::size_t all = 0, before = 0;
  for (const BeamShape& shape : reader.shapes()) all += 2 * shape.at.size();
  for (const BeamShape& shape : reader.shapes()) {
    const std::size_t own = 2 * shape.at.size();
    BeamMotion motion{shape.name, shape.at, {}, shape.kind};
    motion.xy.reserve(own * run->shape_t.size());
    for (std::size_t i = 0; i < run->shape_t.size(); ++i) {
      const auto from = xy.begin() + static_cast<std::ptrdiff_t>(i * all + before);
      motion.xy.insert(motion.xy.end(), from, from + static_cast<std::ptrdiff_t>(own));
    }
    before += own;
    run->shapes.push_back(std::move(motion));
  }
}

// Version 1: a dataset for each number.
std::vector<SummaryNumber> ReadSummaryOfVersion1(const H5Reader& file) {
  std::vector<SummaryNumber> numbers;
  for (const std::string& name : file.Children("/summary")) {
    const std::string at = "/summary/" + name;
    const std::vector<double> value = file.ReadDoubles(at);
    numbers.push_back({{name, file.Units(at), file.Description(at)},
                       value.size() == 1 ? value[0] : std::nan("")});
  }
  return numbers;
}

}  // namespace

std::vector<SummaryNumber> ReadSummary(const H5Reader& file) {
  if (file.schema_version() == 1) return ReadSummaryOfVersion1(file);
  if (!file.Has("/summary/name")) return {};
  std::vector<std::string> names = file.ReadStrings("/summary/name"),
                           units = file.ReadStrings("/summary/units"),
                           what = file.ReadStrings("/summary/description");
  const std::vector<double> values = file.ReadDoubles("/summary/value");
  if (units.size() != names.size() || what.size() != names.size() ||
      values.size() != names.size()) {
    file.Fail("is not as long as the others of its group", "/summary/value", "make the file again");
  }
  std::vector<SummaryNumber> numbers;
  for (std::size_t k = 0; k < names.size(); ++k) {
    numbers.push_back({{std::move(names[k]), std::move(units[k]), std::move(what[k])}, values[k]});
  }
  return numbers;
}

Run ReadRun(const std::string& path, bool with_shapes) {
  const RunReader reader(path);
  const H5Reader& file = reader.file();
  Run run;
  run.quantities = reader.quantities();
  run.columns.resize(run.quantities.size());
  std::vector<double> t;
  std::vector<std::vector<double>> block;
  for (std::size_t first = 0; first < reader.samples(); first += kRunBlockRows) {
    const std::size_t count = std::min(kRunBlockRows, reader.samples() - first);
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
        file.Fail("is missing", mark + part, "make the file again");
      }
    }
  }
  ReadEvents(file, reader.ended(), &run);
  if (with_shapes) ReadShapes(reader, &run);
  for (SummaryNumber& number : ReadSummary(file)) {
    if (!std::isnan(number.value)) run.summary[number.of.name] = number.value;
    run.summary_quantities.push_back(std::move(number.of));
  }
  for (const std::string& name : file.Children("/text")) {
    const std::vector<std::string> text = file.ReadStrings("/text/" + name);
    if (text.size() == 1 && !text[0].empty()) run.text[name] = text[0];
  }
  return run;
}

}  // namespace unfurl::data
