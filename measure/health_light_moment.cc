// When light or focus changed, and by how much at once, flash by flash.
#include <algorithm>
#include <cmath>
#include <utility>

#include "base/dense.h"
#include "base/statistics.h"
#include "measure/health_light.h"

namespace unfurl::measure {

namespace {

constexpr int kReach = 4;             // slices on either side that say what light does by itself
constexpr double kThreeSigmas = 9.0;  // of -2 ln of the likelihood
constexpr double kMedianSquare = 0.4549;  // of a normal error, over its variance

double Capped(double square) { return std::min(square, 2.0 * kThreeSigmas); }

}  // namespace

LightSeries::LightSeries(const std::vector<LightLook>& looks, bool width, int mark, int first,
                         int last)
    : width_(width), first_(first), last_(last) {
  const auto begin = std::partition_point(looks.begin(), looks.end(), [&](const LightLook& look) {
    return look.slice < first - kReach;
  });
  for (auto look = begin; look != looks.end() && look->slice <= last + kReach; ++look) {
    if (look->mark == mark) near_.push_back(&*look);
  }
}

bool LightSeries::Fit(int order, double* level, double* jump, double* variance) const {
  const Eigen::Index numbers = order + 2;
  std::vector<const LightLook*> beside;
  Eigen::Index before = 0;
  for (const LightLook* look : near_) {
    if (Within(*look)) continue;
    beside.push_back(look);
    before += look->slice < first_;
  }
  const auto n = static_cast<Eigen::Index>(beside.size());
  if (before <= numbers || n - before <= numbers) return false;
  const double middle = 0.5 * (near_.front()->t + near_.back()->t);
  const double half = std::max(near_.back()->t - middle, 1e-12);
  Eigen::MatrixXd A(n, numbers);
  Eigen::VectorXd y(n), weight = Eigen::VectorXd::Ones(n), x;
  for (Eigen::Index i = 0; i < n; ++i) {
    const LightLook& look = *beside[static_cast<std::size_t>(i)];
    for (int k = 0; k <= order; ++k) A(i, k) = std::pow((look.t - middle) / half, k);
    A(i, numbers - 1) = look.slice > last_ ? 1.0 : 0.0;
    y(i) = width_ ? look.width * look.width : look.flux;
  }
  Eigen::MatrixXd H;
  double scatter = 0.0;
  constexpr int kRounds = 5;        // of weighing anew; it settles in three or four
  constexpr double kOutlier = 3.0;  // sigmas, from which on a flash tells nothing
  for (int round = 0; round < kRounds; ++round) {
    H = A.transpose() * weight.asDiagonal() * A;
    x = H.ldlt().solve(A.transpose() * weight.cwiseProduct(y));
    const Eigen::VectorXd left = y - A * x;
    scatter = RobustSigma(std::vector<double>(left.data(), left.data() + n));
    if (!(scatter > 0.0) || !x.allFinite()) return false;
    weight = (left.array().abs() < kOutlier * scatter).cast<double>().matrix();
  }
  *level = x(0);
  *jump = x(numbers - 1);
  // The scatter is that of so many flashes less the numbers they gave.
  const double share = static_cast<double>(n) / static_cast<double>(n - numbers);
  *variance = share * scatter * scatter * H.inverse()(numbers - 1, numbers - 1);
  return std::isfinite(*variance) && *variance > 0.0;
}

bool LightSeries::Jump(double* level, double* jump, double* variance) const {
  double other_level = 0.0, other = 0.0, ignored = 0.0;
  if (!Fit(2, level, jump, variance) || !Fit(3, &other_level, &other, &ignored)) return false;
  *variance += (other - *jump) * (other - *jump);
  return true;
}

void LightSeries::Read(double size, std::vector<std::pair<double, double>>* flashes,
                       std::vector<double>* squares) const {
  // Of a width twice its logarithm, as its square is what changes.
  const auto own = [&](const LightLook& look) {
    const double value = width_ ? 2.0 * std::log(look.width) : look.flux;
    return value - (look.slice > last_ ? size : 0.0);
  };
  double n = 0, st = 0, stt = 0, sy = 0, sty = 0;
  for (const LightLook* look : near_) {
    if (Within(*look)) continue;
    const double t = look->t - near_.front()->t, y = own(*look);
    n += 1.0;
    st += t;
    stt += t * t;
    sy += y;
    sty += t * y;
  }
  const double determinant = n * stt - st * st;
  if (n < 3.0 || !(determinant > 0.0)) return;
  const double slope = (n * sty - st * sy) / determinant, level = (sy - slope * st) / n;
  for (const LightLook* look : near_) {
    const double left = own(*look) - level - slope * (look->t - near_.front()->t);
    if (Within(*look)) {
      flashes->emplace_back(look->t, left);
    } else {
      squares->push_back(left * left);
    }
  }
}

bool FindMoment(const std::vector<std::vector<LightLook>>& looks, const LightMoment& moment,
                double* earliest, double* latest) {
  std::vector<std::pair<double, double>> flashes;
  std::vector<double> squares;
  for (std::size_t c = 0; c < looks.size(); ++c) {
    if (moment.subject.camera >= 0 && moment.subject.camera != static_cast<int>(c)) continue;
    for (int m = 0; m < moment.marks; ++m) {
      if (moment.subject.mark >= 0 && moment.subject.mark != m) continue;
      LightSeries(looks[c], moment.width, m, moment.first, moment.last)
          .Read(moment.size, &flashes, &squares);
    }
  }
  if (flashes.size() < 2 || squares.empty()) return false;
  const double variance = Median(squares) / kMedianSquare;
  if (!(variance > 0.0)) return false;
  std::sort(flashes.begin(), flashes.end());
  const double begin = flashes.front().first, end = flashes.back().first;
  // At flash j, and little by little from the first to the last.
  double loss = 0.0, gradual = 0.0;
  for (const auto& [t, left] : flashes) {
    const double after = left - moment.size;
    const double between = left - moment.size * (t - begin) / std::max(end - begin, 1e-12);
    loss += Capped(after * after / variance);
    gradual += Capped(between * between / variance);
  }
  std::vector<double> all = {loss};
  for (const auto& [t, left] : flashes) {
    const double after = left - moment.size;
    loss += Capped(left * left / variance) - Capped(after * after / variance);
    all.push_back(loss);
  }
  const double least = *std::min_element(all.begin(), all.end());
  if (gradual + kThreeSigmas < least) return false;
  std::size_t first = flashes.size(), last = 0;
  for (std::size_t j = 0; j < all.size(); ++j) {
    if (all[j] > least + kThreeSigmas) continue;
    first = std::min(first, j);
    last = j;
  }
  if (first == 0 || last == flashes.size()) return false;
  *earliest = flashes[first - 1].first;
  *latest = flashes[last].first;
  return true;
}

}  // namespace unfurl::measure
