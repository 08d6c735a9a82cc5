#include "calib/set_up.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/dense.h"
#include "base/error.h"
#include "base/length.h"
#include "base/pose.h"
#include "base/statistics.h"
#include "calib/covariance.h"
#include "calib/far_points.h"

namespace unfurl::calib {
namespace {

constexpr Eigen::Index kSix = 6;       // of a rigid motion
constexpr double kFreeSigmas = 30.0;   // of a point: where the prior ends [-]
constexpr double kUnheard = 1e-6;      // of a direction's prior; what the data lower less, none [-]
constexpr std::size_t kFewPoints = 3;  // whose nine numbers hold six

// Whether points tell how they are turned, about the line through them too: with so little beside
// it that a sigma at each turns them by more than the prior does, they do not.
bool TellTheirPlace(const Eigen::Matrix3Xd& p) {
  if (static_cast<std::size_t>(p.cols()) < kFewPoints) return false;
  const Eigen::Matrix3Xd r = p.colwise() - p.rowwise().mean();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(r * r.transpose());
  const double beside = eigen.eigenvalues()(0) + eigen.eigenvalues()(1);  // sum of squares [m^2]
  const double arm = r.squaredNorm() / static_cast<double>(p.cols());     // mean square [m^2]
  return beside * kFreeSigmas * kFreeSigmas > arm;
}

std::vector<int> PointsOf(const data::Survey& survey, const std::string& name) {
  std::vector<int> out;
  for (std::size_t i = 0; i < survey.set_up.size(); ++i) {
    if (survey.set_up[i] == name) out.push_back(static_cast<int>(i));
  }
  return out;
}

// All, the one that holds the frame in front; the others as they are named.
std::vector<std::string> InOrder(const data::Survey& survey, const std::vector<std::string>& names,
                                 const std::string& where) {
  std::size_t first = names.size(), most = 0;
  for (std::size_t k = 0; k < names.size(); ++k) {
    const std::vector<int> points = PointsOf(survey, names[k]);
    if (points.size() <= most || !TellTheirPlace(survey.p(Eigen::all, points))) continue;
    first = k;
    most = points.size();
  }
  if (first == names.size()) {
    throw Error(fmt::format("of {} set-ups none has three points that are not on one line: nothing "
                            "holds a frame",
                            names.size()),
                where, "measure three points or more from each, or leave the column set_up out");
  }
  std::vector<std::string> out = names;
  std::rotate(out.begin(), out.begin() + static_cast<std::ptrdiff_t>(first),
              out.begin() + static_cast<std::ptrdiff_t>(first) + 1);
  return out;
}

void RefuseOneStation(const data::Survey& survey, std::size_t set_ups, const std::string& where) {
  const data::StationErrors& stated = survey.station_errors;
  const bool errors =
      stated.distance_offset > 0.0 || stated.distance_scale > 0.0 || stated.zenith > 0.0;
  if (!survey.station.allFinite() && !errors) return;
  throw Error(
      fmt::format("was measured from {} set-ups, and says {}", set_ups,
                  errors ? "what one station does to all points alike" : "where one station stood"),
      where,
      "leave out the station's place, its distance error and its zenith error, and add them to the "
      "points' standard deviations");
}

// The estimate at P^-1 q is the data's score, of covariance P^-1 - 1 where the set-up is not off:
// the prior, which is 1, drops out. Along directions of which the data say nothing there is none.
void TestOne(const Eigen::VectorXd& q, const Eigen::MatrixXd& P, SetUpEstimate* out) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(P);
  double freedom = 0.0;
  for (Eigen::Index k = 0; k < q.size(); ++k) {
    const double left = std::min(1.0, eigen.eigenvalues()(k));  // of the prior's variance
    if (!(left > 0.0) || 1.0 - left < kUnheard) continue;
    const double along = eigen.eigenvectors().col(k).dot(q);
    out->chi_square += along * along / (left * (1.0 - left));
    freedom += 1.0;
  }
  if (freedom > 0.0) out->chance = ChiSquareTail(out->chi_square, freedom);
}

// Squared sigmas of the survey by which points turned by w are not where w x (p - middle) has them.
double SecondOrder(const Observations& data, const CommonError& own, const SetUp& set_up,
                   const Eigen::Vector3d& w) {
  const Eigen::Matrix3d rest = RotationFromVector(w) - Eigen::Matrix3d::Identity() - Skew(w);
  double sum = 0.0;
  for (Eigen::Index i = 0; i < data.p.cols(); ++i) {
    if (own.shift.col(i).isZero(0.0)) continue;
    const Eigen::Vector3d d = rest * (data.p.col(i) - set_up.middle);
    sum += d.dot(data.cov[static_cast<std::size_t>(i)].llt().solve(d));
  }
  return sum;
}

std::string Six(const Eigen::Vector3d& v, const Eigen::Matrix3d& covariance, double scale) {
  const Eigen::Vector3d s = scale * covariance.diagonal().cwiseSqrt();
  return fmt::format("x {:+.3g} +- {:.2g}, y {:+.3g} +- {:.2g}, z {:+.3g} +- {:.2g}", scale * v(0),
                     s(0), scale * v(1), s(1), scale * v(2), s(2));
}

}  // namespace

void AddSetUps(const data::Survey& survey, const std::string& where, Observations* out) {
  const std::vector<std::string> names = data::SetUpNames(survey);
  out->set_ups_told = !names.empty();
  if (names.size() < 2) return;
  RefuseOneStation(survey, names.size(), where);
  std::vector<double> sigmas;
  for (const Eigen::Matrix3d& cov : out->cov) sigmas.push_back(std::sqrt(cov.trace() / 3.0));
  const double free = kFreeSigmas * Median(sigmas);
  for (const std::string& name : InOrder(survey, names, where)) {
    const std::vector<int> points = PointsOf(survey, name);
    SetUp one{name, static_cast<int>(points.size())};
    const Eigen::Matrix3Xd p = survey.p(Eigen::all, points);
    one.middle = p.rowwise().mean();
    one.arm = std::sqrt((p.colwise() - one.middle).squaredNorm() / static_cast<double>(p.cols()));
    one.told = TellTheirPlace(p);
    const auto number = static_cast<int>(out->set_ups.size());
    out->set_ups.push_back(one);
    if (number == 0) continue;
    // One point does not turn; what a turn's sigma is then says nothing.
    const double turn = free / std::max(one.arm, free);
    for (int k = 0; k < kSix; ++k) {
      const Eigen::Vector3d axis = Eigen::Vector3d::Unit(k % 3);
      Eigen::Matrix3Xd shift = Eigen::Matrix3Xd::Zero(3, survey.p.cols());
      for (const int i : points) {
        const Eigen::Vector3d arm = survey.p.col(i) - one.middle;
        shift.col(i) =
            k < 3 ? Eigen::Vector3d(free * axis) : Eigen::Vector3d(turn * axis.cross(arm));
      }
      out->common.push_back({fmt::format("{} {}", k < 3 ? "shift" : "turn", "xyz"[k % 3]),
                             k < 3 ? "m" : "rad", k < 3 ? free : turn, std::move(shift), number});
    }
  }
}

double SetUpEstimate::ShiftSigma() const {
  return SigmaAlong(covariance.topLeftCorner<3, 3>(), shift);
}
double SetUpEstimate::TurnSigma() const {
  return SigmaAlong(covariance.bottomRightCorner<3, 3>(), turn);
}

// By the errors that are its alone.
std::vector<int> PointsOf(const Observations& data, int set_up) {
  std::vector<int> out;
  for (const CommonError& error : data.common) {
    if (error.set_up != set_up) continue;
    for (int i = 0; i < data.points(); ++i) {
      if (!error.shift.col(i).isZero(0.0)) out.push_back(i);
    }
    break;  // the first is a shift, which all its points have
  }
  return out;
}

namespace {

constexpr double kShown = 1e-3;  // of a shift, as digits [-]

// Surveyed less found by cameras, medians [m].
Eigen::Vector3d ShiftOf(const Observations& data, const std::vector<int>& points,
                        const std::vector<CameraGuess>& guesses, const Eigen::Matrix3Xd& others) {
  data::Rig rig;
  for (const CameraGuess& guess : guesses) {
    rig.cameras.push_back(guess.camera);
    rig.cameras.back().floor_px = guess.sigma_px;
  }
  rig.volume_low = others.rowwise().minCoeff();
  rig.volume_high = others.rowwise().maxCoeff();
  std::vector<double> off[3];
  for (const FarPoint& point : FindFarPoints(data, points, rig)) {
    if (!point.found) continue;
    for (int k = 0; k < 3; ++k) off[k].push_back(data.p(k, point.point) - point.at(k));
  }
  if (off[0].empty()) return Eigen::Vector3d::Zero();
  return {Median(off[0]), Median(off[1]), Median(off[2])};
}

}  // namespace

std::vector<CameraGuess> GuessWithSetUps(const Observations& data, const GuessOptions& options,
                                         const std::string& where) {
  try {
    return GuessCameras(data, options, where);
  } catch (const Error&) {
    for (std::size_t k = 1; k < data.set_ups.size(); ++k) {
      const std::vector<int> points = PointsOf(data, static_cast<int>(k));
      const Observations rest = Unseen(data, points);
      std::vector<CameraGuess> guesses;
      try {
        guesses = GuessCameras(rest, options, where);
      } catch (const Error&) {
        continue;
      }
      Eigen::Vector3d shift = ShiftOf(data, points, guesses, rest.p);
      // What is small beside it are errors of single points.
      const double digit = kShown * shift.norm();
      if (digit > 0.0) shift = (shift / digit).array().round() * digit;
      throw Error(
          fmt::format("the readings fit cameras but for the {} points of set-up \"{}\", "
                      "which are off from the others by about ({:+.3g}, {:+.3g}, {:+.3g}) m",
                      points.size(), data.set_ups[k].name, shift.x(), shift.y(), shift.z()),
          where, "bring that set-up into the frame of the others first");
    }
    throw;
  }
}

std::vector<SetUpEstimate> SetUpsOf(const Observations& data, const Eigen::VectorXd& q,
                                    const Eigen::MatrixXd& covariance, double level) {
  std::vector<SetUpEstimate> out;
  const auto others = static_cast<double>(data.set_ups.size()) - 1.0;
  // So that all together are at the level [Sidak].
  const double each = ChanceOfEach(level, others);
  const Eigen::Index before = covariance.rows() - q.size();
  for (std::size_t s = 1; s < data.set_ups.size(); ++s) {
    Eigen::Index at = 0;
    while (data.common[static_cast<std::size_t>(at)].set_up != static_cast<int>(s)) ++at;
    const SetUp& set_up = data.set_ups[s];
    SetUpEstimate one{set_up.name, data.set_ups[0].name, set_up.points, set_up.middle};
    one.told = set_up.told;
    Eigen::VectorXd sigma(kSix);
    for (Eigen::Index k = 0; k < kSix; ++k) {
      sigma(k) = data.common[static_cast<std::size_t>(at + k)].sigma;
    }
    const Eigen::MatrixXd P = covariance.block(before + at, before + at, kSix, kSix);
    const Eigen::VectorXd x = q.segment(at, kSix);
    one.shift = sigma.head<3>().cwiseProduct(x.head<3>());
    one.turn = sigma.tail<3>().cwiseProduct(x.tail<3>());
    one.covariance = sigma.asDiagonal() * P * sigma.asDiagonal();
    one.strain = x.dot(P * x) +
                 SecondOrder(data, data.common[static_cast<std::size_t>(at)], set_up, one.turn);
    TestOne(x, P, &one);
    one.off = one.chance < each;
    out.push_back(one);
  }
  return out;
}

std::string TextOf(const SetUpEstimate& of) {
  const std::string name = fmt::format("set-up \"{}\" ({} points)", of.name, of.points);
  if (!of.told) {
    return fmt::format(
        "{} has no three points that are not on one line: where it stood is not told, and its "
        "points say little of the cameras. Measure three or more from it",
        name);
  }
  const LengthUnit unit = UnitFor(std::max(of.shift.norm(), of.ShiftSigma()));
  const std::string sizes = fmt::format(
      "{:.3g} +- {:.2g} {} ({}), turned by {:.3g} +- {:.2g} mrad ({})",
      unit.per_metre * of.shift.norm(), unit.per_metre * of.ShiftSigma(), unit.name,
      Six(of.shift, of.covariance.topLeftCorner<3, 3>(), unit.per_metre), 1e3 * of.turn.norm(),
      1e3 * of.TurnSigma(), Six(of.turn, of.covariance.bottomRightCorner<3, 3>(), 1e3));
  if (!of.off) {
    return fmt::format(
        "{} agrees with \"{}\", which holds the frame: off by {}, which chance makes with a "
        "probability of {:.2g}; what is left open is in every error bar",
        name, of.first, sizes, of.chance);
  }
  return fmt::format(
      "{} is off from \"{}\", which holds the frame: by {}, which chance makes with a probability "
      "of {:.1g}; taken out, its uncertainty is in every error bar",
      name, of.first, sizes, of.chance);
}

}  // namespace unfurl::calib
