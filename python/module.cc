#include "python/bindings.h"

namespace unfurl::python {
namespace {

// `unfurl.Error` is a Python exception with the three parts of the line as attributes; one kind
// of it, `unfurl.MachineError`, says that the machine refused.
PyObject* g_error = nullptr;
PyObject* g_machine_error = nullptr;

// pybind11 passes it by value. NOLINTNEXTLINE(performance-unnecessary-value-param)
void Translate(std::exception_ptr thrown) {
  try {
    if (thrown) std::rethrow_exception(thrown);
  } catch (const Error& error) {
    PyObject* type = error.kind() == ErrorKind::kMachine ? g_machine_error : g_error;
    const py::object raised = py::reinterpret_borrow<py::object>(type)(FileText(error.what()));
    raised.attr("what") = FileText(error.problem());
    raised.attr("where") = FileText(error.where());
    raised.attr("remedy") = FileText(error.remedy());
    PyErr_SetObject(type, raised.ptr());
  } catch (const Interrupted&) {
    PyErr_SetNone(PyExc_KeyboardInterrupt);
  }
}

PyObject* MakeError(py::module_& m, const char* name, const char* doc, PyObject* base) {
  const std::string qualified = std::string("unfurl.") + name;
  PyObject* type = PyErr_NewExceptionWithDoc(qualified.c_str(), doc, base, nullptr);
  if (type == nullptr) throw py::error_already_set();
  for (const char* part : {"what", "where", "remedy"}) {
    py::handle(type).attr(part) = "";
  }
  m.attr(name) = py::reinterpret_borrow<py::object>(type);
  return type;
}

}  // namespace

void BindErrors(py::module_& m) {
  g_error = MakeError(m, "Error",
                      "Bad input or use, which you can mend.\n\n"
                      "what: the problem. where: file:line:key, as far as known.\n"
                      "remedy: what to do about it. str() is the whole in one line.",
                      PyExc_ValueError);
  g_machine_error =
      MakeError(m, "MachineError", "The machine refused: disk full, no permission.", g_error);
  py::register_exception_translator(&Translate);
}

}  // namespace unfurl::python

PYBIND11_MODULE(_core, m) {
  namespace py = pybind11;
  using namespace unfurl::python;
  m.doc() = "The library behind the package `unfurl`; import that.";
  m.attr("__version__") = unfurl::data::ProgramVersion().substr(sizeof("unfurl ") - 1);
  BindErrors(m);
  BindTracks(m);
  BindRun(m);
  BindOptics(m);
  BindCalibration(m);
  BindWand(m);
  BindHealth(m);
  BindPlan(m);
  BindMeasure(m);
  BindSim(m);
  BindCompare(m);
  BindChannels(m);
  BindRepeat(m);
  BindFit(m);
  BindStudy(m);
  BindCost(m);
  BindEffects(m);
  BindDesign(m);
  BindCampaign(m);
  BindLines(m);
  BindLoad(m);
  // Users know these by the package's name.
  for (const auto& [name, object] : m.attr("__dict__").cast<py::dict>()) {
    if (PyType_Check(object.ptr()) != 0) object.attr("__module__") = "unfurl";
  }
}
