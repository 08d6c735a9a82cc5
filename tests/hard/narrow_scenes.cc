#include "tests/hard/narrow_scenes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/random.h"
#include "tests/verification/reference.h"

namespace unfurl::sim {
namespace {

constexpr double kGravity = 9.81;  // [m/s^2]
constexpr double kSampleTime = 0.01;
constexpr int kMost = 4;  // coordinates: a cart and three bars
// Hertz stiffness [N/m^1.5], damping [N s/m], shape [-], depth of the transition zone [m], lever
// [m]
constexpr double kK = 5e8, kC = 4000.0, kQ = 3.0, kEpsilon = 5e-6, kLever = 0.03;

struct Bar {
  double length, mass, inertia;        // [m], [kg], [kg m^2]
  double theta, rate;                  // at the start [rad], [rad/s]
  double stiffness, preload;           // [N m/rad], [rad]
  double damping = 0.0;                // [N m s/rad]
  double drag = 0.0;                   // quadratic damper [N m s^2/rad^2]
  double friction = 0.0, creep = 1.0;  // [N m], [rad/s]
  double snap = 0.0, snap_at = 0.0,
         snap_width = 1.0;  // a table's peak [N m], where and how wide [rad]
  double stop = -1.0;       // a latch's clearance; negative: none [rad]
  bool latched = false;
};

// A monotone cubic through (at - width, 0), (at, peak), (at + width, 0), zero beyond: flat at all
// three, so twice 3 s^2 - 2 s^3.
double Snap(const Bar& bar, double theta) {
  const double s = 1.0 - std::fabs(theta - bar.snap_at) / bar.snap_width;
  return s <= 0.0 ? 0.0 : bar.snap * s * s * (3.0 - 2.0 * s);
}

double Stop(double depth, double depth_rate) {
  if (depth <= 0.0) return 0.0;
  const double T = depth < kEpsilon ? std::exp(2.0 * (depth - kEpsilon) * kQ / kEpsilon) : 1.0;
  return std::max(0.0, kK * depth * std::sqrt(depth) + kC * T * depth_rate);
}

struct Chain {
  std::vector<Bar> bars;
  double cart = 0.0;  // its mass; 0: none [kg]
  double cart_stiffness = 0.0, cart_friction = 0.0, cart_creep = 1.0;
  double cart_x = 0.0;                                                         // at the start [m]
  double g = 0.0;                                                              // [m/s^2]
  double near_stiffness = 0.0, near_length = 0.0, near_x = 0.0, near_y = 0.0;  // [N/m], [m]

  int first() const { return cart > 0.0 ? 1 : 0; }
  int count() const { return first() + static_cast<int>(bars.size()); }
  void Tip(const std::vector<double>& q, std::size_t bar, double* x, double* y) const {
    *x = first() > 0 ? q[0] : 0.0;
    *y = 0.0;
    double angle = 0.0;
    for (std::size_t b = 0; b <= bar; ++b) {
      angle += q[first() + b];
      *x += bars[b].length * std::cos(angle);
      *y += bars[b].length * std::sin(angle);
    }
  }
  double Moment(const Bar& bar, double theta, double rate) const {
    double moment = -bar.stiffness * (theta + bar.preload) - bar.damping * rate -
                    bar.drag * std::fabs(rate) * rate - bar.friction * std::tanh(rate / bar.creep) +
                    Snap(bar, theta);
    if (bar.stop >= 0.0) {
      if (bar.latched) moment -= kLever * Stop(kLever * (theta - bar.stop), kLever * rate);
      moment += kLever * Stop(kLever * (-theta - bar.stop), -kLever * rate);
    }
    return moment;
  }
  // q, then q'.
  void Rate(const std::vector<double>& s, std::vector<double>& out) const;
};

// Lagrange's equations of x and the angles phi_k = sum of theta: with b_jk the part of e(phi_k) in
// the place of bar j's centre, S_kl = sum m_j b_jk b_jl and s_k = sum m_j b_jk,
//   sum_l (S_kl cos(phi_k - phi_l) + I_k) phi_l'' - s_k sin(phi_k) x''
//       = -sum_l S_kl sin(phi_k - phi_l) phi_l'^2 - s_k g cos(phi_k) + M_k - M_k+1,
//   M x'' - sum s_k sin(phi_k) phi_k'' = sum s_k cos(phi_k) phi_k'^2 + F.
void Chain::Rate(const std::vector<double>& s, std::vector<double>& out) const {
  const int n = count(), f = first(), links = n - f;
  double phi[kMost], spin[kMost], a[kMost][kMost + 1] = {};
  for (int k = 0; k < links; ++k) {
    phi[k] = s[f + k] + (k > 0 ? phi[k - 1] : 0.0);
    spin[k] = s[n + f + k] + (k > 0 ? spin[k - 1] : 0.0);
  }
  double force = 0.0, mass = cart;
  if (f > 0) {
    force = -cart_stiffness * s[0] - cart_friction * std::tanh(s[n] / cart_creep);
    for (const Bar& bar : bars) mass += bar.mass;
  }
  const auto part = [&](int j, int k) {
    return k < j ? bars[k].length : k == j ? 0.5 * bars[k].length : 0.0;
  };
  for (int k = 0; k < links; ++k) {
    double* row = a[f + k];
    double first_moment = 0.0;
    for (int l = 0; l < links; ++l) {
      double S = 0.0;
      for (int j = 0; j < links; ++j) S += bars[j].mass * part(j, k) * part(j, l);
      row[f + l] += S * std::cos(phi[k] - phi[l]);
      row[n] -= S * std::sin(phi[k] - phi[l]) * spin[l] * spin[l];
    }
    for (int j = 0; j < links; ++j) first_moment += bars[j].mass * part(j, k);
    row[f + k] += bars[k].inertia;
    row[n] -= first_moment * g * std::cos(phi[k]);
    const double moment = Moment(bars[k], s[f + k], s[n + f + k]);
    row[n] += moment;
    if (k > 0) a[f + k - 1][n] -= moment;
    if (f > 0) {
      row[0] -= first_moment * std::sin(phi[k]);
      a[0][f + k] -= first_moment * std::sin(phi[k]);
      force += first_moment * std::cos(phi[k]) * spin[k] * spin[k];
    }
  }
  if (f > 0) {
    a[0][0] = mass;
    a[0][n] = force;
  }
  if (near_stiffness > 0.0) {
    double x = 0.0, y = 0.0;
    Tip(s, bars.size() - 1, &x, &y);
    const double dx = near_x - x, dy = near_y - y, d = std::hypot(dx, dy);
    const double tension = near_stiffness * (d - near_length) / d;
    if (f > 0) a[0][n] += tension * dx;
    for (int k = 0; k < links; ++k) {
      a[f + k][n] += tension * bars[k].length * (dy * std::cos(phi[k]) - dx * std::sin(phi[k]));
    }
  }
  for (int p = 0; p < n; ++p) {  // positive definite: no pivoting
    for (int r = p + 1; r < n; ++r) {
      const double factor = a[r][p] / a[p][p];
      for (int c = p; c <= n; ++c) a[r][c] -= factor * a[p][c];
    }
  }
  double second[kMost];
  for (int p = n - 1; p >= 0; --p) {
    second[p] = a[p][n];
    for (int c = p + 1; c < n; ++c) second[p] -= a[p][c] * second[c];
    second[p] /= a[p][p];
  }
  for (int k = 0; k < n; ++k) {
    out[k] = s[n + k];
    const bool inner = k > f;  // relative angles
    out[n + k] = second[k] - (inner ? second[k - 1] : 0.0);
  }
}

std::string BarText(const Bar& bar, int k, bool cart) {
  std::string t =
      fmt::format("[body.b{}]\nmass = {:.17g}\ninertia = {:.17g}\n", k, bar.mass, bar.inertia);
  const std::string inner = k > 0 ? fmt::format("b{}", k - 1) : cart ? "cart" : "ground";
  const double at = k > 0 ? 0.0 : 0.0;
  (void)at;
  t += fmt::format(
      "[joint.j{0}]\ninner = \"{1}\"\nouter = \"b{0}\"\nouter_point = [{2:.17g}, 0.0]\n"
      "theta = {3:.17g}\ntheta_rate = {4:.17g}\n",
      k, inner, -0.5 * bar.length, bar.theta, bar.rate);
  return t;
}

std::string LawsText(const Bar& bar, int k) {
  std::string t = fmt::format("[joint.j{}.spring]\nstiffness = {:.17g}\npreload = {:.17g}\n", k,
                              bar.stiffness, bar.preload);
  if (bar.damping > 0.0) {
    t += fmt::format("[joint.j{}.damper]\ndamping = {:.17g}\n", k, bar.damping);
  }
  if (bar.drag > 0.0) {
    t += fmt::format("[joint.j{}.quadratic_damper]\ndamping = {:.17g}\n", k, bar.drag);
  }
  if (bar.friction > 0.0) {
    t += fmt::format("[joint.j{}.friction]\nmoment = {:.17g}\ncreep_rate = {:.17g}\n", k,
                     bar.friction, bar.creep);
  }
  if (bar.snap != 0.0) {
    t += fmt::format(
        "[joint.j{}.table]\ntheta = [-40.0, {:.17g}, {:.17g}, {:.17g}, 40.0]\n"
        "moment = [0.0, 0.0, {:.17g}, 0.0, 0.0]\n",
        k, bar.snap_at - bar.snap_width, bar.snap_at, bar.snap_at + bar.snap_width, bar.snap);
  }
  if (bar.stop >= 0.0) {
    t += fmt::format(
        "[joint.j{0}.latch]\ntheta_a = {1:.17g}\ntheta_b = {1:.17g}\nlever = {2}\n"
        "contact = \"lock\"\n",
        k, bar.stop, kLever);
  }
  return t;
}

// `pushed`: by entry of the state at the start.
void Solve(Chain chain, double duration, const std::vector<double>& pushed, Tracks* out) {
  const int n = chain.count(), f = chain.first();
  reference::Integrator integrator;
  integrator.tolerance = 1e-13;
  integrator.largest_step = [](const std::vector<double>&) { return 2e-3; };
  // Guards sit at the edges and the middles of what is narrow.
  auto& guards = integrator.guards;
  std::vector<int> latch_of;
  const auto guard = [&](reference::Integrator::Guard g, int latch = -1) {
    guards.push_back(std::move(g));
    latch_of.push_back(latch);
  };
  const auto band = [&](int entry, double creep) {
    for (const double edge : {-20.0, -2.0, 0.0, 2.0, 20.0}) {
      guard([=](double, const std::vector<double>& y) { return y[entry] - edge * creep; });
    }
  };
  if (chain.cart_friction > 0.0) band(n, chain.cart_creep);
  for (std::size_t b = 0; b < chain.bars.size(); ++b) {
    const Bar& bar = chain.bars[b];
    const int at = f + static_cast<int>(b);
    if (bar.friction > 0.0) band(n + at, bar.creep);
    if (bar.drag > 0.0) guard([=](double, const std::vector<double>& y) { return y[n + at]; });
    if (bar.snap != 0.0) {
      for (const double edge : {-1.0, 0.0, 1.0}) {
        const double knot = bar.snap_at + edge * bar.snap_width;
        guard([=](double, const std::vector<double>& y) { return y[at] - knot; });
      }
    }
    if (bar.stop >= 0.0) {
      const double stop = bar.stop, zone = stop + kEpsilon / kLever;
      guard([=](double, const std::vector<double>& y) { return y[at] - stop; },
            static_cast<int>(b));
      guard([=](double, const std::vector<double>& y) { return y[at] - zone; });
      guard([=](double, const std::vector<double>& y) { return -y[at] - stop; });
      guard([=](double, const std::vector<double>& y) { return -y[at] - zone; });
      // Where a pressed stop's force comes to zero.
      for (const double side : {1.0, -1.0}) {
        guard([=](double, const std::vector<double>& y) {
          const double depth = kLever * (side * y[at] - stop), rate = kLever * side * y[n + at];
          if (depth <= 0.0) return 1.0;
          const double T =
              depth < kEpsilon ? std::exp(2.0 * (depth - kEpsilon) * kQ / kEpsilon) : 1.0;
          return kK * depth * std::sqrt(depth) + kC * T * rate;
        });
      }
    }
  }
  integrator.crossing = [&](int g, bool positive, double, std::vector<double>&) {
    if (latch_of[g] >= 0 && !positive) chain.bars[latch_of[g]].latched = true;
  };
  std::vector<double> y(2 * n, 0.0);
  if (f > 0) y[0] = chain.cart_x;
  for (std::size_t b = 0; b < chain.bars.size(); ++b) {
    y[f + b] = chain.bars[b].theta;
    y[n + f + b] = chain.bars[b].rate;
  }
  for (std::size_t k = 0; k < pushed.size(); ++k) y[k] += pushed[k];
  const std::vector<std::vector<double>> states = integrator.Run(
      [&](double, const std::vector<double>& s, std::vector<double>& rate) { chain.Rate(s, rate); },
      y, reference::EvenTimes(duration, static_cast<int>(std::lround(duration / kSampleTime))));
  for (std::size_t b = 0; b < chain.bars.size(); ++b) {
    out->x.emplace_back();
    out->y.emplace_back();
    for (const std::vector<double>& s : states) {
      double tip_x = 0.0, tip_y = 0.0;
      chain.Tip(s, b, &tip_x, &tip_y);
      out->x.back().push_back(tip_x);
      out->y.back().push_back(tip_y);
    }
  }
}

// By how much the scene itself magnifies what a state is off by at its start, as parts of the tips'
// ranges over parts of 1 rad and of a fifth of the duration: a stop turns an angle's error into one
// of the speed, and a spring that just misses a point throws what passes it apart.
double MagnificationOf(const Chain& chain, double duration, const Tracks& truth, Rng* rng) {
  constexpr double kPush = 1e-7;
  constexpr int kTimes = 3;
  const auto n = static_cast<std::size_t>(chain.count());
  double most = 0.0;
  for (int time = 0; time < kTimes; ++time) {
    std::vector<double> pushed(2 * n);
    for (std::size_t k = 0; k < 2 * n; ++k) {
      pushed[k] = kPush * (rng->Uniform() < 0.5 ? 1.0 : -1.0) * (k < n ? 1.0 : 5.0 / duration);
    }
    Tracks other;
    Solve(chain, duration, pushed, &other);
    most = std::max(most, PartApart(other, truth) / kPush);
  }
  return most;
}

}  // namespace

double PartApart(const Tracks& tracks, const Tracks& truth) {
  const auto range = [](const std::vector<double>& v) {
    const auto [least, most] = std::minmax_element(v.begin(), v.end());
    return *most - *least;
  };
  double worst = 0.0;
  for (std::size_t m = 0; m < truth.x.size(); ++m) {
    const std::vector<double>&x = truth.x[m], &y = truth.y[m];
    double off = 0.0;
    for (std::size_t k = 0; k < x.size(); ++k) {
      off = std::max(off, std::hypot(tracks.x[m][k] - x[k], tracks.y[m][k] - y[k]));
    }
    worst = std::max(worst, off / std::hypot(range(x), range(y)));
  }
  return worst;
}

NarrowScene DrawNarrowScene(std::uint64_t seed) {
  Rng rng(seed);
  const auto between = [&](double low, double high) { return low + (high - low) * rng.Uniform(); };
  const auto power = [&](double low, double high) { return std::pow(10.0, between(low, high)); };
  const auto chance = [&](double p) { return rng.Uniform() < p; };
  NarrowScene out;
  Chain chain;
  const int bars = 1 + static_cast<int>(3.0 * rng.Uniform());
  const bool from_rest = chance(0.6);
  const double duration = 0.01 * std::round(100.0 * between(1.0, 2.5));
  chain.g = chance(0.3) ? kGravity : 0.0;
  if (chance(0.25)) {
    chain.cart = between(0.5, 3.0);
    chain.cart_stiffness = power(0.5, 2.0);
    chain.cart_x = between(0.05, 0.3);
    chain.cart_friction = chance(0.7) ? between(0.02, 0.3) * chain.cart_stiffness * 0.2 : 0.0;
    chain.cart_creep = power(-5.0, -2.0);
    out.contains[0] |= chain.cart_friction > 0.0;
  }
  for (int k = 0; k < bars; ++k) {
    Bar bar{};
    bar.creep = bar.snap_width = 1.0;
    bar.stop = -1.0;
    bar.length = between(0.4, 1.2);
    bar.mass = between(0.2, 2.0);
    bar.inertia = bar.mass * bar.length * bar.length / 12.0;
    bar.theta = between(0.3, 1.5) * (k > 0 && chance(0.5) ? 1.4 : 1.0);
    bar.rate = from_rest ? 0.0 : -between(0.0, 2.0);
    bar.stiffness = power(0.0, 1.5);
    bar.preload = chance(0.5) ? 0.0 : between(0.0, 0.5);
    const int law = static_cast<int>(6.0 * rng.Uniform());
    if (law <= 2) {
      bar.friction = between(0.01, 0.3) * bar.stiffness;
      bar.creep = power(-5.0, -2.0);
      out.contains[0] = true;
    }
    if (law == 2 || law == 3) {
      bar.snap_at = between(0.3, 1.0) * (bar.theta + bar.preload) - bar.preload;
      bar.snap_width = power(-3.0, -1.0);
      // Of the spring's energy, what the snap takes or gives.
      const double energy = 0.5 * bar.stiffness * std::pow(bar.theta + bar.preload, 2);
      bar.snap = (chance(0.5) ? 1.0 : -1.0) * between(0.02, 0.2) * energy / bar.snap_width;
      out.contains[1] = true;
    }
    if (law == 4) {
      bar.stop = between(0.001, 0.006);
      out.contains[2] = true;
    }
    if (chance(0.3)) bar.damping = power(-3.0, -1.0);
    if (law == 5 || chance(0.2)) bar.drag = power(-2.0, -0.5);
    chain.bars.push_back(bar);
  }
  std::string& t = out.toml;
  t = fmt::format("[scene]\nname = \"narrow {}\"\nduration = {}\n", seed, duration);
  t += fmt::format("[contact.lock]\nK = {}\nC = {}\nQ = {}\nepsilon = {}\n", kK, kC, kQ, kEpsilon);
  if (chain.cart > 0.0) {
    t += fmt::format(
        "[body.cart]\nmass = {:.17g}\ninertia = 1.0\n[joint.rail]\ntype = \"slider\"\n"
        "inner = \"ground\"\nouter = \"cart\"\ntravel = {:.17g}\n[joint.rail.spring]\n"
        "stiffness = {:.17g}\n",
        chain.cart, chain.cart_x, chain.cart_stiffness);
    if (chain.cart_friction > 0.0) {
      t += fmt::format("[joint.rail.friction]\nforce = {:.17g}\ncreep_rate = {:.17g}\n",
                       chain.cart_friction, chain.cart_creep);
    }
  }
  for (int k = 0; k < bars; ++k) {
    const Bar& bar = chain.bars[k];
    t += BarText(bar, k, chain.cart > 0.0);
    if (k > 0) t += fmt::format("inner_point = [{:.17g}, 0.0]\n", 0.5 * chain.bars[k - 1].length);
    t += LawsText(bar, k);
    t += fmt::format("[mark.m{0}]\non = \"b{0}\"\npoint = [{1:.17g}, 0.0]\n", k, 0.5 * bar.length);
  }
  if (chance(0.2)) {
    // Beside where the tip will pass.
    std::vector<double> q(static_cast<std::size_t>(chain.count()), 0.0);
    for (int k = 0; k < bars; ++k) {
      q[chain.first() + k] = 0.5 * (chain.bars[k].theta - chain.bars[k].preload);
    }
    chain.Tip(q, chain.bars.size() - 1, &chain.near_x, &chain.near_y);
    chain.near_x += power(-4.0, -1.5);
    chain.near_length = between(0.01, 0.3);
    chain.near_stiffness = power(-0.5, 1.5);
    out.contains[3] = true;
    t += fmt::format(
        "[spring.near]\na = \"b{}\"\na_point = [{:.17g}, 0.0]\nb = \"ground\"\nb_point = [{:.17g}, "
        "{:.17g}]\nstiffness = {:.17g}\nfree_length = {:.17g}\n",
        bars - 1, 0.5 * chain.bars.back().length, chain.near_x, chain.near_y, chain.near_stiffness,
        chain.near_length);
  }
  if (chain.g > 0.0) t += fmt::format("[gravity]\nacceleration = [0.0, -{}]\n", chain.g);
  Solve(chain, duration, {}, &out.truth);
  out.magnifies = MagnificationOf(chain, duration, out.truth, &rng);
  return out;
}

}  // namespace unfurl::sim
