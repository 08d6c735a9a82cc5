#include "calib/gross.h"

#include <Eigen/Dense>
#include <bit>
#include <cmath>

#include "base/statistics.h"
#include "measure/camera_model.h"

namespace unfurl::calib {
namespace {

constexpr int kIterations = 25;
constexpr double kConverged = 1e-8;      // [m]
constexpr double kLongest = 1.0;         // of a step [m]
constexpr double kWorstDilution = 0.05;  // of a point from its readings alone [m/px]
constexpr double kAsLikely = 4.0;        // of chi-square: a likelihood within a factor of e^2
constexpr int kMostReadings = 10;        // of a point with all subsets tried: 2^11 fits
constexpr int kMostLeftOut = 3;          // where there are more

struct Choice {
  double price = HUGE_VAL;
  unsigned use = 0;
  bool survey = true;
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
};

}  // namespace

bool FitPoint(const Observations& data, const Weighting& weighting,
              const std::vector<data::RigCamera>& cameras, std::size_t first, unsigned use,
              bool with_survey, const Eigen::Vector3d& start, PointFit* out) {
  const int count = std::popcount(use);
  if (!with_survey && count < 3) return false;
  const int point = data.readings[first].point;
  const auto index = static_cast<std::size_t>(point);
  const Eigen::Matrix3d S =
      data.cov[index].inverse() / (weighting.survey_factor * weighting.survey_factor);
  out->p = start;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    Eigen::Matrix3d A = Eigen::Matrix3d::Zero(), geometry = Eigen::Matrix3d::Zero();
    Eigen::Vector3d b = Eigen::Vector3d::Zero();
    out->chi_square = 0.0;
    if (with_survey) {
      const Eigen::Vector3d d = data.p.col(point) - out->p;
      A = S;
      b = S * d;
      out->chi_square = d.dot(b);
    }
    for (std::size_t m = 0; m < 32 && first + m < data.readings.size(); ++m) {
      const Reading& r = data.readings[first + m];
      if (r.point != point) break;
      if ((use >> m & 1U) == 0) continue;
      measure::Projection h;
      if (!measure::Project(cameras[static_cast<std::size_t>(r.camera)], out->p, &h)) return false;
      const double w = 1.0 / weighting.Variance(r), residual = r.u_px - h.u_px;
      A += w * h.du_dp.transpose() * h.du_dp;
      geometry += h.du_dp.transpose() * h.du_dp;
      b += w * residual * h.du_dp.transpose();
      out->chi_square += w * residual * residual;
    }
    if (!with_survey) {
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen;
      eigen.computeDirect(geometry, Eigen::EigenvaluesOnly);
      if (!(eigen.eigenvalues()(0) * kWorstDilution * kWorstDilution > 1.0)) return false;
    }
    out->cov = A.inverse();
    Eigen::Vector3d step = out->cov * b;
    const double length = step.norm();
    if (!std::isfinite(length)) return false;
    if (length < kConverged) return true;
    if (length > kLongest) step *= kLongest / length;
    out->p += step;
  }
  return false;
}

GrossChoice ChooseGross(const Observations& data, const GrossOptions& options, Weighting* weighting,
                        BundleState* state) {
  const double reading_price = options.sigmas * options.sigmas;
  const double survey_price = ChiSquareQuantile(1.0 - ChiSquareTail(reading_price, 1.0), 3.0);
  GrossChoice out;
  weighting->use_reading.resize(data.readings.size(), 1);
  weighting->use_survey.resize(static_cast<std::size_t>(data.points()), 1);
  std::size_t first = 0;
  for (int i = 0; i < data.points(); ++i) {
    std::size_t end = first;
    while (end < data.readings.size() && data.readings[end].point == i) ++end;
    const auto n = static_cast<int>(end - first);
    const unsigned all = n >= 32 ? ~0U : (1U << n) - 1U;
    std::vector<Choice> choices;
    const auto consider = [&](unsigned use, bool survey) {
      Choice choice{HUGE_VAL, use, survey, data.p.col(i)};
      const int left_out = n - std::popcount(use);
      choice.price = left_out * reading_price + (survey ? 0.0 : survey_price);
      if (use == 0) {  // the survey alone, or nothing at all
        choices.push_back(choice);
        return;
      }
      // From the survey, then from where the bundle has the point: readings alone may meet twice.
      PointFit fit, other;
      bool good =
          FitPoint(data, *weighting, state->cameras, first, use, survey, data.p.col(i), &fit);
      if (!survey &&
          FitPoint(data, *weighting, state->cameras, first, use, survey, state->points.col(i),
                   &other) &&
          (!good || other.chi_square < fit.chi_square)) {
        fit = other;
        good = true;
      }
      if (!good) return;
      choice.price += fit.chi_square;
      choice.p = fit.p;
      choices.push_back(choice);
    };
    if (n > 0) {
      consider(all, true);
      if (choices.empty() || choices[0].price > reading_price) {
        for (unsigned use = 0; use <= all && n < 31; ++use) {
          if (n > kMostReadings && n - std::popcount(use) > kMostLeftOut) continue;
          if (use != all) consider(use, true);
          if (std::popcount(use) >= 3) consider(use, false);
        }
      }
    }
    std::size_t best = 0;
    for (std::size_t k = 1; k < choices.size(); ++k) {
      if (choices[k].price < choices[best].price) best = k;
    }
    if (!choices.empty()) {
      const Choice& chosen = choices[best];
      const auto point = static_cast<std::size_t>(i);
      for (std::size_t k = first; k < end; ++k) {
        const char use = (chosen.use >> (k - first) & 1U) != 0 ? 1 : 0;
        out.changed = out.changed || weighting->use_reading[k] != use;
        weighting->use_reading[k] = use;
      }
      const char use = chosen.survey ? 1 : 0;
      out.changed = out.changed || weighting->use_survey[point] != use;
      weighting->use_survey[point] = use;
      state->points.col(i) = chosen.p;
      const bool clean = chosen.use == all && chosen.survey;
      for (std::size_t k = 0; !clean && k < choices.size(); ++k) {
        if (k == best || choices[k].price > chosen.price + kAsLikely) continue;
        out.ambiguous.push_back(i);
        break;
      }
    }
    first = end;
  }
  return out;
}

}  // namespace unfurl::calib
