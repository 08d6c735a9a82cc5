#include "calib/layout.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/length.h"
#include "base/pose.h"
#include "calib/verdict.h"

namespace unfurl::calib {
namespace {

constexpr double kPlainly = 0.5;  // of the other's RMS: which way round is beyond doubt

}  // namespace

LayoutMatch CompareLayout(const data::Rig& rig, const data::Lab& lab) {
  const auto n = static_cast<Eigen::Index>(rig.cameras.size());
  Eigen::Matrix3Xd found(3, 2 * n), meant(3, 2 * n), places(3, n);
  for (Eigen::Index j = 0; j < n; ++j) {
    places.col(j) = rig.cameras[static_cast<std::size_t>(j)].p_WC;
  }
  const double arm = std::sqrt((places.colwise() - places.rowwise().mean()).squaredNorm() /
                               static_cast<double>(n));
  for (Eigen::Index j = 0; j < n; ++j) {
    const data::RigCamera& camera = rig.cameras[static_cast<std::size_t>(j)];
    const auto nominal = std::find_if(lab.cameras.begin(), lab.cameras.end(),
                                      [&](const auto& c) { return c.name == camera.name; });
    if (nominal == lab.cameras.end()) {
      throw Error(fmt::format("holds no camera \"{}\"", camera.name), lab.path,
                  "name the cameras as the survey does");
    }
    found.col(2 * j) = camera.p_WC;
    found.col(2 * j + 1) = camera.p_WC + arm * camera.R_CW.row(2).transpose();
    meant.col(2 * j) = nominal->position;
    meant.col(2 * j + 1) =
        nominal->position + arm * (nominal->look_at - nominal->position).normalized();
  }
  LayoutMatch match;
  match.rms = FitRigid(meant, found).rms;
  found.row(0).swap(found.row(1));
  match.rms_mirrored = FitRigid(meant, found).rms;
  match.mirrored = match.rms_mirrored < kPlainly * match.rms;
  return match;
}

void JudgeLayout(const data::Lab& lab, data::Rig* rig) {
  const LayoutMatch match = CompareLayout(*rig, lab);
  rig->checks["layout_rms [m]"] = match.rms;
  if (!match.mirrored) return;
  rig->verdict = kDoNotUse;
  rig->reasons.insert(
      rig->reasons.begin(),
      fmt::format("the survey is left-handed: the cameras are {} RMS from where {} has them, and "
                  "their mirror image {}; its first two columns are N, E and not E, N: name them "
                  "so, or exchange them",
                  LengthText(match.rms), lab.path, LengthText(match.rms_mirrored)));
}

}  // namespace unfurl::calib
