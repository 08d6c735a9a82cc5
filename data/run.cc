#include "data/run.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "base/error.h"
#include "data/h5.h"

namespace unfurl::data {

namespace {

constexpr std::size_t kBufferRows = 1024;

// "theta_rate [rad/s]" as the dataset's name and its unit.
std::pair<std::string, std::string> NameAndUnit(const std::string& text) {
  const std::size_t open = text.find(" [");
  if (open == std::string::npos || text.back() != ']') return {text, "1"};
  return {text.substr(0, open), text.substr(open + 2, text.size() - open - 3)};
}

}  // namespace

struct RunWriter::Impl {
  H5Writer file;
  std::vector<Quantity> quantities;
  H5Series t;
  std::vector<H5Series> series;
  std::vector<double> t_buffer;
  std::vector<std::vector<double>> buffer;  // by quantity
  std::vector<RunEvent> events;

  Impl(const std::string& path, const Provenance& provenance, std::vector<Quantity> q,
       const std::vector<std::string>& marks)
      : file(path, kRunSchema, kRunVersion, provenance), quantities(std::move(q)) {
    file.Write({"/marks", "1", "marks' names"}, marks);
    t = file.Series({"/t", "s", "time of the sample"}, H5Type::kDouble);
    for (const Quantity& quantity : quantities) {
      series.push_back(file.Series(
          {"/series/" + quantity.name, quantity.units, quantity.description}, H5Type::kDouble));
    }
    buffer.resize(quantities.size());
    for (auto& column : buffer) column.reserve(kBufferRows);
  }

  void Flush() {
    if (t_buffer.empty()) return;
    t.Append(std::span<const double>(t_buffer));
    t_buffer.clear();
    for (std::size_t q = 0; q < series.size(); ++q) {
      series[q].Append(std::span<const double>(buffer[q]));
      buffer[q].clear();
    }
  }

  void WriteEvents() {
    std::vector<double> times;
    std::vector<std::string> kinds, places;
    std::set<std::string> names;
    for (const RunEvent& event : events) {
      times.push_back(event.t);
      kinds.push_back(event.kind);
      places.push_back(event.where);
      for (const auto& [name, value] : event.data) names.insert(name);
    }
    file.Write({"/events/t", "s", "time of the event"}, times);
    file.Write({"/events/kind", "1", "latch, contact_start or contact_end"}, kinds);
    file.Write({"/events/where", "1", "joint"}, places);
    for (const std::string& name : names) {
      std::vector<double> column;
      for (const RunEvent& event : events) {
        const auto found = event.data.find(name);
        column.push_back(found != event.data.end() ? found->second
                                                   : std::numeric_limits<double>::quiet_NaN());
      }
      const auto [plain, unit] = NameAndUnit(name);
      file.Write({"/events/data/" + plain, unit, "of the event; NaN where it has none"}, column);
    }
  }
};

RunWriter::RunWriter(const std::string& path, const Provenance& provenance,
                     std::vector<Quantity> quantities, std::vector<std::string> marks)
    : impl_(std::make_unique<Impl>(path, provenance, std::move(quantities), marks)) {}

RunWriter::~RunWriter() = default;

void RunWriter::Append(double t, std::span<const double> values) {
  impl_->t_buffer.push_back(t);
  for (std::size_t q = 0; q < impl_->buffer.size(); ++q) impl_->buffer[q].push_back(values[q]);
  if (impl_->t_buffer.size() == kBufferRows) impl_->Flush();
}

void RunWriter::AddEvent(RunEvent event) { impl_->events.push_back(std::move(event)); }

void RunWriter::SetSummary(const std::string& name, double value, const std::string& units) {
  impl_->file.Write({"/summary/" + name, units, "of the whole run"},
                    std::span<const double>(&value, 1));
}

void RunWriter::SetText(const std::string& name, const std::string& text) {
  impl_->file.Write({"/text/" + name, "1", "in words"}, std::vector<std::string>{text});
}

void RunWriter::Commit() {
  impl_->Flush();
  impl_->WriteEvents();
  impl_->file.Commit();
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

Run ReadRun(const std::string& path) {
  const H5Reader file(path, kRunSchema, kRunVersion);
  Run run;
  run.t = file.ReadDoubles("/t", "s");
  for (std::size_t i = 0; i < run.t.size(); ++i) {
    if (!std::isfinite(run.t[i]) || (i > 0 && run.t[i] <= run.t[i - 1])) {
      file.Fail(fmt::format("sample {} does not come after the one before", i), "/t",
                "make the file again");
    }
  }
  run.marks = file.ReadStrings("/marks");
  for (const std::string& name : file.Children("/series")) {
    const std::string at = "/series/" + name;
    run.quantities.push_back({name, file.Units(at), file.Description(at)});
    run.columns.push_back(file.ReadDoubles(at));
    const std::vector<double>& column = run.columns.back();
    if (column.size() != run.t.size()) {
      file.Fail(fmt::format("has {} samples where t has {}", column.size(), run.t.size()), at,
                "make the file again");
    }
    if (!std::all_of(column.begin(), column.end(), [](double v) { return std::isfinite(v); })) {
      file.Fail("holds a value that is not finite", at, "make the file again");
    }
  }
  for (const std::string& mark : run.marks) {
    for (const char* part : {".x", ".y"}) {
      if (run.Find(mark + part) < 0) {
        file.Fail("is missing", "/series/" + mark + part, "make the file again");
      }
    }
  }
  const std::vector<double> times = file.ReadDoubles("/events/t", "s");
  const std::vector<std::string> kinds = file.ReadStrings("/events/kind");
  const std::vector<std::string> places = file.ReadStrings("/events/where");
  if (kinds.size() != times.size() || places.size() != times.size()) {
    file.Fail("holds columns of different lengths", "/events/t", "make the file again");
  }
  for (std::size_t i = 0; i < times.size(); ++i) {
    run.events.push_back({times[i], kinds[i], places[i], {}});
  }
  for (const std::string& name : file.Children("/events/data")) {
    const std::string at = "/events/data/" + name;
    const std::vector<double> column = file.ReadDoubles(at);
    const std::string key = fmt::format("{} [{}]", name, file.Units(at));
    for (std::size_t i = 0; i < std::min(column.size(), times.size()); ++i) {
      if (!std::isnan(column[i])) run.events[i].data[key] = column[i];
    }
  }
  for (const std::string& name : file.Children("/summary")) {
    const std::vector<double> value = file.ReadDoubles("/summary/" + name);
    if (value.size() == 1) run.summary[name] = value[0];
  }
  for (const std::string& name : file.Children("/text")) {
    const std::vector<std::string> text = file.ReadStrings("/text/" + name);
    if (text.size() == 1) run.text[name] = text[0];
  }
  return run;
}

}  // namespace unfurl::data
