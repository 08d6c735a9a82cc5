#include <fmt/format.h>
#include <fmt/ranges.h>
#include <signal.h>

#include <algorithm>

#include "base/progress.h"
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
  if (py::isinstance<py::list>(value) || py::isinstance<py::tuple>(value) ||
      py::isinstance<py::array>(value)) {
    std::string list;
    for (const py::handle& item : value) {
      const bool text = py::isinstance<py::str>(item);
      list += list.empty() ? "" : ", ";
      list += text ? '"' + TomlValue(item) + '"' : TomlValue(item);
    }
    return "[" + list + "]";
  }
  // TOML tells 3 from 3.0, and readers of numbers take both.
  return fmt::format("{:.17g}", value.cast<double>());
}

}  // namespace

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

Eigen::MatrixXd PointsFrom(const py::handle& array, const std::vector<py::ssize_t>& columns,
                           const std::string& what) {
  const auto points = py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(array);
  if (!points) {
    PyErr_Clear();
    throw py::value_error(what + ": expected numbers");
  }
  const bool fits = points.ndim() == 2 &&
                    std::find(columns.begin(), columns.end(), points.shape(1)) != columns.end();
  if (!fits) {
    throw py::value_error(
        fmt::format("{}: expected shape (n, {}), got {}", what, fmt::join(columns, " or "),
                    py::str(py::object(points.attr("shape"))).cast<std::string>()));
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

fs::path PathFrom(const py::object& object, const std::string& wanted) {
  try {
    return object.cast<fs::path>();
  } catch (const py::cast_error&) {
    throw py::type_error(
        fmt::format("expected {}, got {}", wanted,
                    py::str(py::type::of(object).attr("__name__")).cast<std::string>()));
  }
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
  if (!py::isinstance<py::dict>(set)) return set.cast<std::vector<std::string>>();
  for (const auto& [key, value] : set.cast<py::dict>()) {
    overrides.push_back(key.cast<std::string>() + "=" + TomlValue(value));
  }
  return overrides;
}

std::vector<Source> Joined(std::vector<Source> a, const std::vector<Source>& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

std::string Plural(std::size_t count, const char* word) {
  return fmt::format("{} {}{}", count, word, count == 1 ? "" : "s");
}

}  // namespace unfurl::python
