#include "measure/motion.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "base/error.h"
#include "base/refuse_option.h"

namespace unfurl::measure {

namespace {

// By how much each filter's jerk moves a mark in one interval (standard deviation), over the
// furthest that it can come in it: a mark that glides, two that vibrate, one that is kicked [-]. In
// a volume of some metres 4 um, 40 um, 0.4 mm and 13 mm.
constexpr std::array<double, Motion::kModels> kMoves = {4e-5, 4e-4, 4e-3, 0.13};
// A mark keeps its way of moving with this chance over four intervals [-].
constexpr double kStay = 0.98, kStayIntervals = 4.0;
// Of a mark of which only one place is known, over its highest speed and acceleration [-].
constexpr double kFirstSpeed = 0.25, kFirstAcceleration = 2.5;

// Spectral density of the white jerk that moves a mark by `sigma` in `dt` [m^2/s^5]: the variance
// of position is q dt^5 / 20.
double JerkOf(double sigma, double dt) { return 20.0 * sigma * sigma / std::pow(dt, 5); }

}  // namespace

void MotionOptions::Check() const {
  const RefuseOption refuse("MotionOptions");
  const auto positive = [&](const char* name, double value) {
    if (value > 0.0 && std::isfinite(value)) return;
    refuse(name, "is not a positive number", "give one above 0");
  };
  positive("interval", interval);
  positive("max_speed", max_speed);
  positive("gate_sigmas", gate_sigmas);
}

Motion::Motion(const MotionOptions& options) : options_(options) {
  for (std::size_t j = 0; j < kModels; ++j) {
    jerk_[j] = JerkOf(kMoves[j] * options.reach(), options.interval);
  }
}

void Motion::Expect(const Eigen::Vector3d& p, double sigma) {
  expected_ = p;
  expected_sigma_ = sigma;
}

bool Motion::Fresh(double t) const {
  return count_ >= 2 && t_[1] - t_[0] <= options_.longest_gap() &&
         t - t_[1] <= options_.longest_gap();
}

Eigen::Vector3d Motion::Start(double t) const {
  if (count_ == 0) return expected_;
  if (!Fresh(t)) return p_[1];
  return p_[1] + (p_[1] - p_[0]) * ((t - t_[1]) / (t_[1] - t_[0]));
}

Motion::Models Motion::Carried(double dt) const {
  Models out;
  const double step = kStayIntervals * options_.interval;
  const double stay = dt <= step ? kStay : std::pow(kStay, dt / step);
  for (int j = 0; j < kModels; ++j) {
    Model& to = out[static_cast<std::size_t>(j)];
    std::array<double, kModels> share;
    to.weight = 0.0;
    for (int i = 0; i < kModels; ++i) {
      const double chance = i == j ? stay : (1.0 - stay) / (kModels - 1);
      share[static_cast<std::size_t>(i)] = chance * models_[static_cast<std::size_t>(i)].weight;
      to.weight += share[static_cast<std::size_t>(i)];
    }
    for (std::size_t i = 0; i < kModels; ++i) {
      share[i] /= to.weight;
      to.x += share[i] * models_[i].x;
    }
    // The spread of what is mixed counts whole along each axis: wider rather than narrower.
    for (std::size_t i = 0; i < kModels; ++i) {
      const Eigen::Matrix3d apart = models_[i].x - to.x;
      to.P += share[i] * (models_[i].P + apart * apart.transpose());
    }
    Eigen::Matrix3d F;
    F << 1.0, dt, 0.5 * dt * dt, 0.0, 1.0, dt, 0.0, 0.0, 1.0;
    const double dt2 = dt * dt, dt3 = dt2 * dt;
    Eigen::Matrix3d Q;
    Q << dt3 * dt2 / 20.0, dt2 * dt2 / 8.0, dt3 / 6.0, dt2 * dt2 / 8.0, dt3 / 3.0, dt2 / 2.0,
        dt3 / 6.0, dt2 / 2.0, dt;
    to.x = F * to.x;
    to.P = F * to.P * F.transpose() + jerk_[static_cast<std::size_t>(j)] * Q;
  }
  return out;
}

void Motion::Add(double t, const Eigen::Vector3d& p, double variance) {
  if (count_ == 0 || !(t - t_[1] <= options_.longest_gap()) || !(t > t_[1])) {
    for (Model& model : models_) {
      model.x.setZero();
      model.x.row(0) = p.transpose();
      model.P.setZero();
      model.P.diagonal() << variance, std::pow(kFirstSpeed * options_.max_speed, 2),
          std::pow(kFirstAcceleration * options_.max_acceleration(), 2);
      model.weight = 1.0 / kModels;
    }
    count_ = 1;
  } else {
    models_ = Carried(t - t_[1]);
    std::array<double, kModels> score;
    for (std::size_t j = 0; j < kModels; ++j) {
      Model& model = models_[j];
      const Eigen::RowVector3d left = p.transpose() - model.x.row(0);
      const double S = model.P(0, 0) + variance;
      const Eigen::Vector3d gain = model.P.col(0) / S;
      model.x += gain * left;
      model.P -= gain * model.P.row(0);
      score[j] = -1.5 * std::log(S) - 0.5 * left.squaredNorm() / S;
    }
    const double best = *std::max_element(score.begin(), score.end());
    double sum = 0.0;
    for (std::size_t j = 0; j < kModels; ++j) {
      models_[j].weight *= std::exp(score[j] - best);
      sum += models_[j].weight;
    }
    for (Model& model : models_) model.weight /= sum;
    count_ = 2;
  }
  t_ = {t_[1], t};
  p_ = {p_[1], p};
}

Motion::Prediction Motion::Predict(double t) const {
  // The filters' own forecast is worth something until then [s].
  const double blind = 200.0 * options_.interval;
  Prediction out;
  out.count = kModels;
  if (count_ == 0 || !(t - t_[1] <= blind)) {
    const double sigma =
        count_ == 0 ? expected_sigma_ + options_.start_speed() * std::max(t - expected_t_, 0.0)
                    : options_.max_speed * std::max(t - t_[1], 0.0);
    out.count = 1;
    out.mean[0] = count_ == 0 ? expected_ : p_[1];
    out.variance[0] = sigma * sigma;
    out.weight[0] = 1.0;
    return out;
  }
  const double dt = std::max(t - t_[1], 0.0);
  // And a hundredth of the reach for the error of where it was.
  const double widest = 0.01 * options_.reach() + options_.max_speed * dt;
  const Models models = Carried(dt);
  for (std::size_t j = 0; j < kModels; ++j) {
    out.mean[j] = models[j].x.row(0).transpose();
    out.variance[j] = std::min(models[j].P(0, 0), widest * widest);
    out.weight[j] = models[j].weight;
    // A forecast that runs away is worth less than the last place.
    if ((out.mean[j] - p_[1]).norm() > widest) out.mean[j] = p_[1];
  }
  return out;
}

Motion::Prediction Motion::Between(double t, const Motion& after) const {
  constexpr double kForget = 1e-7;  // weight of a pair of ways that is not looked at [-]
  if (!after.Fresh(-t)) return Predict(t);
  if (!Fresh(t)) return after.Predict(-t);
  // Both sides tell position, velocity and acceleration: what they agree on is the product of the
  // two, pair by pair, weighed by how well the pair agrees.
  const Models before = Carried(t - t_[1]), behind = after.Carried(-t - after.t_[1]);
  std::array<double, Prediction::kMost> score;
  Prediction all;
  for (const Model& a : before) {
    for (const Model& b : behind) {
      const Eigen::Vector3d turned(1.0, -1.0, 1.0);  // time runs backward there
      const Eigen::Matrix3d Pb = turned.asDiagonal() * b.P * turned.asDiagonal();
      const Eigen::Matrix3d apart = turned.asDiagonal() * b.x - a.x;
      const Eigen::Matrix3d S = a.P + Pb;
      // Scaled, for position and acceleration are decades apart.
      const Eigen::Vector3d scale = S.diagonal().cwiseSqrt().cwiseInverse();
      const Eigen::Matrix3d scaled = scale.asDiagonal() * S * scale.asDiagonal();
      const Eigen::Matrix3d inverse = scale.asDiagonal() * scaled.inverse() * scale.asDiagonal();
      const Eigen::RowVector3d gain = a.P.row(0) * inverse;
      const Eigen::RowVector3d kept = Eigen::RowVector3d::UnitX() - gain;
      all.mean[all.count] = (a.x.row(0) + gain * apart).transpose();
      all.variance[all.count] = kept * a.P * kept.transpose() + (gain * Pb * gain.transpose())(0);
      score[all.count] = std::log(std::max(a.weight * b.weight, 1e-300)) -
                         1.5 * (std::log(scaled.determinant()) - 2.0 * scale.array().log().sum()) -
                         0.5 * (apart.transpose() * inverse * apart).trace();
      ++all.count;
    }
  }
  const double best =
      *std::max_element(score.begin(), score.begin() + static_cast<std::ptrdiff_t>(all.count));
  Prediction out;
  double sum = 0.0;
  for (std::size_t k = 0; k < all.count; ++k) {
    const double weight = std::exp(score[k] - best);
    if (weight < kForget) continue;
    out.mean[out.count] = all.mean[k];
    out.variance[out.count] = all.variance[k];
    out.weight[out.count++] = weight;
    sum += weight;
  }
  for (std::size_t k = 0; k < out.count; ++k) out.weight[k] /= sum;
  return out;
}

double Motion::Reach(double t) const {
  if (!Fresh(t)) return std::numeric_limits<double>::infinity();
  // The velocity is a chord's: it belongs to the middle of the last interval.
  const double since = t - t_[1], before = t_[1] - t_[0];
  return 0.5 * options_.max_acceleration() * since * (since + before);
}

bool Motion::WithinReach(double t, const Eigen::Vector3d& p, double sigma) const {
  return !Fresh(t) || (p - Start(t)).norm() <= options_.gate_sigmas * sigma + Reach(t);
}

bool Motion::TooFast(double t, const Eigen::Vector3d& p) const {
  const double slack = 0.1 * options_.reach();  // for the errors of both places [m]
  return count_ > 0 && (p - p_[1]).norm() > options_.max_speed * (t - t_[1]) + slack;
}

double LogSum(std::span<const double> terms) {
  const double best = *std::max_element(terms.begin(), terms.end());
  double sum = 0.0;
  for (double term : terms) sum += std::exp(term - best);
  return best + std::log(sum);
}

double LogDensity(const Motion::Prediction& at, const Eigen::Vector3d& p,
                  const Eigen::Matrix3d& cov) {
  std::array<double, Motion::Prediction::kMost> terms;
  for (std::size_t j = 0; j < at.count; ++j) {
    const Eigen::Matrix3d S = cov + at.variance[j] * Eigen::Matrix3d::Identity();
    const Eigen::Vector3d e = p - at.mean[j];
    terms[j] = std::log(std::max(at.weight[j], 1e-300)) - 1.5 * std::log(2.0 * M_PI) -
               0.5 * std::log(S.determinant()) - 0.5 * e.dot(S.inverse() * e);
  }
  return LogSum({terms.data(), at.count});
}

}  // namespace unfurl::measure
