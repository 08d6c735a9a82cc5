#include "campaign/statistics/correlation.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/dense.h"
#include "base/error.h"
#include "base/probability.h"
#include "base/statistics.h"

namespace unfurl::campaign {

namespace {

// A matrix typed with this much rounding is still taken for symmetric.
constexpr double kRounding = 1e-12;
// The least eigenvalue of a correlation matrix with digits left for its factor: an input with a
// combination of others known to 1e-6 of its scatter.
constexpr double kLeastEigenvalue = 1e-12;

std::string NameOf(const std::vector<std::string>& names, Eigen::Index i) {
  return static_cast<std::size_t>(i) < names.size() ? names[static_cast<std::size_t>(i)]
                                                    : fmt::format("input {}", i + 1);
}

void CheckEntries(const Eigen::MatrixXd& r, const std::vector<std::string>& names) {
  if (r.rows() != r.cols()) {
    throw Error(fmt::format("a correlation matrix of {} x {}", r.rows(), r.cols()), "",
                "give a row and a column for each input");
  }
  for (Eigen::Index i = 0; i < r.rows(); ++i) {
    if (!(std::abs(r(i, i) - 1.0) <= kRounding)) {
      throw Error(fmt::format("the correlation {:g} of {} with itself", r(i, i), NameOf(names, i)),
                  "", "put ones on the diagonal");
    }
    for (Eigen::Index j = 0; j < i; ++j) {
      const std::string pair = NameOf(names, j) + " and " + NameOf(names, i);
      if (!(std::abs(r(i, j)) < 1.0)) {
        throw Error(fmt::format("the correlation {:g} of {}", r(i, j), pair), "",
                    "correlations are between -1 and 1; leave one input out and compute it from "
                    "the other where they are the same");
      }
      if (!(std::abs(r(i, j) - r(j, i)) <= kRounding)) {
        throw Error(fmt::format("two correlations of {}: {:g} and {:g}", pair, r(j, i), r(i, j)),
                    "", "give one");
      }
    }
  }
}

void CheckDefinite(const Eigen::MatrixXd& r, const std::vector<int>& joined,
                   const std::vector<std::string>& names) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(r);
  if (eigen.eigenvalues()[0] >= kLeastEigenvalue) return;
  // The inputs of the combination that would have no or a negative variance.
  const Eigen::VectorXd v = eigen.eigenvectors().col(0).cwiseAbs();
  std::string which;
  for (Eigen::Index i = 0; i < v.size(); ++i) {
    if (v[i] < 0.1 * v.maxCoeff()) continue;
    which += (which.empty() ? "" : ", ") + NameOf(names, joined[static_cast<std::size_t>(i)]);
  }
  throw Error(fmt::format("correlations of {} that no inputs can have together: the matrix has the "
                          "eigenvalue {:.3g}",
                          which, eigen.eigenvalues()[0]),
              "", "bring one of them nearer to zero");
}

}  // namespace

Correlation::Correlation(const Eigen::MatrixXd& scores, const std::vector<std::string>& names) {
  CheckEntries(scores, names);
  for (Eigen::Index i = 0; i < scores.rows(); ++i) {
    for (Eigen::Index j = 0; j < scores.cols(); ++j) {
      if (i == j || scores(i, j) == 0.0) continue;
      joined_.push_back(static_cast<int>(i));
      break;
    }
  }
  if (joined_.empty()) return;
  const Eigen::MatrixXd part = scores(joined_, joined_);
  CheckDefinite(part, joined_, names);
  factor_ = Eigen::LLT<Eigen::MatrixXd>(part).matrixL();
}

void Correlation::Apply(std::span<double> u) const {
  if (joined_.empty()) return;
  if (static_cast<std::size_t>(joined_.back()) >= u.size()) {
    throw Error(
        fmt::format("{} numbers for the correlation of input {}", u.size(), joined_.back() + 1), "",
        "give one for each input");
  }
  const Eigen::Index n = factor_.rows();
  for (int i : joined_) u[i] = NormalQuantile(u[i]);
  for (Eigen::Index i = n; i-- > 0;) {  // from the last: each row needs those above it as they were
    double z = 0.0;
    for (Eigen::Index j = 0; j <= i; ++j) z += factor_(i, j) * u[joined_[j]];
    u[joined_[i]] = z;
  }
  // A score of 9 would be the probability 1 itself.
  for (int i : joined_) u[i] = std::min(NormalCdf(u[i]), 1.0 - 0x1p-53);
}

double SpearmanOfScores(double rho) { return 6.0 / std::numbers::pi * std::asin(rho / 2.0); }

}  // namespace unfurl::campaign
