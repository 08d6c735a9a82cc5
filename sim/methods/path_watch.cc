#include "sim/methods/path_watch.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "sim/methods/quartic.h"
#include "sim/methods/table_watch.h"

namespace unfurl::sim {
namespace {

// Between the places of the quartic, and the step's ends, where a law may just begin to change.
constexpr std::array<double, 7> kLooked = {0.0,
                                           0.0901699437494742,
                                           0.3389830508474576,
                                           0.4142135623730951,
                                           0.6180339887498949,
                                           0.8660254037844386,
                                           1.0};
// Of friction's moment, that may be off the quartic: then the estimate sees the rest.
constexpr double kSmoothPart = 1e-3;
// Creep rates from which on friction is constant but for that, 1 - tanh(3.8) = 1e-3; and within
// which it is no feature: what a quartic of tanh over half a creep rate leaves is 1e-5.
constexpr double kBand = 3.8, kWithinBand = 0.5;
// Times the band's edge: a step that begins farther out is led to the edge first.
constexpr double kOutside = 1.5;
constexpr int kMostHalvings = 60;       // to rounding
constexpr double kFarthestPath = HUGE_VAL;  // mobility of what has no mass of its own

double Squared(double x) { return x * x; }

// M [N m], and the rate that its slope at rest reaches it at [rad/s].
double MomentOf(const Friction& friction) { return friction.MarginMoment({}); }
double CreepRate(const Friction& friction) {
  return MomentOf(friction) / -friction.Slopes({}).by_rate;
}

}  // namespace

JointPath::JointPath(const Coordinate::State& start, const Coordinate::State& end, double h)
    : start_(start), h_(h) {
  // Rounding of a double [-].
  constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
  const double a = h * start.rate, b = h * end.rate;
  double d = end.value - start.value;
  // In a step so short that rounding is seen in it the rate is a straight line.
  const double rounding = 4.0 * kEpsilon * std::max(std::fabs(start.value), std::fabs(end.value));
  constexpr double kSeen = 1e-3;  // of what the rate changes
  if (rounding > kSeen * std::fabs(b - a)) d = 0.5 * (a + b);
  c1_ = a;
  c2_ = 3.0 * d - 2.0 * a - b;
  c3_ = a + b - 2.0 * d;
  d1_ = 2.0 * c2_ / h;
  d2_ = 3.0 * c3_ / h;
}

bool JointPath::RateTurns(double end, double* at) const {
  if (!(std::fabs(d1_) < 2.0 * std::fabs(d2_) * end)) return false;
  *at = -0.5 * d1_ / d2_;
  return *at > 0.0 && *at < end;
}

double JointPath::FirstAt(double rate) const {
  const double c = start_.rate - rate;
  const double square = d1_ * d1_ - 4.0 * d2_ * c;
  if (square < 0.0) return 1.0;
  // The two roots without cancellation.
  const double q = -0.5 * (d1_ + std::copysign(std::sqrt(square), d1_));
  double first = 1.0;
  for (const auto& [over, under] : {std::pair(c, q), std::pair(q, d2_)}) {
    if (!(std::fabs(over) < std::fabs(under))) continue;  // beyond 1
    const double root = over / under;
    if (root > 0.0) first = std::min(first, root);
  }
  return first;
}

PathWatch::PathWatch(const Model& model, const ErrorScale& scale)
    : model_(model),
      friction_(std::get<JointEffect<Friction>>(model.joint_effects)),
      tables_(std::get<JointEffect<MomentTable>>(model.joint_effects)),
      scale_(scale),
      part_(TableWatch::PartUnseen(scale.rtol)) {
  if (empty()) return;
  const auto n = static_cast<std::size_t>(model.rigid_bodies.count);
  for (Array* a : {&cosine_, &sine_, &fx_, &fy_, &m_}) a->assign(n, 0.0);
}

Motion PathWatch::MotionOf(double t, const double* state, const Coordinate& coordinate) {
  const StateIndex& i = model_.index;
  for (const int body : {coordinate.hinge.inner, coordinate.hinge.outer}) {
    cosine_[body] = std::cos(state[i.theta(body)]);
    sine_[body] = std::sin(state[i.theta(body)]);
  }
  return {t,
          state,
          state + i.y(0),
          state + i.theta(0),
          state + i.vx(0),
          state + i.vy(0),
          state + i.omega(0),
          cosine_.data(),
          sine_.data()};
}

JointPath PathWatch::PathOf(double t, double h, const double* state, const double* trial,
                            const Coordinate& coordinate) {
  const Coordinate::State start = coordinate.At(MotionOf(t, state, coordinate));
  return {start, coordinate.At(MotionOf(t + h, trial, coordinate)), h};
}

// By how much a moment of 1 N m at most changes the coordinate's acceleration: what it does to the
// two bodies alone, since what else holds them makes them slower [1/(kg m^2)].
double PathWatch::Mobility(const Coordinate& coordinate, const Motion& motion) {
  const RigidBodies& bodies = model_.rigid_bodies;
  coordinate.Apply(motion, 1.0, {fx_.data(), fy_.data(), m_.data()});
  double sum = 0.0;
  for (const int body : {coordinate.hinge.inner, coordinate.hinge.outer}) {
    if (body != bodies.ground) {
      const bool heavy = bodies.inverse_mass[body] > 0.0;
      sum += heavy ? (Squared(fx_[body]) + Squared(fy_[body])) * bodies.inverse_mass[body] +
                         Squared(m_[body]) * bodies.inverse_inertia[body]
                   : kFarthestPath;
    }
    fx_[body] = fy_[body] = m_[body] = 0.0;
  }
  return sum;
}

namespace {

// Whether friction along the first `end` of a path is near a quartic, or what is not has no weight:
// `weight` times the moment [N m] and the time [s] is a part of the rate's tolerance.
bool FrictionSeen(const Friction& friction, const JointPath& path, double end, double tolerance,
                  double weight) {
  const double r0 = path.Rate(0.0), r1 = path.Rate(end);
  double low = std::min(r0, r1), high = std::max(r0, r1), turn = end;
  if (path.RateTurns(end, &turn)) {
    low = std::min(low, path.Rate(turn));
    high = std::max(high, path.Rate(turn));
  }
  const double w = CreepRate(friction);
  if (low > kBand * w || high < -kBand * w) return true;
  if (high - low < kWithinBand * w) return true;
  // What moves by less than the tolerance stays within it.
  if (std::max(high, -low) < tolerance) return true;
  const auto moment = [&](double s) { return friction.Moment({0.0, path.Rate(s * end), 0.0}); };
  std::array<double, kQuarticPlaces.size()> values{};
  for (std::size_t k = 0; k < values.size(); ++k) values[k] = moment(kQuarticPlaces[k]);
  double unseen = 0.0;
  const auto look = [&](double s) {
    unseen = std::max(unseen, std::fabs(moment(s) - QuarticAt(values, s)));
  };
  for (const double s : kLooked) look(s);
  look(turn / end);
  return unseen < kSmoothPart * MomentOf(friction) || unseen * weight * end * path.h() < 1.0;
}

}  // namespace

double PathWatch::FrictionPart(int k, double t, double h, const double* state,
                               const double* trial) {
  const Friction& friction = friction_.law(k);
  const Coordinate& coordinate = friction_.coordinate(k);
  const JointPath path = PathOf(t, h, state, trial, coordinate);
  const double floor = coordinate.travel ? scale_.speed : scale_.spin;
  const StateIndex& i = model_.index;
  double fastest = 0.0;
  for (const int body : {coordinate.hinge.inner, coordinate.hinge.outer}) {
    const double rate =
        coordinate.travel ? std::hypot(state[i.vx(body)], state[i.vy(body)]) : state[i.omega(body)];
    fastest = std::max(fastest, std::fabs(rate));
  }
  const double tolerance = scale_.rtol * (floor + fastest);
  const double mobility = Mobility(coordinate, MotionOf(t, state, coordinate));
  const double weight = mobility / tolerance;
  if (FrictionSeen(friction, path, 1.0, tolerance, weight)) return 1.0;
  const double edge = std::max(kBand * CreepRate(friction), tolerance);
  const double begin = path.Rate(0.0);
  if (std::fabs(begin) > kOutside * edge) return path.FirstAt(std::copysign(edge, begin));
  double part = 0.5;
  for (int halved = 0; halved < kMostHalvings; ++halved) {
    if (FrictionSeen(friction, path, part, tolerance, weight)) break;
    part *= 0.5;
  }
  return part;
}

namespace {

// All places looked at, in order, with the quartic's own.
constexpr auto kInOrder = [] {
  std::array<double, kLooked.size() + kQuarticPlaces.size()> all{};
  std::copy(kLooked.begin(), kLooked.end(), all.begin());
  std::copy(kQuarticPlaces.begin(), kQuarticPlaces.end(), all.begin() + kLooked.size());
  std::sort(all.begin(), all.end());
  return all;
}();

// Where between two places, of which one lies below and one above, the path comes to `value`.
double PlaceOf(const JointPath& path, double low, double high, double value) {
  constexpr int kBisections = 30;  // to 1e-9 of a step
  const bool rises = path.Value(high) > path.Value(low);
  for (int k = 0; k < kBisections; ++k) {
    const double middle = 0.5 * (low + high);
    ((path.Value(middle) < value) == rises ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

// Whether a table along the first `end` of a path is a quartic but for `part` of its range: looked
// at where the path meets its points, and between them.
bool TableSeen(const MomentTable& table, const JointPath& path, double end, double part) {
  std::array<double, kInOrder.size()> q{};
  for (std::size_t k = 0; k < q.size(); ++k) q[k] = path.Value(end * kInOrder[k]);
  const auto [low, high] = std::minmax_element(q.begin(), q.end());
  const std::vector<double>& knots = table.knots();
  const auto first = std::upper_bound(knots.begin(), knots.end(), *low);
  const auto last = std::lower_bound(first, knots.end(), *high);
  if (first == last) return true;  // one cubic
  if (last - first > TableWatch::kMostKnots) return false;
  std::array<double, kQuarticPlaces.size()> values{};
  for (std::size_t k = 0; k < values.size(); ++k) {
    values[k] = table.At(path.Value(end * kQuarticPlaces[k])).moment;
  }
  const double allowed = part * table.range();
  const auto off = [&](double s) {
    return std::fabs(table.At(path.Value(s)).moment - QuarticAt(values, s / end)) > allowed;
  };
  double before = 0.0;
  for (std::size_t k = 0; k + 1 < q.size(); ++k) {
    const bool rises = q[k + 1] > q[k];
    auto from = std::upper_bound(first, last, std::min(q[k], q[k + 1]));
    const auto to = std::lower_bound(from, last, std::max(q[k], q[k + 1]));
    for (auto count = to - from, i = count - count; i < count; ++i) {
      const double knot = rises ? from[i] : from[count - 1 - i];
      const double at = PlaceOf(path, end * kInOrder[k], end * kInOrder[k + 1], knot);
      if (off(at) || off(0.5 * (before + at))) return false;
      before = at;
    }
    if (off(end * kInOrder[k + 1])) return false;
  }
  return !off(0.5 * (before + end));
}

}  // namespace

double PathWatch::TablePart(int k, double t, double h, const double* state, const double* trial) {
  const MomentTable& table = tables_.law(k);
  const JointPath path = PathOf(t, h, state, trial, tables_.coordinate(k));
  const double shortest =
      TableWatch::kShortestTravel * (table.knots().back() - table.knots().front());
  double part = 1.0;
  while (!TableSeen(table, path, part, part_)) {
    const double before = part;
    part *= 0.5;
    if (std::fabs(path.Value(part) - path.Value(0.0)) < shortest) return before;
  }
  return part;
}

double PathWatch::Part(double t, double h, const double* state, const double* trial) {
  double part = 1.0;
  for (int k = 0; k < friction_.count(); ++k) {
    part = std::min(part, FrictionPart(k, t, h, state, trial));
  }
  for (int k = 0; k < tables_.count(); ++k) {
    part = std::min(part, TablePart(k, t, h, state, trial));
  }
  return part;
}

}  // namespace unfurl::sim
