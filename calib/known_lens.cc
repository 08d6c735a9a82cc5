#include "calib/known_lens.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/dense.h"
#include "base/error.h"
#include "base/length.h"
#include "base/pose.h"
#include "base/statistics.h"
#include "calib/bundle.h"
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

// Where a camera went.
void Place(const KnownLens& before, const data::RigCamera& now, const Eigen::MatrixXd& covariance,
           const Eigen::MatrixXd& root, KnownLensEstimate* out) {
  // Where it was, given the lens: pose + K (lens now - lens then), and what that leaves open.
  const Eigen::MatrixXd information = root.transpose() * root;
  const Eigen::MatrixXd mixed = before.covariance.topRightCorner(kFirstOfLens, kLensParameters);
  const Eigen::MatrixXd K = mixed * information;
  Eigen::MatrixXd from_now(kFirstOfLens, kParameters);
  from_now << Eigen::MatrixXd::Identity(kFirstOfLens, kFirstOfLens), -K;
  const Eigen::MatrixXd open = before.covariance.topLeftCorner(kFirstOfLens, kFirstOfLens) -
                               K * mixed.transpose() + from_now * covariance * from_now.transpose();
  const Eigen::VectorXd corrected = K * (LensOf(now) - LensOf(before.camera));
  out->moved = now.p_WC - (before.camera.p_WC + corrected.tail<3>());
  out->moved_covariance = open.block<3, 3>(3, 3);
  out->moved_sigma = SigmaAlong(out->moved_covariance, out->moved);
  const Eigen::Vector3d turn = VectorFromRotation(
      now.R_CW * (RotationFromVector(corrected.head<3>()) * before.camera.R_CW).transpose());
  out->turned = turn.norm();
  out->turned_sigma = SigmaAlong(open.block<3, 3>(0, 0), turn);
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

const KnownLens& RequireLens(const std::vector<KnownLens>& known, const std::string& camera,
                             int pixels, const std::string& where) {
  const KnownLens* before = FindLens(known, camera);
  if (before == nullptr) {
    throw Error(fmt::format("camera \"{}\" is not among those whose lenses are known", camera),
                where, "give a rig of all cameras, or none");
  }
  if (pixels > 0 && pixels != before->camera.pixels) {
    throw Error(fmt::format("camera \"{}\" has {} pixels, and had {} in the rig that its lens is "
                            "known from",
                            camera, pixels, before->camera.pixels),
                where, "give the rig of the same cameras");
  }
  if (!(before->covariance(kFirstOfLens, kFirstOfLens) > 0.0)) {
    throw Error(fmt::format("the rig that the lens of camera \"{}\" is known from states no "
                            "uncertainty of it",
                            camera),
                where, "give a rig that `unfurl calibrate` has made");
  }
  return *before;
}

void KnowLens(const KnownLens& before, CameraPrior* prior) {
  prior->lens = before.camera.lens;
  for (int k = 0; k < kTerms; ++k) {
    const Eigen::Index at = data::kFirstTerm + k;
    prior->term_sigma_px[static_cast<std::size_t>(k)] =
        std::sqrt(std::max(before.covariance(at, at), 0.0));
  }
  prior->lens_mean = LensOf(before.camera);
  prior->lens_root = before.Root();
}

std::vector<KnownLensEstimate> CompareLenses(const std::vector<KnownLens>& known,
                                             const data::Rig& now, bool one_frame) {
  std::vector<KnownLensEstimate> out;
  for (std::size_t j = 0; j < now.cameras.size(); ++j) {
    const data::RigCamera& camera = now.cameras[j];
    const KnownLens* before = FindLens(known, camera.name);
    if (before == nullptr) continue;
    const Eigen::Index first = kParameters * static_cast<Eigen::Index>(j);
    const Eigen::MatrixXd covariance = now.covariance.block(first, first, kParameters, kParameters);
    const Eigen::VectorXd change = LensOf(camera) - LensOf(before->camera);
    const Eigen::MatrixXd root = before->Root();

    KnownLensEstimate one;
    one.camera = camera.name;
    one.placed = one_frame;
    if (one_frame) {
      Place(*before, camera, covariance, root, &one);
    } else {
      one.moved.setConstant(kUnknown);
      one.moved_covariance.setConstant(kUnknown);
      one.moved_sigma = one.turned = one.turned_sigma = kUnknown;
    }
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

KnownScale CompareScale(const std::vector<KnownLens>& known, const data::Rig& now) {
  std::vector<Eigen::Index> camera;  // of `now`
  for (std::size_t j = 0; j < now.cameras.size(); ++j) {
    if (FindLens(known, now.cameras[j].name) != nullptr) {
      camera.push_back(static_cast<Eigen::Index>(j));
    }
  }
  KnownScale out;
  const auto n = static_cast<Eigen::Index>(camera.size());
  if (n < 3) return out;
  const auto before = [&](Eigen::Index k) -> const KnownLens& {
    return *FindLens(known, now.cameras[static_cast<std::size_t>(camera[k])].name);
  };
  Eigen::Matrix3Xd p(3, n), q(3, n);
  for (Eigen::Index k = 0; k < n; ++k) {
    p.col(k) = now.cameras[static_cast<std::size_t>(camera[k])].p_WC;
    q.col(k) = before(k).camera.p_WC;
  }
  // The frames may be any, and mirror images.
  const RigidFit plain = FitRigid(p, q), mirror = FitRigid(p, -q);
  const Pose& X = mirror.rms < plain.rms ? mirror.X_AB : plain.X_AB;
  if (mirror.rms < plain.rms) q = -q;
  const Eigen::Vector3d p0 = p.rowwise().mean(), q0 = q.rowwise().mean();
  p.colwise() -= p0;
  q = X.linear() * (q.colwise() - q0);
  const double squares = q.squaredNorm();
  out.scale = p.cwiseProduct(q).sum() / squares;
  out.freedom = 3.0 * static_cast<double>(n) - 7.0;
  const double own = (p - out.scale * q).squaredNorm() / out.freedom;  // [m^2]
  Eigen::VectorXd by_now = Eigen::VectorXd::Zero(now.covariance.rows());
  double by_before = 0.0;  // how cameras share errors is not known: as if wholly
  for (Eigen::Index k = 0; k < n; ++k) {
    by_now.segment<3>(kParameters * camera[k] + 3) = q.col(k) / squares;
    const Eigen::Vector3d by = X.linear().transpose() * q.col(k) / squares;
    const Eigen::Matrix3d C = before(k).covariance.block<3, 3>(3, 3);
    by_before += std::sqrt(std::max(by.dot(C * by), 0.0));
  }
  const double variance =
      own / squares + by_now.dot(now.covariance * by_now) + by_before * by_before;
  out.sigma = std::sqrt(std::max(variance, 0.0));
  return out;
}

void JudgeLenses(const std::vector<KnownLensEstimate>& lenses, double level, Tally* tally) {
  const double each = ChanceOfEach(level, static_cast<double>(lenses.size()));
  for (const KnownLensEstimate& lens : lenses) {
    if (lens.chance < each) {
      tally->care.push_back(
          fmt::format("camera \"{}\": its lens is not the one that it was: they differ by a "
                      "chi-square of {:.0f} "
                      "with {:.0f} degrees, which chance makes with a probability of {:.1g}. Was "
                      "it refocused or "
                      "exchanged? Calibrate it from nothing (leave --lenses out)",
                      lens.camera, lens.chi_square, lens.freedom, lens.chance));
    }
    if (!lens.placed) continue;
    const LengthUnit unit = UnitFor(std::max(lens.moved.norm(), lens.moved_sigma));
    tally->fine.push_back(fmt::format(
        "camera \"{}\" stands {:.3g} +- {:.2g} {} and {:.3g} +- {:.2g} mrad from where it was when "
        "its lens was calibrated",
        lens.camera, unit.per_metre * lens.moved.norm(), unit.per_metre * lens.moved_sigma,
        unit.name, 1e3 * lens.turned, 1e3 * lens.turned_sigma));
  }
}

}  // namespace unfurl::calib
