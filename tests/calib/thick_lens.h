#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "base/pose.h"
#include "base/random.h"
#include "tests/calib/synthetic.h"

// Cameras with several cylindrical faces and a slit before or behind them, read by tracing rays
// backwards from the row: it shares no line with measure/, and its lenses are other ones.
namespace unfurl::calib::testing {

// A face that light crosses: its vertex on the axis, the curvature of its section (positive: centre
// at larger z) and the index on the scene's side of it.
struct ThickFace {
  double z = 0.0, curvature = 0.0;  // [m], [1/m]
  double index = 1.0;               // [-]
};

struct ThickCamera {
  std::string name;
  int pixels = 0;
  double pitch = 0.0;                 // [m]
  Eigen::Matrix3d R_CW;               // rows: across the lens axis, along it, towards the scene
  Eigen::Vector3d p_WC;               // of z = 0, the middle of the glass [m]
  std::vector<ThickFace> faces;       // from the row's side to the scene's
  double stop = 0.0, width = 0.0;     // of the slit: its z and its width [m]
  double row_z = 0.0;                 // of the row, below every face [m]
  double shift = 0.0, roll = 0.0;     // of the row: along itself [m], about z [rad]
  double decentre = 0.0, turn = 0.0;  // of the glass: across its axis [m], about z [rad]

  // The reading of a point: mean over the slit; false where a ray does not arrive, or off the row.
  bool Read(const Eigen::Vector3d& p_W, double* u_px) const {
    const Eigen::Vector3d p = R_CW * (p_W - p_WC);
    if (!(p.z() > 0.0)) return false;
    // Nodes of Gauss and Legendre over the slit, and their weights [-].
    constexpr std::array<double, 3> kNode = {-0.7745966692414834, 0.0, 0.7745966692414834};
    constexpr std::array<double, 3> kWeight = {5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0};
    double sum = 0.0;
    for (std::size_t k = 0; k < kNode.size(); ++k) {
      double u = 0.0;
      if (!Land(p, 0.5 * width * kNode[k], &u)) return false;
      sum += kWeight[k] * u;
    }
    *u_px = 0.5 * (pixels - 1) - (sum - shift) / pitch;
    return *u_px >= 0.0 && *u_px <= pixels - 1.0;
  }

 private:
  // From the row's place u with the slopes a and b: `out` is x at the stop, and x and y at z past
  // all faces.
  bool Trace(double u, double a, double b, double z, Eigen::Vector3d* out) const {
    Eigen::Vector3d at(u * std::cos(roll), u * std::sin(roll), row_z);
    Eigen::Vector3d d = Eigen::Vector3d(a, b, 1.0).normalized();
    const Eigen::AngleAxisd into(-turn, Eigen::Vector3d::UnitZ());
    double index = 1.0;
    bool stopped = false;
    const auto cross_stop = [&] {
      (*out)(0) = at.x() + (stop - at.z()) * d.x() / d.z();
      stopped = true;
    };
    for (const ThickFace& face : faces) {
      if (!stopped && stop <= face.z) cross_stop();
      // In the glass' own frame a face is  c (x^2 + z^2) = 2 z,  whatever y.
      const Eigen::Vector3d vertex(decentre, 0.0, face.z);
      Eigen::Vector3d q = into * (at - vertex), e = into * d;
      const double c = face.curvature;
      const double A = c * (e.x() * e.x() + e.z() * e.z());
      const double B = c * (q.x() * e.x() + q.z() * e.z()) - e.z();
      const double C = c * (q.x() * q.x() + q.z() * q.z()) - 2.0 * q.z();
      const double root = B * B - A * C;
      if (!(root > 0.0)) return false;
      q += C / (std::sqrt(root) - B) * e;  // the crossing near the vertex
      const Eigen::Vector3d normal = Eigen::Vector3d(-c * q.x(), 0.0, 1.0 - c * q.z()).normalized();
      const double ratio = index / face.index, cosine = normal.dot(e);
      const double under = 1.0 - ratio * ratio * (1.0 - cosine * cosine);
      if (!(cosine > 0.0) || !(under > 0.0)) return false;
      e = ratio * e + (std::sqrt(under) - ratio * cosine) * normal;  // Snell's law
      d = into.inverse() * e;
      at = into.inverse() * q + vertex;
      index = face.index;
    }
    if (!stopped) cross_stop();
    if (!(d.z() > 0.0)) return false;
    out->tail<2>() = (at + (z - at.z()) / d.z() * d).head<2>();
    return true;
  }

  // The row's place whose ray crosses the stop at x and meets p: Newton's method, led there from
  // the axis.
  bool Land(const Eigen::Vector3d& p, double x, double* u) const {
    constexpr int kSteps = 6, kMost = 30;        // of the way; of Newton's method in each
    constexpr double kMet = 1e-13;               // at the stop [m], and over the distance [-]
    const Eigen::Vector3d by(1e-6, 1e-5, 1e-5);  // of differences [m], [-]
    Eigen::Vector3d v = Eigen::Vector3d::Zero();
    for (int step = 1; step <= kSteps; ++step) {
      const double share = static_cast<double>(step) / kSteps;
      const Eigen::Vector3d wanted(x, share * p.x(), share * p.y());
      bool met = false;
      for (int k = 0; k < kMost && !met; ++k) {
        Eigen::Vector3d now, more, less;
        if (!Trace(v(0), v(1), v(2), p.z(), &now)) return false;
        const Eigen::Vector3d miss = now - wanted;
        met = std::abs(miss(0)) < kMet && miss.tail<2>().norm() < 100.0 * kMet * p.z();
        Eigen::Matrix3d J;
        for (int n = 0; n < 3; ++n) {
          const Eigen::Vector3d w = by(n) * Eigen::Vector3d::Unit(n);
          if (!Trace(v(0) + w(0), v(1) + w(1), v(2) + w(2), p.z(), &more)) return false;
          if (!Trace(v(0) - w(0), v(1) - w(1), v(2) - w(2), p.z(), &less)) return false;
          J.col(n) = (more - less) / (2.0 * by(n));
        }
        v -= J.partialPivLu().solve(miss);
        if (!v.allFinite()) return false;
      }
      if (!met) return false;
    }
    *u = v(0);
    return true;
  }
};

enum class ThickKind { kPlanoConvex, kPlanoBack, kBiconvex, kMeniscus, kDoublet, kPair };

// Faces from the row's side to the scene's, of a focal length of about 1.
inline std::vector<ThickFace> ThickGlass(ThickKind kind, double n, double t, double bend) {
  const double r = n - 1.0, h = 0.5 * t;
  switch (kind) {
    case ThickKind::kPlanoConvex:
      return {{-h, 0.0, n}, {h, -1.0 / r, 1.0}};
    case ThickKind::kPlanoBack:
      return {{-h, 1.0 / r, n}, {h, 0.0, 1.0}};
    case ThickKind::kBiconvex:
      return {{-h, bend / r, n}, {h, -(1.0 - bend) / r, 1.0}};
    case ThickKind::kMeniscus:
      return {{-h, -bend / r, n}, {h, -(1.0 + bend) / r, 1.0}};
    case ThickKind::kDoublet:
      return {{-h, -0.2 * bend / r, 1.75}, {-t / 6.0, 0.9 / r, n}, {h, -1.0 / r, 1.0}};
    case ThickKind::kPair:
      break;
  }
  return {{-h - 0.05, 0.6 / r, n}, {-0.05, 0.0, 1.0}, {0.05, 0.0, n}, {h + 0.05, -0.6 / r, 1.0}};
}

// Where the sharp image of a distance lies, and the focal length, by paraxial rays from the scene.
inline double ParaxialImage(const std::vector<ThickFace>& faces, double distance, double* focal) {
  double image = 0.0;
  const auto slope_past = [&](double h, double slope, double at) {
    for (std::size_t k = faces.size(); k-- > 0;) {
      const double before = faces[k].index, after = k > 0 ? faces[k - 1].index : 1.0;
      h += slope * (at - faces[k].z);
      at = faces[k].z;
      slope = (before * slope + h * (after - before) * faces[k].curvature) / after;
    }
    image = at + h / slope;
    return slope;
  };
  *focal = -1.0 / slope_past(1.0, 0.0, 0.0);
  slope_past(0.0, 1.0, distance);
  return image;
}

// A room of its own for each seed: 4 to 8 cameras on a ring, rows of 1000 to 8000 pixels that the
// cube's corners fill, one kind of glass. `wild`: the slit up to 0.8 focal lengths from the glass
// and not 0.3, where rays at the row's ends meet the faces at ever flatter angles.
struct ThickLab {
  std::vector<ThickCamera> cameras;
  double half = 0.0;  // half a side of the cube that is used [m]
  std::string what;   // in words

  ThickLab(std::uint64_t seed, bool wild) {
    Rng rng = Rng(seed).Stream("thick lab");
    const int n = 4 + static_cast<int>(rng.Integer(5));
    const double room = std::pow(10.0, rng.Uniform(-0.5, 0.5)), distance = 3.3 * room;
    half = room;
    const double height = rng.Uniform(2.2, 3.0), ring = std::sqrt(3.3 * 3.3 - height * height);
    const double from = rng.Uniform(0.0, 2.0 * M_PI);
    const int pixels = static_cast<int>(std::pow(10.0, rng.Uniform(3.0, 3.9)));
    const double focal = distance * rng.Uniform(0.006, 0.016);
    const auto kind = static_cast<ThickKind>(rng.Integer(6));
    const double reach = rng.Uniform(0.05, wild ? 0.8 : 0.3);
    const bool behind = rng.Integer(2) == 1;
    const double index = rng.Uniform(1.48, 1.78), thick = rng.Uniform(0.15, 0.45);
    ThickCamera camera = Model(ThickGlass(kind, index, thick, rng.Uniform(0.2, 0.6)), distance,
                               focal, behind ? -reach : reach);
    for (int j = 0; j < n; ++j) {
      camera.name = "c" + std::to_string(j + 1);
      const double turn = from + 2.0 * M_PI * (j + 0.5) / n;
      const Eigen::Vector3d place(ring * std::cos(turn), ring * std::sin(turn), height);
      // Odd numbers of cameras would have two neighbours alike.
      const double lean =
          n % 2 == 0 ? (j % 2 == 0 ? 1.0 : -1.0) * M_PI / 4.0 : M_PI * j / n - M_PI / 2.0;
      const auto draw = [&](double size) { return size * rng.Normal(); };
      camera.R_CW = RotationFromVector({draw(0.02), draw(0.02), draw(0.02)}) *
                    LookAtFromX(place, Eigen::Vector3d::Zero(), lean).R_CW;
      camera.p_WC = room * (place + Eigen::Vector3d(draw(0.02), draw(0.02), draw(0.02)));
      camera.roll = draw(0.003);
      camera.turn = draw(0.003);
      camera.decentre = 0.01 * focal * rng.Normal();
      cameras.push_back(camera);
    }
    const double widest = WidestReading();
    for (ThickCamera& one : cameras) {
      one.pixels = pixels;
      one.pitch = 2.04 * widest / pixels;
      one.shift = 0.01 * pixels * one.pitch * rng.Normal();
    }
    what = std::to_string(n) + " cameras, " + std::to_string(pixels) + " px, glass " +
           std::to_string(static_cast<int>(kind)) + ", slit " + std::to_string(reach) + " f " +
           (behind ? "behind" : "before");
  }
  bool Read(std::size_t camera, const Eigen::Vector3d& p, double* u) const {
    return cameras[camera].Read(p, u);
  }

 private:
  // In focus; `reach` of the slit beyond the glass, in focal lengths.
  static ThickCamera Model(const std::vector<ThickFace>& faces, double distance, double focal,
                           double reach) {
    ThickCamera out;
    double f = 0.0;
    ParaxialImage(faces, distance, &f);
    const double scale = focal / f;
    for (const ThickFace& face : faces) {
      out.faces.push_back({scale * face.z, face.curvature / scale, face.index});
    }
    out.row_z = ParaxialImage(out.faces, distance, &f);
    const double front = out.faces.back().z, back = out.faces.front().z;
    out.stop = reach > 0.0 ? front + reach * focal
                           : std::max(back + reach * focal, 0.5 * (back + out.row_z));
    out.width = std::min(2e-4, 0.004 * focal);
    return out;
  }

  // How far from a row's middle the cube's corners land [m].
  double WidestReading() const {
    double most = 0.0;
    for (ThickCamera camera : cameras) {
      camera.pitch = 1.0;
      camera.pixels = 1 << 30;
      for (int c = 0; c < 8; ++c) {
        const Eigen::Vector3d corner((c & 1) != 0 ? half : -half, (c & 2) != 0 ? half : -half,
                                     (c & 4) != 0 ? half : -half);
        double u = 0.0;
        if (camera.Read(corner, &u)) most = std::max(most, std::abs(u - 0.5 * (camera.pixels - 1)));
      }
    }
    return most;
  }
};

}  // namespace unfurl::calib::testing
