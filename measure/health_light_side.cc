// One camera's light, or focus, by mark and slice of time.
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

#include "base/dense.h"
#include "base/statistics.h"
#include "measure/camera_model.h"
#include "measure/health_light.h"

namespace unfurl::measure {

namespace {

constexpr std::size_t kFewestSpots = 2;  // of a cell: one may be a reflection
constexpr double kSame = 1e-9;           // of a column's length: less is nothing new [-]
constexpr double kDistinct = 0.05;       // of a change, what nothing else explains, at least [-]

// Of a cell, what is seen there and where.
struct Gathered {
  std::vector<double> y;
  std::array<std::vector<double>, std::tuple_size_v<decltype(LightLook::place)>> terms;
};

// Columns of place to mean 0 and length 1; those that never change to 0.
void Standardize(Eigen::Ref<Eigen::MatrixXd> columns) {
  for (Eigen::Index k = 0; k < columns.cols(); ++k) {
    const double size = columns.col(k).norm();
    columns.col(k).array() -= columns.col(k).mean();
    const double length = columns.col(k).norm();
    columns.col(k) *= length > kSame * size ? 1.0 / length : 0.0;
  }
}

}  // namespace

std::vector<std::vector<LightLook>> LooksOf(const HealthEvidence& evidence,
                                            const Triangulator& triangulator, int slices) {
  const std::size_t cameras = triangulator.cameras();
  std::vector<std::vector<LightLook>> out(cameras);
  std::map<int, Eigen::Vector3d> last;
  std::array<double, CameraBank::kMaxCameras> u{}, s{};
  if (evidence.size() == 0) return out;
  const double from = evidence.t(0);
  const double span = std::max(evidence.t(evidence.size() - 1) - from, 1e-9);
  for (std::size_t i = 0; i < evidence.size(); ++i) {
    const int mark = evidence.mark(i);
    if (mark < 0) continue;
    bool any = false;
    for (std::size_t c = 0; c < cameras; ++c) {
      u[c] = evidence.At(i, c).u_px;
      s[c] = evidence.At(i, c).s_px;
      any = any || evidence.At(i, c).flux > 0.0F;
    }
    if (!any) continue;
    const auto start = last.try_emplace(mark, triangulator.centre()).first;
    const PointSolution point =
        triangulator.Solve({u.data(), cameras}, {s.data(), cameras}, start->second);
    if (point.outcome != PointOutcome::kSolved && point.outcome != PointOutcome::kDisagree) {
      continue;
    }
    start->second = point.p;
    const double t = evidence.t(i);
    for (std::size_t c = 0; c < cameras; ++c) {
      const HealthEvidence::Reading& reading = evidence.At(i, c);
      if (std::isnan(reading.u_px) || !(reading.flux > 0.0F) || !(reading.width_px > 0.0F)) {
        continue;
      }
      const data::RigCamera& camera = triangulator.rig().cameras[c];
      const Eigen::Vector3d p = camera.R_CW * (point.p - camera.p_WC);
      if (!(p.z() > 0.0)) continue;
      const double x = p.x() / p.z(), y = p.y() / p.z();
      LightLook look{.t = t, .mark = mark};
      look.slice = std::min(slices - 1, static_cast<int>((t - from) / span * slices));
      look.flux = std::log(static_cast<double>(reading.flux));
      look.width = reading.width_px;
      look.place = {std::log(p.norm()), x, y, x * x, x * y, y * y};
      out[c].push_back(look);
    }
  }
  return out;
}

LightSide::LightSide(const std::vector<LightLook>& looks, int marks, int slices) : slices_(slices) {
  constexpr std::size_t kPlace = std::tuple_size_v<decltype(LightLook::place)>;
  std::map<std::pair<int, int>, Gathered> by_cell;
  for (const LightLook& look : looks) {
    Gathered& cell = by_cell[{look.mark, look.slice}];
    cell.y.push_back(look.flux);
    for (std::size_t k = 0; k < kPlace; ++k) cell.terms[k].push_back(look.place[k]);
  }
  std::erase_if(by_cell, [](const auto& one) { return one.second.y.size() < kFewestSpots; });
  const auto n = static_cast<Eigen::Index>(by_cell.size());
  if (n == 0) return;
  const auto m = static_cast<Eigen::Index>(marks), k = static_cast<Eigen::Index>(kPlace);
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(n, m + k);
  y_.resize(n);
  ends_.assign(static_cast<std::size_t>(marks), 0);
  Eigen::Index row = 0;
  for (const auto& [at, cell] : by_cell) {
    cells_.push_back({at.first, at.second});
    for (int mark = at.first; mark < marks; ++mark) ends_[static_cast<std::size_t>(mark)]++;
    y_(row) = Median(cell.y);
    A(row, at.first) = 1.0;
    for (std::size_t j = 0; j < kPlace; ++j) {
      A(row, m + static_cast<Eigen::Index>(j)) = Median(cell.terms[j]);
    }
    ++row;
  }
  Standardize(A.rightCols(k));
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(A);
  qr.setThreshold(1e-9);
  q_ = qr.householderQ() * Eigen::MatrixXd::Identity(n, qr.rank());
  y_ -= q_ * (q_.transpose() * y_);
  Scatter();
}

std::size_t LightSide::redundant() const {
  return cells_.size() - static_cast<std::size_t>(q_.cols());
}

// A cell's own: of what is left the fitted numbers have taken a part.
void LightSide::Scatter() {
  constexpr std::size_t kFewest = 8;  // numbers left over: a scatter to within a quarter
  sigma_ = 0.0;
  if (redundant() < kFewest) return;
  const std::vector<double> left(y_.data(), y_.data() + y_.size());
  sigma_ = RobustSigma(left) *
           std::sqrt(static_cast<double>(cells_.size()) / static_cast<double>(redundant()));
  sigma_ = std::max(sigma_, 1e-6);  // of single precision, in which they are kept
}

std::pair<std::size_t, std::size_t> LightSide::CellsOf(int mark) const {
  if (mark < 0) return {0, cells_.size()};
  const auto m = static_cast<std::size_t>(mark);
  return {m == 0 ? 0 : ends_[m - 1], ends_[m]};
}

Eigen::VectorXd LightSide::Column(int mark, const Eigen::VectorXd& shape) const {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(y_.size());
  const auto [first, end] = CellsOf(mark);
  for (std::size_t i = first; i < end; ++i) {
    out(static_cast<Eigen::Index>(i)) = shape(cells_[i].slice);
  }
  return out;
}

LightSide::Terms LightSide::TermsOf(int mark, const Eigen::VectorXd& shape) const {
  // Of the column's inner products only its own cells have a part.
  double whole = 0.0, product = 0.0;
  Eigen::VectorXd explained = Eigen::VectorXd::Zero(q_.cols());
  const auto [first, end] = CellsOf(mark);
  for (std::size_t i = first; i < end; ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    const double s = shape(cells_[i].slice);
    if (s == 0.0) continue;
    whole += s * s;
    product += s * y_(row);
    explained += s * q_.row(row).transpose();
  }
  const double square = whole - explained.squaredNorm();
  if (!(square > kDistinct * kDistinct * whole)) return {};
  return {square / (sigma_ * sigma_), product / (sigma_ * sigma_)};
}

void LightSide::Take(int mark, const Eigen::VectorXd& shape, double size) {
  const Eigen::VectorXd column = Column(mark, shape);
  y_ -= size * (column - q_ * (q_.transpose() * column));
  Scatter();
}

// What is left of place stays for a while: the sum of the series' correlations, by Geyer's rule cut
// where they end [-].
double LightSide::Persistence(int mark, const Eigen::VectorXd& shape, double size) const {
  const Eigen::VectorXd column = Column(mark, shape);
  const Eigen::VectorXd left = y_ - size * (column - q_ * (q_.transpose() * column));
  std::map<std::pair<int, int>, double> at;
  for (std::size_t i = 0; i < cells_.size(); ++i) {
    // A cell that is grossly off is no sign of persistence.
    const double most = 5.0 * sigma_;
    at[{cells_[i].mark, cells_[i].slice}] =
        std::clamp(left(static_cast<Eigen::Index>(i)), -most, most);
  }
  const auto covariance = [&](int lag) {
    double sum = 0.0, n = 0.0;
    for (const auto& [cell, value] : at) {
      const auto later = at.find({cell.first, cell.second + lag});
      if (later == at.end()) continue;
      sum += value * later->second;
      n += 1.0;
    }
    return n > 0.0 ? sum / n : 0.0;
  };
  double sum = covariance(0);
  for (int lag = 1; lag < slices_ / 2; ++lag) {
    const double now = covariance(lag);
    if (now <= 0.0) break;
    sum += 2.0 * now;
  }
  return std::max(1.0, sum / (sigma_ * sigma_));
}

}  // namespace unfurl::measure
