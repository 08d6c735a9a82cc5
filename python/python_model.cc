#include "python/python_model.h"

#include <fmt/format.h>

#include <utility>

#include "correlate/sampled_model.h"

namespace unfurl::python {
namespace {

PyObject* g_model_failed = nullptr;  // unfurl.ModelFailed

// The positions that a Python model gave for one mark, with velocities: its own, or those of the
// cubic through the nearest four positions.
correlate::MarkMotion MotionFrom(const py::handle& given, const std::vector<double>& t,
                                 const std::string& mark) {
  const auto n = static_cast<Eigen::Index>(t.size());
  const bool pair = py::isinstance<py::tuple>(given);
  const auto points = [&](const py::handle& array, const std::string& what) {
    const Eigen::MatrixXd in = PointsFrom(array, {2, 3}, what);
    if (in.cols() != n) {
      throw py::value_error(fmt::format("{}: {} rows for {} times", what, in.cols(), n));
    }
    Eigen::Matrix3Xd out = Eigen::Matrix3Xd::Zero(3, n);
    out.topRows(in.rows()) = in;
    return out;
  };
  correlate::MarkMotion motion;
  motion.p = points(pair ? py::handle(given.cast<py::tuple>()[0]) : given, "p of " + mark);
  if (pair) {
    motion.v = points(given.cast<py::tuple>()[1], "v of " + mark);
    return motion;
  }
  motion.v.setZero(3, n);
  for (Eigen::Index i = 0; i < n && n > 1; ++i) {
    const correlate::LocalCubic cubic = correlate::CubicAt(t, t[static_cast<std::size_t>(i)]);
    for (int k = 0; k < cubic.count; ++k) {
      motion.v.col(i) += cubic.slope[k] * motion.p.col(static_cast<Eigen::Index>(cubic.first) + k);
    }
  }
  return motion;
}

// A Python function as the model of a fit. unfurl.ModelFailed is a failed evaluation; any other
// exception ends the fit.
class PythonModel : public correlate::Model {
 public:
  PythonModel(const py::object& function, std::vector<std::string> names, CallbackError* errors)
      : function_(Shared(function)), names_(std::move(names)), errors_(*errors) {}

  correlate::Prediction Evaluate(std::span<const double> theta,
                                 const correlate::Stamps& stamps) const override {
    correlate::Prediction out;
    errors_.Call([&] {
      try {
        Ask(theta, stamps, &out);
      } catch (py::error_already_set& error) {
        if (!error.matches(g_model_failed)) throw;
        out = {};
        out.status = correlate::ModelStatus::kFailed;
        out.message = py::str(error.value()).cast<std::string>();
      }
    });
    return out;
  }

 private:
  void Ask(std::span<const double> theta, const correlate::Stamps& stamps,
           correlate::Prediction* out) const {
    py::dict parameters, times;
    for (std::size_t j = 0; j < names_.size(); ++j) {
      parameters[py::str(names_[j])] = theta[j];
    }
    for (std::size_t m = 0; m < stamps.marks.size(); ++m) {
      times[py::str(stamps.marks[m])] = Owned(std::vector<double>(stamps.t[m]));
    }
    const py::object answer = (*function_)(parameters, times);
    if (!py::isinstance<py::dict>(answer)) {
      throw py::type_error("the model must return {mark: positions}");
    }
    for (std::size_t m = 0; m < stamps.marks.size(); ++m) {
      const py::str mark(stamps.marks[m]);
      if (!answer.contains(mark)) {
        throw py::key_error("the model returned no mark '" + stamps.marks[m] + "'");
      }
      out->marks.push_back(MotionFrom(answer[mark], stamps.t[m], stamps.marks[m]));
    }
  }

  std::shared_ptr<py::object> function_;
  std::vector<std::string> names_;
  CallbackError& errors_;
};

}  // namespace

std::unique_ptr<correlate::Model> ModelFrom(const py::object& function,
                                            const std::vector<std::string>& names,
                                            CallbackError* errors) {
  return std::make_unique<PythonModel>(function, names, errors);
}

void BindModelFailed(py::module_& m) {
  g_model_failed = PyErr_NewExceptionWithDoc(
      "unfurl.ModelFailed",
      "Raised by a model that cannot be evaluated at some parameters: the fit goes round them.",
      PyExc_RuntimeError, nullptr);
  m.attr("ModelFailed") = py::reinterpret_borrow<py::object>(g_model_failed);
}

}  // namespace unfurl::python
