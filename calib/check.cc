#include "calib/check.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>

#include "base/error.h"
#include "base/length.h"
#include "base/refuse_option.h"
#include "base/statistics.h"
#include "calib/verdict.h"
#include "measure/camera_model.h"
#include "measure/survey_readings.h"
#include "measure/triangulate.h"

namespace unfurl::calib {
namespace {

constexpr Eigen::Index kParameters = data::kCameraParameters;
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

// Cameras of the data, as the rig numbers them.
std::vector<std::size_t> MatchCameras(const data::Rig& rig, const Observations& data,
                                      const std::string& where) {
  std::vector<std::size_t> out;
  for (const std::string& name : data.cameras) {
    std::size_t k = 0;
    while (k < rig.cameras.size() && rig.cameras[k].name != name) ++k;
    if (k == rig.cameras.size()) {
      throw Error(fmt::format("camera \"{}\" is not one of the rig's", name), where,
                  "name the cameras as the rig does (# cameras: ...)");
    }
    out.push_back(k);
  }
  return out;
}

double Variance(const data::Rig& rig, std::size_t camera, double s_px) {
  const double floor = data::FloorOf(rig, camera);
  return s_px * s_px + floor * floor;
}

// Misfits with their joint covariance; which camera and point each belongs to.
struct Joint {
  Eigen::VectorXd misfit;
  Eigen::MatrixXd covariance;
  std::vector<int> camera, point;

  double Chance(const std::vector<Eigen::Index>& keep) const {
    if (keep.empty()) return 0.0;
    const Eigen::MatrixXd C = covariance(keep, keep);
    const Eigen::VectorXd e = misfit(keep);
    const double square = e.dot(C.ldlt().solve(e));
    return ChiSquareTail(square, static_cast<double>(keep.size()));
  }
  template <typename Keep>
  double ChanceOf(const Keep& wanted) const {
    std::vector<Eigen::Index> keep;
    for (Eigen::Index k = 0; k < misfit.size(); ++k) {
      if (wanted(camera[static_cast<std::size_t>(k)], point[static_cast<std::size_t>(k)])) {
        keep.push_back(k);
      }
    }
    return Chance(keep);
  }
};

Joint MakeJoint(const data::Rig& rig, const Observations& data,
                const std::vector<std::size_t>& match, const std::string& where) {
  const auto n = static_cast<Eigen::Index>(data.readings.size());
  Joint joint;
  joint.misfit.resize(n);
  Eigen::MatrixXd H(n, 3), G = Eigen::MatrixXd::Zero(n, rig.covariance.rows());
  for (Eigen::Index k = 0; k < n; ++k) {
    const Reading& r = data.readings[static_cast<std::size_t>(k)];
    const std::size_t c = match[static_cast<std::size_t>(r.camera)];
    measure::Projection h;
    if (!measure::Project(rig.cameras[c], data.p.col(r.point), &h)) {
      throw Error(fmt::format("point \"{}\" lies behind camera \"{}\"",
                              data.ids[static_cast<std::size_t>(r.point)], rig.cameras[c].name),
                  where, "measure in the frame in which the rig was surveyed");
    }
    joint.misfit(k) = r.u_px - h.u_px;
    joint.camera.push_back(static_cast<int>(c));
    joint.point.push_back(r.point);
    H.row(k) = h.du_dp;
    G.block(k, kParameters * static_cast<Eigen::Index>(c), 1, kParameters) = h.du_dc;
  }
  joint.covariance = G * rig.covariance * G.transpose();
  for (Eigen::Index a = 0; a < n; ++a) {
    const Reading& r = data.readings[static_cast<std::size_t>(a)];
    joint.covariance(a, a) += Variance(rig, match[static_cast<std::size_t>(r.camera)], r.s_px);
    for (Eigen::Index b = 0; b < n; ++b) {
      if (joint.point[static_cast<std::size_t>(b)] != r.point) continue;
      joint.covariance(a, b) +=
          (H.row(a) * data.cov[static_cast<std::size_t>(r.point)] * H.row(b).transpose()).value();
    }
  }
  // What the station does to all points: with another set-up than the calibration's, another error.
  for (const CommonError& error : data.common) {
    Eigen::VectorXd shared(n);
    for (Eigen::Index k = 0; k < n; ++k) {
      shared(k) = H.row(k).dot(error.shift.col(joint.point[static_cast<std::size_t>(k)]));
    }
    joint.covariance += shared * shared.transpose();
  }
  return joint;
}

double CommonVariance(const Observations& data, Eigen::Index point) {
  double sum = 0.0;
  for (const CommonError& error : data.common) sum += error.shift.col(point).squaredNorm();
  return sum;
}

// Points found from their readings, with the calibration's factor.
struct Found {
  measure::PointSolution solution;
  Eigen::Matrix3Xd F;
};

std::vector<Found> FindPoints(const data::Rig& rig, const Observations& data,
                              const std::vector<std::size_t>& match) {
  const measure::Triangulator triangulator(rig, {.residual_level = 1e-12});
  std::vector<Found> out(static_cast<std::size_t>(data.points()));
  std::vector<double> u(rig.cameras.size()), s(rig.cameras.size());
  std::size_t k = 0;
  for (int i = 0; i < data.points(); ++i) {
    std::fill(u.begin(), u.end(), kNone);
    std::fill(s.begin(), s.end(), kNone);
    for (; k < data.readings.size() && data.readings[k].point == i; ++k) {
      const std::size_t c = match[static_cast<std::size_t>(data.readings[k].camera)];
      u[c] = data.readings[k].u_px;
      s[c] = data.readings[k].s_px;
    }
    Found& found = out[static_cast<std::size_t>(i)];
    found.F.setZero(3, triangulator.shared_rank());
    found.solution = triangulator.Solve(u, s, data.p.col(i));
    if (found.solution.outcome == measure::PointOutcome::kSolved) {
      triangulator.SharedFactor(found.solution, s, found.F);
    }
  }
  return out;
}

// Whether a check can show an error that matters.
void NoteCoarse(const data::Rig& rig, const CheckOptions& options, CheckResult* result) {
  const double need = NeedOf({.need = options.need}, rig);
  if (!(result->rms_predicted > need)) return;
  result->reasons.push_back(
      fmt::format("this check has a standard deviation of {} itself: it cannot show an error of {}",
                  LengthText(result->rms_predicted), LengthText(need)));
}

void Conclude(const std::string& what, const CheckOptions& options, CheckResult* result) {
  result->options = options;
  result->invalid = result->chance < options.invalid;
  if (result->chance >= options.doubtful) {
    result->verdict = "still valid";
    result->reasons.push_back(fmt::format(
        "{} agree with the calibration: a valid one gives a misfit as large with a probability of "
        "{:.2g}",
        what, result->chance));
    return;
  }
  result->verdict = result->invalid ? "no longer valid" : "doubtful";
  result->reasons.push_back(
      fmt::format("{} do not agree with the calibration: a valid one gives a misfit as large with "
                  "a probability "
                  "of {:.1g}",
                  what, result->chance));
}

// Each surveyed point as its readings place it, and how probable the rest is without it.
void CheckEachPoint(const data::Rig& rig, const Observations& data,
                    const std::vector<std::size_t>& match, const Joint& joint, bool bad,
                    CheckResult* result) {
  const std::vector<Found> found = FindPoints(rig, data, match);
  double squares = 0.0, predicted = 0.0, n = 0.0;
  for (int i = 0; i < data.points(); ++i) {
    const auto point = static_cast<std::size_t>(i);
    CheckedPoint checked{data.ids[point], kNone, kNone};
    if (found[point].solution.outcome == measure::PointOutcome::kSolved) {
      checked.at = found[point].solution.p;
      checked.error = (found[point].solution.p - data.p.col(i)).norm();
      const double variance = found[point].solution.cov.trace() + found[point].F.squaredNorm() +
                              data.cov[point].trace() + CommonVariance(data, i);
      checked.predicted = std::sqrt(variance);
      squares += checked.error * checked.error;
      predicted += variance;
      n += 1.0;
    }
    checked.chance_without =
        bad ? joint.ChanceOf([&](int, int p) { return p != i; }) : result->chance;
    result->points.push_back(checked);
  }
  result->rms = std::sqrt(squares / std::max(1.0, n));
  result->rms_predicted = std::sqrt(predicted / std::max(1.0, n));
}

// Each camera's misfits, and how probable the rest is without it.
void CheckEachCamera(const data::Rig& rig, const Joint& joint, bool bad, CheckResult* result) {
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    CheckedCamera camera{rig.cameras[c].name};
    for (Eigen::Index k = 0; k < joint.misfit.size(); ++k) {
      if (joint.camera[static_cast<std::size_t>(k)] != static_cast<int>(c)) continue;
      ++camera.readings;
      camera.rms_px += joint.misfit(k) * joint.misfit(k);
      camera.rms_predicted_px += joint.covariance(k, k);
    }
    const double m = std::max(1.0, static_cast<double>(camera.readings));
    camera.rms_px = std::sqrt(camera.rms_px / m);
    camera.rms_predicted_px = std::sqrt(camera.rms_predicted_px / m);
    camera.chance_without =
        bad ? joint.ChanceOf([&](int k, int) { return k != static_cast<int>(c); }) : result->chance;
    result->cameras.push_back(camera);
  }
}

// Names the point or the camera without which the rest is probable.
void NameCause(int points, const CheckOptions& options, CheckResult* result) {
  const auto less = [](const auto& a, const auto& b) {
    return a.chance_without < b.chance_without;
  };
  const auto camera = std::max_element(result->cameras.begin(), result->cameras.end(), less);
  const auto point = std::max_element(result->points.begin(), result->points.end(), less);
  if (points > 1 && point->chance_without >= options.doubtful &&
      point->chance_without >= camera->chance_without) {
    result->verdict = "doubtful";
    result->reasons.push_back(fmt::format(
        "the rest agrees without point \"{}\": measure it again, the rig may be unchanged",
        point->id));
  } else if (camera->chance_without >= options.doubtful) {
    result->reasons.push_back(fmt::format(
        "the rest agrees without camera \"{}\": it has moved; its readings are off by {:.2f} px "
        "RMS ({:.2f} px predicted). Use the other cameras without it, or calibrate again",
        camera->name, camera->rms_px, camera->rms_predicted_px));
  } else {
    result->reasons.push_back(
        "no single point or camera explains it: calibrate again (or the points were not measured "
        "in the frame in which the rig was surveyed)");
  }
}

// Both ends of each placement, one after the other.
Observations BarEnds(const data::ReadingTable& table, const data::Rig& rig,
                     const std::string& where) {
  std::map<std::string, std::array<Eigen::Index, 2>> placements;
  for (std::size_t k = 0; k < table.id.size(); ++k) {
    const std::string& id = table.id[k];
    if (id.size() < 2 || (id.back() != 'a' && id.back() != 'b')) {
      throw Error(fmt::format("the id '{}' does not end in a or b", id), where,
                  "name the ends of placement 1 of the bar 1a and 1b");
    }
    auto& ends =
        placements.try_emplace(id.substr(0, id.size() - 1), std::array<Eigen::Index, 2>{-1, -1})
            .first->second;
    ends[id.back() == 'a' ? 0 : 1] = static_cast<Eigen::Index>(k);
  }
  Observations out;
  out.cameras = table.cameras;
  out.pixels = table.pixels;
  std::vector<Eigen::Index> rows;
  for (const auto& [name, ends] : placements) {
    if (ends[0] < 0 || ends[1] < 0) {
      throw Error(fmt::format("placement {} of the bar has one end only", name), where,
                  "give both ends, a and b");
    }
    rows.insert(rows.end(), ends.begin(), ends.end());
  }
  out.p.resize(3, static_cast<Eigen::Index>(rows.size()));
  out.p.colwise() = Eigen::Vector3d(0.5 * (rig.volume_low + rig.volume_high));
  for (std::size_t i = 0; i < rows.size(); ++i) {
    out.ids.push_back(table.id[static_cast<std::size_t>(rows[i])]);
    out.cov.emplace_back(Eigen::Matrix3d::Identity());
    for (Eigen::Index c = 0; c < table.u_px.cols(); ++c) {
      if (std::isnan(table.u_px(rows[i], c))) continue;
      out.readings.push_back({static_cast<int>(i), static_cast<int>(c), table.u_px(rows[i], c),
                              table.s_px(rows[i], c)});
    }
  }
  return out;
}

}  // namespace

void CheckOptions::Check() const {
  const RefuseOption refuse("CheckOptions");
  if (!(invalid > 0.0 && invalid < 1.0)) refuse("invalid", "is not between 0 and 1");
  if (!(doubtful >= invalid && doubtful < 1.0)) refuse("doubtful", "is not from `invalid` to 1");
  if (!(need >= 0.0) || !std::isfinite(need)) refuse("need", "is not a length");
}

CheckResult CheckPoints(const data::Rig& rig, data::Survey survey, const std::string& where,
                        const CheckOptions& options) {
  measure::FindSurveyReadings(&survey);
  return CheckPoints(rig, FromSurvey(survey, where), where, options);
}

CheckResult CheckPoints(const data::Rig& rig, const Observations& data, const std::string& where,
                        const CheckOptions& options) {
  options.Check();
  const std::vector<std::size_t> match = MatchCameras(rig, data, where);
  if (data.readings.empty()) {
    throw Error("holds no readings", where, "give readings of some points");
  }
  const Joint joint = MakeJoint(rig, data, match, where);
  CheckResult result;
  result.chance = joint.ChanceOf([](int, int) { return true; });
  const bool bad = result.chance < options.doubtful;
  CheckEachPoint(rig, data, match, joint, bad, &result);
  for (Eigen::Index k = 0; k < joint.misfit.size(); ++k) {
    const auto at = static_cast<std::size_t>(k);
    result.readings.push_back({joint.camera[at], joint.point[at], data.readings[at].u_px,
                               joint.misfit(k), std::sqrt(joint.covariance(k, k))});
  }
  CheckEachCamera(rig, joint, bad, &result);
  Conclude(fmt::format("{} points ({} RMS from the survey, {} predicted)", data.points(),
                       LengthText(result.rms), LengthText(result.rms_predicted)),
           options, &result);
  if (bad) NameCause(data.points(), options, &result);
  NoteCoarse(rig, options, &result);
  return result;
}

CheckResult CheckBar(const data::Rig& rig, const data::ReadingTable& readings, const Bar& bar,
                     const std::string& where, const CheckOptions& options) {
  return CheckBar(rig, BarEnds(readings, rig, where), bar, where, options);
}

CheckResult CheckBar(const data::Rig& rig, const Observations& data, const Bar& bar,
                     const std::string& where, const CheckOptions& options) {
  options.Check();
  const std::vector<std::size_t> match = MatchCameras(rig, data, where);
  const std::vector<Found> found = FindPoints(rig, data, match);
  const auto most = static_cast<Eigen::Index>(data.points() / 2);
  const Eigen::Index rank = found.empty() ? 0 : found[0].F.cols();
  Eigen::VectorXd misfit(most), variance(most);
  Eigen::MatrixXd shared(most, rank + 1);
  CheckResult result;
  Eigen::Index n = 0;
  for (Eigen::Index k = 0; k < most; ++k) {
    const auto a = static_cast<std::size_t>(2 * k), b = a + 1;
    CheckedPoint checked{data.ids[a] + " to " + data.ids[b], kNone, kNone};
    if (found[a].solution.outcome == measure::PointOutcome::kSolved &&
        found[b].solution.outcome == measure::PointOutcome::kSolved) {
      const Eigen::Vector3d along = found[b].solution.p - found[a].solution.p;
      const Eigen::RowVector3d way = along.normalized().transpose();
      misfit(n) = along.norm() - bar.length;
      variance(n) =
          (way * (found[a].solution.cov + found[b].solution.cov) * way.transpose()).value();
      shared.row(n) << way * (found[b].F - found[a].F), bar.sigma;
      checked.at = 0.5 * (found[a].solution.p + found[b].solution.p);
      checked.error = misfit(n);
      checked.predicted = std::sqrt(variance(n) + shared.row(n).squaredNorm());
      ++n;
    }
    result.points.push_back(checked);
  }
  if (n == 0) {
    throw Error("no placement of the bar was seen whole by three cameras", where,
                "place the bar inside the surveyed volume");
  }
  Eigen::MatrixXd C = shared.topRows(n) * shared.topRows(n).transpose();
  C.diagonal() += variance.head(n);
  const Eigen::VectorXd e = misfit.head(n);
  result.chance = ChiSquareTail(e.dot(C.ldlt().solve(e)), static_cast<double>(n));
  result.rms = std::sqrt(e.squaredNorm() / static_cast<double>(n));
  result.rms_predicted = std::sqrt(C.trace() / static_cast<double>(n));
  Conclude(fmt::format("{} lengths of the bar ({} RMS from {:.6g} m, {} predicted)", n,
                       LengthText(result.rms), bar.length, LengthText(result.rms_predicted)),
           options, &result);
  result.reasons.push_back(fmt::format("on average the bar was found {} too {}",
                                       LengthText(std::abs(e.mean())),
                                       e.mean() > 0.0 ? "long" : "short"));
  NoteCoarse(rig, options, &result);
  return result;
}

}  // namespace unfurl::calib
