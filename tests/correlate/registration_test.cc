// Rows of a registration against Mahalanobis distances written out, its derivatives against
// differences, its solution against the normal equations.
#include "correlate/align/registration.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "base/random.h"
#include "correlate/residual/timed_events.h"

namespace unfurl::correlate::registration_test {
namespace {

constexpr int kMarks = 3, kSamples = 7, kDraws = 2;
constexpr double kPivot = 0.3, kOffsetRef = 0.02;

Eigen::Vector3d RandomVector(Rng* rng, double size) {
  return {size * rng->Normal(), size * rng->Normal(), size * rng->Normal()};
}

Eigen::Matrix<double, 6, 1> RandomCovariance(Rng* rng, double size) {
  Eigen::Matrix3d A;
  for (int k = 0; k < 3; ++k) A.col(k) = RandomVector(rng, size);
  const Eigen::Matrix3d C = A * A.transpose() + 0.1 * size * size * Eigen::Matrix3d::Identity();
  Eigen::Matrix<double, 6, 1> c;
  c << C(0, 0), C(0, 1), C(0, 2), C(1, 1), C(1, 2), C(2, 2);
  return c;
}

Eigen::Matrix3d Turn(const Eigen::Vector3d& w) {
  return w.norm() > 0.0 ? Eigen::AngleAxisd(w.norm(), w.normalized()).toRotationMatrix()
                        : Eigen::Matrix3d(Eigen::Matrix3d::Identity());
}

// Marks in any motion, errors with any covariance, both sides measured, one sample unknown, two
// events.
struct Case {
  Observations record;
  Prediction model;
  Registration at;
};

Case MakeCase(std::uint64_t seed) {
  Rng rng(seed);
  Case c;
  c.at.X_WM.linear() = Turn({0.4, -0.9, 1.3});
  c.at.X_WM.translation() << 0.5, -1.0, 2.0;
  c.at.offset = kOffsetRef + 0.003;
  c.at.drift = 2e-3;
  c.at.z = Eigen::Vector2d(0.7, -0.4);
  c.record.shared_rank = kDraws;
  c.record.placement.pivot = kPivot;
  for (int m = 0; m < kMarks; ++m) {
    MarkSeries s;
    s.name = std::string(1, static_cast<char>('a' + m));
    s.p.resize(3, kSamples);
    s.cov.resize(6, kSamples);
    s.shared.resize(3, kDraws * kSamples);
    MarkMotion y;
    y.p.resize(3, kSamples);
    y.v.resize(3, kSamples);
    y.cov.resize(6, kSamples);
    y.known.assign(kSamples, 1);
    for (int i = 0; i < kSamples; ++i) {
      s.t.push_back(0.1 * i + 0.01 * m);
      s.p.col(i) = RandomVector(&rng, 1.0);
      s.cov.col(i) = RandomCovariance(&rng, 0.3);
      for (int k = 0; k < kDraws; ++k) s.shared.col(kDraws * i + k) = RandomVector(&rng, 0.2);
      y.p.col(i) = RandomVector(&rng, 1.0);
      y.v.col(i) = RandomVector(&rng, 2.0);
      y.cov.col(i) = RandomCovariance(&rng, 0.2);
    }
    if (m == 1) y.known[2] = 0;
    c.record.marks.push_back(std::move(s));
    c.model.marks.push_back(std::move(y));
  }
  std::vector<TimedEvent> events;
  for (const double t : {0.25, 0.55}) {
    TimedEvent e;
    e.kind = "latch";
    e.where = t < 0.5 ? "first" : "second";
    e.t = t;
    e.sigma = 1e-3;
    events.push_back(e);
    c.model.events.push_back({t - 0.04, e.kind, e.where});
  }
  c.record.others = {std::make_shared<TimedEvents>(std::move(events))};
  return c;
}

RegistrationOptions Everything() {
  RegistrationOptions options;
  options.fit_drift = true;
  options.with_others = true;
  options.max_iterations = 0;  // rows at the start itself
  return options;
}

// e' (C_record + R C_model R')^-1 e of each sample, (t - predicted) / sigma of each event, z of the
// prior.
TEST(Registration, RowsAreMahalanobisDistances) {
  const Case c = MakeCase(1);
  const RegistrationFit fit = FitRegistration(c.record, c.model, kOffsetRef, c.at, Everything());
  EXPECT_EQ(fit.known, kMarks * kSamples - 1U);
  ASSERT_EQ(fit.residual.size(), 3 * kMarks * kSamples + 2 + kDraws);
  const Eigen::Matrix3d R = c.at.X_WM.linear();
  Eigen::Index row = 0;
  for (std::size_t m = 0; m < kMarks; ++m) {
    const MarkSeries& s = c.record.marks[m];
    const MarkMotion& y = c.model.marks[m];
    for (Eigen::Index i = 0; i < kSamples; ++i, row += 3) {
      const double found = fit.residual.segment<3>(row).squaredNorm();
      if (m == 1 && i == 2) {
        EXPECT_EQ(found, 0.0);
        continue;
      }
      // The record's clock shows t; the model's is pivot + (t - pivot) / (1 + drift) - offset.
      const double from_pivot = s.t[static_cast<std::size_t>(i)] - kPivot;
      const double later = c.at.offset - kOffsetRef + c.at.drift / (1.0 + c.at.drift) * from_pivot;
      const Eigen::Vector3d e = s.p.col(i) - R * (y.p.col(i) - later * y.v.col(i)) -
                                c.at.X_WM.translation() -
                                s.shared.middleCols(kDraws * i, kDraws) * c.at.z;
      const Eigen::Matrix3d C =
          Symmetric(s.cov.col(i)) + R * Symmetric(y.cov.col(i)) * R.transpose();
      const double expected = e.dot(C.fullPivLu().solve(e));
      EXPECT_NEAR(found, expected, 1e-10 * expected);
    }
  }
  for (int k = 0; k < 2; ++k) {
    const TimedEvent e =
        dynamic_cast<const TimedEvents&>(*c.record.others[0]).events()[static_cast<std::size_t>(k)];
    const double by_model = kPivot + (e.t - kPivot) / (1.0 + c.at.drift) - c.at.offset;
    EXPECT_NEAR(fit.residual(row + k),
                (by_model - c.model.events[static_cast<std::size_t>(k)].t) / e.sigma, 1e-10);
  }
  EXPECT_EQ(fit.residual.tail(kDraws), c.at.z);
}

TEST(Registration, ResidualsInMetresAreTurnedIntoTheModelsFrame) {
  const Case c = MakeCase(9);
  const auto residuals = ResidualsInModelFrame(c.record, c.model, kOffsetRef, c.at);
  for (std::size_t m = 0; m < kMarks; ++m) {
    const MarkSeries& s = c.record.marks[m];
    const MarkMotion& y = c.model.marks[m];
    for (Eigen::Index i = 0; i < kSamples; ++i) {
      const double from_pivot = s.t[static_cast<std::size_t>(i)] - kPivot;
      const double later = c.at.offset - kOffsetRef + c.at.drift / (1.0 + c.at.drift) * from_pivot;
      const Eigen::Vector3d place =
          c.at.X_WM.inverse() *
          Eigen::Vector3d(s.p.col(i) - s.shared.middleCols(kDraws * i, kDraws) * c.at.z);
      const Eigen::Vector3d e = place - (y.p.col(i) - later * y.v.col(i));
      const bool known = m != 1 || i != 2;
      EXPECT_LT(
          (residuals[m].col(i) - (known ? e : Eigen::Vector3d(Eigen::Vector3d::Zero()))).norm(),
          1e-13);
    }
  }
}

TEST(Registration, ColumnsAreDerivatives) {
  const Case c = MakeCase(2);
  const RegistrationOptions options = Everything();
  const RegistrationFit fit = FitRegistration(c.record, c.model, kOffsetRef, c.at, options);
  ASSERT_EQ(fit.jacobian.cols(), 6 + 2 + kDraws);
  ASSERT_EQ(NuisanceNames(options, c.record).size(), 10U);
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (std::size_t m = 0; m < kMarks; ++m) {
    for (Eigen::Index i = 0; i < kSamples; ++i) {
      if (m != 1 || i != 2) mean += c.model.marks[m].p.col(i) / (kMarks * kSamples - 1.0);
    }
  }
  EXPECT_LT((fit.centroid_M - mean).norm(), 1e-14);
  constexpr double kStep = 1e-6;
  // The covariance of the model turns with the start; without it the rows' weights stay as they
  // are.
  Case plain = c;
  for (MarkMotion& y : plain.model.marks) y.cov.resize(6, 0);
  const RegistrationFit here =
      FitRegistration(plain.record, plain.model, kOffsetRef, c.at, options);
  for (int column = 0; column < 10; ++column) {
    Eigen::VectorXd difference = Eigen::VectorXd::Zero(fit.residual.size());
    for (const double side : {1.0, -1.0}) {
      Registration at = c.at;
      const double h = side * kStep;
      if (column < 3) {
        const Eigen::Vector3d centre = at.X_WM * mean;
        at.X_WM.linear() = Turn(h * Eigen::Vector3d::Unit(column)) * at.X_WM.linear();
        at.X_WM.translation() = centre - at.X_WM.linear() * mean;
      } else if (column < 6) {
        at.X_WM.translation()(column - 3) += h;
      } else if (column == 6) {
        at.offset += h;
      } else if (column == 7) {
        at.drift += h;
      } else {
        at.z(column - 8) += h;
      }
      difference += side / (2.0 * kStep) *
                    FitRegistration(plain.record, plain.model, kOffsetRef, at, options).residual;
    }
    // Offset and drift move what the rotation's arm is of second order in; the differences' own
    // error is 1e-9.
    EXPECT_LT((difference - here.jacobian.col(column)).cwiseAbs().maxCoeff(),
              1e-6 * (1.0 + here.jacobian.col(column).cwiseAbs().maxCoeff()))
        << column;
  }
}

// What is known of frame, offset and drift, in its standard deviations: rows after the events',
// whose columns are their derivatives.
TEST(Registration, WhatIsKnownBeforehandAddsRows) {
  Case c = MakeCase(10);
  for (MarkMotion& y : c.model.marks) y.cov.resize(6, 0);
  Placement& known = c.record.placement;
  known.offset = Prior::Normal(c.at.offset - 2e-3, 1e-3);
  known.drift = Prior::Normal(1e-3, 5e-4);
  known.frame.kind = Foreknowledge::kNormal;
  known.frame.X_WM.linear() = Turn({0.3, -0.2, 0.6}).transpose() * c.at.X_WM.linear();
  known.frame.X_WM.translation() = c.at.X_WM.translation() - Eigen::Vector3d(0.1, 0.2, -0.3);
  known.frame.sigma_rotation = 0.5;
  known.frame.sigma_shift = 0.1;
  const RegistrationOptions options = Everything();
  const RegistrationFit fit = FitRegistration(c.record, c.model, kOffsetRef, c.at, options);
  const Eigen::Index first = 3 * kMarks * kSamples + 2;
  ASSERT_EQ(fit.residual.size(), first + 8 + kDraws);
  EXPECT_LT((fit.residual.segment<3>(first) - Eigen::Vector3d(0.6, -0.4, 1.2)).norm(), 1e-12);
  EXPECT_LT((fit.residual.segment<3>(first + 3) - Eigen::Vector3d(1.0, 2.0, -3.0)).norm(), 1e-12);
  EXPECT_NEAR(fit.residual(first + 6), 2.0, 1e-12);
  EXPECT_NEAR(fit.residual(first + 7), 2.0, 1e-12);
  constexpr double kStep = 1e-6;
  for (int column = 0; column < 8; ++column) {
    Eigen::VectorXd difference = Eigen::VectorXd::Zero(8);
    for (const double side : {1.0, -1.0}) {
      Registration at = c.at;
      const double h = side * kStep;
      if (column < 3) {
        const Eigen::Vector3d centre = at.X_WM * fit.centroid_M;
        at.X_WM.linear() = Turn(h * Eigen::Vector3d::Unit(column)) * at.X_WM.linear();
        at.X_WM.translation() = centre - at.X_WM.linear() * fit.centroid_M;
      } else if (column < 6) {
        at.X_WM.translation()(column - 3) += h;
      } else {
        (column == 6 ? at.offset : at.drift) += h;
      }
      difference +=
          side / (2.0 * kStep) *
          FitRegistration(c.record, c.model, kOffsetRef, at, options).residual.segment<8>(first);
    }
    const Eigen::VectorXd found = fit.jacobian.col(column).segment<8>(first);
    EXPECT_LT((difference - found).cwiseAbs().maxCoeff(), 1e-6 * (1.0 + found.norm())) << column;
  }
}

// At the solution the gradient vanishes, and sigma is the diagonal of the inverse of J' J.
TEST(Registration, SolvesTheNormalEquations) {
  Case c = MakeCase(3);
  const Registration truth = c.at;
  Rng rng(4);
  for (std::size_t m = 0; m < kMarks; ++m) {
    c.model.marks[m].cov.resize(6, 0);
    for (Eigen::Index i = 0; i < kSamples; ++i) {
      MarkSeries& s = c.record.marks[m];
      const double later = truth.offset - kOffsetRef;
      s.cov.col(i) *= 1e-6;
      s.p.col(i) = truth.X_WM * Eigen::Vector3d(c.model.marks[m].p.col(i) -
                                                later * c.model.marks[m].v.col(i)) +
                   s.shared.middleCols(kDraws * i, kDraws) * truth.z + RandomVector(&rng, 1e-4);
    }
  }
  RegistrationOptions options;
  Registration start = StartingFrame(c.record, c.model, kOffsetRef);
  EXPECT_LT((start.X_WM.linear() - truth.X_WM.linear()).norm(),
            0.3);  // the common draw is not yet known
  const RegistrationFit fit = FitRegistration(c.record, c.model, kOffsetRef, start, options);
  EXPECT_TRUE(fit.converged);
  EXPECT_TRUE(fit.weak.empty());
  EXPECT_LT((fit.at.X_WM.linear() - truth.X_WM.linear()).norm(), 5e-3);
  EXPECT_NEAR(fit.at.offset, truth.offset, 1e-3);
  EXPECT_LT((fit.at.z - truth.z).norm(), 5e-2);
  const Eigen::MatrixXd inverse = (fit.jacobian.transpose() * fit.jacobian).inverse();
  for (Eigen::Index i = 0; i < fit.sigma.size(); ++i) {
    EXPECT_NEAR(fit.sigma(i), std::sqrt(inverse(i, i)), 1e-6 * fit.sigma(i));
  }
  // What a further step would move, in sigmas: less than the tolerance.
  const Eigen::VectorXd step = inverse * (fit.jacobian.transpose() * fit.residual);
  EXPECT_LT(step.cwiseQuotient(fit.sigma).cwiseAbs().maxCoeff(), options.tolerance);
}

// Of exact marks the start is exact; of marks that disagree the weights are 3 / trace of the
// covariance: the frame is where the weighted sum of squares cannot be lowered.
TEST(StartingFrame, IsTheWeightedLeastSquaresPose) {
  Case c = MakeCase(5);
  for (const double noise : {0.0, 0.05}) {
    Rng rng(6);
    for (std::size_t m = 0; m < kMarks; ++m) {
      for (Eigen::Index i = 0; i < kSamples; ++i) {
        c.record.marks[m].p.col(i) =
            c.at.X_WM * Eigen::Vector3d(c.model.marks[m].p.col(i)) + RandomVector(&rng, noise);
      }
    }
    c.record.marks[1].p.col(2) << 50.0, 50.0, 50.0;  // unknown to the model: takes no part
    const Registration start = StartingFrame(c.record, c.model, 0.7);
    EXPECT_EQ(start.offset, 0.7);
    EXPECT_EQ(start.z.size(), kDraws);
    EXPECT_LT((start.X_WM.matrix() - c.at.X_WM.matrix()).norm(), noise > 0.0 ? 0.5 : 1e-12);
    const auto loss = [&](const Pose& X) {
      double sum = 0.0;
      for (std::size_t m = 0; m < kMarks; ++m) {
        for (Eigen::Index i = 0; i < kSamples; ++i) {
          if (m == 1 && i == 2) continue;
          const auto& cov = c.record.marks[m].cov;
          const Eigen::Vector3d e =
              c.record.marks[m].p.col(i) - X * Eigen::Vector3d(c.model.marks[m].p.col(i));
          sum += e.squaredNorm() / (cov(0, i) + cov(3, i) + cov(5, i));
        }
      }
      return sum;
    };
    constexpr double kMove = 1e-3;
    for (int k = 0; k < 6; ++k) {
      for (const double side : {1.0, -1.0}) {
        Pose X = start.X_WM;
        if (k < 3) {
          X.translation()(k) += side * kMove;
        } else {
          X.linear() = Turn(side * kMove * Eigen::Vector3d::Unit(k - 3)) * X.linear();
        }
        EXPECT_GT(loss(X), loss(start.X_WM));
      }
    }
  }
}

// d residual / d parameter is what a difference of two predictions gives.
TEST(WhitenedSensitivity, IsTheDerivativeOfTheRows) {
  Case c = MakeCase(7);
  for (MarkMotion& y : c.model.marks) y.cov.resize(6, 0);
  RegistrationOptions options = Everything();
  Rng rng(8);
  Prediction moved = c.model;
  constexpr double kStep = 1e-3;  // the rows are linear in the predicted places
  for (MarkMotion& y : moved.marks) {
    Eigen::Matrix3Xd d(3, kSamples);
    for (Eigen::Index i = 0; i < kSamples; ++i) d.col(i) = RandomVector(&rng, 1.0);
    y.p += kStep * d;
  }
  for (ModelEvent& e : moved.events) e.t += kStep * rng.Normal();
  const Change change = Difference(c.record, c.model, moved, 1.0 / kStep);
  const Eigen::VectorXd before =
      FitRegistration(c.record, c.model, kOffsetRef, c.at, options).residual;
  const Eigen::VectorXd after =
      FitRegistration(c.record, moved, kOffsetRef, c.at, options).residual;
  const Eigen::MatrixXd S = WhitenedSensitivity(c.record, c.model, kOffsetRef, c.at, {change});
  EXPECT_LT(((after - before) / kStep - S.col(0)).cwiseAbs().maxCoeff(), 1e-8);
}

}  // namespace
}  // namespace unfurl::correlate::registration_test
