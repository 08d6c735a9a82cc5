#include "calib/wand_frame.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/dense.h"
#include "base/error.h"
#include "base/pose.h"
#include "calib/parameters.h"
#include "calib/wand_poses.h"
#include "measure/camera_model.h"

namespace unfurl::calib {
namespace {

constexpr double kLine = 0.02;  // sine of the angle below which three cameras are on one line

double MedianReadingSigma(const WandFit& fit, std::size_t camera) {
  double sum = 0.0, n = 0.0;
  for (const WandReading& r : fit.data.readings) {
    if (r.camera != static_cast<int>(camera)) continue;
    sum += r.s_px;
    n += 1.0;
  }
  return n > 0.0 ? sum / n : 1.0;
}

std::size_t CameraNamed(const WandFit& fit, const std::string& name, const std::string& where) {
  const auto& names = fit.data.cameras;
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end()) {
    throw Error(fmt::format("holds no camera \"{}\", which gives the frame", name), where,
                "name cameras as the readings do");
  }
  return static_cast<std::size_t>(found - names.begin());
}

int PoseNamed(const WandFit& fit, const std::string& name, const std::string& where) {
  const auto& poses = fit.data.poses;
  const auto found = std::find(poses.begin(), poses.end(), name);
  if (found == poses.end()) {
    throw Error(fmt::format("holds no pose \"{}\" that was found, which gives the frame", name),
                where, "name a pose in which three cameras or more see both ends of the bar");
  }
  return static_cast<int>(found - poses.begin());
}

// What a small rigid motion of everything, 3 of shift and 3 of turn, does to the parameters.
Eigen::MatrixXd RigidMotions(const WandFit& fit) {
  const auto c = static_cast<Eigen::Index>(fit.state.cameras.size());
  Eigen::MatrixXd G = Eigen::MatrixXd::Zero(kParameters * c, 6);
  for (Eigen::Index j = 0; j < c; ++j) {
    const data::RigCamera& camera = fit.state.cameras[static_cast<std::size_t>(j)];
    G.block<3, 3>(kParameters * j, 3) = -camera.R_CW;
    G.block<3, 3>(kParameters * j + 3, 0).setIdentity();
    G.block<3, 3>(kParameters * j + 3, 3) = -Skew(camera.p_WC);
  }
  return G;
}

// Six conditions B x + n = 0 on the parameters' errors x define the frame; n of covariance `noise`.
Eigen::MatrixXd Conditioned(const WandFit& fit, const Eigen::MatrixXd& B,
                            const Eigen::MatrixXd& noise) {
  const Eigen::MatrixXd G = RigidMotions(fit);
  const Eigen::MatrixXd back = G * Eigen::FullPivLU<Eigen::MatrixXd>(B * G).inverse();
  const Eigen::MatrixXd T = Eigen::MatrixXd::Identity(G.rows(), G.rows()) - back * B;
  return T * fit.CameraCovariance() * T.transpose() + back * noise * back.transpose();
}

// The found points' mean shift and turn are none.
Eigen::MatrixXd InnerConditions(const WandFit& fit) {
  const std::vector<WandGridPoint> grid = WandGrid(fit);
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const WandGridPoint& point : grid) centre += point.p / static_cast<double>(grid.size());
  Eigen::MatrixXd B =
      Eigen::MatrixXd::Zero(6, kParameters * static_cast<Eigen::Index>(fit.state.cameras.size()));
  for (const WandGridPoint& point : grid) {
    B.topRows(3) += point.by_cameras;
    B.bottomRows(3) += Skew(point.p - centre) * point.by_cameras;
  }
  return B;
}

Eigen::Matrix3d Axes(const Eigen::Vector3d& x, const Eigen::Vector3d& near_y) {
  Eigen::Matrix3d R;
  R.row(0) = x.normalized();
  R.row(2) = x.cross(near_y).normalized();
  R.row(1) = R.row(2).cross(R.row(0));
  return R;
}

Pose PoseOf(const Eigen::Matrix3d& R, const Eigen::Vector3d& origin) {
  Pose X = Pose::Identity();
  X.linear() = R;
  X.translation() = -R * origin;
  return X;
}

void FrameByCameras(const std::vector<std::string>& names, const std::string& where, WandFit* fit,
                    FramedWand* out) {
  std::size_t j[3];
  for (std::size_t k = 0; k < 3; ++k) j[k] = CameraNamed(*fit, names[k], where);
  const auto place = [&](int k) { return fit->state.cameras[j[k]].p_WC; };
  const Eigen::Vector3d x = place(1) - place(0), y = place(2) - place(0);
  if (!(x.cross(y).norm() > kLine * x.norm() * y.norm())) {
    throw Error(fmt::format("the cameras {}, {} and {} stand on one line, or two are one", names[0],
                            names[1], names[2]),
                where, "name three others for the frame");
  }
  MoveWand(PoseOf(Axes(x, y), place(0)), false, fit);
  Eigen::MatrixXd B =
      Eigen::MatrixXd::Zero(6, kParameters * static_cast<Eigen::Index>(fit->state.cameras.size()));
  const auto at = [&](int k, Eigen::Index axis) {
    return kParameters * static_cast<Eigen::Index>(j[k]) + 3 + axis;
  };
  B(0, at(0, 0)) = B(1, at(0, 1)) = B(2, at(0, 2)) = 1.0;
  B(3, at(1, 1)) = B(4, at(1, 2)) = B(5, at(2, 2)) = 1.0;
  out->covariance = Conditioned(*fit, B, Eigen::MatrixXd::Zero(6, 6));
  out->words = fmt::format(
      "by cameras: origin at the slit of {}, x towards that of {}, y towards that of {}", names[0],
      names[1], names[2]);
}

// The outer marks of a pose as found points, of the cameras that read them.
void EndsOf(const WandFit& fit, int pose, const std::string& where, WandGridPoint ends[2]) {
  const int marks[2] = {0, fit.data.mark_count() - 1};
  for (int end = 0; end < 2; ++end) {
    std::vector<char> use(fit.state.cameras.size(), 0);
    for (std::size_t k = 0; k < fit.data.readings.size(); ++k) {
      const WandReading& r = fit.data.readings[k];
      if (r.pose != pose || r.mark != marks[end] || fit.weighting.use_reading[k] == 0) continue;
      use[static_cast<std::size_t>(r.camera)] = 1;
    }
    if (PlaceOf(fit, fit.state.Mark(pose, marks[end], 0.0), use, &ends[end])) continue;
    throw Error(fmt::format("in pose \"{}\", which gives the frame, mark \"{}\" is read by fewer "
                            "than three cameras that fix it",
                            fit.data.poses[static_cast<std::size_t>(pose)],
                            fit.data.marks[static_cast<std::size_t>(marks[end])]),
                where, "name another pose");
  }
}

void FrameByGravity(const WandFrame& frame, const std::string& where, WandFit* fit,
                    FramedWand* out) {
  const int plumb = PoseNamed(*fit, frame.plumb, where);
  const int origin = PoseNamed(*fit, frame.origin, where);
  const Eigen::Vector3d up = -fit->state.direction.col(plumb);
  const Eigen::Vector3d bearing = fit->state.direction.col(origin);
  if (!(bearing.cross(up).norm() > kLine)) {
    throw Error(fmt::format("in pose \"{}\", which gives the frame's x, the bar is plumb too",
                            frame.origin),
                where, "name a pose in which it lies level");
  }
  Eigen::Matrix3d R;
  R.row(2) = up;
  R.row(1) = up.cross(bearing).normalized();
  R.row(0) = R.row(1).cross(R.row(2));
  MoveWand(PoseOf(R, fit->state.middle.col(origin)), false, fit);
  WandGridPoint hung[2], lying[2];
  EndsOf(*fit, plumb, where, hung);
  EndsOf(*fit, origin, where, lying);
  // Level shift of the hung bar's ends against each other; the lying bar's middle; its bearing.
  // What the ends' own readings add is told apart from what the cameras do.
  const Eigen::Index n = lying[0].by_cameras.cols();
  Eigen::MatrixXd B(6, n), noise = Eigen::MatrixXd::Zero(6, 6);
  B.topRows(2) = (hung[0].by_cameras - hung[1].by_cameras).topRows(2);
  B.middleRows(2, 3) = 0.5 * (lying[0].by_cameras + lying[1].by_cameras);
  B.row(5) = (lying[1].by_cameras - lying[0].by_cameras).row(1);
  noise.topLeftCorner(2, 2) = (hung[0].cov + hung[1].cov).topLeftCorner(2, 2);
  noise.block<3, 3>(2, 2) = 0.25 * (lying[0].cov + lying[1].cov);
  noise(5, 5) = lying[0].cov(1, 1) + lying[1].cov(1, 1);
  noise.block<3, 1>(2, 5) = 0.5 * (lying[1].cov - lying[0].cov).col(1);
  noise.block<1, 3>(5, 2) = noise.block<3, 1>(2, 5).transpose();
  out->covariance = Conditioned(*fit, B, noise);
  out->words = fmt::format(
      "by gravity and bar: z up along the bar as it hung in pose {}, origin at its middle in pose "
      "{}, x along it there, level",
      frame.plumb, frame.origin);
}

// Places and views of the cameras, as found and as planned, where a plan has all of them.
void PairWithPlan(const WandFrame& frame, const WandFit& fit, const std::string& where,
                  Eigen::Matrix3Xd* found, Eigen::Matrix3Xd* planned) {
  const auto n = static_cast<Eigen::Index>(fit.state.cameras.size());
  found->resize(3, 2 * n);
  planned->resize(3, 2 * n);
  for (Eigen::Index j = 0; j < n; ++j) {
    const data::RigCamera& camera = fit.state.cameras[static_cast<std::size_t>(j)];
    const auto plan = std::find_if(frame.layout.begin(), frame.layout.end(),
                                   [&](const auto& p) { return p.camera == camera.name; });
    if (plan == frame.layout.end()) {
      throw Error(fmt::format("the layout holds no camera \"{}\"", camera.name), where,
                  "name the cameras there as the readings do");
    }
    const Eigen::Vector3d view = plan->look_at - plan->place;
    found->col(2 * j) = camera.p_WC;
    found->col(2 * j + 1) = camera.p_WC + view.norm() * camera.R_CW.row(2).transpose();
    planned->col(2 * j) = plan->place;
    planned->col(2 * j + 1) = plan->look_at;
  }
}

// Turns the rig about where the plan says that it is the mirror image; the motion to the plan.
Pose HandByPlan(const WandFrame& frame, const std::string& where, WandFit* fit, bool* handed) {
  Eigen::Matrix3Xd found, planned;
  PairWithPlan(frame, *fit, where, &found, &planned);
  const RigidFit plain = FitRigid(planned, found);
  // With p -> -p a camera at p that views p + v is one at -p that views -p - v.
  const RigidFit mirror = FitRigid(planned, -found);
  *handed = fit->handed;
  if (!TakesMirror(plain, mirror, handed)) return plain.X_AB;
  MoveWand(Pose::Identity(), true, fit);
  // A lens that is known stays as it is.
  if (fit->priors.front().KnowsLens()) RefitWand(BundleOptions{}, fit);
  return mirror.X_AB;
}

}  // namespace

bool PlaceOf(const WandFit& fit, const Eigen::Vector3d& p, const std::vector<char>& use,
             WandGridPoint* out) {
  const auto c = static_cast<Eigen::Index>(fit.state.cameras.size());
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
  Eigen::MatrixXd mixed = Eigen::MatrixXd::Zero(3, kParameters * c);
  int seen = 0;
  for (Eigen::Index j = 0; j < c; ++j) {
    const auto camera = static_cast<std::size_t>(j);
    measure::Projection h;
    if (!use.empty() && use[camera] == 0) continue;
    if (!measure::Project(fit.state.cameras[camera], p, &h)) continue;
    if (h.u_px < 0.0 || h.u_px > fit.state.cameras[camera].pixels - 1.0) continue;
    const double w =
        1.0 / fit.weighting.Variance(static_cast<int>(j), MedianReadingSigma(fit, camera));
    for (int k = 0; k < static_cast<int>(data::kLensTerms); ++k) {
      if (fit.priors[camera].Fixed(k)) h.du_dc(data::kFirstTerm + k) = 0.0;
    }
    H += w * h.du_dp.transpose() * h.du_dp;
    mixed.middleCols(kParameters * j, kParameters) = w * h.du_dp.transpose() * h.du_dc;
    ++seen;
  }
  constexpr double kLeast = 1.0 / (25.0 * 25.0);  // TriangulateOptions::max_condition, squared
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(H);
  if (seen < 3 || !(eigen.eigenvalues()(0) > kLeast * eigen.eigenvalues()(2))) return false;
  out->p = p;
  out->cov = H.inverse();
  out->by_cameras = -out->cov * mixed;
  return true;
}

std::vector<WandGridPoint> WandGrid(const WandFit& fit, int per_side) {
  const Eigen::Vector3d low = fit.state.middle.rowwise().minCoeff();
  const Eigen::Vector3d size = fit.state.middle.rowwise().maxCoeff() - low;
  std::vector<WandGridPoint> out;
  for (int i = 0; i < per_side * per_side * per_side; ++i) {
    const Eigen::Vector3i step(i % per_side, i / per_side % per_side, i / per_side / per_side);
    const Eigen::Vector3d share = step.cast<double>();
    const Eigen::Vector3d p = low + size.cwiseProduct(share) / (per_side - 1.0);
    WandGridPoint point;
    if (PlaceOf(fit, p, {}, &point)) out.push_back(std::move(point));
  }
  return out;
}

FramedWand SetFrame(const WandFrame& frame, const std::string& where, WandFit* fit) {
  FramedWand out;
  out.handed = fit->handed;
  if (fit->by_points && frame.cameras.empty() && frame.plumb.empty()) {
    out.words = "by the surveyed points";
    out.by_points = true;
    if (!frame.layout.empty() && !out.handed) {
      // Points in one plane: the mirror image through it has them, too. The plan knows.
      const Eigen::Vector3d before = fit->state.cameras.front().p_WC;
      HandByPlan(frame, where, fit, &out.handed);
      if (fit->state.cameras.front().p_WC != before) {
        MoveWand(FitRigid(fit->data.points.p, fit->state.points).X_AB, false, fit);
        RefitWand(BundleOptions{}, fit);
      }
    }
    out.covariance = fit->CameraCovariance();
    return out;
  }
  Pose to_plan = Pose::Identity();
  if (!frame.layout.empty()) to_plan = HandByPlan(frame, where, fit, &out.handed);
  if (!frame.cameras.empty()) {
    FrameByCameras(frame.cameras, where, fit, &out);
    return out;
  }
  if (!frame.plumb.empty()) {
    FrameByGravity(frame, where, fit, &out);
    return out;
  }
  if (!frame.layout.empty()) {
    MoveWand(to_plan, false, fit);
    out.words =
        "by the planned places and views of the cameras, as closely as a rigid motion fits them; "
        "error bars are of the shape";
  } else {
    const data::RigCamera& first = fit->state.cameras.front();
    Eigen::Matrix3d R;
    R.row(0) = first.R_CW.row(0);
    R.row(2) = -first.R_CW.row(2);
    R.row(1) = R.row(2).cross(R.row(0));
    MoveWand(PoseOf(R, fit->state.middle.rowwise().mean()), false, fit);
    out.words = fmt::format(
        "its own: origin amid the bar's places, x along the row of {}, z towards it; error bars "
        "are of the shape",
        first.name);
  }
  out.covariance = Conditioned(*fit, InnerConditions(*fit), Eigen::MatrixXd::Zero(6, 6));
  return out;
}

}  // namespace unfurl::calib
