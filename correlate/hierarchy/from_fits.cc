#include "correlate/hierarchy/from_fits.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/dense.h"

namespace unfurl::correlate {

namespace {

// Why a fit has no estimate with a normal error; empty: it has one.
std::string WhyNot(const std::vector<Parameter>& parameters, const FitResult& r) {
  if (!r.Usable()) return r.message;
  for (std::size_t j = 0; j < parameters.size(); ++j) {
    const ParameterEstimate& e = r.parameters[j];
    if (e.verdict == Verdict::kAtBound) return parameters[j].name + " is at its bound";
    if (!e.data95.Closed()) return "it leaves " + parameters[j].name + " open";
  }
  const Eigen::MatrixXd data = r.covariance - r.covariance_model;
  if (!data.allFinite() || Eigen::LLT<Eigen::MatrixXd>(data).info() != Eigen::Success) {
    return "its standard errors are not finite";
  }
  return {};
}

// d u / d value of each parameter at the trial's values, on a diagonal.
Eigen::VectorXd Inward(const std::vector<Parameter>& parameters, const FitResult& r) {
  Eigen::VectorXd out(static_cast<Eigen::Index>(parameters.size()));
  for (std::size_t j = 0; j < parameters.size(); ++j) {
    out(static_cast<Eigen::Index>(j)) = 1.0 / Slope(parameters[j], r.parameters[j].value);
  }
  return out;
}

bool OneCalibration(const std::vector<FittedTrial>& fits, const std::vector<std::size_t>& used) {
  const auto shift = [&](std::size_t i) -> const Eigen::MatrixXd& {
    return fits[i].result->trials.front().calibration_shift;
  };
  return std::all_of(used.begin(), used.end(), [&](std::size_t i) {
    return !fits[i].trial->calibration.empty() && shift(i).size() > 0 &&
           fits[i].trial->calibration == fits[used.front()].trial->calibration &&
           shift(i).cols() == shift(used.front()).cols();
  });
}

}  // namespace

FittedTrials FromFits(const std::vector<Parameter>& parameters,
                      const std::vector<FittedTrial>& fits, std::vector<bool> scatters) {
  FittedTrials out;
  const auto p = static_cast<Eigen::Index>(parameters.size());
  for (std::size_t i = 0; i < fits.size(); ++i) {
    const std::string why = WhyNot(parameters, *fits[i].result);
    if (why.empty()) {
      out.used.push_back(i);
    } else {
      out.left_out.push_back(fmt::format("{} is left out: {}", fits[i].trial->name, why));
    }
  }
  out.problem.scatters = std::move(scatters);
  out.problem.shared = Eigen::MatrixXd::Zero(p, p);
  if (out.used.empty()) return out;
  const auto count = static_cast<double>(out.used.size());
  const bool one = OneCalibration(fits, out.used);
  // What one error of the calibration does is the mean of what it does to each trial; what a trial
  // departs from that counts as its own.
  std::vector<Eigen::MatrixXd> shift;
  Eigen::MatrixXd mean;
  for (std::size_t i : out.used) {
    const FitResult& r = *fits[i].result;
    const Eigen::VectorXd inward = Inward(parameters, r);
    out.problem.shared += inward.asDiagonal() * r.covariance_model * inward.asDiagonal() / count;
    if (!one) continue;
    shift.emplace_back(inward.asDiagonal() * r.trials.front().calibration_shift);
    if (mean.size() == 0) mean = Eigen::MatrixXd::Zero(p, shift.back().cols());
    mean += shift.back() / count;
  }
  if (one) out.problem.shared += mean * mean.transpose();
  for (std::size_t k = 0; k < out.used.size(); ++k) {
    const FitResult& r = *fits[out.used[k]].result;
    const Eigen::VectorXd inward = Inward(parameters, r);
    TrialEstimate trial;
    trial.name = fits[out.used[k]].trial->name;
    trial.value.resize(p);
    for (std::size_t j = 0; j < parameters.size(); ++j) {
      trial.value(static_cast<Eigen::Index>(j)) = ToInternal(parameters[j], r.parameters[j].value);
    }
    trial.covariance =
        inward.asDiagonal() * (r.covariance - r.covariance_model) * inward.asDiagonal();
    if (one) {
      const Eigen::MatrixXd apart = shift[k] - mean;
      trial.covariance += apart * apart.transpose() - shift[k] * shift[k].transpose();
    }
    trial.covariance = (0.5 * (trial.covariance + trial.covariance.transpose())).eval();
    out.problem.trials.push_back(std::move(trial));
  }
  return out;
}

}  // namespace unfurl::correlate
