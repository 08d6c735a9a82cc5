#include "calib/trend_families.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace unfurl::calib {
namespace {

constexpr int kTimeWaves = 8;    // half waves over the survey: a step in its middle is seen too
constexpr int kFieldWaves = 24;  // half waves over the row: shorter ones are noise to the points
constexpr int kCrossWaves = 6;   // of those that go across the row as well, both together
constexpr int kVolumeWaves = 4;  // of a survey's shape along all axes together

double HalfWave(int k, double x01) { return std::cos(k * std::numbers::pi * x01); }

// Half waves are weighed as a random walk's are.
double TimeVariance(Eigen::Index k) { return k == 0 ? 1.0 : 1.0 / static_cast<double>(k * k); }

// Where a point appears to a camera: along the row, and across it.
Eigen::Vector2d FieldOf(const data::RigCamera& camera, const Eigen::Vector3d& p) {
  const Eigen::Vector3d q = camera.R_CW * (p - camera.p_WC);
  return {q.x() / q.z(), q.y() / (q.z() + camera.e)};
}

// Places in a box, from 0 to 1 along each of its sides; a box may be flat.
template <typename Vector>
Vector InBox(const Vector& x, const Vector& low, const Vector& high) {
  Vector out;
  for (Eigen::Index a = 0; a < out.size(); ++a) {
    const double side = high(a) - low(a);
    out(a) = side > 0.0 ? std::clamp((x(a) - low(a)) / side, 0.0, 1.0) : 0.5;
  }
  return out;
}

}  // namespace

Eigen::MatrixXd TimeWaves(int points) {
  Eigen::MatrixXd out(points, 1 + kTimeWaves);
  for (int i = 0; i < points; ++i) {
    const double t = (i + 0.5) / points;
    out(i, 0) = std::numbers::sqrt3 * (2.0 * t - 1.0);
    for (int k = 1; k <= kTimeWaves; ++k) out(i, k) = std::numbers::sqrt2 * HalfWave(k, t);
  }
  return out;
}

Family DriftOfReadings(const Observations& data, const ScoreTest& test, int camera,
                       const Eigen::MatrixXd& waves) {
  Family out;
  out.kind = TrendKind::kReadingDrift;
  out.camera = camera;
  out.columns.on_readings.setZero(static_cast<Eigen::Index>(data.readings.size()), waves.cols());
  for (std::size_t k = 0; k < data.readings.size(); ++k) {
    const Reading& r = data.readings[k];
    if (r.camera == camera && test.Uses(k)) {
      out.columns.on_readings.row(static_cast<Eigen::Index>(k)) = waves.row(r.point);
    }
  }
  for (Eigen::Index k = 0; k < waves.cols(); ++k) out.prior.push_back(TimeVariance(k));
  return out;
}

Family DriftOfSurvey(const Observations& data, const Eigen::MatrixXd& waves) {
  Family out;
  out.kind = TrendKind::kSurveyDrift;
  out.columns.on_survey.setZero(9 * waves.cols(), data.points());
  for (int i = 0; i < data.points(); ++i) {
    for (Eigen::Index k = 0; k < waves.cols(); ++k) {
      for (Eigen::Index a = 0; a < 3; ++a) {
        out.columns.on_survey(3 * (3 * k + a) + a, i) = waves(i, k);
      }
    }
  }
  for (Eigen::Index k = 0; k < waves.cols(); ++k) {
    out.prior.insert(out.prior.end(), 3, TimeVariance(k));
  }
  return out;
}

Family PatternOf(const Observations& data, const RefinedBundle& bundle, const ScoreTest& test,
                 int camera) {
  Family out;
  out.kind = TrendKind::kPattern;
  out.camera = camera;
  std::vector<std::size_t> mine;
  std::vector<Eigen::Vector2d> at;
  Eigen::Vector2d low = Eigen::Vector2d::Constant(HUGE_VAL), high = -low;
  for (std::size_t k = 0; k < data.readings.size(); ++k) {
    const Reading& r = data.readings[k];
    if (r.camera != camera || !test.Uses(k)) continue;
    mine.push_back(k);
    at.push_back(FieldOf(bundle.state.cameras[static_cast<std::size_t>(camera)],
                         bundle.state.points.col(r.point)));
    low = low.cwiseMin(at.back());
    high = high.cwiseMax(at.back());
  }
  std::vector<std::pair<int, int>> waves;
  for (int k = 1; k <= kFieldWaves; ++k) waves.emplace_back(k, 0);
  for (int k = 0; k <= kCrossWaves; ++k) {
    for (int l = 1; k + l <= kCrossWaves; ++l) waves.emplace_back(k, l);
  }
  out.columns.on_readings.setZero(static_cast<Eigen::Index>(data.readings.size()),
                                  static_cast<Eigen::Index>(waves.size()));
  for (std::size_t m = 0; m < mine.size(); ++m) {
    const Eigen::Vector2d x = InBox(at[m], low, high);
    for (std::size_t w = 0; w < waves.size(); ++w) {
      const auto [k, l] = waves[w];
      out.columns.on_readings(static_cast<Eigen::Index>(mine[m]), static_cast<Eigen::Index>(w)) =
          (k > 0 ? std::numbers::sqrt2 : 1.0) * HalfWave(k, x(0)) *
          (l > 0 ? std::numbers::sqrt2 : 1.0) * HalfWave(l, x(1));
    }
  }
  for (const auto& [k, l] : waves) out.prior.push_back(1.0 / (k + l));
  return out;
}

Family ShapeOfSurvey(const Observations& data, const RefinedBundle& bundle) {
  Family out;
  out.kind = TrendKind::kSurveyShape;
  // A place in gross error may lie anywhere.
  Eigen::Vector3d low = Eigen::Vector3d::Constant(HUGE_VAL), high = -low;
  for (int i = 0; i < data.points(); ++i) {
    if (!bundle.weighting.UsesSurvey(static_cast<std::size_t>(i))) continue;
    low = low.cwiseMin(data.p.col(i));
    high = high.cwiseMax(data.p.col(i));
  }
  std::vector<Eigen::Vector3i> waves;
  for (int a = 0; a <= kVolumeWaves; ++a) {
    for (int b = 0; a + b <= kVolumeWaves; ++b) {
      for (int c = 0; a + b + c <= kVolumeWaves; ++c) {
        if (a + b + c > 0) waves.emplace_back(a, b, c);
      }
    }
  }
  const auto m = static_cast<Eigen::Index>(3 * waves.size());
  out.columns.on_survey.setZero(3 * m, data.points());
  for (int i = 0; i < data.points(); ++i) {
    const Eigen::Vector3d x = InBox<Eigen::Vector3d>(data.p.col(i), low, high);
    for (std::size_t w = 0; w < waves.size(); ++w) {
      double value = 1.0;
      for (int a = 0; a < 3; ++a) {
        value *= (waves[w](a) > 0 ? std::numbers::sqrt2 : 1.0) * HalfWave(waves[w](a), x(a));
      }
      for (Eigen::Index a = 0; a < 3; ++a) {
        out.columns.on_survey(3 * (3 * static_cast<Eigen::Index>(w) + a) + a, i) = value;
      }
    }
  }
  for (const Eigen::Vector3i& w : waves) out.prior.insert(out.prior.end(), 3, 1.0 / w.sum());
  return out;
}

}  // namespace unfurl::calib
