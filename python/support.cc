#include <fmt/format.h>
#include <fmt/ranges.h>
#include <signal.h>
#include <stdlib.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>
#include <string_view>

#include "base/progress.h"
#include "base/text.h"
#include "python/bindings.h"

namespace unfurl::python {

namespace {

// Of Python, while a guard is installed.
struct sigaction g_python_handler;
int g_guards = 0;  // that are installed; of the main thread alone

void OnSignal(int signal) {
  RequestInterrupt();
  g_python_handler.sa_handler(signal);  // Python learns of it too, and raises what it would
}

bool InMainThread() {
  const py::module_ threading = py::module_::import("threading");
  return threading.attr("current_thread")().is(threading.attr("main_thread")());
}

std::string TomlValue(const py::handle& value) {
  if (py::isinstance<py::bool_>(value)) return value.cast<bool>() ? "true" : "false";
  if (py::isinstance<py::str>(value)) return value.cast<std::string>();
  if (py::isinstance<py::int_>(value)) return py::str(value).cast<std::string>();
  if (py::isinstance<py::float_>(value)) {
    // TOML tells 3 from 3.0, and readers of numbers take both.
    return fmt::format("{:.17g}", value.cast<double>());
  }
  if (py::hasattr(value, "tolist")) return TomlValue(value.attr("tolist")());  // NumPy's
  if (py::isinstance<py::list>(value) || py::isinstance<py::tuple>(value)) {
    std::string list;
    for (const py::handle& item : value) {
      const bool text = py::isinstance<py::str>(item);
      list += list.empty() ? "" : ", ";
      list += text ? '"' + TomlValue(item) + '"' : TomlValue(item);
    }
    return "[" + list + "]";
  }
  if (py::hasattr(value, "__fspath__")) return TomlValue(value.attr("__fspath__")());
  throw py::type_error(
      fmt::format("set: expected numbers, text, true or false, or lists of those, got {}",
                  py::str(py::type::of(value).attr("__name__")).cast<std::string>()));
}

}  // namespace

void RefuseName(const std::string& what, const std::string& name,
                const std::vector<std::string>& known) {
  const std::string nearest = NearestName(name, known);
  throw py::key_error(fmt::format("no {} '{}'{}", what, name,
                                  nearest.empty() ? "" : "; did you mean '" + nearest + "'?"));
}

InterruptGuard::InterruptGuard() {
  if (!InMainThread()) return;
  if (g_guards == 0) {
    struct sigaction now = {};
    sigaction(SIGINT, nullptr, &now);
    const bool plain = (now.sa_flags & SA_SIGINFO) == 0;
    if (!plain || now.sa_handler == SIG_DFL || now.sa_handler == SIG_IGN) return;
    g_python_handler = now;
    ClearInterrupt();
    now.sa_handler = OnSignal;
    sigaction(SIGINT, &now, nullptr);
  }
  ++g_guards;
  installed_ = true;
}

InterruptGuard::~InterruptGuard() { Leave(); }

void InterruptGuard::Leave() {
  if (!std::exchange(installed_, false) || --g_guards > 0) return;
  sigaction(SIGINT, &g_python_handler, nullptr);
  ClearInterrupt();
}

void InterruptGuard::Raise() {
  Leave();
  if (PyErr_CheckSignals() == 0) PyErr_SetNone(PyExc_KeyboardInterrupt);
  throw py::error_already_set();
}

void CallbackError::Call(const std::function<void()>& call) {
  if (failed_) throw Interrupted();
  const py::gil_scoped_acquire lock;
  try {
    call();
  } catch (...) {
    const std::lock_guard<std::mutex> guard(mutex_);
    if (!error_) error_ = std::current_exception();
    failed_ = true;
  }
  if (failed_) throw Interrupted();
}

void CallbackError::Rethrow() {
  if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
}

std::shared_ptr<py::object> Shared(const py::object& callable) {
  if (callable.is_none()) return nullptr;
  if (PyCallable_Check(callable.ptr()) == 0) throw py::type_error("expected a callable, or None");
  return {new py::object(callable), [](py::object* object) {
            const py::gil_scoped_acquire lock;
            delete object;
          }};
}

Source SourceOf(const fs::path& path) {
  std::error_code ignored;
  return {path.string(), static_cast<std::int64_t>(fs::file_size(path, ignored)),
          fs::last_write_time(path, ignored)};
}

data::Provenance ProvenanceOf(const std::vector<Source>& sources) {
  data::Provenance provenance;
  provenance.program = data::ProgramVersion();
  std::string command = "python3";
  const py::object argv = py::module_::import("sys").attr("argv");
  for (const py::handle& word : argv) command += " " + word.cast<std::string>();
  provenance.command = command;
  for (const Source& source : sources) {
    const Source now = SourceOf(source.path);
    if (now.size == source.size && now.time == source.time) {
      provenance.AddInput(source.path);
    } else {
      provenance.inputs.push_back({source.path, "changed since it was read"});
    }
  }
  return provenance;
}

py::array_t<double> MatrixView(const Eigen::MatrixXd& matrix, py::handle owner) {
  constexpr py::ssize_t kSize = sizeof(double);
  return View(matrix.data(), {matrix.rows(), matrix.cols()}, owner, {kSize, kSize * matrix.rows()});
}

namespace {

using Numbers = py::array_t<double, py::array::c_style | py::array::forcecast>;

std::string TypeName(const py::handle& object) {
  return py::str(py::type::of(object).attr("__name__")).cast<std::string>();
}

// Whatever NumPy makes an array of real numbers of. Text and complex numbers, which it would cast
// without a word, are refused; what is masked has no value.
Numbers RealNumbers(const py::handle& object, const std::string& what) {
  auto given = py::reinterpret_borrow<py::object>(object);
  if (const py::module_ masked = py::module_::import("numpy.ma");
      masked.attr("isMaskedArray")(given).cast<bool>()) {
    given = masked.attr("filled")(given.attr("astype")("f8"), std::nan(""));
  }
  const auto any = py::array::ensure(given);
  if (!any) {
    PyErr_Clear();
    throw py::type_error(
        fmt::format("{}: expected an array of numbers, got {}", what, TypeName(object)));
  }
  constexpr std::string_view kReal = "fiubO";  // kinds of NumPy; objects are tried one by one
  if (kReal.find(any.dtype().kind()) != std::string_view::npos) {
    if (auto numbers = Numbers::ensure(any)) return numbers;
    PyErr_Clear();
  }
  throw py::type_error(fmt::format("{}: expected real numbers, got {}", what,
                                   py::str(any.dtype()).cast<std::string>()));
}

std::string ShapeText(const py::array& array) {
  return py::str(py::object(array.attr("shape"))).cast<std::string>();
}

}  // namespace

std::vector<double> NumbersFrom(const py::handle& array, const std::string& what) {
  const Numbers numbers = RealNumbers(array, what);
  if (numbers.ndim() != 1) {
    throw py::value_error(fmt::format("{}: expected shape (n,), got {}", what, ShapeText(numbers)));
  }
  return {numbers.data(), numbers.data() + numbers.size()};
}

std::vector<std::string> NamesFrom(const py::handle& names, const std::string& what) {
  std::vector<std::string> out;
  if (!py::isinstance<py::str>(names) && py::isinstance<py::iterable>(names)) {
    for (const py::handle& name : names) {
      if (!py::isinstance<py::str>(name)) {
        throw py::type_error(fmt::format("{}: expected names, got {}", what, TypeName(name)));
      }
      out.push_back(name.cast<std::string>());
    }
    return out;
  }
  throw py::type_error(fmt::format("{}: expected a list of names, got {}", what, TypeName(names)));
}

Eigen::MatrixXd PointsFrom(const py::handle& array, const std::vector<py::ssize_t>& columns,
                           const std::string& what) {
  const Numbers points = RealNumbers(array, what);
  const bool fits = points.ndim() == 2 &&
                    std::find(columns.begin(), columns.end(), points.shape(1)) != columns.end();
  if (!fits) {
    throw py::value_error(fmt::format("{}: expected shape (n, {}), got {}", what,
                                      fmt::join(columns, " or "), ShapeText(points)));
  }
  return Eigen::Map<const Eigen::MatrixXd>(points.data(), points.shape(1), points.shape(0));
}

std::function<void(double)> ProgressOf(const py::object& progress, CallbackError* errors) {
  const auto callable = Shared(progress);
  return [callable, errors](double done) {
    ThrowIfInterrupted();
    if (callable != nullptr) errors->Call([&] { (*callable)(done); });
  };
}

std::function<void(double, const std::string&)> StepProgressOf(const py::object& progress,
                                                               CallbackError* errors) {
  return [done = ProgressOf(progress, errors)](double share, const std::string&) { done(share); };
}

std::string NameOf(const std::vector<Source>& sources, const char* otherwise) {
  return sources.empty() ? otherwise : sources.front().path;
}

void ReadingsFrom(const py::object& u, const py::object& s, std::size_t cameras,
                  Eigen::MatrixXd* u_px, Eigen::MatrixXd* s_px) {
  const auto c = static_cast<py::ssize_t>(cameras);
  *u_px = PointsFrom(u, {c}, "u").transpose();
  if (IsNumber(s)) {
    *s_px = u_px->array().isNaN().select(Eigen::MatrixXd::Constant(u_px->rows(), c, std::nan("")),
                                         s.cast<double>());
  } else {
    *s_px = PointsFrom(s, {c}, "s").transpose();
  }
  if (s_px->rows() != u_px->rows()) {
    throw py::value_error("u and s: expected the same number of rows");
  }
  if (u_px->array().isInf().any()) throw py::value_error("u: expected pixels, or NaN: not seen");
  if (!(u_px->array().isNaN() || (s_px->array() > 0.0 && s_px->array().isFinite())).all()) {
    throw py::value_error("s: expected a positive number for every reading");
  }
}

fs::path PathFrom(const py::object& object, const std::string& wanted) {
  // A path's own code may raise, and be where Ctrl-C falls: the conversion of the library takes all
  // of that for another type.
  PyObject* const text = PyOS_FSPath(object.ptr());
  if (text == nullptr && !PyErr_ExceptionMatches(PyExc_TypeError)) throw py::error_already_set();
  try {
    if (text != nullptr) return py::reinterpret_steal<py::object>(text).cast<fs::path>();
  } catch (const py::cast_error&) {
    // Said below.
  }
  PyErr_Clear();
  throw py::type_error(
      fmt::format("expected {}, got {}", wanted,
                  py::str(py::type::of(object).attr("__name__")).cast<std::string>()));
}

py::tuple CornersOf(const Eigen::Vector3d& low, const Eigen::Vector3d& high) {
  return py::make_tuple(Owned(std::vector<double>(low.data(), low.data() + 3)),
                        Owned(std::vector<double>(high.data(), high.data() + 3)));
}

py::str FileText(const std::string& text) {
  return py::reinterpret_steal<py::str>(
      PyUnicode_DecodeFSDefaultAndSize(text.data(), static_cast<Py_ssize_t>(text.size())));
}

std::vector<std::string> OverridesFrom(const py::object& set) {
  std::vector<std::string> overrides;
  if (set.is_none()) return overrides;
  if (!py::isinstance<py::dict>(set)) return NamesFrom(set, "set");
  for (const auto& [key, value] : set.cast<py::dict>()) {
    overrides.push_back(py::str(key).cast<std::string>() + "=" + TomlValue(value));
  }
  return overrides;
}

std::vector<Source> Joined(std::vector<Source> a, const std::vector<Source>& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

SourceState StateOf(const std::vector<Source>& sources) {
  SourceState state;
  for (const Source& s : sources) {
    state.emplace_back(s.path, s.size, s.time.time_since_epoch().count());
  }
  return state;
}

std::vector<Source> SourcesOf(const SourceState& state) {
  std::vector<Source> sources;
  for (const auto& [path, size, ticks] : state) {
    sources.push_back({path, size, fs::file_time_type(fs::file_time_type::duration(ticks))});
  }
  return sources;
}

namespace {

// A folder that is gone when the object is.
class TemporaryFolder {
 public:
  TemporaryFolder() : path_((fs::temp_directory_path() / "unfurl-XXXXXX").string()) {
    if (mkdtemp(path_.data()) == nullptr) {
      throw Error("no temporary folder can be made", path_, "check TMPDIR", ErrorKind::kMachine);
    }
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  std::string File() const { return path_ + "/record.h5"; }

 private:
  std::string path_;
};

}  // namespace

py::bytes FileBytes(const std::function<void(const std::string& path)>& write) {
  const TemporaryFolder folder;
  write(folder.File());
  std::ostringstream bytes;
  bytes << std::ifstream(folder.File(), std::ios::binary).rdbuf();
  return {bytes.str()};
}

void ReadFileBytes(const std::string& bytes, const std::function<void(const std::string&)>& read) {
  const TemporaryFolder folder;
  std::ofstream(folder.File(), std::ios::binary) << bytes;
  read(folder.File());
}

bool IsNumber(const py::object& object) {
  return PyNumber_Check(object.ptr()) != 0 &&
         py::module_::import("numpy").attr("ndim")(object).cast<int>() == 0;
}

std::string Plural(std::size_t count, const char* word) {
  return fmt::format("{} {}{}", count, word, count == 1 ? "" : "s");
}

}  // namespace unfurl::python
