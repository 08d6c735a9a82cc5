#include "sim/dynamics/dynamics.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>

#include "sim/dynamics/trigonometry.h"

namespace unfurl::sim {
namespace {

using Clock = std::chrono::steady_clock;

class PartTimer {
 public:
  explicit PartTimer(double* parts) : parts_(parts), last_(Clock::now()) {}
  void Mark(int part) {
    const auto now = Clock::now();
    parts_[part] += std::chrono::duration<double>(now - last_).count();
    last_ = now;
  }

 private:
  double* parts_;
  Clock::time_point last_;
};

struct NoTimer {
  void Mark(int) {}
};

// Of rates [m/s], [rad/s]: a trial step that is unstable by far gets beyond it, and beyond it
// angles have no direction (2^51 quarter turns) and products of what comes next overflow.
constexpr double kBeyondAll = 1e15;

bool AnyBeyond(const double* __restrict rate, int size) {
  std::uint64_t any = 0;
  for (int k = 0; k < size; ++k) any |= std::fabs(rate[k]) > kBeyondAll ? 1U : 0U;
  return any != 0;
}

}  // namespace

const char* Dynamics::PartName(int part) {
  if (part == kKinematics) return "kinematics";
  if (part == kBending) return "bending";
  if (part == kConstraints) return "constraints";
  return kEffectTexts[static_cast<std::size_t>(part - kFirstEffect)].name;
}

Dynamics::Dynamics(const Model& model)
    : model_(model),
      modes_(model.initial_modes),
      cosine_(model.rigid_bodies.count + kBlock, 1.0),
      sine_(model.rigid_bodies.count + kBlock, 0.0),
      fx_(model.rigid_bodies.count + kBlock, 0.0),
      fy_(model.rigid_bodies.count + kBlock, 0.0),
      m_(model.rigid_bodies.count + kBlock, 0.0),
      scratch_(model.bending.ScratchSize(), 0.0),
      work_(model.constraints.MakeWork()) {
  if (model.kirchhoff.count() == 0) return;
  work_.smooth = &model.kirchhoff;
  work_.smooth_work = model.kirchhoff.MakeWork();
}

Motion Dynamics::Update(double t, double* y) {
  const int n = model_.rigid_bodies.count;
  double* x = y;
  double* yy = y + n;
  double* theta = y + 2 * n;
  double* vx = y + 3 * n;
  double* vy = y + 4 * n;
  double* omega = y + 5 * n;
  if (work_.smooth != nullptr) {
    work_.smooth->Update(x, yy, theta, vx, vy, omega, &work_.smooth_work);
  }
  for (const Station& s : model_.rigid_bodies.stations) {
    theta[s.index] = theta[s.body] + s.angle;
    omega[s.index] = omega[s.body];
  }
  SinCos(theta, n, sine_.data(), cosine_.data());
  double* offset = work_.station.data();
  for (const Station& s : model_.rigid_bodies.stations) {
    const double c = cosine_[s.body], sn = sine_[s.body], w = omega[s.body];
    const double ox = c * s.px - sn * s.py, oy = sn * s.px + c * s.py;
    offset[0] = ox;
    offset[1] = oy;
    offset += 2;
    x[s.index] = x[s.body] + ox;
    yy[s.index] = yy[s.body] + oy;
    vx[s.index] = vx[s.body] - w * oy;
    vy[s.index] = vy[s.body] + w * ox;
  }
  return {Within(t),     x,     yy,      theta, vx, vy, omega, cosine_.data(), sine_.data(),
          modes_.data(), held_, holding_};
}

Motion Dynamics::MotionAt(double t, double* y) const {
  const int n = model_.rigid_bodies.count;
  return {Within(t), y,         y + n,          y + 2 * n,    y + 3 * n,
          y + 4 * n, y + 5 * n, cosine_.data(), sine_.data(), modes_.data(),
          held_,     holding_};
}

template <bool kProfile>
void Dynamics::Evaluate(double t, double* y, double* dydt) {
  std::conditional_t<kProfile, PartTimer, NoTimer> timer = [&] {
    if constexpr (kProfile) {
      return PartTimer(profile);
    } else {
      return NoTimer{};
    }
  }();
  const int n = model_.rigid_bodies.count;
  if (AnyBeyond(y + 3 * n, 3 * n)) {  // so that the step is rejected
    std::fill_n(dydt, 6 * n, kBeyondAll * kBeyondAll);
    std::fill_n(dydt + 6 * n, kExtras, 0.0);
    return;
  }
  const Motion motion = Update(t, y);
  const Load load{fx_.data(), fy_.data(), m_.data()};
  std::fill_n(load.fx, n, 0.0);
  std::fill_n(load.fy, n, 0.0);
  std::fill_n(load.m, n, 0.0);
  double* extra = dydt + 6 * n;
  std::fill_n(extra, kExtras, 0.0);
  // Where each kind of power is added up; null: nowhere.
  const auto power_of = [&](PowerKind kind) {
    if (!track_energy) return static_cast<double*>(nullptr);
    switch (kind) {
      case PowerKind::kContact:
        return extra + kExtraContact;
      case PowerKind::kDissipated:
        return extra + kExtraDampers;
      case PowerKind::kWork:
        return extra + kExtraWork;
      default:
        return static_cast<double*>(nullptr);
    }
  };
  double* lost_beams = track_energy ? extra + kExtraBeams : nullptr;
  timer.Mark(kKinematics);

  if (model_.bending.count() > 0) {
    model_.bending.AddLoad(motion, scratch_.data(), load, lost_beams);
    const double* offset = work_.station.data();
    for (const Station& s : model_.rigid_bodies.stations) {
      load.fx[s.body] += load.fx[s.index];
      load.fy[s.body] += load.fy[s.index];
      load.m[s.body] +=
          load.m[s.index] + offset[0] * load.fy[s.index] - offset[1] * load.fx[s.index];
      offset += 2;
    }
    timer.Mark(kBending);
  }
  int part = kFirstEffect;
  ForEachEffect(model_, [&](const auto& effect) {
    if (effect.count() > 0) {
      effect.AddLoad(motion, load, power_of(effect.kPower));
      timer.Mark(part);
    }
    ++part;
  });
  model_.constraints.Accelerate(motion, load, &work_);
  if (model_.constraints.driven() && track_energy) {
    extra[kExtraWork] += model_.constraints.DrivePower(motion.t, work_);
  }
  if (work_.smooth != nullptr && track_energy) extra[kExtraBeams] += work_.smooth_work.power;
  std::copy_n(y + 3 * n, 3 * n, dydt);
  std::copy_n(work_.ax.data(), n, dydt + 3 * n);
  std::copy_n(work_.ay.data(), n, dydt + 4 * n);
  std::copy_n(work_.alpha.data(), n, dydt + 5 * n);
  timer.Mark(kConstraints);
}

void Dynamics::RightSide(double t, double* y, double* dydt) {
  profile != nullptr ? Evaluate<true>(t, y, dydt) : Evaluate<false>(t, y, dydt);
}

double Dynamics::PositionDrift(double t, double* y) {
  if (model_.constraints.count() == 0) return 0.0;
  const Motion motion = MotionAt(t, y);
  return model_.constraints.PositionDrift(motion, &work_);
}

double Dynamics::VelocityDrift(double t, double* y) {
  if (model_.constraints.count() == 0) return 0.0;
  const Motion motion = MotionAt(t, y);
  return model_.constraints.VelocityDrift(motion, &work_);
}

double Dynamics::EvaluateConstraints(double t, double* y) {
  return model_.constraints.PositionDriftAt(Update(t, y), &work_);
}

double Dynamics::EvaluateConstraintRates(double t, double* y) {
  return model_.constraints.VelocityDrift(Update(t, y), &work_);
}

void Dynamics::Jacobian(double t, double* y, double* six_per_row) const {
  model_.constraints.Jacobian(MotionAt(t, y), work_, six_per_row);
}

void Dynamics::Project(double t, double* y) {
  if (model_.constraints.count() == 0) return;
  const Motion motion = MotionAt(t, y);
  // Velocities first: their rows are at the positions of the factored matrix.
  model_.constraints.VelocityDrift(motion, &work_);
  const int n = model_.rigid_bodies.count;
  model_.constraints.RemoveDrift(&work_, y + 3 * n, y + 4 * n, y + 5 * n);
  model_.constraints.PositionDrift(motion, &work_);
  model_.constraints.RemoveDrift(&work_, y, y + n, y + 2 * n);
}

double Dynamics::SmallestPivot(std::string* where) const {
  if (model_.constraints.count() == 0) return 1.0;
  int row = -1;
  const double ratio = model_.constraints.SmallestPivot(work_, &row);
  if (row >= 0 && where != nullptr) *where = model_.constraints.NameOf(row);
  return ratio;
}

Balance Dynamics::BalanceAt(double t, double* y) {
  Balance b;
  const RigidBodies& bodies = model_.rigid_bodies;
  const int n = bodies.count;
  const Motion m = Update(t, y);
  double total_mass = 0.0;
  for (int k = 0; k < n; ++k) {
    const double mass = bodies.mass[k];
    b.kinetic += 0.5 * mass * (m.vx[k] * m.vx[k] + m.vy[k] * m.vy[k]) +
                 0.5 * bodies.inertia[k] * m.omega[k] * m.omega[k];
    b.momentum_x += mass * m.vx[k];
    b.momentum_y += mass * m.vy[k];
    b.angular_momentum +=
        mass * (m.x[k] * m.vy[k] - m.y[k] * m.vx[k]) + bodies.inertia[k] * m.omega[k];
    b.centre_x += mass * m.x[k];
    b.centre_y += mass * m.y[k];
    total_mass += mass;
  }
  if (total_mass > 0.0) {
    b.centre_x /= total_mass;
    b.centre_y /= total_mass;
  }
  b.bending = model_.bending.Energy(m);
  b.axial = model_.bending.AxialEnergy(m);
  std::size_t k = 0;
  ForEachEffect(model_, [&](const auto& effect) {
    b.effects[k++] = effect.Energy(m);
    b.effects_scale += effect.EnergyScale(m);
  });
  if (work_.smooth != nullptr) {
    b.kinetic += work_.smooth->KineticAboutCentres(&work_.smooth_work);
    b.angular_momentum += work_.smooth->AngularMomentum(&work_.smooth_work);
    b.bending += work_.smooth->Bending(work_.smooth_work);
    b.axial += work_.smooth->Stretching(work_.smooth_work);
    const double strings = work_.smooth->OfStrings(work_.smooth_work);
    b.effects[EffectIndex<Suspension>()] += strings;
    b.effects_scale += strings;
  }
  b.dissipated_contact = y[model_.index.extra(kExtraContact)] + model_.latches.HeldEnergy(m);
  b.dissipated_beams = y[model_.index.extra(kExtraBeams)];
  b.dissipated_dampers = y[model_.index.extra(kExtraDampers)];
  b.work = y[model_.index.extra(kExtraWork)];
  if (model_.constraints.count() > 0) {
    b.position_drift = model_.constraints.PositionDriftAt(m, &work_);
    b.velocity_drift = model_.constraints.VelocityDrift(m, &work_);
  }
  return b;
}

}  // namespace unfurl::sim
