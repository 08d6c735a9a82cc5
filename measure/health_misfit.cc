// What no place explains of three flashes in a row, on their mean: noise is a third there, what
// lasts is whole. It is held against what the calibration's errors, which are the same in the whole
// record, and the cameras' floors, which are alike where places are near each other, may make of
// it. What is over, tau, is thought independent from row to row and alike in all cameras, and found
// by maximum likelihood.
#include <algorithm>
#include <cmath>
#include <utility>

#include "base/dense.h"
#include "base/statistics.h"
#include "measure/camera_model.h"
#include "measure/flash_triples.h"
#include "measure/health.h"

namespace unfurl::measure {

namespace {

// Numbers that are looked at together: their covariance has the square of it.
constexpr std::size_t kMostNumbers = 300;
constexpr double kRowLeftOut = 1e-3;  // chance that a sound row is taken for a wild one [-]
// Over which the model's own error changes, of the volume's diagonal [-]: terms of a lens reach the
// seventh degree, and what they leave has about eight half waves over a row.
constexpr double kAlike = 1.0 / 8.0;

struct Row {
  FlashTriple triple;
  Eigen::MatrixXd M;      // m x r, what the calibration's errors do [px]
  Eigen::MatrixXd floor;  // m x C, what the cameras' floors do [px]
  const Eigen::VectorXd& y() const { return triple.mean.y; }
  Eigen::MatrixXd Noise() const { return triple.mean.part * triple.mean.part.transpose(); }
  // Covariance without a misfit [px^2].
  Eigen::MatrixXd Known() const { return Noise() + floor * floor.transpose() + M * M.transpose(); }
  double ChiSquare(double square) const {  // with one
    Eigen::MatrixXd S = Known();
    S.diagonal().array() += square;
    return y().dot(Eigen::LLT<Eigen::MatrixXd>(S).solve(y()));
  }
};

class Rows {
 public:
  Rows(const HealthEvidence& evidence, const Triangulator& triangulator)
      : alike_(kAlike * triangulator.size()) {
    const std::size_t left = triangulator.cameras() - 3;
    for (FlashTriple& one : TriplesOf(evidence, triangulator, kMostNumbers / left)) {
      if (Alike(one.differs)) Add(std::move(one), triangulator);
    }
  }

  std::size_t numbers() const {
    std::size_t n = 0;
    for (const Row& row : rows_) n += static_cast<std::size_t>(row.y().size());
    return n;
  }
  const std::vector<Row>& all() const { return rows_; }

  // Those that are wild by a misfit of `square` [px^2] go.
  void Trim(double square) {
    std::erase_if(rows_, [&](const Row& row) {
      const double m = static_cast<double>(row.y().size());
      return !(row.ChiSquare(square) < ChiSquareQuantile(1.0 - kRowLeftOut, m));
    });
  }

  // The misfit that the middle one of the rows has, each by itself [px^2].
  double MiddleSquare() const {
    const auto middle = [&](double square) {
      std::vector<double> ratios;
      for (const Row& row : rows_) {
        const double m = static_cast<double>(row.y().size());
        ratios.push_back(row.ChiSquare(square) / ChiSquareQuantile(0.5, m));
      }
      return Median(ratios);
    };
    if (middle(0.0) <= 1.0) return 0.0;
    double low = 0.0, high = 0.0;
    for (const Row& row : rows_) high = std::max(high, row.y().squaredNorm());
    constexpr int kHalvings = 40;  // to a part in 1e12
    for (int k = 0; k < kHalvings; ++k) {
      const double at = 0.5 * (low + high);
      (middle(at) > 1.0 ? low : high) = at;
    }
    return high;
  }

  // Of all numbers, without a misfit [px^2].
  Eigen::MatrixXd Covariance() const {
    const auto n = static_cast<Eigen::Index>(numbers());
    Eigen::MatrixXd M(n, rows_.empty() ? 0 : rows_[0].M.cols()), K(n, n);
    Eigen::Index at = 0;
    for (const Row& row : rows_) {
      M.middleRows(at, row.M.rows()) = row.M;
      at += row.M.rows();
    }
    K.noalias() = M * M.transpose();
    Eigen::Index i = 0;
    for (const Row& one : rows_) {
      Eigen::Index j = 0;
      for (const Row& other : rows_) {
        const double apart = (one.triple.p - other.triple.p).squaredNorm() / (alike_ * alike_);
        auto block = K.block(i, j, one.y().size(), other.y().size());
        block += std::exp(-0.5 * apart) * one.floor * other.floor.transpose();
        if (&one == &other) block += one.Noise();
        j += other.y().size();
      }
      i += one.y().size();
    }
    return K;
  }

 private:
  void Add(FlashTriple triple, const Triangulator& triangulator) {
    const data::Rig& rig = triangulator.rig();
    const Eigen::MatrixXd& factor = triangulator.rig_factor();
    const Eigen::Index C = triple.left.cols();
    Eigen::MatrixXd G = Eigen::MatrixXd::Zero(C, factor.cols());
    Eigen::VectorXd floor(C);
    for (Eigen::Index c = 0; c < C; ++c) {
      const auto k = static_cast<std::size_t>(c);
      floor(c) = data::FloorOf(rig, k);
      Projection here;
      if ((triple.cameras >> k & 1U) == 0) continue;
      if (!Project(rig.cameras[k], triple.p, &here)) return;
      if (factor.cols() == 0) continue;
      G.row(c) =
          here.du_dc * factor.middleRows(c * data::kCameraParameters, data::kCameraParameters);
    }
    Row row{std::move(triple), {}, {}};
    row.M = row.triple.left * G;
    row.floor = row.triple.left * floor.asDiagonal();
    rows_.push_back(std::move(row));
  }

  // A reading that is wrong by itself differs from those before and after it.
  static bool Alike(const Triple& differs) {
    const Eigen::LLT<Eigen::MatrixXd> S(differs.part * differs.part.transpose());
    const double m = static_cast<double>(differs.y.size());
    return differs.y.dot(S.solve(differs.y)) < ChiSquareQuantile(1.0 - kRowLeftOut, m);
  }

  double alike_;  // [m]
  std::vector<Row> rows_;
};

// All numbers as independent ones.
class Likelihood {
 public:
  explicit Likelihood(const Rows& rows) {
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(rows.Covariance());
    constexpr double kRounding = 1e-12;  // of the largest [-]
    variance_ = eigen.eigenvalues().cwiseMax(kRounding * eigen.eigenvalues().maxCoeff());
    Eigen::VectorXd y(variance_.size());
    Eigen::Index at = 0;
    for (const Row& row : rows.all()) {
      y.segment(at, row.y().size()) = row.y();
      at += row.y().size();
    }
    along_ = eigen.eigenvectors().transpose() * y;
  }
  // -2 ln of it, where the misfit is `square` [px^2].
  double Loss(double square) const {
    const Eigen::ArrayXd variance = variance_ + square;
    return variance.log().sum() + (along_.array().square() / variance).sum();
  }
  double Best() const {
    constexpr double kFinest = 1e-4;  // of the least variance, that changes nothing
    constexpr double kFiner = 1.1;    // from one that is tried to the next: finer than it is known
    double best = 0.0, least = Loss(0.0);
    const double most = along_.cwiseAbs2().maxCoeff(), first = kFinest * variance_.minCoeff();
    const auto steps = static_cast<int>(std::log(std::max(most / first, 1.0)) / std::log(kFiner));
    for (int k = 0; k < steps; ++k) {
      const double at = first * std::pow(kFiner, k), loss = Loss(at);
      if (loss >= least) continue;
      least = loss;
      best = at;
    }
    return best;
  }

 private:
  Eigen::ArrayXd variance_;  // of independent numbers, without a misfit [px^2]
  Eigen::VectorXd along_;    // those [px]
};

// By cell, how large a misfit of that camera alone would have to be to leave so much along its own
// part of what no place explains, at most [px^2]. Few independent numbers are in what lasts, too
// few to say whose it is: nobody is taken for sound because another explains it, too.
std::vector<double> AtMost(const Rows& rows, double square, std::size_t cameras,
                           std::size_t marks) {
  std::vector<double> sum(marks * cameras, 0.0), weight = sum, all(cameras, 0.0), of = all;
  for (const Row& row : rows.all()) {
    const Eigen::MatrixXd known = row.Known();
    const double m = static_cast<double>(row.y().size());
    // What is beyond chance is counted as it would be at its edge: it may be wild.
    const double beyond = row.ChiSquare(square) / ChiSquareQuantile(1.0 - kRowLeftOut, m);
    const double scale = 1.0 / std::max(1.0, beyond);
    for (std::size_t c = 0; c < cameras; ++c) {
      const Eigen::VectorXd n = row.triple.left.col(static_cast<Eigen::Index>(c));
      const double share = n.squaredNorm();
      if (!(share > 0.0)) continue;
      const double along = n.dot(row.y());
      // Of rows where it counts for little, little.
      const double more = (scale * along * along - n.dot(known * n)) / share;
      sum[row.triple.mean.mark * cameras + c] += more;
      weight[row.triple.mean.mark * cameras + c] += share;
      all[c] += more;
      of[c] += share;
    }
  }
  for (std::size_t k = 0; k < sum.size(); ++k) {
    const std::size_t c = k % cameras;
    const double whole = of[c] > 0.0 ? all[c] / of[c] : 0.0;
    sum[k] = std::max({square, whole, weight[k] > 0.0 ? sum[k] / weight[k] : 0.0});
  }
  return sum;
}

// By cell, the mean of squares of stated sigmas [px^2].
std::vector<double> StatedSquares(const HealthEvidence& evidence, std::size_t cameras,
                                  std::size_t marks) {
  std::vector<double> sum(marks * cameras, 0.0), count(marks * cameras, 0.0);
  for (std::size_t i = 0; i < evidence.size(); ++i) {
    if (evidence.mark(i) < 0) continue;
    for (std::size_t c = 0; c < cameras; ++c) {
      const HealthEvidence::Reading& reading = evidence.At(i, c);
      if (std::isnan(reading.u_px)) continue;
      const std::size_t k = static_cast<std::size_t>(evidence.mark(i)) * cameras + c;
      sum[k] += static_cast<double>(reading.s_px) * reading.s_px;
      count[k] += 1.0;
    }
  }
  for (std::size_t k = 0; k < sum.size(); ++k) sum[k] = count[k] > 0.0 ? sum[k] / count[k] : 0.0;
  return sum;
}

// `evidence` has what is known of noise and faults taken out.
MisfitReport MisfitOf(const HealthEvidence& evidence, const Triangulator& triangulator,
                      const HealthOptions& options, std::size_t marks) {
  MisfitReport out;
  const std::size_t cameras = triangulator.cameras();
  Rows rows(evidence, triangulator);
  if (static_cast<double>(rows.numbers()) < kFewestNumbers) return out;
  Rows sound = rows;
  sound.Trim(rows.MiddleSquare());
  if (static_cast<double>(sound.numbers()) < kFewestNumbers) return out;
  const Likelihood likelihood(sound);
  const double square = likelihood.Best();
  const double limit = ChiSquareQuantile(1.0 - 2.0 * options.false_alarm, 1.0);  // one side of it
  if (!(likelihood.Loss(0.0) - likelihood.Loss(square) > limit)) return out;
  const std::vector<double> stated = StatedSquares(evidence, cameras, marks);
  const std::vector<double> more = AtMost(rows, square, cameras, marks);
  out.all_px = std::sqrt(square);
  for (std::size_t k = 0; k < more.size(); ++k) {
    const double floor = data::FloorOf(triangulator.rig(), k % cameras);
    out.px.push_back(std::sqrt(more[k]));
    out.factors.push_back(stated[k] > 0.0 ? std::sqrt(1.0 + more[k] / stated[k]) : 1.0);
    out.wide = out.wide || more[k] > options.scatter_harmless * (stated[k] + floor * floor);
  }
  return out;
}

void TakeWidest(const MisfitReport& other, MisfitReport* out) {
  if (!other.wide) return;
  if (!out->wide) {
    *out = other;
    return;
  }
  out->all_px = std::max(out->all_px, other.all_px);
  for (std::size_t k = 0; k < other.px.size(); ++k) {
    out->px[k] = std::max(out->px[k], other.px[k]);
    out->factors[k] = std::max(out->factors[k], other.factors[k]);
  }
}

}  // namespace

void FindMisfit(const HealthEvidence& stated, const Triangulator& triangulator,
                std::span<const Correction> corrections, const HealthOptions& options,
                HealthReport* report) {
  const std::size_t cameras = triangulator.cameras(), marks = stated.Marks();
  if (cameras < 4) return;
  HealthEvidence evidence = stated;
  evidence.Widen(WideningsOf(report->scatter, marks * cameras));
  bool away = false;
  for (const Correction& correction : corrections) {
    away = away || correction.leave_out;
    if (correction.camera < 0) evidence.LeaveOut(correction);
  }
  // With the cameras that are left out, put right: of few others nothing is known, and what no
  // fault explains may have been taken for theirs. Then without them, for they may be no better.
  MisfitReport& out = report->misfit;
  out = MisfitOf(evidence, triangulator, options, marks);
  if (away) {
    for (const Correction& correction : corrections) evidence.LeaveOut(correction);
    TakeWidest(MisfitOf(evidence, triangulator, options, marks), &out);
  }
  if (out.wide) report->unvouched.Widen(Median(out.factors));
}

}  // namespace unfurl::measure
