#include "correlate/align/registration.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "base/dense.h"
#include "correlate/align/nuisance.h"
#include "correlate/align/sample_whitener.h"
#include "correlate/residual/row_layout.h"

namespace unfurl::correlate {

namespace {

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

std::vector<std::string> NuisanceNames(const RegistrationOptions& options,
                                       const Observations& observations) {
  return NamesOf(Nuisances(options, observations));
}

RegistrationOptions WithPlacement(RegistrationOptions options, const Observations& observations) {
  const Placement& placement = observations.placement;
  auto fitted = [](bool otherwise, Foreknowledge kind) {
    return kind == Foreknowledge::kUnsaid ? otherwise : kind != Foreknowledge::kKnown;
  };
  options.fit_frame =
      !observations.marks.empty() && fitted(options.fit_frame, placement.frame.kind);
  options.fit_offset = fitted(options.fit_offset, placement.offset.kind);
  options.fit_drift = fitted(options.fit_drift, placement.drift.kind);
  return options;
}

Eigen::VectorXd StartOfOwn(const Observations& observations) {
  std::vector<double> start;
  for (const auto& kind : observations.others) {
    for (const ResidualKind::Unknown& u : kind->unknowns()) start.push_back(u.start);
  }
  return Eigen::Map<const Eigen::VectorXd>(start.data(), static_cast<Eigen::Index>(start.size()));
}

Registration StartingFrame(const Observations& observations, const Prediction& prediction,
                           double offset) {
  Registration start;
  start.offset = offset;
  start.z = Eigen::VectorXd::Zero(observations.shared_rank);
  start.own = StartOfOwn(observations);
  if (observations.placement.frame.Told()) {
    start.X_WM = observations.placement.frame.X_WM;
    return start;
  }
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

// The inverse of the left Jacobian of rotations: log(Exp(d) Exp(w)) = w + J^-1 d + O(d^2)
// [Barfoot 2017, eq. (7.76)].
Eigen::Matrix3d InverseOfLeftJacobian(const Eigen::Vector3d& w) {
  constexpr double kSmall = 1e-4;  // [rad]: the series' next term is 1e-11
  const double angle = w.norm();
  const Eigen::Matrix3d W = Skew(w);
  const double square =
      angle < kSmall
          ? 1.0 / 12.0
          : 1.0 / (angle * angle) - (1.0 + std::cos(angle)) / (2.0 * angle * std::sin(angle));
  return Eigen::Matrix3d::Identity() - 0.5 * W + square * W * W;
}

// Gauss-Newton over the frame, the offset, the drift and the calibration's draw.
class RegistrationSolver {
 public:
  RegistrationSolver(const Observations& observations, const Prediction& prediction,
                     const Clock& reference, const Registration& start,
                     const RegistrationOptions& options, const RowWhitening* whitening)
      : observations_(observations),
        prediction_(prediction),
        reference_(reference),
        pivot_(observations.Pivot()),
        length_(observations.End() - observations.Start()),
        options_(WithPlacement(options, observations)),
        whitening_(whitening != nullptr && !whitening->identity() ? whitening : nullptr),
        k_(observations.shared_rank),
        names_(NuisanceNames(options_, observations)),
        time_(options_.fit_frame ? 6 : 0),
        rate_(time_ + (options_.fit_offset ? 1 : 0)),
        own_(rate_ + (options_.fit_drift ? 1 : 0)),
        draw_(own_ + (options_.with_others ? observations.OtherUnknowns() : 0)),
        layout_(observations) {
    fit_.at = start;
    const Placement& known = observations.placement;
    if (known.frame.kind == Foreknowledge::kKnown) fit_.at.X_WM = known.frame.X_WM;
    if (known.offset.kind == Foreknowledge::kKnown) fit_.at.offset = known.offset.mean;
    if (known.drift.kind == Foreknowledge::kKnown) fit_.at.drift = known.drift.mean;
    if (fit_.at.z.size() != k_) fit_.at.z = Eigen::VectorXd::Zero(k_);
    if (fit_.at.own.size() != observations.OtherUnknowns()) fit_.at.own = StartOfOwn(observations);
    fit_.centroid_M = Centroid(prediction);
    fit_.residual.setZero(layout_.rows);
    fit_.jacobian.setZero(fit_.residual.size(), static_cast<Eigen::Index>(names_.size()));
    for (const MarkMotion& motion : prediction.marks) {
      for (Eigen::Index i = 0; i < motion.p.cols(); ++i) fit_.known += Known(motion, i) ? 1 : 0;
    }
    for (std::size_t k = 0; options_.with_others && k < observations.others.size(); ++k) {
      const ResidualKind& kind = *observations.others[k];
      numbers_.push_back(kind.NumbersOf(prediction));
      const auto unknowns = static_cast<Eigen::Index>(kind.unknowns().size());
      rows_.push_back({Eigen::VectorXd::Zero(kind.rows()), Eigen::VectorXd::Zero(kind.rows()),
                       Eigen::MatrixXd::Zero(kind.rows(), unknowns)});
    }
    // The reference's own covariance turns with the frame; that second-order effect is left to the
    // caller's next round.
    whitener_.reserve(observations.size());
    for (std::size_t m = 0; m < observations.marks.size(); ++m) {
      for (Eigen::Index i = 0; i < observations.marks[m].p.cols(); ++i) {
        whitener_.push_back(
            Whitener(observations.marks[m], prediction.marks[m], i, fit_.at.X_WM.linear()));
      }
    }
  }

  RegistrationFit Run() {
    // A channel's swings are not linear in the clock: a step that leads up is halved. Marks alone,
    // carried along by their velocities, hardly ever need it.
    constexpr int kMostHalved = 20;
    constexpr double kRises = 1.0 + 1e-9;  // beyond rounding
    Evaluate();
    for (int iteration = 0; iteration < options_.max_iterations && !fit_.converged; ++iteration) {
      const double least = fit_.SumOfSquares();
      const Registration before = fit_.at;
      Eigen::VectorXd step = NextStep();
      // Where sigma is a unit weight's (records without one) it says nothing: relative round-off.
      constexpr double kRoundOff = 1e-13;
      fit_.converged =
          (step.cwiseAbs().array() <= options_.tolerance * fit_.sigma.array() + kRoundOff).all();
      Move(step);
      Evaluate();
      for (int half = 0; fit_.SumOfSquares() > kRises * least && half < kMostHalved; ++half) {
        step *= 0.5;
        fit_.at = before;
        Move(step);
        Evaluate();
      }
    }
    fit_.data_rows = 3 * static_cast<Eigen::Index>(fit_.known);
    for (const ResidualKind::Rows& rows : rows_) fit_.data_rows += rows.known;
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
    OtherRows();
    if (whitening_ != nullptr) {
      whitening_->Apply(fit_.residual);
      whitening_->Apply(fit_.jacobian);
    }
    PriorRows(layout_.priors);
    // The prior of the draw, N(0, I).
    fit_.residual.tail(k_) = fit_.at.z;
    if (k_ > 0) fit_.jacobian.bottomRightCorner(k_, k_).setIdentity();
  }

  // What is known of frame, offset and drift by a normal density, in its standard deviations.
  void PriorRows(Eigen::Index row) {
    constexpr Foreknowledge kNormal = Foreknowledge::kNormal;
    const Placement& known = observations_.placement;
    if (known.frame.kind == kNormal && options_.fit_frame) {
      const Pose& X = fit_.at.X_WM;
      const Eigen::Vector3d w =
          VectorFromRotation(X.linear() * known.frame.X_WM.linear().transpose());
      const double inverse_rotation = 1.0 / known.frame.sigma_rotation;
      const double inverse_shift = 1.0 / known.frame.sigma_shift;
      fit_.residual.segment<3>(row) = inverse_rotation * w;
      fit_.residual.segment<3>(row + 3) =
          inverse_shift * (X.translation() - known.frame.X_WM.translation());
      // The origin goes along with a turn about the centroid.
      fit_.jacobian.block<3, 3>(row, 0) = inverse_rotation * InverseOfLeftJacobian(w);
      fit_.jacobian.block<3, 3>(row + 3, 0) = inverse_shift * Skew(X.linear() * fit_.centroid_M);
      fit_.jacobian.block<3, 3>(row + 3, 3) = inverse_shift * Eigen::Matrix3d::Identity();
      row += 6;
    }
    if (known.offset.kind == kNormal) {
      fit_.residual(row) = (fit_.at.offset - known.offset.mean) / known.offset.sigma;
      fit_.jacobian(row++, time_) = 1.0 / known.offset.sigma;
    }
    if (known.drift.kind == kNormal) {
      fit_.residual(row) = (fit_.at.drift - known.drift.mean) / known.drift.sigma;
      fit_.jacobian(row, rate_) = 1.0 / known.drift.sigma;
    }
  }

  // e = p - X_WM (y - ahead dy/dt) - F z, whitened.
  void SampleRows(const MarkSeries& series, const MarkMotion& motion, Eigen::Index i,
                  Eigen::Index row) {
    const Eigen::Matrix3d& W = whitener_[static_cast<std::size_t>(row / 3)];
    const Eigen::Matrix3d R = fit_.at.X_WM.linear();
    const double t = series.t[static_cast<std::size_t>(i)];
    const double ahead = Ahead(t, pivot_, reference_, fit_.at.clock());
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
      fit_.jacobian.block<3, 1>(row, rate_) = W * (R * motion.v.col(i)) * AheadByDrift(t);
    }
    if (k_ > 0) {
      fit_.jacobian.block(row, draw_, 3, k_).noalias() = -W * series.shared.middleCols(i * k_, k_);
    }
  }

  // Derivative of Ahead by the drift.
  double AheadByDrift(double t) const {
    const double rate = 1.0 + fit_.at.drift;
    return (t - pivot_) / (rate * rate);
  }

  // Those of the residual kinds.
  void OtherRows() {
    const ResidualKind::Clocks clocks = ClocksOf(observations_, reference_, fit_.at.clock());
    for (std::size_t k = 0; k < rows_.size(); ++k) {
      const ResidualKind& kind = *observations_.others[k];
      ResidualKind::Rows& rows = rows_[k];
      const Eigen::Index first = layout_.others[k], n = kind.rows();
      const Eigen::Index count = rows.by_unknown.cols();
      kind.Evaluate(numbers_[k], clocks, layout_.OwnOf(k, fit_.at.own), &rows);
      fit_.residual.segment(first, n) = rows.residual;
      if (options_.fit_offset) fit_.jacobian.block(first, time_, n, 1) = -rows.by_time;
      for (Eigen::Index i = 0; i < n && options_.fit_drift; ++i) {
        const double t = kind.TimeOf(i);
        fit_.jacobian(first + i, rate_) = std::isnan(t) ? 0.0 : -AheadByDrift(t) * rows.by_time(i);
      }
      fit_.jacobian.block(first, own_ + layout_.unknowns[k], n, count) = rows.by_unknown;
    }
  }

  // The Gauss-Newton step, and the standard errors.
  Eigen::VectorXd NextStep() {
    const Eigen::Index unknowns = fit_.jacobian.cols();
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(unknowns, unknowns);
    if (unknowns > 0) normal.selfadjointView<Eigen::Lower>().rankUpdate(fit_.jacobian.transpose());
    normal.triangularView<Eigen::StrictlyUpper>() = normal.transpose();
    // An offset known to no more than the record's length, as where nothing moves, is not
    // determined: a step by what rounding says of it would leave the record.
    const bool sized = observations_.has_sigma || observations_.marks.empty();
    if (options_.fit_offset && sized && normal(time_, time_) * length_ * length_ < 1.0) {
      normal.row(time_).setZero();
      normal.col(time_).setZero();
    }
    fit_.weak.clear();
    const Eigen::MatrixXd inverse = InvertNormal(normal, names_, &fit_.weak);
    fit_.sigma = inverse.diagonal().cwiseMax(0.0).cwiseSqrt();
    return -inverse * (fit_.jacobian.transpose() * fit_.residual);
  }

  void Move(const Eigen::VectorXd& step) {
    if (options_.fit_frame) {  // a turn about the centroid and a shift of it
      Pose& X = fit_.at.X_WM;
      const Eigen::Vector3d centre = X * fit_.centroid_M + step.segment<3>(3);
      X.linear() = RotationFromVector(step.head<3>()) * X.linear();
      X.translation() = centre - X.linear() * fit_.centroid_M;
    }
    if (options_.fit_offset) fit_.at.offset += step(time_);
    if (options_.fit_drift) fit_.at.drift += step(rate_);
    if (options_.with_others) fit_.at.own += step.segment(own_, fit_.at.own.size());
    fit_.at.z += step.tail(k_);
  }

  const Observations& observations_;
  const Prediction& prediction_;
  const Clock reference_;  // that the prediction is for
  const double pivot_;     // of the drift [s]
  const double length_;    // of the record [s]
  const RegistrationOptions options_;
  const RowWhitening* whitening_;  // null: white
  const int k_;                    // rank of the calibration's draw
  const std::vector<std::string> names_;
  const Eigen::Index time_, rate_, own_, draw_;  // first columns; the frame's is 0
  const RowLayout layout_;
  std::vector<Eigen::VectorXd> numbers_;   // by residual kind
  std::vector<ResidualKind::Rows> rows_;   // likewise
  std::vector<Eigen::Matrix3d> whitener_;  // by sample [1/m]
  RegistrationFit fit_;
};

}  // namespace

RegistrationFit FitRegistration(const Observations& observations, const Prediction& prediction,
                                const Clock& reference, const Registration& start,
                                const RegistrationOptions& options, const RowWhitening* whitening) {
  return RegistrationSolver(observations, prediction, reference, start, options, whitening).Run();
}

}  // namespace unfurl::correlate
