#include <fmt/format.h>

#include "base/error.h"
#include "correlate/compare/channel_comparison.h"
#include "data/channels.h"
#include "data/fit.h"
#include "data/formats.h"
#include "data/run.h"
#include "python/bindings.h"
#include "python/placement.h"
#include "study/compare_study.h"

namespace unfurl::python {
namespace {

using data::Channel;
using FitChannel = data::FitRecord::Channel;
using Run = Recorded<data::Run>;

std::shared_ptr<Channel> Make(const std::string& name, const py::object& t, const py::object& y,
                              const std::string& unit, const py::object& sigma) {
  auto out = std::make_shared<Channel>();
  out->name = name;
  out->unit = unit;
  out->where = name;
  out->t = NumbersFrom(t, "t");
  out->y = NumbersFrom(y, "y");
  if (!sigma.is_none()) out->sigma = NumbersFrom(sigma, "sigma");
  data::CheckChannel(*out);
  return out;
}

using Channels = std::vector<std::shared_ptr<Channel>>;

std::vector<Channel> Copies(const Channels& from) {
  std::vector<Channel> out;
  for (const auto& one : from) out.push_back(*one);
  return out;
}

// Channels, or a path of any record that has them.
std::vector<Channel> ChannelsFrom(const py::object& object) {
  if (py::isinstance<Channel>(object)) return {object.cast<const Channel&>()};
  if (py::isinstance<py::list>(object) || py::isinstance<py::tuple>(object)) {
    return Copies(object.cast<Channels>());
  }
  const std::string path = PathFrom(object, "Channels or a path").string();
  return Long([&] { return correlate::ChannelsOf(path); });
}

bool IsStudy(const py::object& record) {
  if (py::isinstance<data::Study>(record)) return true;
  if (!py::isinstance<py::str>(record) && !py::hasattr(record, "__fspath__")) return false;
  return data::FormatOf(PathFrom(record, "a path").string()) == data::FileFormat::kToml;
}

std::shared_ptr<correlate::Comparison> CompareStudy(
    const py::object& record, const py::object& reference, const std::string& trial,
    const std::vector<correlate::ChannelName>& pairs, const correlate::ComparisonOptions& options) {
  const std::vector<std::string> names = study::StudyChannelNames(pairs, "channels");
  const bool is_run = py::isinstance<Run>(reference);
  const std::string path =
      is_run ? std::string() : PathFrom(reference, "a Run or its path").string();
  const auto study =
      py::isinstance<data::Study>(record)
          ? record.cast<std::shared_ptr<data::Study>>()
          : std::make_shared<data::Study>(data::ReadStudy(PathFrom(record, "a path").string()));
  const Run* run = is_run ? &reference.cast<const Run&>() : nullptr;
  return Long([&] {
    return std::make_shared<correlate::Comparison>(
        run != nullptr
            ? study::CompareStudy(*study, run->data, "run", trial, names, options)
            : study::CompareStudy(*study, data::ReadRun(path), path, trial, names, options));
  });
}

std::shared_ptr<correlate::Comparison> CompareOfChannels(
    const py::object& record, const py::object& reference,
    const std::map<std::string, std::string>& channels, std::optional<double> start,
    std::optional<double> end, const std::string& modes, bool clock_drift, const py::object& offset,
    const py::object& drift, const std::string& trial) {
  correlate::ComparisonOptions options;
  options.from = start;
  options.to = end;
  options.modes = correlate::ParseExcitation(modes, "modes");
  options.clock_drift = clock_drift;
  options.placement = PlacementFrom(offset, drift, py::none());
  if (start && end && !(*start < *end)) {
    throw Error(fmt::format("no time between {} and {} s", *start, *end), "start, end",
                "give the earlier one first");
  }
  std::vector<correlate::ChannelName> pairs;
  std::vector<std::string> names;
  for (const auto& [name, of] : channels) {
    pairs.push_back({name, of});
    names.push_back(name);
  }
  if (IsStudy(record)) return CompareStudy(record, reference, trial, pairs, options);
  if (!trial.empty()) {
    throw Error("record is no study", "trial", "leave it out, or give a Study");
  }
  const bool alone = reference.is_none();
  const auto many = [](const py::object& o) {
    return py::isinstance<Channel>(o) || py::isinstance<py::list>(o) ||
           py::isinstance<py::tuple>(o);
  };
  const bool paths = !alone && !many(record) && !many(reference);
  if (paths) {  // of a run more is known than its quantities
    const std::string a = PathFrom(record, "a path").string();
    const std::string b = PathFrom(reference, "a path").string();
    return Long([&] {
      return std::make_shared<correlate::Comparison>(
          correlate::CompareChannels(a, b, pairs, options));
    });
  }
  const std::vector<Channel> a = ChannelsFrom(record);
  if (alone) {
    return Long([&] {
      return std::make_shared<correlate::Comparison>(
          correlate::DescribeChannels(a, names, options));
    });
  }
  const std::vector<Channel> b = ChannelsFrom(reference);
  return Long([&] {
    return std::make_shared<correlate::Comparison>(
        correlate::CompareChannels(a, b, pairs, options));
  });
}

}  // namespace

void BindChannels(py::module_& m) {
  py::class_<Channel, std::shared_ptr<Channel>>(m, "Channel",
                                                "What an instrument other than a camera recorded.")
      .def(py::init(&Make), py::arg("name"), py::arg("t"), py::arg("y"), py::kw_only(),
           py::arg("unit") = "", py::arg("sigma") = py::none(),
           "t: (n,) ascending [s]; y: (n,) readings; sigma: (n,) their standard deviations.")
      .def_readonly("name", &Channel::name)
      .def_readonly("unit", &Channel::unit, "Of the readings; '' where none is told.")
      .def_property_readonly("t", ViewOf(&Channel::t), "(n,) on the file's clock [s].")
      .def_property_readonly("y", ViewOf(&Channel::y), "(n,) readings.")
      .def_property_readonly("sigma", ViewOf(&Channel::sigma), "(n,) or empty: none is told.")
      .def("__len__", [](const Channel& c) { return c.t.size(); })
      .def("__repr__", [](const Channel& c) {
        return fmt::format("<unfurl.Channel '{}' [{}]: {}>", c.name, c.unit,
                           Plural(c.t.size(), "reading"));
      });
  py::class_<FitChannel>(m, "FitChannel",
                         "A channel of a fitted trial, and the model at the estimate.")
      .def_readonly("name", &FitChannel::name)
      .def_readonly("quantity", &FitChannel::quantity, "Of the model's run.")
      .def_readonly("unit", &FitChannel::unit)
      .def_property_readonly("t", ViewOf(&FitChannel::t), "(n,) on the channel's clock [s].")
      .def_property_readonly("measured", ViewOf(&FitChannel::measured), "(n,)")
      .def_property_readonly("sigma", ViewOf(&FitChannel::sigma), "(n,)")
      .def_property_readonly("simulated", ViewOf(&FitChannel::simulated),
                             "(n,) as the instrument would show it; NaN: the model has none.")
      .def("__repr__", [](const FitChannel& c) {
        return fmt::format("<unfurl.FitChannel '{}' ({}): {}>", c.name, c.quantity,
                           Plural(c.t.size(), "reading"));
      });
  m.def(
      "read_channels",
      [](const fs::path& path) {
        Channels out;
        for (Channel& c : Long([&] { return correlate::ChannelsOf(path.string()); })) {
          out.push_back(std::make_shared<Channel>(std::move(c)));
        }
        return out;
      },
      py::arg("path"),
      "All channels of a file (.csv, .uff, .h5), quantities of a run, coordinates of tracks.");
  m.def("compare_channels", &CompareOfChannels, py::arg("record"),
        py::arg("reference") = py::none(), py::kw_only(),
        py::arg("channels") = std::map<std::string, std::string>{}, py::arg("start") = py::none(),
        py::arg("end") = py::none(), py::arg("modes") = "auto", py::arg("clock_drift") = false,
        py::arg("offset") = py::none(), py::arg("drift") = py::none(), py::arg("trial") = "",
        "Channels of a record beside those of a reference (lists of Channel, or paths): the clock\n"
        "found or taken as known, then scores, spectra and modes, each in its unit. Without a\n"
        "reference: spectra and modes of the record alone.\n\n"
        "channels: {name: name in the reference}; none: those of the same name. modes: 'auto',\n"
        "'decay' or 'ambient', what the record's vibration is. start, end: of spectra and modes\n"
        "[s]. offset [s], drift [-]: as in compare. A Study (or its path) for the record: the\n"
        "instruments of a trial of its (trial: its name; '': the only one) as it says that they\n"
        "are, against a Run or its path.");
}

}  // namespace unfurl::python
