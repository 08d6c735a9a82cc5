#include "sim/methods/contact_watch.h"

#include <algorithm>
#include <cmath>

namespace unfurl::sim {
namespace {

// Places of a step at which the law's pieces are told apart: steps on the way out of a contact are
// limited to half of the transition zone, in which the force comes back and goes again.
constexpr int kPlacesOfContact = 16;
constexpr int kContactBisections = 40;  // to rounding of a place
// Of a step, to either side of a kink: the slopes there.
constexpr double kBesideKink = 1e-4;
// Of the error allowed to a step: a contact has some five kinks.
constexpr double kKinkPart = 0.2;
// Of a step: so near to an end of it a kink is met.
constexpr double kKinkMet = 1e-3;

// Pieces of the law, within each of which the force is smooth.
enum class Piece { kHeld, kZone, kBeyond };

}  // namespace

double ContactWatch::PartOf(int k, bool upper, const JointPath& path, double weight) const {
  const double zone = model_.latches.law(k).ReturnDepth();
  const auto contact = [&](double s) {
    return model_.latches.At(k, upper, path.Value(s), path.Rate(s));
  };
  const auto piece = [&](double s) {
    const Latches::Contact c = contact(s);
    return c.held || !(c.depth > 0.0) ? Piece::kHeld
           : c.depth < zone           ? Piece::kZone
                                      : Piece::kBeyond;
  };
  const auto rise = [&](double s) {  // of the force over kBesideKink of the step [N]
    return contact(s + kBesideKink).force - contact(s).force;
  };
  Piece before = piece(0.0);
  // Pressed in further from beyond the zone, it has none.
  if (before == Piece::kBeyond && piece(1.0) == before && contact(0.0).depth_rate >= 0.0 &&
      contact(1.0).depth_rate >= 0.0) {
    return 1.0;
  }
  for (int i = 1; i <= kPlacesOfContact; ++i) {
    double low = static_cast<double>(i - 1) / kPlacesOfContact;
    double high = static_cast<double>(i) / kPlacesOfContact;
    const Piece after = piece(high);
    if (after == before) continue;
    for (int b = 0; b < kContactBisections; ++b) {
      const double middle = 0.5 * (low + high);
      (piece(middle) == before ? low : high) = middle;
    }
    before = after;
    // What a kink hides: its change of slope, over the time to the nearer end.
    const double bend = std::fabs(rise(high + kBesideKink) - rise(low - 2.0 * kBesideKink));
    const double near = std::min(high, 1.0 - high);
    if (near > kKinkMet && 0.5 * bend / kBesideKink * near * near * weight > kKinkPart) return high;
  }
  return 1.0;
}

double ContactWatch::Part(const Motion& start, const Motion& end, double h,
                          const std::vector<LatchMode>& modes,
                          const KirchhoffBeams::Work& beams) const {
  double part = 1.0;
  for (int k = 0; k < model_.latches.count(); ++k) {
    const LatchMode mode = modes[static_cast<std::size_t>(k)];
    if (!(mode.upper_contact | mode.lower_contact)) continue;
    const Hinge& hinge = model_.latches.hinge(k);
    const JointPath path({hinge.Theta(start), hinge.Rate(start)},
                         {hinge.Theta(end), hinge.Rate(end)}, h);
    // By how much a force of 1 N through the step changes the rate, on the two bodies alone, in
    // parts of its tolerance.
    double mobility = 0.0, fastest = 0.0;
    for (const int body : {hinge.inner, hinge.outer}) {
      if (body == model_.rigid_bodies.ground) continue;
      mobility += model_.rigid_bodies.inverse_inertia[static_cast<std::size_t>(body)] +
                  model_.kirchhoff.Mobility(beams, body);
      fastest = std::max(fastest, std::fabs(start.omega[body]));
    }
    const double lever = std::fabs(model_.latches.Depth(k, 1.0));
    const double weight = lever * mobility * h / (scale_.rtol * (scale_.spin + fastest));
    if (mode.upper_contact) part = std::min(part, PartOf(k, true, path, weight));
    if (mode.lower_contact) part = std::min(part, PartOf(k, false, path, weight));
  }
  return part;
}

}  // namespace unfurl::sim
