#include "python/placement.h"

#include <fmt/format.h>

#include <cmath>
#include <utility>

#include "base/error.h"

namespace unfurl::python {

namespace {

namespace py = pybind11;

std::pair<double, double> PairFrom(const py::object& given, const char* name) {
  try {
    const auto pair = given.cast<py::sequence>();
    if (pair.size() == 2) return {pair[0].cast<double>(), pair[1].cast<double>()};
  } catch (const py::cast_error&) {
  }
  throw py::type_error(fmt::format("{}: expected two numbers", name));
}

correlate::Prior PriorFrom(const py::object& given, const char* name) {
  if (given.is_none()) return {};
  if (py::isinstance<py::str>(given)) return correlate::ParsePrior(given.cast<std::string>(), name);
  if (PyNumber_Check(given.ptr()) != 0 && !py::isinstance<py::sequence>(given)) {
    const double value = given.cast<double>();
    if (!std::isfinite(value)) throw Error("is not a number", name, "give a finite one");
    return correlate::Prior::Known(value);
  }
  const auto [mean, sigma] = PairFrom(given, name);
  if (!std::isfinite(mean) || !(sigma > 0.0) || !std::isfinite(sigma)) {
    throw Error("is no mean and standard deviation", name, "give (mean, sigma) with sigma > 0");
  }
  return correlate::Prior::Normal(mean, sigma);
}

}  // namespace

correlate::Placement PlacementFrom(const py::object& offset, const py::object& drift,
                                   const py::object& frame) {
  correlate::Placement out;
  out.offset = PriorFrom(offset, "offset");
  out.drift = PriorFrom(drift, "drift");
  if (frame.is_none()) return out;
  if (py::isinstance<py::str>(frame)) {
    out.frame = correlate::ParseFramePrior(frame.cast<std::string>(), "frame");
    return out;
  }
  const auto [shift, rotation] = PairFrom(frame, "frame");
  if (!(shift > 0.0) || !(rotation > 0.0) || !std::isfinite(shift) || !std::isfinite(rotation)) {
    throw Error("are no standard deviations", "frame", "give (shift, rotation) > 0 in m and rad");
  }
  out.frame.kind = correlate::Foreknowledge::kNormal;
  out.frame.sigma_shift = shift;
  out.frame.sigma_rotation = rotation;
  return out;
}

}  // namespace unfurl::python
