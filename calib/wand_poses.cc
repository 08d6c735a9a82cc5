#include "calib/wand_poses.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "base/dense.h"
#include "base/error.h"
#include "base/pose.h"
#include "base/statistics.h"
#include "calib/initial_guess.h"
#include "calib/slips.h"
#include "calib/wand_guess.h"
#include "measure/camera_model.h"

namespace unfurl::calib {
namespace {

constexpr int kFewestReadings = 5;  // a pose at rest has five unknowns
constexpr int kDirections = 400;    // tried where one mark was found: some 8 degrees apart
constexpr double kFlat = 0.05;      // GuessOptions::flatness: points that count as on a line

// Readings of a pose in `data.readings`.
struct Span {
  std::size_t first = 0, end = 0;
};
std::vector<Span> SpansOf(const WandData& data) {
  std::vector<Span> out(data.poses.size());
  for (std::size_t k = 0; k < data.readings.size(); ++k) {
    Span& span = out[static_cast<std::size_t>(data.readings[k].pose)];
    if (span.end == 0) span.first = k;
    span.end = k + 1;
  }
  return out;
}

// Whether a pose has readings for its five unknowns, and one mark three for a point.
bool Seen(const WandData& data, const Span& span) {
  std::vector<int> of_mark(data.marks.size(), 0);
  for (std::size_t k = span.first; k < span.end; ++k) {
    ++of_mark[static_cast<std::size_t>(data.readings[k].mark)];
  }
  return static_cast<int>(span.end - span.first) >= kFewestReadings &&
         *std::max_element(of_mark.begin(), of_mark.end()) >= 3;
}

// A pose from two marks that were found, the farthest apart; false where fewer were.
bool PoseFromMarks(const Eigen::Matrix3Xd& marks, int pose, const Eigen::VectorXd& place,
                   Eigen::Vector3d* middle, Eigen::Vector3d* direction) {
  int a = -1, b = -1;
  const auto m = static_cast<int>(place.size());
  for (int k = 0; k < m; ++k) {
    if (!marks.col(pose * m + k).allFinite()) continue;
    if (a < 0 || place(k) < place(a)) a = k;
    if (b < 0 || place(k) > place(b)) b = k;
  }
  if (a < 0 || a == b) return false;
  const Eigen::Vector3d from = marks.col(pose * m + a), to = marks.col(pose * m + b);
  if (!((to - from).norm() > 0.0)) return false;
  *direction = (to - from).normalized();
  *middle = 0.5 * (from + to) - 0.5 * (place(a) + place(b)) * *direction;
  return true;
}

// What a pose is tried by.
struct PoseTrial {
  const WandData& data;
  const Span& span;
  const std::vector<data::RigCamera>& cameras;
  const std::vector<double>& sigma_px;
  const Eigen::VectorXd& place;
  double least = std::numeric_limits<double>::infinity();
  Eigen::Vector3d middle = {}, direction = {};  // of the best

  // A mark `at` a place, the bar along d.
  void Try(int mark, const Eigen::Vector3d& at, const Eigen::Vector3d& d) {
    double cost = 0.0;
    for (std::size_t r = span.first; r < span.end; ++r) {
      const WandReading& reading = data.readings[r];
      const auto j = static_cast<std::size_t>(reading.camera);
      const Eigen::Vector3d p = at + (place(reading.mark) - place(mark)) * d;
      double u = 0.0;
      const bool seen = measure::Project(cameras[j], p, &u);
      const double off = seen ? (reading.u_px - u) / std::hypot(sigma_px[j], reading.s_px) : 1e6;
      cost += Loss(off * off, 3.0);
    }
    if (!(cost < least)) return;
    least = cost;
    direction = d;
    middle = at - place(mark) * d;
  }
};

// Through a mark, all around.
void TryAround(int mark, const Eigen::Vector3d& at, PoseTrial* trial) {
  for (int k = 0; k < kDirections; ++k) {
    // A spiral of equal areas over the sphere.
    const double z = 1.0 - 2.0 * (k + 0.5) / kDirections, turn = 2.399963 * k;
    const double across = std::sqrt(1.0 - z * z);
    trial->Try(mark, at, Eigen::Vector3d(across * std::cos(turn), across * std::sin(turn), z));
  }
}

// Where only one mark was found: the bar all around it, and to where the others roughly are.
bool PoseFromMark(const Eigen::Matrix3Xd& marks, int pose, const std::vector<RoughMark>& rough,
                  PoseTrial* trial) {
  const int m = trial->data.mark_count();
  int mark = 0;
  while (mark < m && !marks.col(pose * m + mark).allFinite()) ++mark;
  if (mark == m) return false;
  const Eigen::Vector3d at = marks.col(pose * m + mark);
  TryAround(mark, at, trial);
  const auto first = std::lower_bound(rough.begin(), rough.end(), pose * m,
                                      [](const RoughMark& a, int of) { return a.mark < of; });
  for (auto one = first; one != rough.end() && one->mark < (pose + 1) * m; ++one) {
    const double apart = trial->place(one->mark - pose * m) - trial->place(mark);
    const Eigen::Vector3d way = one->p - at;
    if (way.norm() > 0.0) trial->Try(mark, at, (apart > 0.0 ? 1.0 : -1.0) * way.normalized());
  }
  return true;
}

Eigen::VectorXd CentredPlaces(const WandData& data) {
  return data.place.array() - 0.5 * (data.place.maxCoeff() + data.place.minCoeff());
}

}  // namespace

PosesLeft StartPoses(const std::vector<data::RigCamera>& cameras,
                     const std::vector<double>& sigma_px, const Eigen::Matrix3Xd& marks,
                     const std::vector<RoughMark>& rough, WandData* data, WandState* state) {
  const std::vector<Span> spans = SpansOf(*data);
  const Eigen::VectorXd place = CentredPlaces(*data);
  PosesLeft left;
  std::vector<int> keep;
  std::vector<Eigen::Vector3d> middles, directions;
  for (int k = 0; k < data->pose_count(); ++k) {
    const Span& span = spans[static_cast<std::size_t>(k)];
    if (!Seen(*data, span)) {
      left.unseen.push_back(k);
      continue;
    }
    PoseTrial trial{*data, span, cameras, sigma_px, place};
    if (!PoseFromMarks(marks, k, place, &trial.middle, &trial.direction) &&
        !PoseFromMark(marks, k, rough, &trial)) {
      left.contradicting.push_back(k);
      continue;
    }
    keep.push_back(k);
    middles.push_back(trial.middle);
    directions.push_back(trial.direction);
  }
  *data = SelectPoses(*data, keep);
  const auto n = static_cast<Eigen::Index>(keep.size());
  state->cameras = cameras;
  state->place = place;
  state->middle.resize(3, n);
  state->direction.resize(3, n);
  for (Eigen::Index k = 0; k < n; ++k) {
    state->middle.col(k) = middles[static_cast<std::size_t>(k)];
    state->direction.col(k) = directions[static_cast<std::size_t>(k)];
  }
  state->velocity.setZero(3, n);
  state->turning.setZero(3, n);
  state->points = data->points.p;
  state->common.setZero(static_cast<Eigen::Index>(data->points.common.size()));
  return left;
}

void StartMotion(WandFit* fit) {
  WandState& state = fit->state;
  const std::vector<double>& time = fit->data.time;
  const Eigen::Index n = state.middle.cols();
  if (!fit->data.Moves() || n < 3) return;
  std::vector<double> unrest;
  const double arm = 0.5 * fit->data.Length();
  for (Eigen::Index k = 1; k + 1 < n; ++k) {
    const auto i = static_cast<std::size_t>(k);
    const double before = time[i] - time[i - 1], after = time[i + 1] - time[i];
    const Eigen::Vector3d v0 = (state.middle.col(k) - state.middle.col(k - 1)) / before;
    const Eigen::Vector3d v1 = (state.middle.col(k + 1) - state.middle.col(k)) / after;
    const Eigen::Vector3d w0 = (state.direction.col(k) - state.direction.col(k - 1)) / before;
    const Eigen::Vector3d w1 = (state.direction.col(k + 1) - state.direction.col(k)) / after;
    const double share = before / (before + after);
    state.velocity.col(k) = (1.0 - share) * v0 + share * v1;
    state.turning.col(k) = (1.0 - share) * w0 + share * w1;
    // Mean rates over neighbouring intervals differ by white acceleration's (T0 + T1) / 3.
    const double squares = (v1 - v0).squaredNorm() + arm * arm * (w1 - w0).squaredNorm();
    unrest.push_back(squares / 6.0 / ((before + after) / 3.0));
  }
  state.velocity.col(0) = state.velocity.col(1);
  state.velocity.col(n - 1) = state.velocity.col(n - 2);
  state.turning.col(0) = state.turning.col(1);
  state.turning.col(n - 1) = state.turning.col(n - 2);
  fit->weighting.unrest = std::max(Mean(unrest), 1e-12);  // 0: a bar that never moved
}

double SurveySquare(const Observations& points, const WandState& state, int point) {
  Eigen::Vector3d d = state.points.col(point) - points.p.col(point);
  for (std::size_t m = 0; m < points.common.size(); ++m) {
    d += state.common(static_cast<Eigen::Index>(m)) * points.common[m].shift.col(point);
  }
  return d.dot(points.cov[static_cast<std::size_t>(point)].llt().solve(d));
}

bool FixFrame(const Eigen::Matrix3Xd& p) {
  if (p.cols() < 3) return false;
  const PointSpread spread = SpreadOf(p);
  return spread.sigma(1) >= kFlat * spread.sigma(0);
}

bool TakesMirror(const RigidFit& plain, const RigidFit& mirror, bool* handed) {
  constexpr double kBeyondDoubt = 0.5;  // of the other's RMS [-]
  const bool told =
      std::min(plain.rms, mirror.rms) < kBeyondDoubt * std::max(plain.rms, mirror.rms);
  const bool known = std::exchange(*handed, *handed || told);
  return mirror.rms < plain.rms && (told || !known);
}

void TakeFrame(const std::string& where, WandFit* fit) {
  const Observations& points = fit->data.points;
  if (points.points() < 3) return;
  std::vector<int> number(fit->data.cameras.size());
  for (std::size_t j = 0; j < number.size(); ++j) number[j] = static_cast<int>(j);
  const Eigen::Matrix3Xd at =
      LocateMarks(points, fit->state.cameras, number, fit->weighting.floor_px, fit->state.Ends());
  const Slip slip = FindScaleSlip(points.p, at);
  if (slip.found) {
    throw Error("the surveyed points (--points) " + slip.what, where,
                slip.remedy + "; or put right the length of the bar (--bar)");
  }
  std::vector<int> found;
  for (Eigen::Index i = 0; i < at.cols(); ++i) {
    if (at.col(i).allFinite()) found.push_back(static_cast<int>(i));
  }
  if (found.size() < 3) return;
  const Eigen::Matrix3Xd p = points.p(Eigen::all, found), q = at(Eigen::all, found);
  if (!FixFrame(p)) return;  // on one line
  const RigidFit plain = FitRigid(p, q), mirror = FitRigid(p, -q);
  // Off a plane, the mirror image misses the points by about as much as they are off it.
  const bool mirrored = TakesMirror(plain, mirror, &fit->handed);
  MoveWand(mirrored ? mirror.X_AB : plain.X_AB, mirrored, fit);
  fit->by_points = true;
  for (Eigen::Index i = 0; i < points.p.cols(); ++i) fit->state.points.col(i) = points.p.col(i);
}

WandFit KeepPoses(const WandFit& fit, const std::vector<int>& keep) {
  WandFit out = fit;
  out.data = SelectPoses(fit.data, keep);
  const auto pick = [&](const Eigen::Matrix3Xd& all) {
    return Eigen::Matrix3Xd(all(Eigen::all, keep));
  };
  out.state.middle = pick(fit.state.middle);
  out.state.direction = pick(fit.state.direction);
  out.state.velocity = pick(fit.state.velocity);
  out.state.turning = pick(fit.state.turning);
  std::vector<char> kept(fit.data.poses.size(), 0);
  for (const int k : keep) kept[static_cast<std::size_t>(k)] = 1;
  out.weighting.use_reading.clear();
  for (std::size_t k = 0; k < fit.data.readings.size(); ++k) {
    if (kept[static_cast<std::size_t>(fit.data.readings[k].pose)] == 0) continue;
    out.weighting.use_reading.push_back(fit.weighting.use_reading[k]);
  }
  return out;
}

}  // namespace unfurl::calib
