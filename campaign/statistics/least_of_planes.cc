#include "campaign/statistics/least_of_planes.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "base/dense.h"

namespace unfurl::campaign {

namespace {

constexpr Eigen::Index kMostPlanes = 20;  // more ways to fail than some thousand runs tell apart
constexpr int kAssignments = 20;          // of assignment: it has settled, or it does not
// Of its points that begin a new plane: enough for a direction, few enough to be of one plane.
constexpr double kBegin = 0.15;

using Assignment = std::vector<Eigen::Index>;

// Points with a row of ones above.
struct Data {
  Eigen::MatrixXd x;  // (1 + d) x n
  Eigen::VectorXd y;
  Eigen::Index least = 0;  // points that a plane asks for
};

Assignment LeastAt(const Data& data, const Eigen::MatrixXd& planes) {
  const Eigen::MatrixXd values = planes.transpose() * data.x;
  Assignment of(static_cast<std::size_t>(data.x.cols()));
  for (Eigen::Index i = 0; i < data.x.cols(); ++i) {
    values.col(i).minCoeff(&of[static_cast<std::size_t>(i)]);
  }
  return of;
}

std::vector<Eigen::Index> Members(const Assignment& of, Eigen::Index plane) {
  std::vector<Eigen::Index> own;
  for (std::size_t i = 0; i < of.size(); ++i) {
    if (of[i] == plane) own.push_back(static_cast<Eigen::Index>(i));
  }
  return own;
}

// Least squares of one plane on its points; false where they are too few or lie in a plane.
bool SolvePlane(const Data& data, const std::vector<Eigen::Index>& own,
                Eigen::Ref<Eigen::VectorXd> plane) {
  if (static_cast<Eigen::Index>(own.size()) < data.least) return false;
  const Eigen::MatrixXd x = data.x(Eigen::all, own);
  const Eigen::LLT<Eigen::MatrixXd> normal((x * x.transpose()).eval());
  if (normal.info() != Eigen::Success) return false;
  plane = normal.solve(x * data.y(own));
  return true;
}

// Planes and assignment in turn: a plane that comes to have too few points stays as it was. False
// where the newest, the last, has too few to begin with.
bool Settle(const Data& data, Eigen::MatrixXd* planes, Assignment* of) {
  for (int iteration = 0; iteration < kAssignments; ++iteration) {
    for (Eigen::Index k = 0; k < planes->cols(); ++k) {
      const bool solved = SolvePlane(data, Members(*of, k), planes->col(k));
      if (!solved && iteration == 0 && k + 1 == planes->cols()) return false;
    }
    Assignment next = LeastAt(data, *planes);
    const bool same = next == *of;
    *of = std::move(next);
    if (same) break;
  }
  return true;
}

double LeaveOneOut(const Data& data, const Eigen::MatrixXd& planes, const Assignment& of,
                   double near) {
  double square = 0.0, count = 0.0;
  constexpr double kOwn = 1e-12;  // a point that alone decides a coefficient tells nothing of it
  for (Eigen::Index k = 0; k < planes.cols(); ++k) {
    const std::vector<Eigen::Index> own = Members(of, k);
    if (own.empty()) continue;
    const Eigen::MatrixXd x = data.x(Eigen::all, own);
    // A plane of few points is of an earlier assignment, to which these lend no weight.
    Eigen::MatrixXd half = Eigen::MatrixXd::Zero(x.rows(), x.cols());
    const Eigen::LLT<Eigen::MatrixXd> normal((x * x.transpose()).eval());
    if (x.cols() >= data.least && normal.info() == Eigen::Success) half = normal.matrixL().solve(x);
    for (std::size_t i = 0; i < own.size(); ++i) {
      const double y = data.y[own[i]];
      if (y > near) continue;
      const double leverage =
          std::min(half.col(static_cast<Eigen::Index>(i)).squaredNorm(), 1.0 - kOwn);
      square += std::pow((y - planes.col(k).dot(data.x.col(own[i]))) / (1.0 - leverage), 2.0);
      count += 1.0;
    }
  }
  return count > 0.0 ? std::sqrt(square / count) : std::numeric_limits<double>::infinity();
}

// Gives points that lie far below all planes to one more: those in the direction of the farthest,
// since of all directions together they would make a plane that is lower everywhere.
void Begin(const Data& data, Eigen::MatrixXd* planes, Assignment* of) {
  const Eigen::VectorXd below =
      (planes->transpose() * data.x).colwise().minCoeff().transpose() - data.y;
  Eigen::Index farthest = 0;
  below.maxCoeff(&farthest);
  const auto z = data.x.bottomRows(data.x.rows() - 1);
  const Eigen::VectorXd cosine =
      (z.transpose() * z.col(farthest))
          .cwiseQuotient(z.colwise().norm().transpose().cwiseMax(1e-300));
  const Eigen::VectorXd score = below.cwiseMax(0.0).cwiseProduct(cosine.cwiseMax(0.0));
  std::vector<Eigen::Index> order(of->size());
  std::iota(order.begin(), order.end(), 0);
  const auto begin = static_cast<std::ptrdiff_t>(
      std::max(static_cast<double>(data.least), kBegin * static_cast<double>(order.size())));
  const auto end = order.begin() + std::min<std::ptrdiff_t>(begin, std::ssize(order));
  std::partial_sort(order.begin(), end, order.end(),
                    [&](Eigen::Index a, Eigen::Index b) { return score[a] > score[b]; });
  planes->conservativeResize(Eigen::NoChange, planes->cols() + 1);
  for (auto i = order.begin(); i != end; ++i)
    (*of)[static_cast<std::size_t>(*i)] = planes->cols() - 1;
}

}  // namespace

LeastOfPlanes FitLeastOfPlanes(const Eigen::MatrixXd& points, const Eigen::VectorXd& margins,
                               double near, int points_each) {
  Data data;
  data.x.resize(points.rows() + 1, points.cols());
  data.x << Eigen::RowVectorXd::Ones(points.cols()), points;
  data.y = margins;
  data.least = points_each * data.x.rows();
  constexpr double kExact = 1e-12;  // of the margins' scatter: met to rounding
  const double scatter = std::sqrt((data.y.array() - data.y.mean()).square().mean());
  LeastOfPlanes best;
  best.error = std::numeric_limits<double>::infinity();
  Eigen::MatrixXd planes = Eigen::MatrixXd::Zero(data.x.rows(), 1);
  Assignment of(static_cast<std::size_t>(points.cols()), 0);
  while (Settle(data, &planes, &of)) {
    const double error = LeaveOneOut(data, planes, of, near);
    if (error < best.error) best = {planes, error};
    if (planes.cols() == kMostPlanes || error <= kExact * scatter) break;
    Begin(data, &planes, &of);
  }
  return best;
}

}  // namespace unfurl::campaign
