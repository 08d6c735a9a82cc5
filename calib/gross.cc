#include "calib/gross.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>

#include "base/dense.h"
#include "base/error.h"
#include "base/refuse_option.h"
#include "measure/camera_model.h"

namespace unfurl::calib {
namespace {

// Of Gauss-Newton, which converges in a few; a hypothesis that takes more is dropped.
constexpr int kIterations = 25;
// A step is the last when it is this small a share of the point's own standard deviation [-]: it
// then changes chi-square by a millionth of that.
constexpr double kConverged = 1e-5;
constexpr double kLongest = 0.3;  // of a step, over the distance to the nearest camera [-]
// Readings alone fix a point when their planes do not count as parallel; laxer than
// TriangulateOptions::max_condition, for the hypotheses are compared by their likelihood [-].
constexpr double kWorstCondition = 60.0;
constexpr double kAsLikely = 4.0;  // of chi-square: a likelihood within a factor of e^2
constexpr double kMayGain = 4.0;   // of a price, by what determinants do to it
constexpr int kMostReadings = 10;  // of a point with all subsets tried: 2^11 fits
constexpr int kMostLeftOut = 3;    // where there are more

struct Choice {
  double price = 0.0;
  unsigned use = 0;
  bool survey = true;
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
};

// Of being gross at all, for one in a hundred: 9.2.
double AtAll(double share) { return 2.0 * std::log((1.0 - share) / share); }

// What it costs to call a datum wrong by d of its sigmas, beyond being so at all: -2 log of the
// density of wrong values over the normal one's peak. Sizes are as likely in each octave from
// `from` to `to` sigmas, and spread evenly below.
double BeingOff(double d, double from, double to) {
  const double octaves = 1.0 + std::log(std::max(1.0, to / from));
  return 2.0 * std::log(2.0 * octaves * std::max(d, from) / std::sqrt(2.0 * std::numbers::pi));
}
// The same of a place in three dimensions.
double PlaceBeingOff(double d, double from, double to) {
  const double octaves = 1.0 / 3.0 + std::log(std::max(1.0, to / from));
  return 2.0 * std::log(4.0 * std::numbers::pi * octaves * std::pow(std::max(d, from), 3)) -
         3.0 * std::log(2.0 * std::numbers::pi);
}

// What depends on all points: the shares that are gross, how large an error may be.
class Prices {
 public:
  Prices(const Observations& data, const GrossOptions& options) : from_(options.sigmas) {
    reading_ = AtAll(options.reading_share);
    survey_ = AtAll(options.survey_share);
    size_ = (data.p.rowwise().maxCoeff() - data.p.rowwise().minCoeff()).norm();
    for (int c = 0; c < data.camera_count(); ++c) rows_.push_back(data.RowOf(c));
  }

  // Of a reading with that variance that is off by so much [px].
  double Reading(int camera, double off_px, double variance) const {
    const double row = rows_[static_cast<std::size_t>(camera)], sigma = std::sqrt(variance);
    if (!std::isfinite(off_px)) off_px = row;
    return reading_ + BeingOff(std::abs(off_px) / sigma, from_, row / sigma);
  }
  // Of a surveyed place that is `off` from the true one [m]; covariance of the survey.
  double Survey(const Eigen::Vector3d& off, const Eigen::Matrix3d& cov) const {
    const double sigmas = std::sqrt(off.dot(cov.llt().solve(off)));
    return survey_ + PlaceBeingOff(sigmas, from_, size_ / std::cbrt(std::sqrt(cov.determinant())));
  }
  // Chi-square of the whole, below which nothing is tried: nothing costs less to leave out.
  double suspect() const { return reading_ + BeingOff(from_, from_, from_) - kMayGain; }

 private:
  double from_ = 0.0, reading_ = 0.0, survey_ = 0.0;
  double size_ = 0.0;         // of the surveyed volume [m]
  std::vector<double> rows_;  // of the cameras [px]
};

// Tries subsets of one point's n data, from reading `first` on.
class Subsets {
 public:
  Subsets(const Observations& data, const Prices& prices, const Weighting& weighting,
          const BundleState& state, std::size_t first, int n)
      : data_(data), prices_(prices), weighting_(weighting), state_(state), first_(first), n_(n) {
    point_ = data.readings[first].point;
    surveyed_ = data.p.col(point_);
    survey_cov_ = data.cov[static_cast<std::size_t>(point_)] *
                  (weighting.survey_factor * weighting.survey_factor);
    log_survey_ = std::log(survey_cov_.determinant());
  }

  // With their prices: all of them where the whole is suspect.
  void Try(std::vector<Choice>* choices) const {
    const unsigned all = n_ >= 32 ? ~0U : (1U << n_) - 1U;
    choices->clear();
    if (Consider(all, true, choices) <= prices_.suspect()) return;
    for (unsigned use = 0; use <= all && n_ < 31; ++use) {
      if (n_ > kMostReadings && n_ - std::popcount(use) > kMostLeftOut) continue;
      if (use != all) Consider(use, true, choices);
      if (std::popcount(use) >= 3) Consider(use, false, choices);
    }
  }

 private:
  // Chi-square of what is kept.
  double Consider(unsigned use, bool survey, std::vector<Choice>* choices) const {
    Choice choice{0.0, use, survey, surveyed_};
    double chi_square = 0.0;
    if (use != 0) {  // else the survey alone
      // From the survey, then from where the bundle has the point: readings alone may meet twice.
      PointFit fit, other;
      bool good = Fit(use, survey, surveyed_, &fit);
      if (!survey && Fit(use, survey, state_.points.col(point_), &other) &&
          (!good || other.chi_square < fit.chi_square)) {
        fit = other;
        good = true;
      }
      if (!good) return HUGE_VAL;
      chi_square = fit.chi_square;
      choice.price = chi_square + log_survey_ - std::log(fit.cov.determinant());
      choice.p = fit.p;
    }
    choice.price += LeftOut(use, choice.p);
    if (!survey) choice.price += prices_.Survey(surveyed_ - choice.p, survey_cov_);
    choices->push_back(choice);
    return chi_square;
  }

  bool Fit(unsigned use, bool survey, const Eigen::Vector3d& start, PointFit* out) const {
    return FitPoint(data_, weighting_, state_.cameras, first_, use, survey, start, out);
  }

  // Of the readings that are not in `use`.
  double LeftOut(unsigned use, const Eigen::Vector3d& p) const {
    double sum = 0.0;
    for (int m = 0; m < n_; ++m) {
      if (m < 32 && (use >> m & 1U) != 0) continue;
      const Reading& r = data_.readings[first_ + static_cast<std::size_t>(m)];
      double u = NAN;
      measure::Project(state_.cameras[static_cast<std::size_t>(r.camera)], p, &u);
      sum += prices_.Reading(r.camera, r.u_px - u, weighting_.Variance(r));
    }
    return sum;
  }

  const Observations& data_;
  const Prices& prices_;
  const Weighting& weighting_;
  const BundleState& state_;
  std::size_t first_;
  int n_, point_ = 0;
  Eigen::Vector3d surveyed_ = Eigen::Vector3d::Zero();
  Eigen::Matrix3d survey_cov_ = Eigen::Matrix3d::Zero();
  double log_survey_ = 0.0;
};

}  // namespace

void GrossOptions::Check() const {
  const RefuseOption refuse("GrossOptions");
  const auto share = [&](const char* name, double value) {
    if (!(value > 0.0 && value < 1.0)) refuse(name, "is not between 0 and 1", "give a share");
  };
  if (!(sigmas > 0.0)) refuse("sigmas", "is not above 0", "give sigmas, as 4");
  share("reading_share", reading_share);
  share("survey_share", survey_share);
  share("least_share", least_share);
  share("most_share", most_share);
  share("doubt", doubt);
}

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
    double nearest = std::numeric_limits<double>::infinity();  // camera [m]
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
      nearest =
          std::min(nearest, (out->p - cameras[static_cast<std::size_t>(r.camera)].p_WC).norm());
      const double w = 1.0 / weighting.Variance(r), residual = r.u_px - h.u_px;
      A += w * h.du_dp.transpose() * h.du_dp;
      geometry += h.du_dp.transpose() * h.du_dp;
      b += w * residual * h.du_dp.transpose();
      out->chi_square += w * residual * residual;
    }
    if (!with_survey) {
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen;
      eigen.computeDirect(geometry, Eigen::EigenvaluesOnly);
      if (!(eigen.eigenvalues()(0) * kWorstCondition * kWorstCondition > eigen.eigenvalues()(2))) {
        return false;
      }
    }
    out->cov = A.inverse();
    Eigen::Vector3d step = out->cov * b;
    const double length = step.norm();
    if (!std::isfinite(length)) return false;
    if (step.dot(b) < kConverged * kConverged) return true;  // step^T A step
    if (length > kLongest * nearest) step *= kLongest * nearest / length;
    out->p += step;
  }
  return false;
}

namespace {

// The most probable choice of one point's data, with what is also improbable left out.
struct PointChoice {
  Choice chosen;
  double price = 0.0;  // of the most probable one
  bool ambiguous = false;
  double readings_wrong = 0.0, survey_wrong = 0.0;  // expected numbers
};

PointChoice Decide(const Observations& data, const GrossOptions& options,
                   const Weighting& weighting, const BundleState& state, std::size_t first, int n,
                   const std::vector<Choice>& choices) {
  std::size_t best = 0;
  for (std::size_t k = 1; k < choices.size(); ++k) {
    if (choices[k].price < choices[best].price) best = k;
  }
  PointChoice out;
  // How probable it is of each datum that it is wrong, over all subsets; the survey's last.
  std::vector<double> wrong(static_cast<std::size_t>(n) + 1, 0.0);
  double sum = 0.0;
  for (std::size_t k = 0; k < choices.size(); ++k) {
    const double weight = std::exp(-0.5 * (choices[k].price - choices[best].price));
    sum += weight;
    for (int m = 0; m < n; ++m) {
      if ((choices[k].use >> m & 1U) == 0) wrong[static_cast<std::size_t>(m)] += weight;
    }
    if (!choices[k].survey) wrong.back() += weight;
    out.ambiguous |= k != best && choices[k].price < choices[best].price + kAsLikely;
  }
  out.chosen = choices[best];
  out.price = choices[best].price;
  Choice doubted = out.chosen;
  for (int m = 0; m < n; ++m) {
    const double chance = wrong[static_cast<std::size_t>(m)] / sum;
    out.readings_wrong += chance;
    if (chance > options.doubt) doubted.use &= ~(1U << m);
  }
  out.survey_wrong = wrong.back() / sum;
  if (out.survey_wrong > options.doubt) doubted.survey = false;
  // What is left must still fix the point.
  const bool differs = doubted.use != out.chosen.use || doubted.survey != out.chosen.survey;
  PointFit fit;
  if (differs && doubted.use != 0 &&
      FitPoint(data, weighting, state.cameras, first, doubted.use, doubted.survey, out.chosen.p,
               &fit)) {
    doubted.p = fit.p;
    out.chosen = doubted;
  }
  return out;
}

}  // namespace

GrossChoice ChooseGross(const Observations& data, const GrossOptions& options, Weighting* weighting,
                        BundleState* state) {
  const Prices prices(data, options);
  GrossChoice out;
  weighting->use_reading.resize(data.readings.size(), 1);
  weighting->use_survey.resize(static_cast<std::size_t>(data.points()), 1);
  const auto set = [&](bool use, char* stored) {
    out.changed = out.changed || (*stored != 0) != use;
    *stored = use ? 1 : 0;
  };
  std::vector<Choice> choices;
  std::size_t first = 0, end = 0;
  for (int i = 0; i < data.points(); ++i, first = end) {
    for (end = first; end < data.readings.size() && data.readings[end].point == i;) ++end;
    if (end == first) continue;
    const auto n = static_cast<int>(end - first);
    Subsets(data, prices, *weighting, *state, first, n).Try(&choices);
    if (choices.empty()) continue;
    const PointChoice point = Decide(data, options, *weighting, *state, first, n, choices);
    out.reading_share += point.readings_wrong;
    out.survey_share += point.survey_wrong;
    const Choice& chosen = point.chosen;
    out.price += point.price;
    for (std::size_t k = first; k < end; ++k) {
      out.price += std::log(weighting->Variance(data.readings[k]));
    }
    for (std::size_t k = first; k < end; ++k) {
      set((chosen.use >> (k - first) & 1U) != 0, &weighting->use_reading[k]);
    }
    set(chosen.survey, &weighting->use_survey[static_cast<std::size_t>(i)]);
    state->points.col(i) = chosen.p;
    const bool clean = std::popcount(chosen.use) == n && chosen.survey;
    if (point.ambiguous && !clean) out.ambiguous.push_back(i);
  }
  out.reading_share /= std::max<double>(1.0, static_cast<double>(data.readings.size()));
  out.survey_share /= std::max(1.0, static_cast<double>(data.points()));
  return out;
}

}  // namespace unfurl::calib
