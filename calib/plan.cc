#include "calib/plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>

#include "base/error.h"
#include "base/length.h"
#include "base/progress.h"
#include "base/random.h"
#include "base/refuse_option.h"
#include "base/statistics.h"
#include "calib/verdict.h"
#include "measure/camera_model.h"
#include "measure/lens_camera.h"
#include "measure/triangulate.h"
#include "measure/virtual_rig.h"

namespace unfurl::calib {
namespace {

// A spot nearer to the row's end is not whole: 5 px of the shipped sensor's row, over the row [-].
constexpr double kEdge = 0.0025;

// The maps and what they say.
PlanResult Finished(PlannedRig planned, const PlanOptions& options) {
  PlanResult out;
  out.planned = std::move(planned);
  out.need = NeedOf({.need = options.need}, out.planned.rig);
  out.cases = PlanCases(out.planned.rig, out.planned.sees, options.map);
  const UncertaintyMap& all = out.cases[0].map;
  if (all.Found() > 0.0) {
    out.reasons.push_back(fmt::format(
        "With all cameras {:.0f}% of the volume is found, half of it with an error of {} or less, "
        "95% with {} or less (one sigma, 3-D).",
        100.0 * all.Found(), LengthText(all.Quantile(0.5)), LengthText(all.Quantile(0.95))));
    out.reasons.push_back(fmt::format(
        "{:.0f}% of the volume reaches the accuracy aimed at, {}{}.", 100.0 * all.Within(out.need),
        LengthText(out.need),
        options.need > 0.0 ? "" : " (a 2000th of the volume's longest side; --need sets another)"));
  } else {
    out.reasons.push_back(
        "No place of the volume is seen by three cameras whose planes cross: check where the "
        "cameras look, the field that lens and sensor give them, and the roll of the lens axes.");
  }
  if (all.Within(out.need) < options.usable) {
    out.verdict = PlanVerdict::kNotUsable;
    out.headline = fmt::format("This layout reaches {} in less than {:.0f}% of the volume",
                               LengthText(out.need), 100.0 * options.usable);
    return out;
  }
  out.headline = "Any one camera may fail";
  for (std::size_t k = 1; k < out.cases.size(); ++k) {
    const double left = out.cases[k].map.Within(out.need) / all.Within(out.need);
    if (left >= options.little_lost) continue;
    out.verdict = PlanVerdict::kCare;
    out.headline = "Not every camera may fail";
    out.reasons.push_back(fmt::format("{}, {:.0f}% of what reached that accuracy is lost.",
                                      out.cases[k].name, 100.0 * (1.0 - left)));
  }
  out.reasons.insert(out.reasons.end(), out.planned.advice.begin(), out.planned.advice.end());
  return out;
}

bool OnRow(double u_px, int pixels) {
  return u_px >= kEdge * pixels && u_px <= (1.0 - kEdge) * pixels - 1.0;
}

}  // namespace

Visibility SeenOnRow(const data::Rig& rig) {
  return [cameras = rig.cameras](std::size_t camera, const Eigen::Vector3d& p) {
    double u = 0.0;
    return measure::Project(cameras[camera], p, &u) && OnRow(u, cameras[camera].pixels);
  };
}

Eigen::Vector3d UncertaintyMap::Middle(std::size_t cell) const {
  const auto n = static_cast<std::size_t>(columns);
  const std::size_t layer = cell / (n * n);
  const Eigen::Vector3d at(static_cast<double>(cell % n) + 0.5,
                           static_cast<double>(cell / n % n) + 0.5,
                           static_cast<double>(layer) + 0.5);
  return low +
         (high - low).cwiseProduct(at).cwiseQuotient(Eigen::Vector3d(columns, columns, layers));
}

double UncertaintyMap::Found() const {
  double found = 0.0;
  for (const double s : sigma) found += std::isfinite(s) ? 1.0 : 0.0;
  return sigma.empty() ? 0.0 : found / static_cast<double>(sigma.size());
}

double UncertaintyMap::Within(double need) const {
  const auto count = std::count_if(sigma.begin(), sigma.end(),
                                   [&](double s) { return std::isfinite(s) && s <= need; });
  return sigma.empty() ? 0.0 : static_cast<double>(count) / static_cast<double>(sigma.size());
}

void PlanOptions::Check() const {
  const RefuseOption refuse("PlanOptions");
  if (survey_points < 1) refuse("survey_points", "is less than 1");
  if (map.columns < 1) refuse("map.columns", "is less than 1");
  if (map.layers < 1) refuse("map.layers", "is less than 1");
  if (!(map.reading_sigma_px > 0.0)) refuse("map.reading_sigma_px", "is not above 0");
  if (!(need >= 0.0) || !std::isfinite(need)) refuse("need", "is not a length");
  if (!(usable > 0.0 && usable <= 1.0)) refuse("usable", "is not from 0 to 1");
  if (!(little_lost > 0.0 && little_lost <= 1.0)) refuse("little_lost", "is not from 0 to 1");
}

double UncertaintyMap::Quantile(double p) const {
  std::vector<double> found;
  for (const double s : sigma) {
    if (std::isfinite(s)) found.push_back(s);
  }
  return found.empty() ? std::numeric_limits<double>::quiet_NaN() : unfurl::Quantile(found, p);
}

UncertaintyMap MapUncertainty(const data::Rig& rig, const Visibility& sees,
                              const MapOptions& options, int without) {
  UncertaintyMap map;
  const bool own = options.low != options.high;
  map.low = own ? options.low : rig.volume_low;
  map.high = own ? options.high : rig.volume_high;
  map.columns = options.columns;
  map.layers = options.layers;
  const auto cells = static_cast<std::size_t>(map.columns * map.columns * map.layers);
  map.sigma.assign(cells, std::numeric_limits<double>::quiet_NaN());
  map.sigma_readings = map.sigma;
  map.covariance.assign(cells, Eigen::Matrix3d::Zero());
  map.cameras.assign(cells, 0);
  const measure::Triangulator triangulator(rig, {.residual_level = 1e-12});
  Eigen::Matrix3Xd F(3, triangulator.shared_rank());
  std::vector<double> u(rig.cameras.size()), s(rig.cameras.size(), options.reading_sigma_px);
  for (std::size_t cell = 0; cell < cells; ++cell) {
    ThrowIfInterrupted();
    const Eigen::Vector3d p = map.Middle(cell);
    std::uint32_t use = 0;
    for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
      if (static_cast<int>(c) == without || !sees(c, p) ||
          !measure::Project(rig.cameras[c], p, &u[c])) {
        continue;
      }
      use |= 1U << c;
      ++map.cameras[cell];
    }
    const measure::PointSolution found = triangulator.Solve(u, s, p, use);
    if (found.outcome != measure::PointOutcome::kSolved) continue;
    triangulator.SharedFactor(found, s, F);
    map.sigma_readings[cell] = std::sqrt(found.cov.trace());
    map.covariance[cell] = found.cov + F * F.transpose();
    map.sigma[cell] = std::sqrt(map.covariance[cell].trace());
  }
  return map;
}

namespace {

// What a camera reads of a place, or that it does not see it.
using Look = std::function<bool(std::size_t camera, const Eigen::Vector3d& p, double* u_px)>;

// Places at random in the laboratory's volume, as its station measures them.
data::Survey RandomPlaces(const data::Lab& lab, const PlanOptions& options) {
  Rng rng = Rng(options.seed).Stream("plan");
  data::Survey out;
  out.p.resize(3, options.survey_points);
  out.cov.setZero(6, options.survey_points);
  const double variance = lab.survey.sigma * lab.survey.sigma;
  for (int i = 0; i < options.survey_points; ++i) {
    for (int k = 0; k < 3; ++k) out.p(k, i) = rng.Uniform(lab.volume_low(k), lab.volume_high(k));
    out.id.push_back(fmt::format("p{}", i + 1));
    out.cov.col(i) << variance, 0.0, 0.0, variance, 0.0, variance;
  }
  return out;
}

// Calibrates on what the cameras would read of the places, without noise. `data` has the cameras,
// `floors_px` what their lens models miss besides.
PlannedRig PlanSurvey(data::Survey survey, const Look& look, const std::string& where,
                      const PlanOptions& options, const Observations& data,
                      const std::vector<double>& floors_px) {
  const auto cameras = static_cast<Eigen::Index>(data.cameras.size());
  survey.u_px.setConstant(survey.p.cols(), cameras, std::numeric_limits<double>::quiet_NaN());
  survey.s_px = survey.u_px;
  for (Eigen::Index i = 0; i < survey.p.cols(); ++i) {
    for (Eigen::Index c = 0; c < cameras; ++c) {
      double u = 0.0;
      if (!look(static_cast<std::size_t>(c), survey.p.col(i), &u)) continue;
      survey.u_px(i, c) = u;
      survey.s_px(i, c) =
          std::hypot(options.map.reading_sigma_px, floors_px[static_cast<std::size_t>(c)]);
    }
  }
  survey.cameras = data.cameras;
  Observations read = FromSurvey(survey, where);
  read.pixels = data.pixels;
  read.pitch = data.pitch;
  CalibrateOptions calibrate = options.calibrate;
  calibrate.order = kFullOrder;
  const RigFit fit = FitRig(read, calibrate, where);
  PlannedRig plan;
  plan.rig = fit.rig;
  for (std::size_t c = 0; c < floors_px.size(); ++c) {
    data::RigCamera& camera = plan.rig.cameras[c];
    camera.floor_px = std::hypot(data::FloorOf(plan.rig, c), floors_px[c]);
    plan.rig.model_floor_px = std::max(plan.rig.model_floor_px, camera.floor_px);
  }
  plan.weak = FindWeak(plan.rig, fit.priors, fit.bundle.summary.information);
  plan.advice = SurveyAdvice(read, fit.bundle.weighting, plan.rig, fit.priors);
  return plan;
}

}  // namespace

PlannedRig PlanLab(const data::Lab& lab, const PlanOptions& options) {
  options.Check();
  data::Lab nominal = lab;
  nominal.mounting = {};
  const auto truth = std::make_shared<measure::VirtualRig>(measure::MakeVirtualRig(nominal));
  const Look look = [truth](std::size_t camera, const Eigen::Vector3d& p, double* u_px) {
    measure::SpotLight spot;
    if (!measure::TraceSpot(truth->cameras[camera], p, &spot)) return false;
    *u_px = spot.centre_px;
    return OnRow(spot.centre_px, truth->cameras[camera].sensor.pixels);
  };
  Observations data;
  for (const auto& camera : truth->cameras) {
    data.cameras.push_back(camera.name);
    data.pixels.push_back(camera.sensor.pixels);
    data.pitch.push_back(camera.sensor.pitch);
  }
  PlannedRig plan =
      PlanSurvey(options.survey ? *options.survey : RandomPlaces(lab, options), look, lab.path,
                 options, data, std::vector<double>(data.cameras.size(), 0.0));
  plan.sees = [look](std::size_t camera, const Eigen::Vector3d& p) {
    double u = 0.0;
    return look(camera, p, &u);
  };
  plan.rig.volume_low = lab.volume_low;
  plan.rig.volume_high = lab.volume_high;
  return plan;
}

PlannedRig PlanRig(const data::Rig& rig, const PlanOptions& options) {
  options.Check();
  assert(options.survey);
  const Visibility sees = SeenOnRow(rig);
  const Look look = [&](std::size_t camera, const Eigen::Vector3d& p, double* u_px) {
    return sees(camera, p) && measure::Project(rig.cameras[camera], p, u_px);
  };
  Observations data;
  std::vector<double> floors_px;  // its model follows itself to nothing, and the glass only so far
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    data.cameras.push_back(rig.cameras[c].name);
    data.pixels.push_back(rig.cameras[c].pixels);
    floors_px.push_back(data::FloorOf(rig, c));
  }
  PlannedRig plan = PlanSurvey(*options.survey, look, "the points", options, data, floors_px);
  plan.sees = sees;
  plan.rig.volume_low = rig.volume_low;
  plan.rig.volume_high = rig.volume_high;
  return plan;
}

std::vector<PlanCase> PlanCases(const data::Rig& rig, const Visibility& sees,
                                const MapOptions& options) {
  std::vector<PlanCase> cases = {{"all cameras", MapUncertainty(rig, sees, options)}};
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    cases.push_back({"without " + rig.cameras[c].name,
                     MapUncertainty(rig, sees, options, static_cast<int>(c))});
  }
  return cases;
}

PlanResult Plan(const data::Lab& lab, const PlanOptions& options) {
  return Finished(PlanLab(lab, options), options);
}

PlanResult Plan(const data::Rig& rig, const PlanOptions& options) {
  options.Check();
  if (options.survey) return Finished(PlanRig(rig, options), options);
  return Finished({rig, SeenOnRow(rig), {}, {}}, options);
}

}  // namespace unfurl::calib
