#include "sim/methods/run_judge.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace unfurl::sim {
namespace {

// Of what moved: beyond it the motion is not that of the scene. Runs within ten tolerances of
// their references at rtol = 1e-3 stay below (tests/hard/sets_test.cc).
constexpr double kMostResidual = 0.01;

// The beam whose elements stretch fastest, or a smooth one that stretches; -1: none does.
int StiffestAxis(const Model& model) {
  int stiffest = -1;
  double most = 0.0;
  for (std::size_t b = 0; b < model.beams.size(); ++b) {
    const Model::Beam& beam = model.beams[b];
    if (beam.smooth >= 0 && beam.EA > 0.0 && stiffest < 0) stiffest = static_cast<int>(b);
    if (beam.smooth >= 0) continue;
    for (int e = beam.first; e + 1 < beam.first + beam.segments; ++e) {
      const double square = model.bending.axial_stiffness(e) / model.rigid_bodies.mass[e];
      if (square <= most) continue;
      most = square;
      stiffest = static_cast<int>(b);
    }
  }
  return stiffest;
}

}  // namespace

bool IsClosed(const Model& model) {
  bool closed = !model.constraints.driven();
  ForEachEffect(model, [&](const auto& effect) {
    if (effect.kPower == PowerKind::kWork && effect.count() > 0) closed = false;
  });
  return closed;
}

RunJudge::RunJudge(const Model& model, const ErrorScale& scale, bool tracked)
    : dynamics_(model),
      tracked_(tracked),
      closed_(IsClosed(model)),
      stiffest_axis_(StiffestAxis(model)),
      rtol_(scale.rtol),
      state_(model.index.size(), 0.0) {
  const double speed = scale.rtol * scale.speed, spin = scale.rtol * scale.spin;
  for (int k = 0; k < model.rigid_bodies.count; ++k) {
    tolerance_floor_ += 0.5 * (model.rigid_bodies.mass[k] * speed * speed +
                               model.rigid_bodies.inertia[k] * spin * spin);
  }
  // And of places: beams whose ends are off by the tolerance are bent by it, 3 EI / L^3 to a metre.
  const double off = scale.rtol * scale.length;
  for (const Model::Beam& beam : model.beams) {
    const double length = beam.segments * beam.segment_length;
    tolerance_floor_ += 0.5 * 3.0 * beam.EI / (length * length * length) * off * off;
  }
}

void RunJudge::Look(double t, const double* state, const std::vector<LatchMode>& modes) {
  if (!watches()) return;
  dynamics_.modes() = modes;
  std::copy_n(state, state_.size(), state_.begin());
  const Balance b = dynamics_.BalanceAt(t, state_.data());
  std::array<double, kKinds> kinds = {
      b.kinetic, b.bending, b.axial, b.dissipated_contact, b.dissipated_beams, b.dissipated_dampers,
      b.work};
  std::copy(b.effects.begin(), b.effects.end(), kinds.end() - kEffects);
  const double now = tracked_ ? b.Conserved() : b.Stored();
  if (!started_) {
    started_ = true;
    start_ = now;
    least_ = most_ = kinds;
  }
  for (int k = 0; k < kKinds; ++k) {
    least_[k] = std::min(least_[k], kinds[k]);
    most_[k] = std::max(most_[k], kinds[k]);
    largest_term_ = std::max(largest_term_, std::fabs(kinds[k]));
  }
  const double off = tracked_ ? std::fabs(now - start_) : now - start_;
  if (off <= residual_) return;
  residual_ = off;
  at_ = t;
}

double RunJudge::Kinetic(double t, const double* state) {
  std::copy_n(state, state_.size(), state_.begin());
  return dynamics_.BalanceAt(t, state_.data()).kinetic;
}

double RunJudge::moved() const {
  double sum = 0.0;
  for (int k = 0; k < kKinds; ++k) sum += most_[k] - least_[k];
  return 0.5 * sum;
}

std::string RunJudge::Warning() const {
  if (!Complaint().empty() || !IsLessAccurate()) return {};
  return fmt::format(
      "the balance of energy is off by {:.2g}% of what moved, {:.0f} tolerances: the run is less "
      "accurate than its rtol says; use a smaller one, or another method",
      100.0 * residual_ / moved(), residual_ / (rtol_ * moved()));
}

std::string RunJudge::Complaint() const {
  if (residual_ > kMostResidual * moved() + floor()) {
    return fmt::format(
        "the balance of energy is off by {:.3g} J of the {:.3g} J that moved, most at t = {:.6g} s",
        residual_, moved(), at_);
  }
  // A stiff axis turns an error of a tolerance into forces that do work: what elsewhere is heat of
  // vibrations that nobody sees then moves marks.
  if (stiffest_axis_ < 0 || !IsLessAccurate()) return {};
  return fmt::format(
      "the balance of energy is off by {:.2g}% of what moved, {:.0f} tolerances, while beam '{}' "
      "stretches; axial = \"rigid\" does without that",
      100.0 * residual_ / moved(), residual_ / (rtol_ * moved()),
      dynamics_.model().beams[stiffest_axis_].name);
}

}  // namespace unfurl::sim
