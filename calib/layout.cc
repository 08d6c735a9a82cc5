#include "calib/layout.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/error.h"
#include "base/length.h"
#include "base/pose.h"
#include "base/statistics.h"
#include "calib/verdict.h"

namespace unfurl::calib {
namespace {

constexpr double kPlainly = 0.5;       // of the other's RMS: which way round is beyond doubt
constexpr double kScaleChance = 1e-3;  // of a sound scale to be called off, as of a sound survey
// Of the cameras' distances in another unit: a plan is seldom out by a quarter, and units are
// further apart [-].
constexpr double kPlanAlike = 0.25;
// Over the best: explanations that are as good for all that mounting errors tell [-].
constexpr double kAsGood = 2.0;

// Places, and points along the optical axes as far away as the cameras are from their middle.
struct Stand {
  Eigen::Matrix3Xd found, meant;  // 3 x 2 c; of camera j: 2 j, 2 j + 1
  double arm = 0.0, meant_arm = 0.0;
};

double ArmOf(const Eigen::Matrix3Xd& places) {
  return std::sqrt((places.colwise() - places.rowwise().mean()).squaredNorm() /
                   static_cast<double>(places.cols()));
}

// `scale`: what the found places are multiplied by.
Stand StandOf(const data::Rig& rig, const data::Lab& lab, double scale) {
  const auto n = static_cast<Eigen::Index>(rig.cameras.size());
  Stand out{Eigen::Matrix3Xd(3, 2 * n), Eigen::Matrix3Xd(3, 2 * n)};
  Eigen::Matrix3Xd found(3, n), meant(3, n), view(3, n);
  for (Eigen::Index j = 0; j < n; ++j) {
    const data::RigCamera& camera = rig.cameras[static_cast<std::size_t>(j)];
    const auto nominal = std::find_if(lab.cameras.begin(), lab.cameras.end(),
                                      [&](const auto& c) { return c.name == camera.name; });
    if (nominal == lab.cameras.end()) {
      throw Error(fmt::format("holds no camera \"{}\"", camera.name), lab.path,
                  "name the cameras as the survey does");
    }
    found.col(j) = scale * camera.p_WC;
    meant.col(j) = nominal->position;
    view.col(j) = (nominal->look_at - nominal->position).normalized();
  }
  out.arm = ArmOf(found);
  out.meant_arm = ArmOf(meant);
  for (Eigen::Index j = 0; j < n; ++j) {
    out.found.col(2 * j) = found.col(j);
    out.found.col(2 * j + 1) =
        found.col(j) + out.arm * rig.cameras[static_cast<std::size_t>(j)].R_CW.row(2).transpose();
    out.meant.col(2 * j) = meant.col(j);
    out.meant.col(2 * j + 1) = meant.col(j) + out.arm * view.col(j);
  }
  return out;
}

// Camera j of the rig stands where the layout has camera of[j].
struct Names {
  std::vector<Eigen::Index> of;
  std::string what;
};

std::vector<Names> NamesOf(const data::Rig& rig) {
  const auto n = static_cast<Eigen::Index>(rig.cameras.size());
  std::vector<Eigen::Index> as_is(static_cast<std::size_t>(n));
  std::iota(as_is.begin(), as_is.end(), Eigen::Index{0});
  std::vector<Names> out = {{as_is, ""}};
  for (std::size_t a = 0; a < as_is.size(); ++a) {
    for (std::size_t b = a + 1; b < as_is.size(); ++b) {
      out.push_back({as_is, fmt::format("the readings of cameras \"{}\" and \"{}\" are exchanged",
                                        rig.cameras[a].name, rig.cameras[b].name)});
      std::swap(out.back().of[a], out.back().of[b]);
    }
  }
  for (std::size_t by = 1; by < as_is.size() && as_is.size() > 2; ++by) {
    out.push_back({as_is, fmt::format("the cameras' readings are moved on by {}: what is called "
                                      "\"{}\" is \"{}\", and so on",
                                      by, rig.cameras[0].name, rig.cameras[by].name)});
    std::rotate(out.back().of.begin(), out.back().of.begin() + static_cast<std::ptrdiff_t>(by),
                out.back().of.end());
  }
  return out;
}

double RmsOf(const Stand& stand, const Names& names, bool mirrored) {
  Eigen::Matrix3Xd meant(3, stand.meant.cols()), found = stand.found;
  for (std::size_t j = 0; j < names.of.size(); ++j) {
    meant.middleCols<2>(2 * static_cast<Eigen::Index>(j)) =
        stand.meant.middleCols<2>(2 * names.of[j]);
  }
  if (mirrored) found.row(0).swap(found.row(1));
  return FitRigid(meant, found).rms;
}

LayoutSlip SlipOf(ScaleFrom from, const UnitSlip& unit, bool mirrored, const Names& names,
                  double rms) {
  LayoutSlip out;
  out.rms = rms;
  out.mirrored = mirrored;
  const auto add = [&](const std::string& what, const std::string& remedy) {
    ++out.parts;
    out.what += (out.what.empty() ? "" : ", and ") + what;
    out.remedy += (out.remedy.empty() ? "" : "; ") + remedy;
  };
  if (unit.found) add(UnitSubject(from) + " " + unit.what, UnitRemedy(from, unit));
  if (mirrored) {
    add("the survey is left-handed: its first two columns are N, E and not E, N",
        "name them so, or exchange them");
  }
  if (!names.what.empty()) {
    add(names.what, "exchange the columns, or the names in \"# cameras:\"");
  }
  return out;
}

}  // namespace

LayoutMatch CompareLayout(const data::Rig& rig, const data::Lab& lab) {
  const Stand stand = StandOf(rig, lab, 1.0);
  const Names as_is = NamesOf(rig).front();
  LayoutMatch match;
  match.rms = RmsOf(stand, as_is, false);
  match.rms_mirrored = RmsOf(stand, as_is, true);
  match.mirrored = match.rms_mirrored < kPlainly * match.rms;
  return match;
}

std::vector<LayoutSlip> FindLayoutSlips(const data::Rig& rig, const data::Lab& lab,
                                        ScaleFrom from) {
  const Stand as_written = StandOf(rig, lab, 1.0);
  const UnitSlip unit = FindUnitSlipOf(as_written.arm / as_written.meant_arm, kPlanAlike);
  const Stand stand = StandOf(rig, lab, unit.factor);
  const std::vector<Names> all = NamesOf(rig);
  const double rms = RmsOf(as_written, all.front(), false);
  std::vector<LayoutSlip> slips;
  for (const Names& names : all) {
    for (const bool mirrored : {false, true}) {
      const double now = RmsOf(stand, names, mirrored);
      if (!(now < kPlainly * rms)) continue;
      // Where the scale is off, the layout has not told a bar's rig from its mirror image.
      const bool told = mirrored && from != ScaleFrom::kBar;
      LayoutSlip slip = SlipOf(from, unit, told, names, now);
      if (slip.parts > 0) slips.push_back(std::move(slip));
    }
  }
  std::stable_sort(slips.begin(), slips.end(),
                   [](const auto& a, const auto& b) { return a.rms < b.rms; });
  while (!slips.empty() && slips.back().rms > kAsGood * slips.front().rms) slips.pop_back();
  // One thing wrong is likelier than two; columns in another order than cameras' names are.
  const auto parts = [](const LayoutSlip& slip) { return slip.parts; };
  const int least = slips.empty() ? 0 : std::ranges::min(slips, {}, parts).parts;
  std::erase_if(slips, [&](const LayoutSlip& slip) { return slip.parts > least; });
  std::stable_partition(slips.begin(), slips.end(),
                        [](const LayoutSlip& slip) { return slip.mirrored; });
  return slips;
}

LayoutScale CompareScale(const data::Rig& rig, const data::Lab& lab) {
  const Stand stand = StandOf(rig, lab, 1.0);
  const auto n = static_cast<Eigen::Index>(rig.cameras.size());
  const Eigen::Matrix3Xd found = stand.found(Eigen::all, Eigen::seqN(0, n, 2));
  const Eigen::Matrix3Xd meant = stand.meant(Eigen::all, Eigen::seqN(0, n, 2));
  const Pose X = FitRigid(found, meant).X_AB;  // found = X meant
  const Eigen::Matrix3Xd arm = found.colwise() - found.rowwise().mean();
  const double square = arm.squaredNorm();
  // By each place, arm . error / square; what is rigid has no part in it.
  Eigen::VectorXd by = Eigen::VectorXd::Zero(rig.covariance.rows());
  LayoutScale out;
  for (Eigen::Index j = 0; j < n; ++j) {
    out.strain += arm.col(j).dot(X * Eigen::Vector3d(meant.col(j)) - found.col(j)) / square;
    if (by.size() > 0) by.segment<3>(data::kCameraParameters * j + 3) = arm.col(j) / square;
  }
  // A camera that stands far from its place says that the layout is worse than it states.
  double left = 0.0;
  for (Eigen::Index j = 0; j < n; ++j) {
    left +=
        (X * Eigen::Vector3d(meant.col(j)) - found.col(j) - out.strain * arm.col(j)).squaredNorm();
  }
  const double stated = lab.mounting.position * lab.mounting.position;
  double variance = std::max(stated, left / (3.0 * static_cast<double>(n) - 7.0)) / square;
  if (by.size() > 0) variance += by.dot(rig.covariance * by);
  out.sigma = std::sqrt(variance);
  const double limit = NormalQuantile(1.0 - 0.5 * kScaleChance);
  out.off = lab.mounting.position > 0.0 && std::abs(out.strain) > limit * out.sigma;
  return out;
}

void JudgeScale(const data::Lab& lab, ScaleFrom from, data::Rig* rig) {
  const LayoutScale scale = CompareScale(*rig, lab);
  rig->checks["layout_scale [1]"] = 1.0 + scale.strain;
  if (!scale.off) return;
  const std::string text = fmt::format(
      "the cameras stand {:.2g} +- {:.1g}% {} each other than {} has them, where each was put up "
      "to {}: {} is wrong, and with it the scale of everything, or the layout is",
      100.0 * std::abs(scale.strain), 100.0 * scale.sigma,
      scale.strain > 0.0 ? "nearer to" : "farther from", lab.path,
      LengthText(lab.mounting.position),
      from == ScaleFrom::kSurvey ? "the station's scale or the survey's unit"
                                 : "the bar's stated length");
  if (rig->verdict == kDoNotUse) {
    rig->reasons.push_back(text);
    return;
  }
  rig->verdict = kWithCare;
  rig->reasons.insert(rig->reasons.begin(), text);
}

void JudgeLayout(const data::Lab& lab, data::Rig* rig, ScaleFrom from) {
  const double rms = CompareLayout(*rig, lab).rms;
  rig->checks["layout_rms [m]"] = rms;
  const std::vector<LayoutSlip> slips = FindLayoutSlips(*rig, lab, from);
  if (slips.empty()) {
    JudgeScale(lab, from, rig);
    return;
  }
  std::string what, remedy;
  for (const LayoutSlip& slip : slips) {
    what += (what.empty() ? "" : "; or ") + slip.what;
    if (remedy.find(slip.remedy) != remedy.npos) continue;
    remedy += (remedy.empty() ? "" : "; or ") + slip.remedy;
  }
  rig->verdict = kDoNotUse;
  rig->reasons.insert(
      rig->reasons.begin(),
      fmt::format("{} (the cameras are {} RMS from where {} has them, and then {}): {}", what,
                  LengthText(rms), lab.path, LengthText(slips.front().rms), remedy));
}

}  // namespace unfurl::calib
