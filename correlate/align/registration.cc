#include "correlate/align/registration.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>

#include "correlate/align/nuisance.h"

namespace unfurl::correlate {

namespace {

bool Known(const MarkMotion& motion, Eigen::Index i) {
  return motion.known.empty() || motion.known[static_cast<std::size_t>(i)] != 0;
}

// The inverse of the lower Cholesky factor of a sample's covariance, the reference's included.
Eigen::Matrix3d Whitener(const MarkSeries& series, const MarkMotion& motion, Eigen::Index i,
                         const Eigen::Matrix3d& R_WM) {
  Eigen::Matrix3d cov = Symmetric(series.cov.col(i));
  if (motion.cov.cols() > 0) cov += R_WM * Symmetric(motion.cov.col(i)) * R_WM.transpose();
  // Written out: this is called for every sample of every iteration.
  Eigen::Matrix3d W = Eigen::Matrix3d::Zero();
  const double l00 = std::sqrt(cov(0, 0));
  const double l10 = cov(1, 0) / l00, l20 = cov(2, 0) / l00;
  const double l11 = std::sqrt(cov(1, 1) - l10 * l10);
  const double l21 = (cov(2, 1) - l20 * l10) / l11;
  const double l22 = std::sqrt(cov(2, 2) - l20 * l20 - l21 * l21);
  W(0, 0) = 1.0 / l00;
  W(1, 1) = 1.0 / l11;
  W(2, 2) = 1.0 / l22;
  W(1, 0) = -l10 * W(0, 0) * W(1, 1);
  W(2, 1) = -l21 * W(1, 1) * W(2, 2);
  W(2, 0) = -(l20 * W(0, 0) + l21 * W(1, 0)) * W(2, 2);
  return W;
}

Eigen::Vector3d Centroid(const Prediction& prediction) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double n = 0.0;
  for (const MarkMotion& motion : prediction.marks) {
    for (Eigen::Index i = 0; i < motion.p.cols(); ++i) {
      if (!Known(motion, i)) continue;
      sum += motion.p.col(i);
      n += 1.0;
    }
  }
  return n > 0.0 ? Eigen::Vector3d(sum / n) : sum;
}

// Pseudo-inverse of the normal matrix in scaled unknowns; names what it cannot determine.
Eigen::MatrixXd InvertNormal(const Eigen::MatrixXd& normal, const std::vector<std::string>& names,
                             std::vector<std::string>* weak) {
  // Below this share of the largest eigenvalue of the unit-diagonal normal matrix, a direction is
  // round-off of the differences that made the rows, not information.
  constexpr double kRank = 1e-11;
  const Eigen::Index n = normal.rows();
  if (n == 0) return normal;
  Eigen::VectorXd scale = normal.diagonal().cwiseSqrt();
  for (Eigen::Index i = 0; i < n; ++i) {
    if (scale(i) > 0.0) {
      scale(i) = 1.0 / scale(i);
    } else {
      weak->push_back(names[static_cast<std::size_t>(i)]);
    }
  }
  const Eigen::MatrixXd scaled = scale.asDiagonal() * normal * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scaled);
  Eigen::VectorXd inverse = eigen.eigenvalues();
  const double largest = inverse.maxCoeff();
  for (Eigen::Index i = 0; i < n; ++i) {
    if (inverse(i) > kRank * largest && inverse(i) > 0.0) {
      inverse(i) = 1.0 / inverse(i);
      continue;
    }
    inverse(i) = 0.0;
    Eigen::Index strongest = 0;
    eigen.eigenvectors().col(i).cwiseAbs().maxCoeff(&strongest);
    const std::string& name = names[static_cast<std::size_t>(strongest)];
    if (std::find(weak->begin(), weak->end(), name) == weak->end()) weak->push_back(name);
  }
  const Eigen::MatrixXd V = scale.asDiagonal() * eigen.eigenvectors();
  return V * inverse.asDiagonal() * V.transpose();
}

}  // namespace

std::vector<std::string> NuisanceNames(const RegistrationOptions& options, int shared_rank) {
  std::vector<std::string> names;
  for (const Nuisance& n : Nuisances(options, shared_rank)) names.push_back(n.Name());
  return names;
}

Registration StartingFrame(const Observations& observations, const Prediction& prediction,
                           double offset) {
  Registration start;
  start.offset = offset;
  start.z = Eigen::VectorXd::Zero(observations.shared_rank);
  const auto n = static_cast<Eigen::Index>(observations.size());
  Eigen::Matrix3Xd p_W(3, n), p_M(3, n);
  Eigen::VectorXd weight(n);
  Eigen::Index row = 0;
  for (std::size_t m = 0; m < observations.marks.size(); ++m) {
    const MarkSeries& series = observations.marks[m];
    const MarkMotion& motion = prediction.marks[m];
    for (Eigen::Index i = 0; i < motion.p.cols(); ++i) {
      if (!Known(motion, i)) continue;
      p_W.col(row) = series.p.col(i);
      p_M.col(row) = motion.p.col(i);
      weight(row++) = 3.0 / (series.cov(0, i) + series.cov(3, i) + series.cov(5, i));
    }
  }
  if (row >= 3) {
    weight /= weight.head(row).maxCoeff();
    start.X_WM = FitRigid(p_W.leftCols(row), p_M.leftCols(row), weight.head(row)).X_AB;
  }
  return start;
}

namespace {

// Gauss-Newton over the frame, the offset, the drift and the calibration's draw.
class RegistrationSolver {
 public:
  RegistrationSolver(const Observations& observations, const Prediction& prediction,
                     double offset_ref, const Registration& start,
                     const RegistrationOptions& options, const RowWhitening* whitening)
      : observations_(observations),
        prediction_(prediction),
        offset_ref_(offset_ref),
        options_(options),
        whitening_(whitening != nullptr && !whitening->identity() ? whitening : nullptr),
        k_(observations.shared_rank),
        names_(NuisanceNames(options, observations.shared_rank)),
        time_(options.fit_frame ? 6 : 0),
        rate_(time_ + (options.fit_offset ? 1 : 0)),
        draw_(rate_ + (options.fit_drift ? 1 : 0)),
        samples_(static_cast<Eigen::Index>(observations.size())),
        events_(static_cast<Eigen::Index>(observations.events.size())),
        event_time_(EventTimes(observations.events, prediction)) {
    fit_.at = start;
    if (fit_.at.z.size() != k_) fit_.at.z = Eigen::VectorXd::Zero(k_);
    fit_.centroid_M = Centroid(prediction);
    fit_.residual.resize(3 * samples_ + events_ + k_);
    fit_.jacobian.setZero(fit_.residual.size(), static_cast<Eigen::Index>(names_.size()));
    for (const MarkMotion& motion : prediction.marks) {
      for (Eigen::Index i = 0; i < motion.p.cols(); ++i) fit_.known += Known(motion, i) ? 1 : 0;
    }
    // The reference's own covariance turns with the frame; that second-order effect is left to the
    // caller's next round.
    whitener_.reserve(observations.size());
    for (std::size_t m = 0; m < observations.marks.size(); ++m) {
      for (Eigen::Index i = 0; i < observations.marks[m].p.cols(); ++i) {
        whitener_.push_back(
            Whitener(observations.marks[m], prediction.marks[m], i, start.X_WM.linear()));
      }
    }
  }

  RegistrationFit Run() {
    for (int iteration = 0; iteration < options_.max_iterations && !fit_.converged; ++iteration) {
      Evaluate();
      fit_.converged = Step();
    }
    Evaluate();
    return std::move(fit_);
  }

 private:
  // Residuals and their derivatives at fit_.at.
  void Evaluate() {
    // Whitening fills in what the blocks below leave at zero.
    if (whitening_ != nullptr) fit_.jacobian.setZero();
    Eigen::Index row = 0;
    for (std::size_t m = 0; m < observations_.marks.size(); ++m) {
      for (Eigen::Index i = 0; i < observations_.marks[m].p.cols(); ++i, row += 3) {
        if (Known(prediction_.marks[m], i)) {
          SampleRows(observations_.marks[m], prediction_.marks[m], i, row);
        } else {
          fit_.residual.segment<3>(row).setZero();
        }
      }
    }
    if (whitening_ != nullptr) {
      whitening_->Apply(fit_.residual);
      whitening_->Apply(fit_.jacobian);
    }
    fit_.residual.segment(3 * samples_, events_).setZero();
    for (Eigen::Index i = 0; i < events_ && options_.with_events; ++i) EventRow(i);
    // The prior of the draw, N(0, I).
    fit_.residual.tail(k_) = fit_.at.z;
    if (k_ > 0) fit_.jacobian.bottomRightCorner(k_, k_).setIdentity();
  }

  // e = p - X_WM (y - (ahead + drift (t - pivot)) dy/dt) - F z, whitened.
  void SampleRows(const MarkSeries& series, const MarkMotion& motion, Eigen::Index i,
                  Eigen::Index row) {
    const Eigen::Matrix3d& W = whitener_[static_cast<std::size_t>(row / 3)];
    const Eigen::Matrix3d R = fit_.at.X_WM.linear();
    const double from_pivot = series.t[static_cast<std::size_t>(i)] - options_.drift_pivot;
    const double ahead = fit_.at.offset - offset_ref_ + fit_.at.drift * from_pivot;
    const Eigen::Vector3d y = motion.p.col(i) - ahead * motion.v.col(i);
    Eigen::Vector3d e = series.p.col(i) - fit_.at.X_WM * y;
    if (k_ > 0) e -= series.shared.middleCols(i * k_, k_) * fit_.at.z;
    fit_.residual.segment<3>(row) = W * e;
    if (options_.fit_frame) {
      fit_.jacobian.block<3, 3>(row, 0) = W * Skew(R * (y - fit_.centroid_M));
      fit_.jacobian.block<3, 3>(row, 3) = -W;
    }
    if (options_.fit_offset) fit_.jacobian.block<3, 1>(row, time_) = W * (R * motion.v.col(i));
    if (options_.fit_drift) {
      fit_.jacobian.block<3, 1>(row, rate_) = W * (R * motion.v.col(i)) * from_pivot;
    }
    if (k_ > 0) {
      fit_.jacobian.block(row, draw_, 3, k_).noalias() = -W * series.shared.middleCols(i * k_, k_);
    }
  }

  // (t - offset - drift (t - pivot) - t_model) / sigma; without one in the model, the last stamp.
  void EventRow(Eigen::Index i) {
    const TimedEvent& e = observations_.events[static_cast<std::size_t>(i)];
    const double predicted = event_time_[static_cast<std::size_t>(i)];
    const double from_pivot = e.t - options_.drift_pivot;
    const double by_record = e.t - fit_.at.offset - fit_.at.drift * from_pivot;
    const double last = observations_.End() - offset_ref_;
    const Eigen::Index row = 3 * samples_ + i;
    fit_.residual(row) = (by_record - (std::isnan(predicted) ? last : predicted)) / e.sigma;
    if (options_.fit_offset) fit_.jacobian(row, time_) = -1.0 / e.sigma;
    if (options_.fit_drift) fit_.jacobian(row, rate_) = -from_pivot / e.sigma;
  }

  // One Gauss-Newton step. True: it moved no unknown by more than its tolerance.
  bool Step() {
    const Eigen::Index unknowns = fit_.jacobian.cols();
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(unknowns, unknowns);
    normal.selfadjointView<Eigen::Lower>().rankUpdate(fit_.jacobian.transpose());
    normal.triangularView<Eigen::StrictlyUpper>() = normal.transpose();
    fit_.weak.clear();
    const Eigen::MatrixXd inverse = InvertNormal(normal, names_, &fit_.weak);
    fit_.sigma = inverse.diagonal().cwiseMax(0.0).cwiseSqrt();
    const Eigen::VectorXd step = -inverse * (fit_.jacobian.transpose() * fit_.residual);
    if (options_.fit_frame) {  // a turn about the centroid and a shift of it
      Pose& X = fit_.at.X_WM;
      const Eigen::Vector3d centre = X * fit_.centroid_M + step.segment<3>(3);
      X.linear() = RotationFromVector(step.head<3>()) * X.linear();
      X.translation() = centre - X.linear() * fit_.centroid_M;
    }
    if (options_.fit_offset) fit_.at.offset += step(time_);
    if (options_.fit_drift) fit_.at.drift += step(rate_);
    fit_.at.z += step.tail(k_);
    // Where sigma is a unit weight's (records without one) it says nothing: relative round-off.
    constexpr double kRoundOff = 1e-13;
    return (step.cwiseAbs().array() <= options_.tolerance * fit_.sigma.array() + kRoundOff).all();
  }

  const Observations& observations_;
  const Prediction& prediction_;
  const double offset_ref_;  // [s]
  const RegistrationOptions& options_;
  const RowWhitening* whitening_;  // null: white
  const int k_;                    // rank of the calibration's draw
  const std::vector<std::string> names_;
  const Eigen::Index time_, rate_, draw_;  // first columns; the frame's is 0
  const Eigen::Index samples_, events_;
  const std::vector<double> event_time_;   // on the model's clock [s]
  std::vector<Eigen::Matrix3d> whitener_;  // by sample [1/m]
  RegistrationFit fit_;
};

}  // namespace

RegistrationFit FitRegistration(const Observations& observations, const Prediction& prediction,
                                double offset_ref, const Registration& start,
                                const RegistrationOptions& options, const RowWhitening* whitening) {
  return RegistrationSolver(observations, prediction, offset_ref, start, options, whitening).Run();
}

Eigen::MatrixXd WhitenedSensitivity(const Observations& observations, const Prediction& prediction,
                                    const Pose& X_WM,
                                    const std::vector<std::vector<Eigen::Matrix3Xd>>& change) {
  const auto columns = static_cast<Eigen::Index>(change.size());
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(
      3 * static_cast<Eigen::Index>(observations.size()) +
          static_cast<Eigen::Index>(observations.events.size()) + observations.shared_rank,
      columns);
  const Eigen::Matrix3d R = X_WM.linear();
  Eigen::Index row = 0;
  for (std::size_t m = 0; m < observations.marks.size(); ++m) {
    const MarkSeries& series = observations.marks[m];
    const MarkMotion& motion = prediction.marks[m];
    for (Eigen::Index i = 0; i < series.p.cols(); ++i, row += 3) {
      if (!Known(motion, i)) continue;
      const Eigen::Matrix3d WR = Whitener(series, motion, i, R) * R;
      for (Eigen::Index j = 0; j < columns; ++j) {
        out.block<3, 1>(row, j) = -WR * change[static_cast<std::size_t>(j)][m].col(i);
      }
    }
  }
  return out;
}

Eigen::VectorXd EventSensitivity(const Observations& observations, const Prediction& prediction,
                                 const Prediction& moved, double h) {
  const std::vector<double> before = EventTimes(observations.events, prediction);
  const std::vector<double> after = EventTimes(observations.events, moved);
  Eigen::VectorXd out(static_cast<Eigen::Index>(before.size()));
  for (std::size_t i = 0; i < before.size(); ++i) {
    const double change = (after[i] - before[i]) / h;
    out(static_cast<Eigen::Index>(i)) =
        std::isfinite(change) ? -change / observations.events[i].sigma : 0.0;
  }
  return out;
}

std::vector<Eigen::Matrix3Xd> ResidualsInModelFrame(const Observations& observations,
                                                    const Prediction& prediction, double offset_ref,
                                                    const Registration& at) {
  const int k = observations.shared_rank;
  const double ahead = at.offset - offset_ref;
  std::vector<Eigen::Matrix3Xd> out;
  for (std::size_t m = 0; m < observations.marks.size(); ++m) {
    const MarkSeries& series = observations.marks[m];
    const MarkMotion& motion = prediction.marks[m];
    Eigen::Matrix3Xd e = Eigen::Matrix3Xd::Zero(3, series.p.cols());
    for (Eigen::Index i = 0; i < series.p.cols(); ++i) {
      if (!Known(motion, i)) continue;
      const Eigen::Vector3d y = motion.p.col(i) - ahead * motion.v.col(i);
      Eigen::Vector3d w = series.p.col(i) - at.X_WM * y;
      if (k > 0 && at.z.size() == k) w -= series.shared.middleCols(i * k, k) * at.z;
      e.col(i) = at.X_WM.linear().transpose() * w;
    }
    out.push_back(std::move(e));
  }
  return out;
}

}  // namespace unfurl::correlate
