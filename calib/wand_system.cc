#include "calib/wand_system.h"

#include <algorithm>
#include <cmath>

#include "base/dense.h"
#include "calib/block_chain.h"
#include "calib/covariance.h"

namespace unfurl::calib {
namespace {

// What of a row lies in the shared columns and in each block of its own, two at most.
struct SplitRow {
  Eigen::VectorXd shared;
  int block[2] = {-1, -1};
  Eigen::VectorXd own[2];
};

class Splitter {
 public:
  explicit Splitter(const WandRows& rows)
      : rows_(rows), shared_(static_cast<int>(rows.shared.size())) {}

  int blocks() const { return rows_.poses + rows_.points; }
  int SizeOf(int block) const { return block < rows_.poses ? rows_.pose_size : 3; }

  void Split(std::size_t r, SplitRow* out) const {
    out->shared.setZero(shared_);
    out->block[0] = out->block[1] = -1;
    for (int at = rows_.first[r]; at < rows_.first[r + 1]; ++at) {
      const auto k = static_cast<std::size_t>(at);
      const int own = rows_.column[k] - shared_;
      if (own < 0) {
        out->shared(rows_.column[k]) = rows_.value[k];
        continue;
      }
      const int of_poses = rows_.poses * rows_.pose_size;
      const int block = own < of_poses ? own / rows_.pose_size : rows_.poses + (own - of_poses) / 3;
      const int entry = own < of_poses ? own % rows_.pose_size : (own - of_poses) % 3;
      const int side = out->block[0] < 0 || out->block[0] == block ? 0 : 1;
      if (out->block[side] < 0) {
        out->block[side] = block;
        out->own[side].setZero(SizeOf(block));
      }
      out->own[side](entry) = rows_.value[k];
    }
    if (out->block[1] >= 0 && out->block[1] < out->block[0]) {
      std::swap(out->block[0], out->block[1]);
      std::swap(out->own[0], out->own[1]);
    }
  }

 private:
  const WandRows& rows_;
  int shared_;
};

// A pose or point whose readings do not fix it stays somewhere: a sigma of so many of the solver's
// lengths. It weighs nothing against what is measured.
constexpr double kAnywhere = 1e3;

// The normal equations of all rows, block by block.
struct NormalEquations {
  std::vector<Eigen::MatrixXd> diagonal, next, mixed;
  Eigen::MatrixXd together;  // of the shared unknowns

  NormalEquations(const WandRows& rows, const Splitter& splitter) {
    const auto shared = static_cast<Eigen::Index>(rows.shared.size());
    const auto blocks = static_cast<std::size_t>(splitter.blocks());
    next.resize(blocks > 0 ? blocks - 1 : 0);
    for (int b = 0; b < splitter.blocks(); ++b) {
      const int n = splitter.SizeOf(b);
      diagonal.emplace_back(Eigen::MatrixXd::Identity(n, n) / (kAnywhere * kAnywhere));
      mixed.emplace_back(Eigen::MatrixXd::Zero(n, shared));
    }
    together = Eigen::MatrixXd::Zero(shared, shared);
    SplitRow row;
    for (std::size_t r = 0; r < rows.row.size(); ++r) {
      splitter.Split(r, &row);
      Add(row);
    }
  }

 private:
  void Add(const SplitRow& row) {
    for (Eigen::Index k = 0; k < row.shared.size(); ++k) {  // most are of other cameras
      if (row.shared(k) != 0.0) together.col(k) += row.shared(k) * row.shared;
    }
    for (int side = 0; side < 2; ++side) {
      if (row.block[side] < 0) continue;
      const auto b = static_cast<std::size_t>(row.block[side]);
      diagonal[b] += row.own[side] * row.own[side].transpose();
      mixed[b] += row.own[side] * row.shared.transpose();
    }
    if (row.block[1] < 0) return;
    Eigen::MatrixXd& link = next[static_cast<std::size_t>(row.block[0])];
    if (link.size() == 0) link.setZero(row.own[0].size(), row.own[1].size());
    link += row.own[0] * row.own[1].transpose();
  }
};

// What elimination of the blocks leaves.
struct Eliminated {
  // Of each block: how it follows the shared unknowns, and its own part of the inverse.
  std::vector<Eigen::MatrixXd> follow, inverse;
  Eigen::MatrixXd information, covariance;  // of the shared unknowns, in the solver's units

  explicit Eliminated(const NormalEquations& equations) : information(equations.together) {
    const BlockChain chain(equations.diagonal, equations.next);
    follow = chain.Solve(equations.mixed);
    inverse = chain.InverseDiagonal();
    for (std::size_t b = 0; b < follow.size(); ++b) {
      information -= equations.mixed[b].transpose() * follow[b];
    }
    information = 0.5 * (information + information.transpose()).eval();
    covariance = CameraCovariance(information);
  }

  // What a row's own datum moves its prediction by [-].
  double Leverage(const SplitRow& row) const {
    Eigen::VectorXd z = row.shared;
    double out = 0.0;
    if (row.block[0] >= 0) {
      const auto b = static_cast<std::size_t>(row.block[0]);
      z -= follow[b].transpose() * row.own[0];
      out += row.own[0].dot(inverse[b] * row.own[0]);
    }
    return out + z.dot(covariance * z);
  }
};

// Information and covariance in the units of files.
void Expand(const WandRows& rows, const Eliminated& eliminated, WandSystem* out) {
  const auto shared = static_cast<Eigen::Index>(rows.shared.size());
  Eigen::MatrixXd expand = Eigen::MatrixXd::Zero(rows.size, shared);
  for (Eigen::Index k = 0; k < shared; ++k) {
    const auto& [unknown, unit] = rows.shared[static_cast<std::size_t>(k)];
    expand(unknown, k) = unit;
  }
  out->covariance = expand * eliminated.covariance * expand.transpose();
  const Eigen::MatrixXd shrink = expand.unaryExpr([](double u) { return u > 0.0 ? 1.0 / u : 0.0; });
  out->information = shrink * eliminated.information * shrink.transpose();
  for (const int unknown : rows.fixed) {
    out->information(unknown, unknown) = out->covariance(unknown, unknown) = 1.0;
  }
}

// Of readings and surveyed points; the leverages of all rows but the motion's.
double Redundancies(const WandRows& rows, const Splitter& splitter, const Eliminated& eliminated,
                    WandSystem* out) {
  double sum = 0.0;
  SplitRow row;
  for (std::size_t r = 0; r < rows.row.size(); ++r) {
    const WandRow& what = rows.row[r];
    if (what.kind == WandRow::kMotion) continue;
    splitter.Split(r, &row);
    const double leverage = eliminated.Leverage(row);
    sum += leverage;
    const auto k = static_cast<std::size_t>(what.index);
    if (what.kind == WandRow::kReading) out->redundancy[k] = std::max(0.0, 1.0 - leverage);
    if (what.kind == WandRow::kPointReading) {
      out->point_redundancy[k] = std::max(0.0, 1.0 - leverage);
    }
    if (what.kind == WandRow::kSurvey) out->survey_redundancy[k] += 1.0 - leverage;
  }
  return sum;
}

// The motion's squares and redundancy, which is its rows less what the unknowns leave to them: the
// leverages of all rows sum to the unknowns.
void MotionPart(const WandRows& rows, const Splitter& splitter, double leverage_else,
                WandSystem* out) {
  double unknowns = static_cast<double>(rows.shared.size()), motion_rows = 0.0;
  for (int b = 0; b < splitter.blocks(); ++b) unknowns += splitter.SizeOf(b);
  for (std::size_t r = 0; r < rows.row.size(); ++r) {
    if (rows.row[r].kind != WandRow::kMotion) continue;
    motion_rows += 1.0;
    out->motion_squares += rows.residual[r] * rows.residual[r];
  }
  if (motion_rows > 0.0) {
    out->motion_redundancy = std::max(0.0, motion_rows - (unknowns - leverage_else));
  }
}

std::vector<double> SpeedVariances(const WandRows& rows, const Eliminated& eliminated,
                                   const WandState& state) {
  constexpr int kVelocity = 5;  // where it begins in a pose's columns
  std::vector<double> out(static_cast<std::size_t>(rows.poses), 0.0);
  if (rows.pose_size <= kVelocity) return out;
  for (std::size_t k = 0; k < out.size(); ++k) {
    const Eigen::Vector3d d = rows.length * state.direction.col(static_cast<Eigen::Index>(k));
    const Eigen::VectorXd z = eliminated.follow[k].middleRows(kVelocity, 3).transpose() * d;
    out[k] = d.dot(eliminated.inverse[k].block<3, 3>(kVelocity, kVelocity) * d) +
             z.dot(eliminated.covariance * z);
  }
  return out;
}

}  // namespace

WandSystem SystemOf(const WandRows& rows, const WandData& data, const WandState& state) {
  const Splitter splitter(rows);
  const Eliminated eliminated(NormalEquations(rows, splitter));
  WandSystem out;
  Expand(rows, eliminated, &out);
  out.redundancy.assign(data.readings.size(), 0.0);
  out.point_redundancy.assign(data.points.readings.size(), 0.0);
  out.survey_redundancy.assign(static_cast<std::size_t>(data.points.points()), 0.0);
  const double leverage_else = Redundancies(rows, splitter, eliminated, &out);
  MotionPart(rows, splitter, leverage_else, &out);
  out.speed_variance = SpeedVariances(rows, eliminated, state);
  return out;
}

}  // namespace unfurl::calib
