#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <Eigen/Core>
#include <atomic>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "base/error.h"
#include "data/provenance.h"

namespace unfurl::data {
struct Lab;
}

namespace unfurl::python {

namespace py = pybind11;
namespace fs = std::filesystem;

/// Each file of this room adds its part to the module.
void BindErrors(py::module_& m);
void BindTracks(py::module_& m);
void BindRun(py::module_& m);
void BindOptics(py::module_& m);       // survey, rig, lab, trial
void BindCalibration(py::module_& m);  // calibrate, check
void BindWand(py::module_& m);         // a bar's readings, calibrate_wand
void BindHealth(py::module_& m);
void BindPlan(py::module_& m);
void BindMeasure(py::module_& m);  // expose, reconstruct, smooth
void BindSim(py::module_& m);
void BindCompare(py::module_& m);
void BindChannels(py::module_& m);  // of instruments other than cameras
void BindRepeat(py::module_& m);    // before fits, which have them
void BindFit(py::module_& m);
void BindStudy(py::module_& m);
void BindCost(py::module_& m);
void BindEffects(py::module_& m);  // after fits, which they have
void BindDesign(py::module_& m);
void BindCampaign(py::module_& m);
void BindLines(py::module_& m);  // raw lines, and surveys in parts
void BindLoad(py::module_& m);

/// What `load` asks of the files that own these types.
py::object LoadScene(const fs::path& path);
py::object LoadModes(const fs::path& path);
py::object LoadStudy(const fs::path& path);
py::object LoadFit(const fs::path& path);
py::object LoadCampaign(const fs::path& path);

/// Raises KeyError: there is no `what` of this name ("quantity"), with the nearest of those that
/// there are.
[[noreturn]] void RefuseName(const std::string& what, const std::string& name,
                             const std::vector<std::string>& known);

/// A file that a record was read from, as it was then.
struct Source {
  std::string path;
  std::int64_t size = 0;  // [byte]
  fs::file_time_type time;
};
Source SourceOf(const fs::path& path);
/// The first one's path, for messages; `otherwise` of a record that came from no file.
std::string NameOf(const std::vector<Source>& sources, const char* otherwise);

/// A record of the library with the files that it was made from. Arrays of a record are views into
/// it, so records do not change once Python has them.
template <class T>
struct Recorded {
  T data;
  std::vector<Source> sources;
};

/// What is stored with a file that Python writes: the script's command and its inputs by hash. An
/// input that has changed since it was read is said to have.
data::Provenance ProvenanceOf(const std::vector<Source>& sources);

/// A read-only array over memory that `owner` keeps alive. Strides in bytes; empty: C order.
template <class T>
py::array_t<T> View(const T* values, std::vector<py::ssize_t> shape, py::handle owner,
                    std::vector<py::ssize_t> strides = {}) {
  py::array_t<T> array = strides.empty()
                             ? py::array_t<T>(std::move(shape), values, owner)
                             : py::array_t<T>(std::move(shape), std::move(strides), values, owner);
  array.attr("flags").attr("writeable") = false;
  return array;
}

template <class T>
py::array_t<T> View(const std::vector<T>& values, py::handle owner) {
  return View(values.data(), {static_cast<py::ssize_t>(values.size())}, owner);
}

/// The same of a member of its owner, for a property.
template <class Owner>
auto ViewOf(std::vector<double> Owner::*member) {
  return [member](const py::object& self) { return View(self.cast<Owner&>().*member, self); };
}

/// A matrix of k rows and n columns as an array of shape (n, k): points row by row.
template <int kRows>
py::array_t<double> PointsView(const Eigen::Matrix<double, kRows, Eigen::Dynamic>& points,
                               py::handle owner) {
  return View(points.data(), {points.cols(), points.rows()}, owner);
}

/// Any matrix of Eigen's own layout, as it is.
py::array_t<double> MatrixView(const Eigen::MatrixXd& matrix, py::handle owner);

/// An array that owns what it shows.
template <class T>
py::array_t<T> Owned(std::vector<T> values) {
  auto* kept = new std::vector<T>(std::move(values));
  const py::capsule owner(kept, [](void* p) { delete static_cast<std::vector<T>*>(p); });
  return View(*kept, owner);
}

/// n numbers as Python gives them: any array or sequence of real numbers; what is masked is NaN.
/// Throws TypeError or ValueError naming `what`.
std::vector<double> NumbersFrom(const py::handle& array, const std::string& what);

/// Whether it is a Python number, or NumPy's, or an array without dimensions.
bool IsNumber(const py::object& object);

/// n names. Throws TypeError naming `what`.
std::vector<std::string> NamesFrom(const py::handle& names, const std::string& what);

/// Points as Python gives them, shape (n, k), to k x n; as for NumbersFrom.
Eigen::MatrixXd PointsFrom(const py::handle& array, const std::vector<py::ssize_t>& columns,
                           const std::string& what);

/// While it lives Ctrl-C ends the library's work, if this is Python's main thread; afterwards
/// Python's own handler is back. Made and destroyed with the interpreter's lock.
class InterruptGuard {
 public:
  InterruptGuard();
  ~InterruptGuard();
  InterruptGuard(const InterruptGuard&) = delete;
  InterruptGuard& operator=(const InterruptGuard&) = delete;
  /// Of work that ended by Interrupted: raises what Python's handler raises, else
  /// KeyboardInterrupt.
  [[noreturn]] void Raise();

 private:
  void Leave();
  bool installed_ = false;
};

/// Work that may take long: without the interpreter's lock, and Ctrl-C ends it.
template <class Work>
auto Long(Work&& work) {
  InterruptGuard guard;
  try {
    const py::gil_scoped_release released;
    return work();
  } catch (const Interrupted&) {
    guard.Raise();
  }
}

/// An exception of a Python callable that was called from a thread of the library. There it ends
/// the work as an interruption; Rethrow, with the lock, raises it where the work was asked for.
class CallbackError {
 public:
  /// Calls `call` with the lock. After an exception, and ever after it: throws Interrupted.
  void Call(const std::function<void()>& call);
  void Rethrow();

 private:
  std::mutex mutex_;
  std::exception_ptr error_;
  std::atomic<bool> failed_{false};
};

/// The same as Long for work that calls back through `errors`.
template <class Work>
auto LongWithCallbacks(CallbackError& errors, Work&& work) {
  InterruptGuard guard;
  try {
    const py::gil_scoped_release released;
    return work();
  } catch (const Interrupted&) {
    errors.Rethrow();
    guard.Raise();
  }
}

/// A Python callable that C++ may copy and drop without the lock; `none` gives an empty pointer.
std::shared_ptr<py::object> Shared(const py::object& callable);

/// For the options of long calls: heeds Ctrl-C, and calls `progress`, unless it is None, with the
/// share that is done.
std::function<void(double)> ProgressOf(const py::object& progress, CallbackError* errors);

/// The same for calls that also say what they are at.
std::function<void(double, const std::string&)> StepProgressOf(const py::object& progress,
                                                               CallbackError* errors);

/// {"joint.j.spring.stiffness": 3.0} or ["key=value"] as the overrides of the TOML readers.
std::vector<std::string> OverridesFrom(const py::object& set);

/// Readings of `cameras` cameras, NaN: not seen, and their standard deviations, an array of the
/// same shape or one number [px]. Throws ValueError for what neither is a reading nor says that it
/// is none.
void ReadingsFrom(const py::object& u, const py::object& s, std::size_t cameras,
                  Eigen::MatrixXd* u_px, Eigen::MatrixXd* s_px);

/// A path as Python has them: str, bytes or anything with __fspath__. Throws TypeError that names
/// what is `wanted` ("a Rig or a path").
fs::path PathFrom(const py::object& object, const std::string& wanted);

/// A record as it is, or read from the path that was given in its place.
template <class T, class Read>
std::shared_ptr<T> RecordFrom(const py::object& object, const std::string& wanted,
                              const Read& read) {
  if (py::isinstance<T>(object)) return object.cast<std::shared_ptr<T>>();
  const fs::path path = PathFrom(object, wanted + " or a path");
  const Source source = SourceOf(path);
  const py::gil_scoped_release released;
  return std::make_shared<T>(T{read(path.string()), {source}});
}

/// A laboratory as it is, or read from the path that was given in its place.
std::shared_ptr<data::Lab> LabFrom(const py::object& lab_or_path);

/// Parts of a record as a list; each keeps the record alive.
template <class Part>
py::list PartsOf(const py::object& self, const std::vector<Part>& parts) {
  py::list list;
  for (const Part& part : parts) {
    list.append(py::cast(&part, py::return_value_policy::reference_internal, self));
  }
  return list;
}

/// The corners of a box, (3,) each.
py::tuple CornersOf(const Eigen::Vector3d& low, const Eigen::Vector3d& high);

/// Text of a file name: bytes that are no UTF-8 become what os.fsdecode makes of them.
py::str FileText(const std::string& text);

std::vector<Source> Joined(std::vector<Source> a, const std::vector<Source>& b);

/// The sources of a record as Python pickles them, and back.
using SourceState = std::vector<std::tuple<std::string, std::int64_t, std::int64_t>>;
SourceState StateOf(const std::vector<Source>& sources);
std::vector<Source> SourcesOf(const SourceState& state);

/// The bytes of a file that `write` makes, and `read` of a file of such bytes: records that know
/// their file are pickled so.
py::bytes FileBytes(const std::function<void(const std::string& path)>& write);
void ReadFileBytes(const std::string& bytes, const std::function<void(const std::string&)>& read);

/// Pickling of a Recorded<T> by way of its file.
template <class T, class Write, class Read>
auto PickledAsFile(const Write& write, const Read& read) {
  return py::pickle(
      [write](const Recorded<T>& record) {
        const py::bytes bytes = FileBytes(
            [&](const std::string& path) { write(path, record.data, data::Provenance()); });
        return py::make_tuple(bytes, StateOf(record.sources));
      },
      [read](const py::tuple& state) {
        auto record = std::make_shared<Recorded<T>>();
        ReadFileBytes(state[0].cast<std::string>(),
                      [&](const std::string& path) { record->data = read(path); });
        record->sources = SourcesOf(state[1].cast<SourceState>());
        return record;
      });
}

/// "1 mark", "3 marks".
std::string Plural(std::size_t count, const char* word);

}  // namespace unfurl::python
