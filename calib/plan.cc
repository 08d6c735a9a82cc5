#include "calib/plan.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <memory>

#include "base/error.h"
#include "base/random.h"
#include "base/statistics.h"
#include "measure/camera_model.h"
#include "measure/lens_camera.h"
#include "measure/triangulate.h"
#include "measure/virtual_rig.h"

namespace unfurl::calib {
namespace {

constexpr double kEdge = 5.0;  // a spot nearer to the row's end is not whole [px]

}  // namespace

Visibility SeenOnRow(const data::Rig& rig, double pixels) {
  return [cameras = rig.cameras, pixels](std::size_t camera, const Eigen::Vector3d& p) {
    double u = 0.0;
    return measure::Project(cameras[camera], p, &u) && u >= kEdge && u <= pixels - 1.0 - kEdge;
  };
}

Eigen::Vector3d UncertaintyMap::Middle(std::size_t cell) const {
  const auto n = static_cast<std::size_t>(columns);
  const Eigen::Vector3d at(static_cast<double>(cell % n) + 0.5,
                           static_cast<double>(cell / n % n) + 0.5,
                           static_cast<double>(cell / (n * n)) + 0.5);
  return low +
         (high - low).cwiseProduct(at).cwiseQuotient(Eigen::Vector3d(columns, columns, layers));
}

double UncertaintyMap::Found() const {
  double found = 0.0;
  for (const double s : sigma) found += std::isfinite(s) ? 1.0 : 0.0;
  return sigma.empty() ? 0.0 : found / static_cast<double>(sigma.size());
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
  map.cameras.assign(cells, 0);
  const measure::Triangulator triangulator(rig, {.residual_level = 1e-12});
  Eigen::Matrix3Xd F(3, triangulator.shared_rank());
  std::vector<double> u(rig.cameras.size()), s(rig.cameras.size(), options.reading_sigma_px);
  for (std::size_t cell = 0; cell < cells; ++cell) {
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
    map.sigma[cell] = std::sqrt(found.cov.trace() + F.squaredNorm());
  }
  return map;
}

Plan PlanLab(const data::Lab& lab, const PlanOptions& options) {
  data::Lab nominal = lab;
  nominal.mounting = {};
  const auto truth = std::make_shared<measure::VirtualRig>(measure::MakeVirtualRig(nominal));
  const double last = static_cast<double>(lab.sensor.format.active) - 1.0 - kEdge;
  Plan plan;
  plan.sees = [truth, last](std::size_t camera, const Eigen::Vector3d& p) {
    measure::SpotLight spot;
    return measure::TraceSpot(truth->cameras[camera], p, &spot) && spot.centre_px >= kEdge &&
           spot.centre_px <= last;
  };
  Observations data;
  for (const auto& camera : truth->cameras) data.cameras.push_back(camera.name);
  Rng rng = Rng(options.seed).Stream("plan");
  data.p.resize(3, options.survey_points);
  for (int i = 0; i < options.survey_points; ++i) {
    for (int k = 0; k < 3; ++k) data.p(k, i) = rng.Uniform(lab.volume_low(k), lab.volume_high(k));
    data.ids.push_back(fmt::format("p{}", i + 1));
    data.cov.emplace_back(lab.survey.sigma * lab.survey.sigma * Eigen::Matrix3d::Identity());
    for (std::size_t c = 0; c < truth->cameras.size(); ++c) {
      measure::SpotLight spot;
      if (!measure::TraceSpot(truth->cameras[c], data.p.col(i), &spot) || spot.centre_px < kEdge ||
          spot.centre_px > last) {
        continue;
      }
      data.readings.push_back({i, static_cast<int>(c), spot.centre_px, options.reading_sigma_px});
    }
  }
  CalibrateOptions calibrate = options.calibrate;
  calibrate.order = kFullOrder;
  const RigFit fit = FitRig(data, calibrate, lab.path);
  plan.rig = fit.rig;
  plan.rig.volume_low = lab.volume_low;
  plan.rig.volume_high = lab.volume_high;
  plan.weak = FindWeak(plan.rig, fit.priors, fit.bundle.summary.information);
  plan.advice = SurveyAdvice(data, fit.bundle.weighting, plan.rig);
  return plan;
}

}  // namespace unfurl::calib
