#include "calib/known_lens.h"

#include <algorithm>
#include <cmath>

#include "base/dense.h"
#include "base/pose.h"
#include "base/statistics.h"
#include "calib/covariance.h"

namespace unfurl::calib {
namespace {

// Of a camera's parameters, those of the lens that are free.
std::vector<Eigen::Index> FreeOf(const Eigen::MatrixXd& covariance) {
  std::vector<Eigen::Index> out;
  for (Eigen::Index k = kFirstOfLens; k < covariance.rows(); ++k) {
    if (covariance(k, k) > 0.0) out.push_back(k);
  }
  return out;
}

// Where the lens is the one that was known, root * (now - known) has the covariance that the data
// took off the prior's, which is 1.
void TestLens(const Eigen::VectorXd& q, const Eigen::MatrixXd& left, KnownLensEstimate* out) {
  constexpr double kUnheard = 1e-3;  // of a direction: what the data lower less tells nothing [-]
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(left);
  for (Eigen::Index k = 0; k < q.size(); ++k) {
    const double taken = 1.0 - std::min(1.0, eigen.eigenvalues()(k));
    if (taken < kUnheard) continue;
    const double along = eigen.eigenvectors().col(k).dot(q);
    out->chi_square += along * along / taken;
    out->freedom += 1.0;
  }
  if (out->freedom > 0.0) out->chance = ChiSquareTail(out->chi_square, out->freedom);
}

}  // namespace

Eigen::MatrixXd KnownLens::Root() const {
  Eigen::MatrixXd out = Eigen::MatrixXd::Identity(kLensParameters, kLensParameters);
  std::vector<Eigen::Index> free = FreeOf(covariance);
  if (free.empty()) return out;
  // In units of their own sigmas: pixels and metres invert alike. What round-off leaves below zero
  // is cut off.
  const Eigen::MatrixXd C = covariance(free, free);
  const Eigen::VectorXd sigma = C.diagonal().cwiseSqrt();
  const Eigen::MatrixXd R = C.cwiseQuotient(sigma * sigma.transpose());
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(R);
  const double least = 1e-12 * eigen.eigenvalues().maxCoeff();
  const Eigen::VectorXd roots = eigen.eigenvalues().cwiseMax(least).cwiseSqrt().cwiseInverse();
  for (Eigen::Index& k : free) k -= kFirstOfLens;
  out(free, free) =
      roots.asDiagonal() * eigen.eigenvectors().transpose() * sigma.cwiseInverse().asDiagonal();
  return out;
}

Eigen::VectorXd LensOf(const data::RigCamera& camera) {
  Eigen::VectorXd out(kLensParameters);
  out << camera.f_px, camera.u0_px, camera.e,
      Eigen::VectorXd::Map(camera.terms_px.data(), static_cast<Eigen::Index>(data::kLensTerms));
  return out;
}

std::vector<KnownLens> KnownLensesOf(const data::Rig& rig) {
  std::vector<KnownLens> out;
  for (std::size_t j = 0; j < rig.cameras.size(); ++j) {
    const Eigen::Index first = kParameters * static_cast<Eigen::Index>(j);
    out.push_back({rig.cameras[j], rig.covariance.block(first, first, kParameters, kParameters)});
  }
  return out;
}

const KnownLens* FindLens(const std::vector<KnownLens>& known, const std::string& camera) {
  const auto found = std::find_if(known.begin(), known.end(),
                                  [&](const KnownLens& k) { return k.camera.name == camera; });
  return found != known.end() ? &*found : nullptr;
}

std::vector<KnownLensEstimate> CompareLenses(const std::vector<KnownLens>& known,
                                             const data::Rig& now) {
  std::vector<KnownLensEstimate> out;
  for (std::size_t j = 0; j < now.cameras.size(); ++j) {
    const data::RigCamera& camera = now.cameras[j];
    const KnownLens* before = FindLens(known, camera.name);
    if (before == nullptr) continue;
    const Eigen::Index first = kParameters * static_cast<Eigen::Index>(j);
    const Eigen::MatrixXd covariance = now.covariance.block(first, first, kParameters, kParameters);
    const Eigen::VectorXd change = LensOf(camera) - LensOf(before->camera);
    const Eigen::MatrixXd root = before->Root();

    // Where it was, given the lens: pose + K (lens now - lens then), and what that leaves open.
    const Eigen::MatrixXd information = root.transpose() * root;
    const Eigen::MatrixXd mixed = before->covariance.topRightCorner(kFirstOfLens, kLensParameters);
    const Eigen::MatrixXd K = mixed * information;
    Eigen::MatrixXd from_now(kFirstOfLens, kParameters);
    from_now << Eigen::MatrixXd::Identity(kFirstOfLens, kFirstOfLens), -K;
    const Eigen::MatrixXd open = before->covariance.topLeftCorner(kFirstOfLens, kFirstOfLens) -
                                 K * mixed.transpose() +
                                 from_now * covariance * from_now.transpose();
    const Eigen::VectorXd corrected = K * change;

    KnownLensEstimate one;
    one.camera = camera.name;
    one.moved = camera.p_WC - (before->camera.p_WC + corrected.tail<3>());
    one.moved_covariance = open.block<3, 3>(3, 3);
    one.moved_sigma = SigmaAlong(one.moved_covariance, one.moved);
    const Eigen::Vector3d turn = VectorFromRotation(
        camera.R_CW * (RotationFromVector(corrected.head<3>()) * before->camera.R_CW).transpose());
    one.turned = turn.norm();
    one.turned_sigma = SigmaAlong(open.block<3, 3>(0, 0), turn);
    std::vector<Eigen::Index> free = FreeOf(before->covariance);
    for (Eigen::Index& k : free) k -= kFirstOfLens;
    const Eigen::MatrixXd left =
        root * covariance.bottomRightCorner(kLensParameters, kLensParameters) * root.transpose();
    const Eigen::VectorXd q = root * change;
    TestLens(q(free), left(free, free), &one);
    out.push_back(one);
  }
  return out;
}

}  // namespace unfurl::calib
