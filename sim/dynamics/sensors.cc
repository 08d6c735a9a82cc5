#include "sim/dynamics/sensors.h"

#include <algorithm>
#include <cmath>

#include "sim/dynamics/observables.h"

namespace unfurl::sim {

namespace {

// Velocities are linear in the rates and trigonometric in the angles, so that a central difference
// over the time in which angles turn by this much is off by its square / 6, and rounded by 1e-16
// over it: both below 1e-10 of omega v [rad].
constexpr double kTurn = 1e-5;

}  // namespace

Sensors::Sensors(const Model& model) : model_(model) {
  if (model.sensors.empty()) return;
  for (const Model::Beam& beam : model.beams) lines_.emplace_back(model, beam);
  for (const Model::Sensor& s : model.sensors) {
    needs_rates_ = needs_rates_ || s.kind == data::SceneSensor::Kind::kAccelerometer;
  }
  readings_.resize(model.sensors.size());
  moved_.resize(model.index.size());
}

Sensors::Turn Sensors::TurnOf(const Model::Sensor& sensor, const double* state) const {
  const StateIndex& i = model_.index;
  const MovingPoint& p = sensor.point;
  if (p.watched >= 0) {
    const KirchhoffRod::Frame f = model_.kirchhoff.MotionAt(p.watched, state, i.n);
    return {f.theta, f.omega};
  }
  if (sensor.beam >= 0) {
    const CentreLine& line = lines_[static_cast<std::size_t>(sensor.beam)];
    if (line.HasSegment(p.body)) {
      return {line.Between(state + i.theta(0), sensor.place),
              line.Between(state + i.omega(0), sensor.place)};
    }
  }
  return {state[i.theta(p.body)], state[i.omega(p.body)]};
}

double Sensors::StepAt(const double* state) const {
  const StateIndex& i = model_.index;
  double fastest = 0.0;
  for (int k = 0; k < i.n; ++k) fastest = std::max(fastest, std::fabs(state[i.omega(k)]));
  // Three to a body, and angles all of them.
  for (const int k : model_.rigid_bodies.amplitudes) {
    fastest = std::max({fastest, std::fabs(state[i.vx(k)]), std::fabs(state[i.vy(k)])});
  }
  // Where nothing turns the velocities are linear, and any step will do.
  return kTurn / std::max(fastest, kTurn / model_.time_scale);
}

void Sensors::Read(double t, double* state, const double* rates, Dynamics* dynamics) {
  using Kind = data::SceneSensor::Kind;
  const auto n = static_cast<std::size_t>(6 * model_.index.n);
  // dv/dt of every accelerometer's place, by what its velocity is a moment later and earlier.
  std::vector<double>& out = readings_;
  const double step = needs_rates_ ? StepAt(state) : 0.0;
  for (const double side : {+1.0, -1.0}) {
    if (!needs_rates_) break;
    std::copy(state, state + model_.index.size(), moved_.begin());
    for (std::size_t k = 0; k < n; ++k) moved_[k] += side * step * rates[k];
    dynamics->Update(t + side * step, moved_.data());
    for (std::size_t s = 0; s < out.size(); ++s) {
      const Model::Sensor& sensor = model_.sensors[s];
      if (sensor.kind != Kind::kAccelerometer) continue;
      const PointMotion m = MotionOf(model_, sensor.point, moved_.data());
      const double angle = TurnOf(sensor, state).angle + sensor.angle;
      const double along = std::cos(angle) * m.vx + std::sin(angle) * m.vy;
      out[s] = side > 0.0 ? along : (out[s] - along) / (2.0 * step);
    }
  }
  const Motion motion = dynamics->Update(t, state);
  for (std::size_t s = 0; s < out.size(); ++s) {
    const Model::Sensor& sensor = model_.sensors[s];
    switch (sensor.kind) {
      case Kind::kAccelerometer: {
        if (!sensor.feels_gravity) break;
        const double angle = TurnOf(sensor, state).angle + sensor.angle;
        out[s] -= std::cos(angle) * model_.field[0] + std::sin(angle) * model_.field[1];
        break;
      }
      case Kind::kGyroscope:
        out[s] = TurnOf(sensor, state).rate;
        break;
      case Kind::kCurvature:
      case Kind::kStrainGauge: {
        const auto beam = static_cast<std::size_t>(sensor.beam);
        const double curvature = lines_[beam].Curvature(motion, sensor.place);
        out[s] = sensor.kind == Kind::kCurvature ? curvature : -sensor.height * curvature;
        if (sensor.kind == Kind::kStrainGauge && model_.beams[beam].EA > 0.0) {
          out[s] += lines_[beam].Strain(motion, sensor.place);
        }
        break;
      }
    }
  }
}

}  // namespace unfurl::sim
