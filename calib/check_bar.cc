#include <algorithm>
#include <cmath>
#include <limits>

#include "base/dense.h"
#include "base/statistics.h"
#include "calib/check_design.h"
#include "calib/parameters.h"
#include "measure/camera_model.h"

namespace unfurl::calib {
namespace {

// Of Levenberg and Marquardt: steps that are refused, some fifteen in a row, end it sooner.
constexpr int kBarIterations = 60;
constexpr double kBarConverged = 1e-9;  // of a step, over the bar's length
// By how much a bar's length differs from one placement to the next, over itself: how it is held
// and seated. It only keeps the length's weight finite [-].
constexpr double kSeating = 2e-6;
// The same while its ends are sought: a step along a sphere leaves it by the step's square over the
// radius, so that a stiff length allows short ones only. A hundredth lets the ends go by a tenth
// of the bar at a time, and each of the next starts where it needs no longer ones [-].
constexpr double kSeatings[] = {1e-2, 1e-4, kSeating};
// Chance that a placement which is found from a good start is looked for from others, too [-].
constexpr double kElsewhere = 1e-3;
constexpr double kRank = 1e-9;  // of singular values: what the data do not fix at all [-]

// The data of one placement at two places: whitened misfits, readings first, the length last.
struct Placement {
  Eigen::VectorXd misfit;     // m + 1
  Eigen::MatrixXd by_places;  // m + 1 x 6
  Eigen::MatrixXd by_camera;  // m + 1 x 31 c
  Eigen::VectorXd weight;     // 1 / sigma [1/px], the length's [1/m]
};

class Placer {
 public:
  Placer(const data::Rig& rig, const Observations& data, const std::vector<std::size_t>& match,
         double length)
      : rig_(rig), data_(data), match_(match), length_(length) {}

  // False where a place lies behind a camera, or both are one. `length`: as it is stated.
  bool At(const std::vector<std::size_t>& readings, int first,
          const Eigen::Matrix<double, 6, 1>& places, double length, double seating,
          Placement* out) const {
    const auto m = static_cast<Eigen::Index>(readings.size());
    out->misfit.resize(m + 1);
    out->weight.resize(m + 1);
    out->by_places.setZero(m + 1, 6);
    out->by_camera.setZero(m + 1, rig_.covariance.rows());
    for (Eigen::Index k = 0; k < m; ++k) {
      const Reading& r = data_.readings[readings[static_cast<std::size_t>(k)]];
      const std::size_t c = match_[static_cast<std::size_t>(r.camera)];
      const Eigen::Index end = 3 * (r.point - first);
      measure::Projection h;
      if (!measure::Project(rig_.cameras[c], places.segment<3>(end), &h)) return false;
      const double w = 1.0 / std::sqrt(ReadingVariance(rig_, c, r.s_px));
      out->weight(k) = w;
      out->misfit(k) = w * (r.u_px - h.u_px);
      out->by_places.block<1, 3>(k, end) = w * h.du_dp;
      out->by_camera.block(k, kParameters * static_cast<Eigen::Index>(c), 1, kParameters) =
          w * h.du_dc;
    }
    const Eigen::Vector3d along = places.tail<3>() - places.head<3>();
    const double apart = along.norm();
    if (!(apart > 0.0)) return false;
    out->weight(m) = 1.0 / (seating * length);
    out->misfit(m) = out->weight(m) * (length - apart);
    out->by_places.block<1, 3>(m, 0) = -out->weight(m) * along.transpose() / apart;
    out->by_places.block<1, 3>(m, 3) = out->weight(m) * along.transpose() / apart;
    return true;
  }

  // Least squares over the two places, the length held softly at first; the sum of squares,
  // infinite where it leads nowhere.
  double Solve(const std::vector<std::size_t>& readings, int first,
               Eigen::Matrix<double, 6, 1>* places) const {
    double square = 0.0;
    for (const double seating : kSeatings) square = Descend(readings, first, seating, places);
    return square;
  }

 private:
  // [Levenberg-Marquardt]
  double Descend(const std::vector<std::size_t>& readings, int first, double seating,
                 Eigen::Matrix<double, 6, 1>* places) const {
    Placement here, there;
    if (!At(readings, first, *places, length_, seating, &here)) {
      return std::numeric_limits<double>::infinity();
    }
    double square = here.misfit.squaredNorm(), damping = 1e-3;
    for (int k = 0; k < kBarIterations; ++k) {
      Eigen::MatrixXd A = here.by_places.transpose() * here.by_places;
      const Eigen::VectorXd b = here.by_places.transpose() * here.misfit;
      A.diagonal() *= 1.0 + damping;
      A.diagonal().array() += 1e-12 * A.trace();
      const Eigen::Matrix<double, 6, 1> step = A.ldlt().solve(b);
      const bool better = At(readings, first, *places + step, length_, seating, &there) &&
                          there.misfit.squaredNorm() <= square;
      if (!better) {
        damping *= 10.0;
        if (damping > 1e12) break;
        continue;
      }
      *places += step;
      here = there;
      square = here.misfit.squaredNorm();
      damping *= 0.1;
      if (step.norm() < kBarConverged * length_) break;
    }
    return square;
  }

  const data::Rig& rig_;
  const Observations& data_;
  const std::vector<std::size_t>& match_;
  double length_;  // which the ends are held apart by [m]
};

// The length about which misfits are made linear: as stated, or where the ends were found plainly
// elsewhere, as found. By a hundredth of a length readings are linear to some hundredths of a
// pixel; held apart by a tenth too much, ends are where the length alone explains no readings any
// more.
double LengthOf(const Eigen::Matrix3Xd& start, const Bar& bar) {
  constexpr double kLinear = 0.01;    // of the length [-]
  constexpr std::size_t kEnough = 3;  // placements whose median is none of a wrong reading
  std::vector<double> found;
  for (Eigen::Index i = 0; i + 1 < start.cols(); i += 2) {
    const double apart = (start.col(i + 1) - start.col(i)).norm();
    if (std::isfinite(apart)) found.push_back(apart);
  }
  if (found.size() < kEnough) return bar.length;
  const double length = Median(found);
  return length > 0.0 && std::abs(length / bar.length - 1.0) > kLinear ? length : bar.length;
}

// Where the two ends are: from where both were found; unless that fits, from each and along the
// axes to the other, too. Three planes that bend may meet twice, and where they meet at small
// angles an end was found far from where the other and the length have it.
Eigen::Matrix<double, 6, 1> FindEnds(const Placer& placer, const std::vector<std::size_t>& readings,
                                     int first, double length, const Eigen::Vector3d& middle,
                                     const Eigen::Matrix3Xd& start) {
  const bool a = start.col(first).allFinite(), b = start.col(first + 1).allFinite();
  Eigen::Matrix<double, 6, 1> best = Eigen::Matrix<double, 6, 1>::Zero();
  double least = std::numeric_limits<double>::infinity();
  const auto from = [&](const Eigen::Vector3d& one, const Eigen::Vector3d& other) {
    Eigen::Matrix<double, 6, 1> places;
    places << one, other;
    const double square = placer.Solve(readings, first, &places);
    if (!(square < least)) return;
    least = square;
    best = places;
  };
  const double freedom = static_cast<double>(readings.size()) - 5.0;
  if (a && b) {
    from(start.col(first), start.col(first + 1));
    if (ChiSquareTail(least, freedom) > kElsewhere) return best;
  }
  for (int way = 0; way < 6; ++way) {
    const Eigen::Vector3d bar = (way % 2 == 0 ? length : -length) * Eigen::Vector3d::Unit(way / 2);
    if (b) from(start.col(first + 1) - bar, start.col(first + 1));
    if (a) from(start.col(first), start.col(first) + bar);
    if (!a && !b) from(middle - 0.5 * bar, middle + 0.5 * bar);
  }
  return best;
}

}  // namespace

CheckDesign DesignOfBar(const data::Rig& rig, const Observations& data,
                        const std::vector<std::size_t>& match, const Bar& bar,
                        const Eigen::Matrix3Xd& start) {
  const double about = LengthOf(start, bar);
  const Placer placer(rig, data, match, about);
  const Eigen::Vector3d middle = 0.5 * (rig.volume_low + rig.volume_high);
  const int placements = data.points() / 2;
  const auto all = static_cast<Eigen::Index>(data.readings.size());
  CheckDesign design;
  // At most as many rows as data; those that check nothing are not filled.
  design.misfit.setZero(all + placements);
  design.by_camera.setZero(all + placements, rig.covariance.rows());
  design.by_reading.assign(data.readings.size(), {0, Eigen::MatrixXd(0, 1)});
  design.by_point.assign(static_cast<std::size_t>(placements), {0, Eigen::MatrixXd(0, 1)});
  Eigen::Index n = 0;
  std::vector<std::size_t> mine;
  std::size_t k = 0;
  for (int i = 0; i < placements; ++i) {
    mine.clear();
    for (; k < data.readings.size() && data.readings[k].point < 2 * i + 2; ++k) {
      mine.push_back(k);
      design.camera.push_back(
          static_cast<int>(match[static_cast<std::size_t>(data.readings[k].camera)]));
      design.point.push_back(data.readings[k].point);
    }
    if (mine.size() < 6) continue;  // with the length, as many as there are unknowns or fewer
    const Eigen::Matrix<double, 6, 1> places = FindEnds(placer, mine, 2 * i, about, middle, start);
    Placement at;
    if (!placer.At(mine, 2 * i, places, bar.length, kSeating, &at)) continue;
    // What the data say beyond the two places: the left null space of their derivative.
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(at.by_places, Eigen::ComputeFullU);
    const Eigen::VectorXd& s = svd.singularValues();
    const Eigen::Index rank = (s.array() > kRank * s(0)).count();
    const Eigen::Index beyond = at.misfit.size() - rank;
    const Eigen::MatrixXd N = svd.matrixU().rightCols(beyond);
    design.misfit.segment(n, beyond) = N.transpose() * at.misfit;
    design.by_camera.middleRows(n, beyond) = N.transpose() * at.by_camera;
    const auto m = static_cast<Eigen::Index>(mine.size());
    for (Eigen::Index r = 0; r < m; ++r) {
      design.by_reading[mine[static_cast<std::size_t>(r)]] = {n,
                                                              at.weight(r) * N.row(r).transpose()};
    }
    design.by_point[static_cast<std::size_t>(i)] = {n, at.weight(m) * N.row(m).transpose()};
    design.covariance.own.emplace_back(Eigen::MatrixXd::Identity(beyond, beyond));
    n += beyond;
  }
  design.misfit.conservativeResize(n);
  design.by_camera.conservativeResize(n, Eigen::NoChange);
  design.by_frame.setZero(n, 1);
  for (const Effect& length : design.by_point) {
    design.by_frame.middleRows(length.first, length.rows.rows()) += length.rows;
  }
  Eigen::MatrixXd& shared = design.covariance.shared;
  shared = SharedByRig(rig, design.by_camera);
  shared.conservativeResize(Eigen::NoChange, shared.cols() + 1);
  shared.rightCols(1) = bar.sigma * design.by_frame;
  return design;
}

}  // namespace unfurl::calib
