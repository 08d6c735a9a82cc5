#include <fmt/format.h>

#include <cmath>
#include <map>

#include "base/error.h"
#include "data/atomic_file.h"
#include "data/csv.h"
#include "data/formats.h"
#include "data/run.h"
#include "python/bindings.h"

namespace unfurl::python {
namespace {

using Run = Recorded<data::Run>;

std::string TextOf(const data::Run& run, const std::string& name) {
  const auto found = run.text.find(name);
  return found == run.text.end() ? std::string() : found->second;
}

std::size_t IndexOf(const data::Run& run, const std::string& name) {
  const int index = run.Find(name);
  if (index >= 0) return static_cast<std::size_t>(index);
  std::vector<std::string> known;
  for (const data::Quantity& quantity : run.quantities) known.push_back(quantity.name);
  RefuseName("quantity", name, known);
}

py::array Column(const py::object& self, const std::string& name) {
  const data::Run& run = self.cast<Run&>().data;
  if (name == "t") return View(run.t, self);
  return View(run.columns[IndexOf(run, name)], self);
}

std::vector<std::string> Names(const data::Run& run) {
  std::vector<std::string> names;
  for (const data::Quantity& quantity : run.quantities) names.push_back(quantity.name);
  return names;
}

void WriteCsv(const data::Run& run, const fs::path& path) {
  constexpr std::size_t kRows = 4096;  // that are text at a time
  std::vector<data::CsvColumn> columns = {{"t", "s"}};
  for (const data::Quantity& quantity : run.quantities) {
    columns.push_back({quantity.name, quantity.units});
  }
  data::TextFileWriter file(path.string());
  data::CsvWriter writer(columns);
  std::vector<double> row(columns.size());
  for (std::size_t i = 0; i < run.t.size(); ++i) {
    row[0] = run.t[i];
    for (std::size_t q = 0; q < run.columns.size(); ++q) row[q + 1] = run.columns[q][i];
    writer.Row(row);
    if (i % kRows == 0) file.Append(writer.Take());
  }
  file.Append(writer.Take());
  file.Commit();
}

void WriteRun(const Run& run, const fs::path& path) {
  if (data::FormatOf(path.string()) == data::FileFormat::kCsv) return WriteCsv(run.data, path);
  data::WriteRun(path.string(), run.data, ProvenanceOf(run.sources));
}

py::tuple Pickle(const Run& run) {
  const data::Run& d = run.data;
  std::vector<std::tuple<std::string, std::string, std::string>> quantities;
  for (const data::Quantity& q : d.quantities) {
    quantities.emplace_back(q.name, q.units, q.description);
  }
  py::list columns;
  for (const std::vector<double>& column : d.columns) columns.append(Owned(column));
  py::list summary_quantities, shapes;
  for (const data::Quantity& q : d.summary_quantities) {
    summary_quantities.append(py::make_tuple(q.name, q.units, q.description));
  }
  for (const data::BeamMotion& beam : d.shapes) {
    shapes.append(
        py::make_tuple(beam.name, Owned(beam.at), Owned(beam.xy), static_cast<int>(beam.kind)));
  }
  return py::make_tuple(Owned(d.t), quantities, columns, d.marks, py::cast(d.events), d.summary,
                        d.text, StateOf(run.sources), summary_quantities, Owned(d.shape_t), shapes);
}

std::shared_ptr<Run> Unpickle(const py::tuple& state) {
  auto run = std::make_shared<Run>();
  data::Run& d = run->data;
  d.t = NumbersFrom(state[0], "t");
  for (const py::handle& q : state[1]) {
    const auto words = q.cast<std::vector<std::string>>();
    d.quantities.push_back({words.at(0), words.at(1), words.at(2)});
  }
  for (const py::handle& column : state[2]) d.columns.push_back(NumbersFrom(column, "a column"));
  d.marks = state[3].cast<std::vector<std::string>>();
  d.events = state[4].cast<std::vector<data::RunEvent>>();
  d.summary = state[5].cast<std::map<std::string, double>>();
  d.text = state[6].cast<std::map<std::string, std::string>>();
  run->sources = SourcesOf(state[7].cast<SourceState>());
  for (const py::handle& q : state[8]) {
    const auto words = q.cast<std::vector<std::string>>();
    d.summary_quantities.push_back({words.at(0), words.at(1), words.at(2)});
  }
  d.shape_t = NumbersFrom(state[9], "shape_t");
  for (const py::handle& beam : state[10]) {
    const auto parts = beam.cast<py::tuple>();
    d.shapes.push_back({parts[0].cast<std::string>(), NumbersFrom(parts[1], "at"),
                        NumbersFrom(parts[2], "xy"),
                        static_cast<data::ShapeKind>(parts[3].cast<int>())});
  }
  return run;
}

// A beam's centre line as an array that the run keeps alive.
std::map<std::string, py::array_t<double>> ShapesOf(const py::object& self) {
  const data::Run& run = self.cast<Run&>().data;
  std::map<std::string, py::array_t<double>> out;
  for (const data::BeamMotion& beam : run.shapes) {
    if (beam.kind != data::ShapeKind::kBeam) continue;
    const py::array flat = View(beam.xy, self);
    out[beam.name] = flat.attr("reshape")(run.shape_t.size(), beam.at.size(), 2);
  }
  return out;
}

std::string Repr(const data::Run& run) {
  const std::string status = TextOf(run, "status");
  return fmt::format("<unfurl.Run: {}, {} of {}, {}{}>", status.empty() ? "no status" : status,
                     Plural(run.t.size(), "sample"),
                     run.quantities.size() == 1
                         ? "1 quantity"
                         : fmt::format("{} quantities", run.quantities.size()),
                     run.t.empty() ? "empty" : fmt::format("to {:g} s", run.t.back()),
                     run.events.empty() ? "" : ", " + Plural(run.events.size(), "event"));
}

}  // namespace

void BindRun(py::module_& m) {
  py::class_<data::RunEvent>(m, "RunEvent", "Something that happened at one time.")
      .def_readonly("t", &data::RunEvent::t, "[s]")
      .def_readonly("kind", &data::RunEvent::kind,
                    "'latch', 'contact_start', 'contact_end' or 'watch'.")
      .def_readonly("where", &data::RunEvent::where, "The joint, or the watch.")
      .def_readonly("data", &data::RunEvent::data,
                    "Numbers by name with unit: {'theta_rate [rad/s]': -0.8}.")
      .def(py::pickle(
          [](const data::RunEvent& e) { return py::make_tuple(e.t, e.kind, e.where, e.data); },
          [](const py::tuple& s) {
            return data::RunEvent{s[0].cast<double>(), s[1].cast<std::string>(),
                                  s[2].cast<std::string>(),
                                  s[3].cast<std::map<std::string, double>>()};
          }))
      .def("__repr__", [](const data::RunEvent& e) {
        return fmt::format("<unfurl.RunEvent: {} at {}, t = {:g} s>", e.kind, e.where, e.t);
      });

  py::class_<Run, std::shared_ptr<Run>>(
      m, "Run",
      "A simulated motion: n samples of every quantity, events, and what was counted.\n\n"
      "run['tip.x'] is the column of a quantity, a read-only view of shape (n,); "
      "run.units('tip.x')\n"
      "its unit.")
      .def(py::pickle(&Pickle, &Unpickle))
      .def("__len__", [](const Run& self) { return self.data.quantities.size(); })
      .def("__getitem__", &Column, py::arg("name"))
      .def("__contains__",
           [](const Run& self, const std::string& name) { return self.data.Find(name) >= 0; })
      .def("__iter__", [](const Run& self) { return py::iter(py::cast(Names(self.data))); })
      .def(
          "keys", [](const Run& self) { return Names(self.data); }, "Names of the quantities.")
      .def(
          "units",
          [](const Run& self, const std::string& name) {
            return name == "t" ? std::string("s")
                               : self.data.quantities[IndexOf(self.data, name)].units;
          },
          py::arg("name"), "Unit of a quantity; '1' for none.")
      .def(
          "description",
          [](const Run& self, const std::string& name) {
            return self.data.quantities[IndexOf(self.data, name)].description;
          },
          py::arg("name"), "What a quantity is, in one line.")
      .def_property_readonly(
          "t", [](const py::object& self) { return View(self.cast<Run&>().data.t, self); },
          "(n,) time of each sample [s].")
      .def_property_readonly(
          "marks", [](const Run& self) { return self.data.marks; },
          "Names of the marks; MARK.x and MARK.y are quantities.")
      .def_property_readonly(
          "events", [](const Run& self) { return self.data.events; }, "List of RunEvent.")
      .def_property_readonly(
          "shape_t",
          [](const py::object& self) { return View(self.cast<Run&>().data.shape_t, self); },
          "(s,) times at which the beams' shapes were kept [s]; empty: none were.")
      .def_property_readonly(
          "shapes", &ShapesOf,
          "Centre lines of the beams by name: (s, k, 2), x and y of k points [m].")
      .def_property_readonly(
          "summary", [](const Run& self) { return self.data.summary; },
          "Numbers of the whole run by name: steps, impacts, JOINT.latch_time [s] ..")
      .def_property_readonly(
          "text", [](const Run& self) { return self.data.text; },
          "Words by name: 'status', 'method', 'scene' ..")
      .def_property_readonly(
          "status", [](const Run& self) { return TextOf(self.data, "status"); },
          "'good', or how it ended.")
      .def_property_readonly(
          "message", [](const Run& self) { return TextOf(self.data, "message"); },
          "Why, where it is not good.")
      .def_property_readonly(
          "usable", [](const Run& self) { return TextOf(self.data, "status") == "good"; },
          "Whether it ran to its end.")
      .def("write", &WriteRun, py::arg("path"), "Writes the samples as .csv, or all of it as HDF5.")
      .def("__repr__", [](const Run& self) { return Repr(self.data); });
}

}  // namespace unfurl::python
