#pragma once

#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "base/pose.h"
#include "base/random.h"
#include "base/statistics.h"
#include "calib/wand_data.h"
#include "calib/wand_fit.h"
#include "tests/calib/fixtures.h"
#include "tests/calib/synthetic.h"
#include "tests/calib/traced.h"

// Readings of a bar that somebody waves, by cameras of the fitted model or by rays through glass.
namespace unfurl::calib::testing {

struct Wave {
  int poses = 500;
  double length = 0.75, length_sigma = 1e-4;  // of the bar, and of what is stated of it [m]
  double half = 1.08;           // half a side of the cube that the bar's middle stays in [m]
  double reading_sigma = 0.05;  // [px]
  // Of a bar that moves: time from pose to pose and from one mark's flash to the next, and the
  // frequencies of the motion. An interval of 0: poses anywhere, marks that flash at once.
  double interval = 0.0, flash = 0.0;  // [s]
  double hertz = 0.3;
  // Where the bar's middle and direction are limited to; both as drawn where empty.
  std::function<void(Eigen::Vector3d*, Eigen::Vector3d*)> limit = nullptr;
};

/// Reads a true place; false where the camera does not see it.
using Reader = std::function<bool(std::size_t camera, const Eigen::Vector3d& p, double* u)>;

struct Waved {
  WandData data;
  Eigen::Matrix3Xd marks;  // true places at the poses' times, 3 x 2 n [m]
};

// The bar's middle and direction at a time: sums of sines that fill the cube.
struct Path {
  Eigen::Matrix3d phase, direction_phase;
  double half, hertz;
  Path(double half_side, double frequency, Rng rng) : half(half_side), hertz(frequency) {
    for (int k = 0; k < 9; ++k) phase(k) = rng.Uniform(0.0, 2.0 * M_PI);
    for (int k = 0; k < 9; ++k) direction_phase(k) = rng.Uniform(0.0, 2.0 * M_PI);
  }
  void At(double t, Eigen::Vector3d* middle, Eigen::Vector3d* direction) const {
    const double w = 2.0 * M_PI * hertz;
    for (int k = 0; k < 3; ++k) {
      (*middle)(k) = half * (0.6 * std::sin(w * (1.0 + 0.37 * k) * t + phase(k, 0)) +
                             0.4 * std::sin(w * (1.7 + 0.29 * k) * t + phase(k, 1)));
      (*direction)(k) = std::sin(w * (0.8 + 0.23 * k) * t + direction_phase(k, 0)) +
                        0.6 * std::sin(w * (1.5 + 0.31 * k) * t + direction_phase(k, 1));
    }
    direction->normalize();
  }
};

inline Waved MakeWave(const std::vector<std::string>& cameras, const std::vector<int>& pixels,
                      const Reader& read, const Wave& wave, Rng rng) {
  Waved out;
  WandData& data = out.data;
  data.cameras = cameras;
  data.pixels = pixels;
  data.marks = {"a", "b"};
  data.place = Eigen::Vector2d(0.0, wave.length);
  data.place_sigma = wave.length_sigma;
  Rng places = rng.Stream("places"), noise = rng.Stream("noise");
  const double length = wave.length + wave.length_sigma * noise.Normal();  // what it is
  const Path path(wave.half, wave.hertz, rng.Stream("path"));
  std::vector<Eigen::Vector3d> marks;
  for (int attempt = 0; data.pose_count() < wave.poses && attempt < 50 * wave.poses; ++attempt) {
    const bool moving = wave.interval > 0.0;
    const double time = moving ? attempt * wave.interval : 0.0;
    Eigen::Vector3d anywhere, any_direction;
    for (int k = 0; k < 3; ++k) {
      anywhere(k) = places.Uniform(-wave.half, wave.half);
      any_direction(k) = places.Normal();
    }
    std::vector<WandReading> readings;
    Eigen::Vector3d ends[2];
    for (int mark = 0; mark < 2; ++mark) {
      const double after = moving ? (mark - 0.5) * wave.flash : 0.0;
      Eigen::Vector3d middle = anywhere, direction = any_direction.normalized();
      if (moving) path.At(time + after, &middle, &direction);
      if (wave.limit) wave.limit(&middle, &direction);
      const Eigen::Vector3d flashed = middle + (mark - 0.5) * length * direction;
      ends[mark] = flashed;
      for (std::size_t j = 0; j < cameras.size(); ++j) {
        double u = 0.0;
        if (!read(j, flashed, &u)) continue;
        readings.push_back({data.pose_count(), mark, static_cast<int>(j),
                            u + wave.reading_sigma * noise.Normal(), wave.reading_sigma, after});
      }
    }
    if (readings.size() < 6) continue;
    data.poses.push_back(std::to_string(data.pose_count() + 1));
    data.time.push_back(time);
    data.readings.insert(data.readings.end(), readings.begin(), readings.end());
    marks.push_back(ends[0]);
    marks.push_back(ends[1]);
  }
  out.marks.resize(3, static_cast<Eigen::Index>(marks.size()));
  for (std::size_t k = 0; k < marks.size(); ++k) {
    out.marks.col(static_cast<Eigen::Index>(k)) = marks[k];
  }
  return out;
}

// By cameras of the fitted model.
inline Waved WaveBefore(const std::vector<data::RigCamera>& cameras, const Wave& wave, Rng rng) {
  std::vector<std::string> names;
  std::vector<int> pixels;
  for (const data::RigCamera& camera : cameras) {
    names.push_back(camera.name);
    pixels.push_back(camera.pixels);
  }
  const Reader read = [&](std::size_t j, const Eigen::Vector3d& p, double* u) {
    return measure::Project(cameras[j], p, u) && *u >= 0.0 && *u <= cameras[j].pixels - 1.0;
  };
  return MakeWave(names, pixels, read, wave, rng);
}

// By rays through the glass of a laboratory.
inline Waved WaveBefore(const TracedLab& lab, const Wave& wave) {
  std::vector<std::string> names;
  std::vector<int> pixels;
  for (const auto& camera : lab.truth.cameras) {
    names.push_back(camera.name);
    pixels.push_back(camera.sensor.pixels);
  }
  const Reader read = [&](std::size_t j, const Eigen::Vector3d& p, double* u) {
    return lab.Read(j, p, u);
  };
  return MakeWave(names, pixels, read, wave, lab.rng.Stream("wave"));
}

// How far the bar's marks as found are from where they were, after the best rigid motion; of those
// that three cameras read, as two and the length leave two places.
inline double MarksRms(const WandFit& fit, const Waved& waved, bool mirror) {
  const auto marks = static_cast<std::size_t>(2 * fit.data.pose_count());
  std::vector<double> after(marks, 0.0);
  std::vector<int> read(marks, 0);
  for (const WandReading& r : fit.data.readings) {
    const auto at = static_cast<std::size_t>(2 * r.pose + r.mark);
    after[at] = r.after;
    ++read[at];
  }
  std::vector<Eigen::Vector3d> from, to;
  for (int k = 0; k < fit.data.pose_count(); ++k) {
    const int pose = std::stoi(fit.data.poses[static_cast<std::size_t>(k)]) - 1;
    for (int mark = 0; mark < 2; ++mark) {
      const auto at = static_cast<std::size_t>(2 * k + mark);
      if (read[at] < 3) continue;
      from.emplace_back(waved.marks.col(2 * pose + mark));
      to.push_back((mirror ? -1.0 : 1.0) * fit.state.Mark(k, mark, after[at]));
    }
  }
  Eigen::Matrix3Xd truth(3, static_cast<Eigen::Index>(from.size())), found = truth;
  for (std::size_t k = 0; k < from.size(); ++k) {
    truth.col(static_cast<Eigen::Index>(k)) = from[k];
    found.col(static_cast<Eigen::Index>(k)) = to[k];
  }
  return FitRigid(truth, found).rms;
}

// The errors of found points with their whole covariance, in the survey's frame.
struct Nees {
  double sum = 0.0, n = 0.0;
  int inside = 0, errors = 0;
  void Add(const TrueErrors& found) {
    for (std::size_t k = 0; k < found.error.size(); ++k) {
      const double squared = found.error[k].dot(found.predicted[k].llt().solve(found.error[k]));
      sum += squared / 3.0;
      n += 1.0;
      inside += squared < ChiSquareQuantile(0.95, 3.0) ? 1 : 0;
      ++errors;
    }
  }
};

inline Waved WithPoints(const std::vector<data::RigCamera>& truth, Wave wave, int points,
                        std::uint64_t seed) {
  const Rng rng(seed);
  Waved waved = WaveBefore(truth, wave, rng.Stream("wave"));
  waved.data.points =
      Observe(truth, PointsInCube(points, 1.0, rng.Stream("points")), 3e-4, 0.05, rng.Stream("n"));
  return waved;
}

}  // namespace unfurl::calib::testing
