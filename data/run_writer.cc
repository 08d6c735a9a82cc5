#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <stdexcept>

#include "data/run.h"
#include "data/run_tables.h"

namespace unfurl::data {

namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
// Numbers held back per buffer: what bounds the memory of a run with thousands of quantities.
constexpr std::size_t kBufferNumbers = std::size_t{1} << 20;
constexpr std::size_t kMostRows = 1024, kLeastRows = 64;
constexpr std::size_t kEventRows = 256;
constexpr std::size_t kEventKindWidth = 32;
constexpr std::size_t kWordsWidth = 1024;   // of "status", "message", "method" and "stopped_by"
constexpr double kBytesPerObject = 1000.0;  // header, attributes and index of a dataset
// Of a table, side by side in a chunk: one column of a wide table is read without all the others.
constexpr std::size_t kChunkColumns = 64;

std::size_t RowsPerChunk(std::size_t numbers_per_row) {
  return std::clamp(kBufferNumbers / std::max<std::size_t>(numbers_per_row, 1), kLeastRows,
                    kMostRows);
}

std::string NameWithUnit(const Quantity& q) { return fmt::format("{} [{}]", q.name, q.units); }

}  // namespace

struct RunWriter::Impl {
  H5Writer file;
  RunLayout layout;
  std::vector<RunTable> tables;
  std::size_t rows_per_chunk, shapes_per_chunk = 1, shape_numbers = 0;

  H5Series t, series_t, shape_t, shape_xy, event_t, event_kind, event_where;
  std::vector<H5Series> series, event_data;

  std::vector<double> t_buffer, shape_t_buffer, shape_buffer, event_t_buffer;
  std::vector<std::vector<double>> buffer;        // by table, row after row
  std::vector<std::vector<double>> event_buffer;  // by event_data
  std::vector<std::string> kinds, places;
  std::map<std::string, std::size_t> summary_place;
  std::vector<double> summary;
  bool summary_waits = false;

  Impl(const std::string& path, const Provenance& provenance, RunLayout l)
      : file(path, kRunSchema, kRunVersion, provenance, H5Writer::Mode::kStreamed),
        layout(std::move(l)),
        tables(TablesOf(layout.quantities)),
        rows_per_chunk(RowsPerChunk(layout.quantities.size())) {
    file.Write({"/marks", "1", "marks' names"}, layout.marks);
    t = file.Series({"/t", "s", "time of the sample"}, H5Type::kDouble, {}, rows_per_chunk);
    MakeTables();
    MakeShapes();
    MakeEvents();
    MakeSummary();
    for (const auto& [name, words] : layout.text) {
      file.Write({"/text/" + name, "1", "in words"}, std::vector<std::string>{words});
    }
    for (const char* name : {"status", "message", "method", "stopped_by"}) {
      std::string words = std::string(name) == "status" ? kRunning : "";
      words.resize(kWordsWidth, '\0');
      file.Write({fmt::format("/text/{}", name), "1", "in words"}, std::vector<std::string>{words});
    }
    file.StartStreaming();
  }

  void MakeTables() {
    std::vector<std::string> names;
    names.reserve(layout.quantities.size());
    for (const Quantity& q : layout.quantities) names.push_back(q.name);
    file.Write({kQuantityNames, "1", "names of all quantities, in order"}, names);
    series_t =
        file.Series({kSeriesTime, "s", "time of the sample"}, H5Type::kDouble, {}, rows_per_chunk);
    for (const RunTable& table : tables) {
      file.Write({OwnersPath(table.path), "1", "whose, by column"}, table.owners);
      series.push_back(file.Series(
          {table.path, table.units, table.description, {kSeriesTime, OwnersPath(table.path)}},
          H5Type::kDouble, {table.owners.size()}, rows_per_chunk, 0, kChunkColumns));
      file.Attribute(table.path, kTableKind, table.kind);
    }
    buffer.resize(tables.size());
  }

  // All shapes in one table, point after point; beside it whose points they are.
  void MakeShapes() {
    if (layout.shapes.empty()) return;
    std::vector<std::string> names, kinds_of;
    std::vector<std::int32_t> points;
    std::vector<double> at;
    for (const BeamShape& shape : layout.shapes) {
      names.push_back(shape.name);
      kinds_of.emplace_back(ShapeKindName(shape.kind));
      points.push_back(static_cast<std::int32_t>(shape.at.size()));
      at.insert(at.end(), shape.at.begin(), shape.at.end());
    }
    shape_numbers = 2 * at.size();
    shapes_per_chunk = std::max<std::size_t>(1, RowsPerChunk(shape_numbers) / 16);
    shape_t =
        file.Series({kShapeTime, "s", "time of the shapes"}, H5Type::kDouble, {}, shapes_per_chunk);
    file.Write({"/shapes/name", "1", "of each shape"}, names);
    file.Write({"/shapes/kind",
                "1",
                "beam: a centre line; body: lines from its centre of mass to what holds on to it; "
                "pin: a joint",
                {"/shapes/name"}},
               kinds_of);
    file.Write({"/shapes/points", "1", "how many points are of each", {"/shapes/name"}},
               std::span<const std::int32_t>(points));
    file.BareScale("/shapes/point", at.size());
    file.Write({"/shapes/axis", "1", "of a point"}, std::vector<std::string>{"x", "y"});
    file.Write(
        {"/shapes/at", "m", "of every point: its place along its beam; else 0", {"/shapes/point"}},
        std::span<const double>(at));
    shape_xy = file.Series({kShapePoints,
                            "m",
                            "x, y of every point, shape after shape",
                            {kShapeTime, "/shapes/point", "/shapes/axis"}},
                           H5Type::kDouble, {at.size(), 2}, shapes_per_chunk);
  }

  void MakeSummary() {
    if (layout.summary.empty()) return;
    std::vector<std::string> names, units, what;
    for (const Quantity& q : layout.summary) {
      summary_place[q.name] = names.size();
      names.push_back(q.name);
      units.push_back(q.units);
      what.push_back(q.description);
    }
    summary.assign(names.size(), kNaN);
    const std::vector<std::string> scales = {"/summary/name"};
    file.Write({"/summary/name", "1", "of each number of the whole run"}, names);
    file.Write({"/summary/units", "1", "its unit", scales}, units);
    file.Write({"/summary/description", "1", "what it is", scales}, what);
    file.Write({"/summary/value", "1", "each in its unit; NaN: not known", scales},
               std::span<const double>(summary));
  }

  void MakeEvents() {
    std::size_t width = kEventKindWidth;
    for (const std::string& place : layout.event_places) width = std::max(width, place.size());
    event_t = file.Series({"/events/t", "s", "time of the event"}, H5Type::kDouble, {}, kEventRows);
    const std::vector<std::string> scales = {"/events/t"};
    event_kind = file.TextSeries({"/events/kind", "1", "what happened", scales}, width, kEventRows);
    event_where = file.TextSeries({"/events/where", "1", "joint, or name of the event", scales},
                                  width, kEventRows);
    for (const Quantity& q : layout.event_data) {
      event_data.push_back(
          file.Series({"/events/data/" + q.name, q.units, q.description, {"/events/t"}},
                      H5Type::kDouble, {}, kEventRows));
    }
    event_buffer.resize(event_data.size());
  }

  static void Move(H5Series* series, std::vector<double>* values) {
    series->Append(std::span<const double>(*values));
    values->clear();
  }

  void FlushSamples() {
    if (t_buffer.empty()) return;
    for (std::size_t k = 0; k < series.size(); ++k) Move(&series[k], &buffer[k]);
    series_t.Append(std::span<const double>(t_buffer));
    Move(&t, &t_buffer);
  }

  void FlushShapes() {
    if (shape_t_buffer.empty()) return;
    Move(&shape_xy, &shape_buffer);
    Move(&shape_t, &shape_t_buffer);
  }

  void FlushSummary() {
    if (summary_waits) file.Overwrite("/summary/value", std::span<const double>(summary));
    summary_waits = false;
  }

  void FlushEvents() {
    if (event_t_buffer.empty()) return;
    for (std::size_t q = 0; q < event_data.size(); ++q) Move(&event_data[q], &event_buffer[q]);
    event_kind.Append(kinds);
    event_where.Append(places);
    kinds.clear();
    places.clear();
    Move(&event_t, &event_t_buffer);
  }
};

RunWriter::RunWriter(const std::string& path, const Provenance& provenance, RunLayout layout)
    : impl_(std::make_unique<Impl>(path, provenance, std::move(layout))) {}

RunWriter::~RunWriter() = default;

void RunWriter::Append(double t, std::span<const double> values) {
  impl_->t_buffer.push_back(t);
  for (std::size_t k = 0; k < impl_->tables.size(); ++k) {
    for (const std::size_t q : impl_->tables[k].places) impl_->buffer[k].push_back(values[q]);
  }
  if (impl_->t_buffer.size() == impl_->rows_per_chunk) Flush();
}

void RunWriter::AppendShapes(double t, std::span<const double> points) {
  if (impl_->shape_numbers == 0) return;
  impl_->shape_t_buffer.push_back(t);
  const std::span<const double> own = points.first(impl_->shape_numbers);
  impl_->shape_buffer.insert(impl_->shape_buffer.end(), own.begin(), own.end());
  if (impl_->shape_t_buffer.size() == impl_->shapes_per_chunk) impl_->FlushShapes();
}

void RunWriter::AddEvent(const RunEvent& event) {
  impl_->event_t_buffer.push_back(event.t);
  impl_->kinds.push_back(event.kind);
  impl_->places.push_back(event.where);
  std::size_t found_all = 0;
  for (std::size_t q = 0; q < impl_->event_buffer.size(); ++q) {
    const auto found = event.data.find(NameWithUnit(impl_->layout.event_data[q]));
    found_all += found != event.data.end() ? 1 : 0;
    impl_->event_buffer[q].push_back(found != event.data.end() ? found->second : kNaN);
  }
  if (found_all != event.data.size()) {
    throw std::logic_error("RunWriter: an event carries what its layout does not name");
  }
  if (impl_->event_t_buffer.size() == kEventRows) impl_->FlushEvents();
}

void RunWriter::SetSummary(const std::string& name, double value) {
  impl_->summary.at(impl_->summary_place.at(name)) = value;
  impl_->summary_waits = true;
}

void RunWriter::SetText(const std::string& name, const std::string& text) {
  impl_->file.OverwriteText("/text/" + name, text);
}

void RunWriter::Flush() {
  impl_->FlushSamples();
  impl_->FlushShapes();
  impl_->FlushEvents();
  impl_->FlushSummary();
  impl_->file.Flush();
}

bool RunWriter::holds_samples() const { return impl_->t.rows() > 0; }
const std::string& RunWriter::partial() const { return impl_->file.temporary(); }

void RunWriter::Commit() {
  Flush();
  impl_->file.Commit();
}

void RunWriter::Keep() {
  Flush();
  impl_->file.Keep();
}

void RunWriter::Abandon() { impl_->file.Abandon(); }

double RunWriter::FileSize(const RunLayout& layout, double samples, double shapes) {
  double points = 0.0;
  for (const BeamShape& shape : layout.shapes) points += static_cast<double>(shape.at.size());
  const double rows = static_cast<double>(RowsPerChunk(layout.quantities.size()));
  const double whole_chunks = std::ceil(samples / rows) * rows;
  double columns = 2.0, chunks = 2.0, tables = 0.0, words = 0.0;
  for (const RunTable& table : TablesOf(layout.quantities)) {
    const std::size_t wide = (table.owners.size() + kChunkColumns - 1) / kChunkColumns;
    // The last chunk is as wide as the others.
    columns += static_cast<double>(wide * std::min(table.owners.size(), kChunkColumns));
    chunks += static_cast<double>(wide);
    tables += 2.0;
    std::size_t longest = 1;
    for (const std::string& owner : table.owners) longest = std::max(longest, owner.size() + 1);
    // Its owners, and as much again among all names.
    words += 2.0 * static_cast<double>(longest * table.owners.size());
  }
  constexpr double kBytesOfANumber = 100.0;  // of the summary: name, unit, description
  return 8.0 * columns * whole_chunks + 8.0 * (1.0 + 2.0 * points) * shapes + words +
         kBytesPerObject * (tables + 20.0) +
         kBytesOfANumber * static_cast<double>(layout.summary.size()) +
         16.0 * chunks * samples / rows;
}

namespace {

// "theta_rate [rad/s]" apart.
Quantity FromNameWithUnit(const std::string& text) {
  const std::size_t open = text.rfind(" [");
  if (open == std::string::npos || text.back() != ']') return {text, "1", ""};
  return {text.substr(0, open), text.substr(open + 2, text.size() - open - 3), ""};
}

RunLayout LayoutOf(const Run& run) {
  RunLayout layout;
  layout.quantities = run.quantities;
  layout.marks = run.marks;
  for (const BeamMotion& beam : run.shapes) {
    layout.shapes.push_back({beam.name, beam.at, beam.kind});
  }
  std::map<std::string, Quantity> event_data;
  for (const RunEvent& event : run.events) {
    layout.event_places.push_back(event.where);
    for (const auto& [name, value] : event.data) event_data[name] = FromNameWithUnit(name);
  }
  for (const auto& [name, quantity] : event_data) layout.event_data.push_back(quantity);
  layout.summary = run.summary_quantities;
  for (const auto& [name, value] : run.summary) {
    const std::string& wanted = name;  // clang 14 captures no structured binding
    const auto same = [&](const Quantity& q) { return q.name == wanted; };
    if (std::none_of(layout.summary.begin(), layout.summary.end(), same)) {
      layout.summary.push_back({name, "1", ""});
    }
  }
  if (const auto scene = run.text.find("scene"); scene != run.text.end()) {
    layout.text["scene"] = scene->second;
  }
  return layout;
}

}  // namespace

void WriteRun(const std::string& path, const Run& run, const Provenance& provenance) {
  RunWriter writer(path, provenance, LayoutOf(run));
  std::vector<double> row(run.columns.size());
  for (std::size_t i = 0; i < run.t.size(); ++i) {
    for (std::size_t q = 0; q < row.size(); ++q) row[q] = run.columns[q][i];
    writer.Append(run.t[i], row);
  }
  std::vector<double> points;
  for (std::size_t i = 0; i < run.shape_t.size(); ++i) {
    points.clear();
    for (const BeamMotion& beam : run.shapes) {
      const std::size_t numbers = 2 * beam.at.size();
      const auto from = beam.xy.begin() + static_cast<std::ptrdiff_t>(i * numbers);
      points.insert(points.end(), from, from + static_cast<std::ptrdiff_t>(numbers));
    }
    writer.AppendShapes(run.shape_t[i], points);
  }
  for (const RunEvent& event : run.events) writer.AddEvent(event);
  for (const auto& [name, value] : run.summary) writer.SetSummary(name, value);
  for (const char* name : {"status", "message", "method", "stopped_by"}) {
    if (const auto words = run.text.find(name); words != run.text.end()) {
      writer.SetText(name, words->second);
    }
  }
  writer.Commit();
}

}  // namespace unfurl::data
