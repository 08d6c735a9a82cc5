#pragma once

#include <Eigen/Dense>
#include <functional>
#include <string>
#include <vector>

#include "data/scene.h"

namespace unfurl::sim {

// A second formulation of a scene's equations of motion, written from the physics and not from the
// model: no body is merged (welds are constraints), forces are numerical gradients of the energy
// and of Rayleigh's function, Jacobians are numerical derivatives of the constraints, and the
// multipliers come from the dense matrix of [paper, eq. (26)].
class DenseFormulation {
 public:
  using Vector = Eigen::VectorXd;

  explicit DenseFormulation(const data::Scene& scene) : scene_(scene) {
    for (const auto& body : scene.bodies) AddBody(body.name, body.mass, body.inertia);
    for (const auto& beam : scene.beams) {
      first_segment_.push_back(static_cast<int>(mass_.size()));
      const double m = beam.mass / beam.segments, l = beam.length / beam.segments;
      for (int k = 0; k < beam.segments; ++k) {
        AddBody(beam.name + "/" + std::to_string(k), m, m * l * l / 12.0);
      }
    }
  }

  int bodies() const { return static_cast<int>(mass_.size()); }
  int SegmentOf(int beam, int k) const { return first_segment_[beam] + k; }
  double mass(int b) const { return mass_[b]; }
  double inertia(int b) const { return inertia_[b]; }
  // Where each body hangs on its string, x, y by body; needed with a suspension.
  std::vector<std::array<double, 2>> hang;
  // Moment on each joint's angle beside the spring's (contact), by joint.
  std::vector<double> joint_moment;

  double Theta(const Vector& q, int joint) const {
    const auto& j = scene_.joints[joint];
    return j.sign * (PoseOf(q, j.outer)[2] - PoseOf(q, j.inner)[2] - j.zero_angle);
  }

  double Energy(const Vector& q) const {
    double U = 0.0;
    ForEachElement([&](const data::SceneBeam& beam, double l, const Element& e) {
      const Eigen::Vector3d d = Deformation(q, e, l);
      U += 6.0 * beam.EI / (l * l * l) * d[1] * d[1] + 0.5 * beam.EI / l * d[2] * d[2];
      if (beam.axial_elastic) U += 0.5 * beam.EA / l * d[0] * d[0];
    });
    for (std::size_t j = 0; j < scene_.joints.size(); ++j) {
      if (!scene_.joints[j].spring) continue;
      const auto& spring = *scene_.joints[j].spring;
      const double stretch = Theta(q, static_cast<int>(j)) + spring.preload;
      U += 0.5 * spring.stiffness * stretch * stretch;
    }
    for (int b = 0; b < bodies(); ++b) {
      if (scene_.gravity) {
        U -= mass_[b] * (scene_.gravity->acceleration[0] * q[3 * b] +
                         scene_.gravity->acceleration[1] * q[3 * b + 1]);
      }
      if (scene_.suspension) {
        const double k = mass_[b] * scene_.suspension->gravity / scene_.suspension->length;
        const double dx = q[3 * b] - hang[b][0], dy = q[3 * b + 1] - hang[b][1];
        U += 0.5 * k * (dx * dx + dy * dy);
      }
    }
    return U;
  }

  Vector Constraints(const Vector& q) const {
    std::vector<double> phi;
    for (const auto& joint : scene_.joints) {
      const Eigen::Vector3d a = PoseOf(q, joint.inner), b = PoseOf(q, joint.outer);
      phi.push_back(b[0] - a[0]);
      phi.push_back(b[1] - a[1]);
    }
    for (const auto& weld : scene_.welds) {
      if (IsBeam(weld.inner) || IsBeam(weld.outer)) continue;
      const Eigen::Vector3d a = PoseOf(q, weld.inner), b = PoseOf(q, weld.outer);
      phi.push_back(b[0] - a[0]);
      phi.push_back(b[1] - a[1]);
      phi.push_back(b[2] - a[2] - weld.angle);
    }
    ForEachElement([&](const data::SceneBeam& beam, double l, const Element& e) {
      if (beam.axial_elastic) return;
      const Eigen::Vector3d i = e.i(q), j = e.j(q);
      if (beam.along_chord) {
        phi.push_back(std::hypot(j[0] - i[0], j[1] - i[1]) - l);
        return;
      }
      phi.push_back((j[0] - i[0]) * std::cos(i[2]) + (j[1] - i[1]) * std::sin(i[2]) - l);
    });
    return Eigen::Map<Vector>(phi.data(), static_cast<Eigen::Index>(phi.size()));
  }

  // Accelerations at (q, v).
  Vector Accelerations(const Vector& q, const Vector& v) const {
    const Eigen::Index n = 3 * bodies();
    Vector Q = Vector::Zero(n);
    Eigen::MatrixXd J(Constraints(q).size(), n);
    for (Eigen::Index c = 0; c < n; ++c) {
      const Vector e = Vector::Unit(n, c);
      Q[c] -= Derivative([&](double s) { return Energy(q + s * e); });
      Q[c] -= Derivative([&](double s) { return Rayleigh(q, v + s * e); });
      for (std::size_t j = 0; j < joint_moment.size(); ++j) {
        Q[c] += joint_moment[j] *
                Derivative([&](double s) { return Theta(q + s * e, static_cast<int>(j)); });
      }
      J.col(c) = VectorDerivative([&](double s) { return Constraints(q + s * e); });
    }
    // gamma = -d2(Phi)/ds2 along v, by the five-point rule.
    const double h = 2e-3;
    const auto phi = [&](double s) { return Constraints(q + s * v); };
    const Vector gamma =
        -(-phi(2 * h) + 16 * phi(h) - 30 * phi(0) + 16 * phi(-h) - phi(-2 * h)) / (12 * h * h);
    const Eigen::Index m = J.rows();
    Eigen::MatrixXd K = Eigen::MatrixXd::Zero(n + m, n + m);
    for (int b = 0; b < bodies(); ++b) {
      K(3 * b, 3 * b) = K(3 * b + 1, 3 * b + 1) = mass_[b];
      K(3 * b + 2, 3 * b + 2) = inertia_[b];
    }
    K.topRightCorner(n, m) = J.transpose();
    K.bottomLeftCorner(m, n) = J;
    Vector right(n + m);
    right << Q, gamma;
    return K.fullPivLu().solve(right).head(n);
  }

 private:
  using Station = std::function<Eigen::Vector3d(const Vector&)>;
  struct Element {
    Station i, j;
  };

  void AddBody(const std::string&, double m, double I) {
    mass_.push_back(m);
    inertia_.push_back(I);
  }
  static bool IsBeam(const data::SceneEnd& e) {
    return e.kind == data::SceneEnd::Kind::kBeamStart || e.kind == data::SceneEnd::Kind::kBeamEnd;
  }
  static double Derivative(const std::function<double(double)>& f) {
    const double h = 1e-3;
    return (8 * (f(h) - f(-h)) - (f(2 * h) - f(-2 * h))) / (12 * h);
  }
  static Vector VectorDerivative(const std::function<Vector(double)>& f) {
    const double h = 1e-3;
    return (8 * (f(h) - f(-h)) - (f(2 * h) - f(-2 * h))) / (12 * h);
  }
  static Eigen::Vector3d PointOf(const Vector& q, int body, double px, double py) {
    const double c = std::cos(q[3 * body + 2]), s = std::sin(q[3 * body + 2]);
    return {q[3 * body] + c * px - s * py, q[3 * body + 1] + s * px + c * py, q[3 * body + 2]};
  }
  // Point and angle of an end.
  Eigen::Vector3d PoseOf(const Vector& q, const data::SceneEnd& e) const {
    switch (e.kind) {
      case data::SceneEnd::Kind::kGround:
        return {e.point[0], e.point[1], 0.0};
      case data::SceneEnd::Kind::kBody:
        return PointOf(q, e.index, e.point[0], e.point[1]);
      default: {
        const auto& beam = scene_.beams[e.index];
        const bool start = e.kind == data::SceneEnd::Kind::kBeamStart;
        const double half = 0.5 * beam.length / beam.segments;
        return PointOf(q, SegmentOf(e.index, start ? 0 : beam.segments - 1), start ? -half : half,
                       0.0);
      }
    }
  }
  Eigen::Vector3d Deformation(const Vector& q, const Element& e, double l) const {
    const Eigen::Vector3d i = e.i(q), j = e.j(q);
    const double mean = 0.5 * (i[2] + j[2]), c = std::cos(mean), s = std::sin(mean);
    const double rx = j[0] - i[0], ry = j[1] - i[1];
    return {c * rx + s * ry - l, c * ry - s * rx, j[2] - i[2]};
  }
  double Rayleigh(const Vector& q, const Vector& v) const {
    double R = 0.0;
    ForEachElement([&](const data::SceneBeam& beam, double l, const Element& e) {
      if (beam.damping == 0.0) return;
      const Vector rate =
          VectorDerivative([&](double s) -> Vector { return Deformation(q + s * v, e, l); });
      R += beam.damping * (6.0 * beam.EI / (l * l * l) * rate[1] * rate[1] +
                           0.5 * beam.EI / l * rate[2] * rate[2]);
      if (beam.axial_elastic) R += beam.damping * 0.5 * beam.EA / l * rate[0] * rate[0];
    });
    return R;
  }
  // The station where a beam's end is welded to a body, if it is.
  Station WeldedStation(int beam, bool start) const {
    for (const auto& weld : scene_.welds) {
      for (const bool inner : {true, false}) {
        const data::SceneEnd& b = inner ? weld.inner : weld.outer;
        const data::SceneEnd& other = inner ? weld.outer : weld.inner;
        const auto kind = start ? data::SceneEnd::Kind::kBeamStart : data::SceneEnd::Kind::kBeamEnd;
        if (b.kind != kind || b.index != beam) continue;
        const double turn = inner ? -weld.angle : weld.angle;
        return [this, other, turn](const Vector& q) -> Eigen::Vector3d {
          return PoseOf(q, other) + Eigen::Vector3d(0.0, 0.0, turn);
        };
      }
    }
    return {};
  }
  void ForEachElement(
      const std::function<void(const data::SceneBeam&, double, const Element&)>& f) const {
    for (std::size_t b = 0; b < scene_.beams.size(); ++b) {
      const auto& beam = scene_.beams[b];
      const double l = beam.length / beam.segments;
      const auto segment = [&](int k) -> Station {
        const int body = SegmentOf(static_cast<int>(b), k);
        return [body](const Vector& q) -> Eigen::Vector3d { return q.segment<3>(3 * body); };
      };
      if (const Station s = WeldedStation(static_cast<int>(b), true)) {
        f(beam, 0.5 * l, {s, segment(0)});
      }
      for (int k = 0; k + 1 < beam.segments; ++k) f(beam, l, {segment(k), segment(k + 1)});
      if (const Station s = WeldedStation(static_cast<int>(b), false)) {
        f(beam, 0.5 * l, {segment(beam.segments - 1), s});
      }
    }
  }

  data::Scene scene_;
  std::vector<double> mass_, inertia_;
  std::vector<int> first_segment_;
};

}  // namespace unfurl::sim
