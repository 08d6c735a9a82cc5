#include <fmt/format.h>

#include <array>

#include "base/error.h"
#include "data/formats.h"
#include "data/tracks.h"
#include "measure/smooth.h"
#include "python/bindings.h"

namespace unfurl::python {
namespace {

using Tracks = Recorded<data::Tracks>;

void WriteTracks(const Tracks& tracks, const fs::path& path) {
  data::WriteTracksAny(path.string(), tracks.data, ProvenanceOf(tracks.sources));
}

// Covariances as Python gives them: (n, 6) as stored, (n, 3) standard deviations, or one number.
Eigen::MatrixXd CovarianceFrom(const py::object& cov, const py::object& sigma, Eigen::Index n) {
  if (cov.is_none() == sigma.is_none()) {
    throw py::value_error("give either cov, shape (n, 6) [m^2], or sigma [m]");
  }
  if (!cov.is_none()) {
    Eigen::MatrixXd out = PointsFrom(cov, {6}, "cov");
    if (out.cols() != n) throw py::value_error("cov: expected one row per sample");
    for (const Eigen::Index k : {0, 3, 5}) {
      if ((out.row(k).array() < 0.0).any()) throw py::value_error("cov: a variance is negative");
    }
    return out;
  }
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(6, n);
  Eigen::MatrixXd each(3, n);
  if (IsNumber(sigma)) {
    each.setConstant(sigma.cast<double>());
  } else {
    each = PointsFrom(sigma, {3}, "sigma");
    if (each.cols() != n) throw py::value_error("sigma: expected one row per sample");
  }
  if (!(each.array() > 0.0).all() || !each.allFinite()) {
    throw py::value_error("sigma: expected positive numbers");
  }
  constexpr std::array<Eigen::Index, 3> kDiagonal = {0, 3, 5};
  for (Eigen::Index k = 0; k < 3; ++k) out.row(kDiagonal[k]) = each.row(k).array().square();
  return out;
}

// NaN in all of it where a sample has no position.
data::SampleStatus SettleStatus(Eigen::Index i, data::Tracks* tracks) {
  if (tracks->p.col(i).allFinite()) {
    if (tracks->cov.col(i).allFinite()) return data::SampleStatus::kGood;
    throw py::value_error(fmt::format("cov: row {} is not finite, and that of p is", i));
  }
  tracks->p.col(i).setConstant(std::nan(""));
  tracks->cov.col(i).setConstant(std::nan(""));
  return data::SampleStatus::kUnsolvable;
}

Tracks MakeTracks(const py::object& times, const py::object& names, const py::object& p,
                  const py::object& cov, const py::object& sigma, const std::string& frame) {
  Tracks out;
  out.data.frame = frame;
  const std::vector<double> t = NumbersFrom(times, "t");
  const std::vector<std::string> mark = NamesFrom(names, "mark");
  Eigen::MatrixXd points = PointsFrom(p, {2, 3}, "p");
  const Eigen::Index n = points.cols();
  if (static_cast<Eigen::Index>(t.size()) != n || static_cast<Eigen::Index>(mark.size()) != n) {
    throw py::value_error(fmt::format("t, mark and p: expected the same length, got {}, {} and {}",
                                      t.size(), mark.size(), n));
  }
  out.data.p.setZero(3, n);
  out.data.p.topRows(points.rows()) = points;
  out.data.cov = CovarianceFrom(cov, sigma, n);
  out.data.shared.resize(3, 0);
  out.data.t = t;
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto k = static_cast<std::size_t>(i);
    if (!std::isfinite(t[k])) throw py::value_error("t: expected finite numbers");
    if (i > 0 && t[k] < t[k - 1]) {
      throw py::value_error(
          fmt::format("t: expected samples in order of time, and {} s follows {} s; np.argsort(t, "
                      "kind='stable') "
                      "gives the order",
                      t[k], t[k - 1]));
    }
    if (out.data.FindMark(mark[k]) < 0) out.data.marks.push_back(mark[k]);
    out.data.mark.push_back(out.data.FindMark(mark[k]));
    out.data.status.push_back(SettleStatus(i, &out.data));
  }
  return out;
}

using StateArray = py::array_t<double, py::array::f_style>;

template <int kRows>
py::array_t<double> MatrixState(const Eigen::Matrix<double, kRows, Eigen::Dynamic>& m) {
  return StateArray({m.rows(), m.cols()}, m.data());
}

py::tuple PickleTracks(const Tracks& tracks) {
  const data::Tracks& d = tracks.data;
  const auto numbers = [](const auto& of) {
    std::vector<std::int32_t> out;
    out.reserve(of.size());
    for (const auto& value : of) out.push_back(static_cast<std::int32_t>(value));
    return Owned(std::move(out));
  };
  return py::make_tuple(d.frame, d.marks, d.smoothed, Owned(d.t), Owned(d.mark),
                        MatrixState<3>(d.p), MatrixState<6>(d.cov), numbers(d.status),
                        d.shared_rank, MatrixState<3>(d.shared), d.cameras, Owned(d.used),
                        Owned(d.left_out), numbers(d.reason), StateOf(tracks.sources));
}

template <class Value>
std::vector<Value> ColumnOf(const py::object& array) {
  std::vector<Value> out;
  for (const std::int64_t value : array.cast<std::vector<std::int64_t>>()) {
    out.push_back(static_cast<Value>(value));
  }
  return out;
}

std::shared_ptr<Tracks> UnpickleTracks(const py::tuple& state) {
  const auto matrix = [&](int k, Eigen::Index rows) {
    const auto array = state[k].cast<StateArray>();
    return Eigen::MatrixXd(Eigen::Map<const Eigen::MatrixXd>(array.data(), rows, array.shape(1)));
  };
  auto tracks = std::make_shared<Tracks>();
  data::Tracks& d = tracks->data;
  d.frame = state[0].cast<std::string>();
  d.marks = state[1].cast<std::vector<std::string>>();
  d.smoothed = state[2].cast<bool>();
  d.t = state[3].cast<std::vector<double>>();
  d.mark = ColumnOf<std::int32_t>(state[4]);
  d.p = matrix(5, 3);
  d.cov = matrix(6, 6);
  d.status = ColumnOf<data::SampleStatus>(state[7]);
  d.shared_rank = state[8].cast<int>();
  d.shared = matrix(9, 3);
  d.cameras = state[10].cast<std::vector<std::string>>();
  d.used = ColumnOf<std::uint32_t>(state[11]);
  d.left_out = ColumnOf<std::uint32_t>(state[12]);
  d.reason = ColumnOf<data::SampleReason>(state[13]);
  tracks->sources = SourcesOf(state[14].cast<SourceState>());
  return tracks;
}

py::array_t<bool> UsableOf(const data::Tracks& tracks) {
  py::array_t<bool> out(static_cast<py::ssize_t>(tracks.size()));
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    out.mutable_at(static_cast<py::ssize_t>(i)) = data::Usable(tracks.status[i]);
  }
  return out;
}

py::array_t<std::int64_t> SamplesOf(const data::Tracks& tracks, const std::string& mark) {
  const int index = tracks.FindMark(mark);
  if (index < 0) RefuseName("mark", mark, tracks.marks);
  std::vector<std::int64_t> samples;
  for (const std::size_t i : tracks.SamplesOf(index))
    samples.push_back(static_cast<std::int64_t>(i));
  return Owned(std::move(samples));
}

Tracks Smooth(const Tracks& tracks, const std::vector<double>& events, double event_sigma,
              double longest_gap, double jerk) {
  return Long([&] {
    const measure::SmoothOptions options{
        .events = events, .event_sigma = event_sigma, .longest_gap = longest_gap, .jerk = jerk};
    return Tracks{measure::Smooth(tracks.data, options), tracks.sources};
  });
}

}  // namespace

void BindTracks(py::module_& m) {
  py::class_<Tracks, std::shared_ptr<Tracks>>(
      m, "Tracks",
      "Marks in time: n samples of m marks, in order of time.\n\n"
      "The error of sample i is random_i + shared[i] @ z: random_i has covariance cov[i] and is\n"
      "independent between samples; z ~ N(0, 1) is one draw of k numbers common to all samples,\n"
      "the calibration's. Arrays are read-only views without a copy.")
      .def(py::init(&MakeTracks), py::arg("t"), py::arg("mark"), py::arg("p"), py::kw_only(),
           py::arg("cov") = py::none(), py::arg("sigma") = py::none(), py::arg("frame") = "rig",
           "Tracks of your own.\n\n"
           "t: (n,) time stamps, in order [s]. mark: n names. p: (n, 3), or (n, 2) in a plane [m]; "
           "NaN where\n"
           "unsolvable. cov: (n, 6) xx, xy, xz, yy, yz, zz [m^2]; or sigma: (n, 3) or one number "
           "[m].")
      .def(py::pickle(&PickleTracks, &UnpickleTracks))
      .def("__len__", [](const Tracks& self) { return self.data.size(); })
      .def_property_readonly(
          "frame", [](const Tracks& self) { return self.data.frame; },
          "Frame of p: 'rig' (the survey's) or 'model'.")
      .def_property_readonly(
          "marks", [](const Tracks& self) { return self.data.marks; }, "Names of the m marks.")
      .def_property_readonly(
          "cameras", [](const Tracks& self) { return self.data.cameras; },
          "Names of the cameras; empty where nobody knows.")
      .def_property_readonly(
          "smoothed", [](const Tracks& self) { return self.data.smoothed; },
          "Whether they were smoothed: a fit refuses those.")
      .def_property_readonly(
          "t", [](const py::object& self) { return View(self.cast<Tracks&>().data.t, self); },
          "(n,) time stamp of each sample [s].")
      .def_property_readonly(
          "mark", [](const py::object& self) { return View(self.cast<Tracks&>().data.mark, self); },
          "(n,) index into marks.")
      .def_property_readonly(
          "p",
          [](const py::object& self) { return PointsView<3>(self.cast<Tracks&>().data.p, self); },
          "(n, 3) x, y, z; NaN where unsolvable [m].")
      .def_property_readonly(
          "cov",
          [](const py::object& self) { return PointsView<6>(self.cast<Tracks&>().data.cov, self); },
          "(n, 6) random covariance: xx, xy, xz, yy, yz, zz [m^2].")
      .def_property_readonly(
          "status",
          [](const py::object& self) {
            const auto& status = self.cast<Tracks&>().data.status;
            return View(reinterpret_cast<const std::int32_t*>(status.data()),
                        {static_cast<py::ssize_t>(status.size())}, self);
          },
          "(n,) unfurl.SampleStatus of each sample.")
      .def_property_readonly(
          "shared",
          [](const py::object& self) {
            const data::Tracks& tracks = self.cast<Tracks&>().data;
            const auto n = static_cast<py::ssize_t>(tracks.size());
            const py::ssize_t k = tracks.shared_rank, size = sizeof(double);
            return View(tracks.shared.data(), {n, 3, k}, self, {3 * k * size, size, 3 * size});
          },
          "(n, 3, k) what one sigma of the calibration's k errors does to each sample [m].")
      .def_property_readonly(
          "usable", [](const Tracks& self) { return UsableOf(self.data); },
          "(n,) bool: the sample has a position.")
      .def(
          "samples",
          [](const Tracks& self, const std::string& mark) { return SamplesOf(self.data, mark); },
          py::arg("mark"), "Indices of the usable samples of a mark, in order of time.")
      .def(
          "smooth", &Smooth, py::arg("events") = std::vector<double>{}, py::kw_only(),
          py::arg("event_sigma") = 0.0, py::arg("longest_gap") = 0.0, py::arg("jerk") = 0.0,
          "Smoothed tracks (Rauch, Tung and Striebel), for looking at and not for fitting.\n\n"
          "events: times at which something kicks the marks [s]. event_sigma: how well they are\n"
          "known [s]. longest_gap: a longer pause starts a new stretch [s]; 0: twenty median\n"
          "intervals of a mark. jerk: spectral density of the white jerk [m^2/s^5]; 0: by maximum\n"
          "likelihood.")
      .def("write", &WriteTracks, py::arg("path"),
           "Writes them; the ending tells the format: .h5, .csv, .c3d or .uff.")
      .def("__repr__", [](const Tracks& self) {
        const data::Tracks& d = self.data;
        const auto usable = std::count_if(d.status.begin(), d.status.end(), &data::Usable);
        return fmt::format("<unfurl.Tracks: {} of {} in frame '{}', {} usable{}>",
                           Plural(d.size(), "sample"), Plural(d.marks.size(), "mark"), d.frame,
                           usable, d.smoothed ? ", smoothed" : "");
      });
}

}  // namespace unfurl::python
