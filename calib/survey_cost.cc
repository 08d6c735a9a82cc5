// What surveying costs: calibrations of a rig's own cameras by surveys that do not exist yet.
#include "calib/survey_cost.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/cpu_time.h"
#include "base/error.h"
#include "base/length.h"
#include "base/progress.h"
#include "base/random_vector.h"
#include "base/refuse_option.h"
#include "base/text.h"
#include "calib/covariance.h"
#include "calib/verdict.h"
#include "calib/wand.h"
#include "measure/camera_model.h"
#include "measure/lens/lens.h"
#include "measure/triangulate.h"

namespace unfurl::calib {

namespace {

class Study {
 public:
  Study(const data::Rig& rig, const SurveyCostOptions& options)
      : rig_(rig),
        options_(options),
        sees_(SeenOnRow(rig)),
        map_options_{.columns = options.columns,
                     .layers = options.layers,
                     .reading_sigma_px = Whole(options.reading_sigma_px)} {
    data::Rig known = rig;
    known.covariance.resize(0, 0);
    truth_ = MapUncertainty(known, sees_, map_options_);
  }

  // Readings of a survey of `shots`: the lens model's own error does not average.
  double Whole(double sigma_px) const { return std::hypot(sigma_px, rig_.model_floor_px); }

  Observations Read(const SurveySetting& setting) const {
    const data::Survey survey = SurveyOf(rig_, setting, options_);
    const double sigma = Whole(options_.reading_sigma_px / std::sqrt(setting.shots));
    Observations out;
    out.ids = survey.id;
    out.p = survey.p;
    for (const data::RigCamera& camera : rig_.cameras) {
      out.cameras.push_back(camera.name);
      out.pixels.push_back(camera.pixels);
    }
    for (Eigen::Index i = 0; i < survey.p.cols(); ++i) {
      const auto c = survey.cov.col(i);
      out.cov.emplace_back();
      out.cov.back() << c(0), c(1), c(2), c(1), c(3), c(4), c(2), c(4), c(5);
      for (std::size_t j = 0; j < rig_.cameras.size(); ++j) {
        double u = 0.0;
        if (!sees_(j, survey.p.col(i)) || !measure::Project(rig_.cameras[j], survey.p.col(i), &u)) {
          continue;
        }
        out.readings.push_back({static_cast<int>(i), static_cast<int>(j), u, sigma});
      }
    }
    return out;
  }

  // Of a calibrated rig: what its covariance says, and what it is off by beside that.
  void Judge(data::Rig found, bool by_covariance, SurveySetting* out) const {
    found.volume_low = rig_.volume_low;
    found.volume_high = rig_.volume_high;
    const UncertaintyMap map = MapUncertainty(found, sees_, map_options_);
    const measure::Triangulator triangulator(found, {.residual_level = 1e-12});
    const std::size_t cameras = rig_.cameras.size();
    std::vector<double> u(cameras), s(cameras, map_options_.reading_sigma_px);
    double variance = 0.0, bias = 0.0, readings = 0.0, n = 0.0;
    for (std::size_t cell = 0; cell < map.sigma.size(); ++cell) {
      if (!std::isfinite(truth_.sigma[cell]) || !std::isfinite(map.sigma[cell])) continue;
      const Eigen::Vector3d p = map.Middle(cell);
      for (std::size_t c = 0; c < cameras; ++c) {
        u[c] = kUnknown;
        if (sees_(c, p)) measure::Project(rig_.cameras[c], p, &u[c]);
      }
      const measure::PointSolution point = triangulator.Solve(u, s, p);
      if (point.outcome != measure::PointOutcome::kSolved) continue;
      bias += (point.p - p).squaredNorm();
      variance +=
          map.sigma[cell] * map.sigma[cell] - map.sigma_readings[cell] * map.sigma_readings[cell];
      readings += truth_.sigma_readings[cell] * truth_.sigma_readings[cell];
      n += 1.0;
    }
    if (!(n > 0.0)) {
      out->problem = "no place of the volume is found";
      return;
    }
    out->bias = std::sqrt(bias / n);
    out->calibration = std::sqrt((by_covariance ? variance + bias : bias) / n);
    out->error = std::hypot(out->calibration, std::sqrt(readings / n));
  }

  double Readings() const {
    double squares = 0.0, n = 0.0;
    for (const double sigma : truth_.sigma_readings) {
      if (!std::isfinite(sigma)) continue;
      squares += sigma * sigma;
      n += 1.0;
    }
    return n > 0.0 ? std::sqrt(squares / n) : kUnknown;
  }

  // By points, with terms `order` of the lens.
  void ByPoints(int order, SurveySetting* out) const {
    Try(out, [&] {
      const Observations data = Read(*out);
      const double before = CpuSeconds();
      const RigFit fit = FitRig(data, Calibrating(order), "the planned survey");
      out->cpu_seconds = CpuSeconds() - before;
      Judge(fit.rig, true, out);
    });
  }

  // The mean over draws of a survey with noise, some readings of which are anywhere.
  void WithWild(SurveySetting* out) const {
    const bool robust = out->estimator == "robust";
    Try(out, [&] {
      CalibrateOptions calibrate = Calibrating(kFullOrder);
      if (!robust) {
        calibrate.bundle.loss_width = std::numeric_limits<double>::infinity();
        calibrate.refine.choose_gross = false;
      }
      const Observations clean = Read(*out);
      double squares = 0.0;
      for (int draw = 0; draw < options_.draws; ++draw) {
        Rng rng = Rng(options_.seed).Stream("wild", static_cast<std::uint64_t>(draw));
        Observations data = clean;
        for (Reading& r : data.readings) {
          r.u_px += r.s_px * rng.Normal();
          const double row = data.pixels[static_cast<std::size_t>(r.camera)];
          if (rng.Uniform(0.0, 1.0) < options_.wild) r.u_px = rng.Uniform(0.0, row - 1.0);
        }
        for (std::size_t i = 0; i < data.cov.size(); ++i) {
          data.p.col(static_cast<Eigen::Index>(i)) +=
              data.cov[i].llt().matrixL() * NormalVector(&rng);
        }
        const double before = CpuSeconds();
        const RigFit fit = FitRig(data, calibrate, "the planned survey");
        out->cpu_seconds += (CpuSeconds() - before) / options_.draws;
        SurveySetting one;
        Judge(fit.rig, false, &one);
        squares += one.calibration * one.calibration / options_.draws;
      }
      out->calibration = out->bias = std::sqrt(squares);
      out->error = std::hypot(out->calibration, Readings());
    });
  }

  // A bar at rest in each pose, anywhere in the volume.
  void ByWand(SurveySetting* out) const {
    Try(out, [&] {
      const WandData data = Wave(*out);
      WandFitOptions fitting;
      fitting.from = rig_.cameras;
      fitting.guess.lens = rig_.cameras.front().lens;
      const double before = CpuSeconds();
      WandFit fit = FitWand(data, fitting, "the planned bar");
      const FramedWand framed = SetFrame({}, "the planned bar", &fit);
      out->cpu_seconds = CpuSeconds() - before;
      data::Rig found = rig_;
      found.cameras = fit.state.cameras;
      for (std::size_t j = 0; j < found.cameras.size(); ++j) {
        found.cameras[j].floor_px = rig_.cameras[j].floor_px;
      }
      found.covariance = framed.covariance;
      ClearFixed(fit.priors, &found.covariance);
      Judge(std::move(found), true, out);
    });
  }

  double Hours(const SurveySetting& of) const {
    const double point = options_.minutes_per_point + of.shots * options_.seconds_per_shot / 60.0;
    return (options_.minutes_before + of.points * point +
            of.poses * options_.seconds_per_pose / 60.0) /
           60.0;
  }

 private:
  template <typename Do>
  static void Try(SurveySetting* out, const Do& work) {
    ThrowIfInterrupted();
    try {
      work();
    } catch (const Error& error) {
      out->problem = error.what();
    }
  }

  CalibrateOptions Calibrating(int order) const {
    CalibrateOptions out;
    out.guess.lens = rig_.cameras.front().lens;
    out.order = order;
    out.workers = options_.workers;
    return out;
  }

  WandData Wave(const SurveySetting& setting) const {
    const Eigen::Vector3d size = rig_.volume_high - rig_.volume_low;
    const double length = options_.bar > 0.0 ? options_.bar : size.maxCoeff() / 3.0;
    WandData out;
    for (const data::RigCamera& camera : rig_.cameras) {
      out.cameras.push_back(camera.name);
      out.pixels.push_back(camera.pixels);
    }
    out.marks = {"a", "b"};
    out.place = Eigen::Vector2d(0.0, length);
    out.place_sigma = options_.bar_sigma;
    const double sigma = Whole(options_.reading_sigma_px);
    Rng rng = Rng(options_.seed).Stream("bar");
    for (int k = 0; k < setting.poses; ++k) {
      const Eigen::Vector3d at(SpreadPlace(k, 2), SpreadPlace(k, 3), SpreadPlace(k, 5));
      const Eigen::Vector3d middle = rig_.volume_low + size.cwiseProduct(at);
      const Eigen::Vector3d way = NormalVector(&rng).normalized();
      out.poses.push_back(std::to_string(k + 1));
      for (int m = 0; m < 2; ++m) {
        const Eigen::Vector3d p = middle + (m - 0.5) * length * way;
        for (std::size_t j = 0; j < rig_.cameras.size(); ++j) {
          double u = 0.0;
          if (!sees_(j, p) || !measure::Project(rig_.cameras[j], p, &u)) continue;
          out.readings.push_back({k, m, static_cast<int>(j), u, sigma, 0.0});
        }
      }
    }
    out.time.assign(out.poses.size(), 0.0);
    out.points = Read(setting);
    return out;
  }

  const data::Rig& rig_;
  const SurveyCostOptions& options_;
  Visibility sees_;
  MapOptions map_options_;
  UncertaintyMap truth_;
};

// All that is tried: points, bar, terms of the lens, estimators.
std::vector<SurveySetting> SettingsOf(const data::Rig& rig, const SurveyCostOptions& options) {
  std::vector<SurveySetting> out;
  for (const int points : options.points) {
    for (const SurveyPlaces places : options.places) {
      for (const int shots : options.shots) {
        out.push_back({.points = points, .places = places, .shots = shots});
      }
    }
  }
  for (const int poses : options.poses) out.push_back({.points = options.few, .poses = poses});
  if (options.points.empty()) return out;
  const int middle = options.points[options.points.size() / 2];
  for (const measure::LensOrder& order : measure::OrdersOf(rig.cameras.front().lens)) {
    out.push_back({.points = middle, .lens = order.name});
  }
  if (options.draws == 0) return out;
  for (const char* estimator : {"robust", "ordinary"}) {
    out.push_back({.points = middle, .estimator = estimator});
  }
  return out;
}

int OrderOf(const data::Rig& rig, const std::string& name) {
  const auto orders = measure::OrdersOf(rig.cameras.front().lens);
  for (std::size_t k = 0; k < orders.size(); ++k) {
    if (orders[k].name == name) return static_cast<int>(k);
  }
  return kFullOrder;
}

bool Predicted(const SurveySetting& of) {
  return of.problem.empty() && of.lens.empty() && of.estimator.empty();
}

void MarkFront(std::vector<SurveySetting>* all) {
  for (SurveySetting& one : *all) {
    if (!Predicted(one)) continue;
    one.on_front = std::none_of(all->begin(), all->end(), [&](const SurveySetting& other) {
      return Predicted(other) && other.hours <= one.hours && other.error <= one.error &&
             (other.hours < one.hours || other.error < one.error);
    });
  }
}

}  // namespace

SurveyCost StudySurveyCost(const data::Rig& rig, const std::string& name,
                           const SurveyCostOptions& options) {
  options.Check();
  if (rig.cameras.size() < 3) {
    throw Error("has fewer than three cameras", name, "give a rig that finds points");
  }
  const Study study(rig, options);
  SurveyCost out;
  out.need = NeedOf({.need = options.need}, rig);
  out.floor_px = rig.model_floor_px;
  out.readings = study.Readings();
  out.settings = SettingsOf(rig, options);
  for (std::size_t k = 0; k < out.settings.size(); ++k) {
    SurveySetting& one = out.settings[k];
    one.hours = study.Hours(one);
    if (!one.estimator.empty()) {
      study.WithWild(&one);
    } else if (one.poses > 0) {
      study.ByWand(&one);
    } else {
      study.ByPoints(OrderOf(rig, one.lens), &one);
    }
    if (options.progress) {
      options.progress(static_cast<double>(k + 1) / static_cast<double>(out.settings.size()));
    }
  }
  MarkFront(&out.settings);
  for (std::size_t k = 0; k < out.settings.size(); ++k) {
    const SurveySetting& one = out.settings[k];
    if (!Predicted(one) || one.error > out.need) continue;
    if (out.advised < 0 || one.hours < out.settings[static_cast<std::size_t>(out.advised)].hours) {
      out.advised = static_cast<int>(k);
    }
  }
  return out;
}

}  // namespace unfurl::calib
