#pragma once

#include <cmath>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "correlate/fit/fit.h"
#include "correlate/residual/channel.h"
#include "tests/correlate/fit_repeats.h"

namespace unfurl::correlate {

// A sum of motions, the first two much alike: as the dampings of a hinge are.
class Alike : public Model {
 public:
  static Eigen::Vector3d At(double t) {
    const double c = std::cos(2.0 * t);
    return {c, c + 0.1 * std::sin(5.0 * t), std::cos(3.0 * t)};
  }
  Prediction Evaluate(std::span<const double> theta, const Stamps& stamps) const override {
    const Eigen::Vector3d parts(theta[0], theta[1], theta[2]);
    Prediction out;
    for (const QuantityStamps& q : stamps.quantities) {
      Eigen::VectorXd values(static_cast<Eigen::Index>(q.t.size()));
      for (Eigen::Index i = 0; i < values.size(); ++i) {
        values(i) = At(q.t[static_cast<std::size_t>(i)]).dot(parts);
      }
      out.quantities.push_back({q.key, std::move(values)});
    }
    return out;
  }
};

// Readings of it, and their normal equations.
struct AlikeRecord {
  static constexpr double kNoise = 0.3;  // the parts are known to 0.2 together, to 0.02 alone
  static constexpr Eigen::Index kReadings = 400;
  Observations data;
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();

  AlikeRecord(const Eigen::Vector3d& truth, std::uint64_t seed) {
    Rng rng(seed);
    ChannelRecord r;
    r.name = r.quantity = "sum";
    r.unit = "rad";
    r.y.resize(kReadings);
    r.sigma = Eigen::VectorXd::Constant(kReadings, kNoise);
    for (Eigen::Index i = 0; i < kReadings; ++i) {
      r.t.push_back(0.03 * static_cast<double>(i + 1));
      const Eigen::Vector3d row = Alike::At(r.t.back());
      r.y(i) = row.dot(truth) + kNoise * rng.Normal();
      H += row * row.transpose() / (kNoise * kNoise);
      right += row * r.y(i) / (kNoise * kNoise);
    }
    data.others = {std::make_shared<Channel>(std::move(r))};
    data.placement.offset = Prior::Known(0.0);
  }

  // `parameters` of the three parts, which are named here.
  FitResult FittedBy(std::vector<Parameter> parameters, FitOptions options = {}) const {
    const Alike model;
    FitProblem problem;
    problem.parameters = std::move(parameters);
    for (std::size_t j = 0; j < 3; ++j) {
      problem.parameters[j].name = std::string("part ") + "abc"[j];
    }
    problem.trials.resize(1);
    problem.trials[0].model = &model;
    problem.trials[0].observations = &data;
    options.whiten = options.robust = false;
    options.workers = 1;
    return Fit(problem, options);
  }
};

}  // namespace unfurl::correlate
