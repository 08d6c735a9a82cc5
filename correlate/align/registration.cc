#include "correlate/align/registration.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>

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
  if (options.fit_frame) {
    names = {"frame rotation about x", "frame rotation about y", "frame rotation about z",
             "frame shift along x",    "frame shift along y",    "frame shift along z"};
  }
  if (options.fit_offset) names.push_back("time offset");
  if (options.fit_drift) names.push_back("clock drift");
  for (int i = 0; i < shared_rank; ++i) names.push_back(fmt::format("calibration draw {}", i + 1));
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

RegistrationFit FitRegistration(const Observations& observations, const Prediction& prediction,
                                double offset_ref, const Registration& start,
                                const RegistrationOptions& options, const RowWhitening* whitening) {
  const int k = observations.shared_rank;
  const std::vector<std::string> names = NuisanceNames(options, k);
  const auto unknowns = static_cast<Eigen::Index>(names.size());
  const Eigen::Index frame = 0;
  const Eigen::Index time = options.fit_frame ? 6 : 0;
  const Eigen::Index rate = time + (options.fit_offset ? 1 : 0);
  const Eigen::Index draw = rate + (options.fit_drift ? 1 : 0);
  const auto samples = static_cast<Eigen::Index>(observations.size());
  const auto events = static_cast<Eigen::Index>(observations.events.size());
  const Eigen::Index rows = 3 * samples + events + k;
  const std::vector<double> event_time = EventTimes(observations.events, prediction);

  RegistrationFit fit;
  fit.at = start;
  if (fit.at.z.size() != k) fit.at.z = Eigen::VectorXd::Zero(k);
  fit.centroid_M = Centroid(prediction);
  fit.residual.resize(rows);
  fit.jacobian.setZero(rows, unknowns);
  for (const MarkMotion& motion : prediction.marks) {
    for (Eigen::Index i = 0; i < motion.p.cols(); ++i) fit.known += Known(motion, i) ? 1 : 0;
  }

  // The reference's own covariance turns with the frame; that second-order effect is left to the
  // caller's next round.
  std::vector<Eigen::Matrix3d> whitener;
  whitener.reserve(observations.size());
  for (std::size_t m = 0; m < observations.marks.size(); ++m) {
    for (Eigen::Index i = 0; i < observations.marks[m].p.cols(); ++i) {
      whitener.push_back(
          Whitener(observations.marks[m], prediction.marks[m], i, start.X_WM.linear()));
    }
  }

  // Residuals and, with `jacobian`, their derivatives at fit.at.
  auto evaluate = [&](bool jacobian) {
    // Whitening fills in what the blocks below leave at zero.
    if (jacobian && whitening != nullptr && !whitening->identity()) fit.jacobian.setZero();
    const Eigen::Matrix3d R = fit.at.X_WM.linear();
    const double ahead = fit.at.offset - offset_ref;
    Eigen::Index row = 0;
    for (std::size_t m = 0; m < observations.marks.size(); ++m) {
      const MarkSeries& series = observations.marks[m];
      const MarkMotion& motion = prediction.marks[m];
      for (Eigen::Index i = 0; i < series.p.cols(); ++i, row += 3) {
        if (!Known(motion, i)) {
          fit.residual.segment<3>(row).setZero();
          continue;
        }
        const Eigen::Matrix3d& W = whitener[static_cast<std::size_t>(row / 3)];
        const double from_pivot = series.t[static_cast<std::size_t>(i)] - options.drift_pivot;
        const Eigen::Vector3d y =
            motion.p.col(i) - (ahead + fit.at.drift * from_pivot) * motion.v.col(i);
        Eigen::Vector3d e = series.p.col(i) - fit.at.X_WM * y;
        if (k > 0) e -= series.shared.middleCols(i * k, k) * fit.at.z;
        fit.residual.segment<3>(row) = W * e;
        if (!jacobian) continue;
        if (options.fit_frame) {
          const Eigen::Vector3d arm = R * (y - fit.centroid_M);
          fit.jacobian.block<3, 3>(row, frame) = W * Skew(arm);
          fit.jacobian.block<3, 3>(row, frame + 3) = -W;
        }
        if (options.fit_offset) fit.jacobian.block<3, 1>(row, time) = W * (R * motion.v.col(i));
        if (options.fit_drift) {
          fit.jacobian.block<3, 1>(row, rate) = W * (R * motion.v.col(i)) * from_pivot;
        }
        if (k > 0) {
          fit.jacobian.block(row, draw, 3, k).noalias() = -W * series.shared.middleCols(i * k, k);
        }
      }
    }
    if (whitening != nullptr && !whitening->identity()) {
      whitening->Apply(fit.residual);
      if (jacobian) whitening->Apply(fit.jacobian);
    }
    fit.residual.segment(3 * samples, events).setZero();
    for (Eigen::Index i = 0; i < events && options.with_events; ++i) {
      const TimedEvent& e = observations.events[static_cast<std::size_t>(i)];
      const double predicted = event_time[static_cast<std::size_t>(i)];
      const double from_pivot = e.t - options.drift_pivot;
      const double by_record = e.t - fit.at.offset - fit.at.drift * from_pivot;
      const double last = observations.End() - offset_ref;
      const Eigen::Index at = 3 * samples + i;
      fit.residual(at) = (by_record - (std::isnan(predicted) ? last : predicted)) / e.sigma;
      if (!jacobian) continue;
      if (options.fit_offset) fit.jacobian(at, time) = -1.0 / e.sigma;
      if (options.fit_drift) fit.jacobian(at, rate) = -from_pivot / e.sigma;
    }
    fit.residual.tail(k) = fit.at.z;
    if (jacobian && k > 0) fit.jacobian.bottomRightCorner(k, k).setIdentity();
  };

  for (int iteration = 0; iteration < options.max_iterations; ++iteration) {
    evaluate(true);
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(unknowns, unknowns);
    normal.selfadjointView<Eigen::Lower>().rankUpdate(fit.jacobian.transpose());
    normal.triangularView<Eigen::StrictlyUpper>() = normal.transpose();
    fit.weak.clear();
    const Eigen::MatrixXd inverse = InvertNormal(normal, names, &fit.weak);
    fit.sigma = inverse.diagonal().cwiseMax(0.0).cwiseSqrt();
    const Eigen::VectorXd step = -inverse * (fit.jacobian.transpose() * fit.residual);
    if (options.fit_frame) {
      const Eigen::Vector3d centre = fit.at.X_WM * fit.centroid_M + step.segment<3>(frame + 3);
      fit.at.X_WM.linear() = RotationFromVector(step.segment<3>(frame)) * fit.at.X_WM.linear();
      fit.at.X_WM.translation() = centre - fit.at.X_WM.linear() * fit.centroid_M;
    }
    if (options.fit_offset) fit.at.offset += step(time);
    if (options.fit_drift) fit.at.drift += step(rate);
    fit.at.z += step.tail(k);
    bool small = true;
    for (Eigen::Index i = 0; i < unknowns; ++i) {
      // The last term: where sigma is a unit weight's (records without one), relative round-off.
      small = small && std::abs(step(i)) <= options.tolerance * fit.sigma(i) + 1e-13;
    }
    if (small) {
      fit.converged = true;
      break;
    }
  }
  evaluate(true);
  return fit;
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
