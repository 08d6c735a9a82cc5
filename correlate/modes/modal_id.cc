#include "correlate/modes/modal_id.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/statistics.h"
#include "correlate/modes/decay_information.h"
#include "correlate/modes/matrix_pencil.h"
#include "correlate/modes/turn.h"

namespace unfurl::correlate {

namespace {

using Complex = std::complex<double>;

struct ModeCandidate {
  StabilisationPole pole;
  Eigen::VectorXcd shape;
};

bool Near(const ModeCandidate& a, const ModeCandidate& b, const ModalOptions& options) {
  return std::abs(a.pole.frequency - b.pole.frequency) <=
             options.frequency_tolerance * a.pole.frequency &&
         ModalAssurance(a.shape, b.shape) >= 1.0 - options.shape_tolerance;
}

// All poles of the band, order by order, each marked by how the order before knows it.
std::vector<std::vector<ModeCandidate>> Diagram(const std::vector<PencilOrder>& orders, double low,
                                                double high, const ModalOptions& options) {
  constexpr double kSameDamping = 0.002;  // absolute: light dampings scatter by more than a tenth
  std::vector<std::vector<ModeCandidate>> out;
  for (const PencilOrder& order : orders) {
    std::vector<ModeCandidate> row;
    for (std::size_t k = 0; k < order.poles.size(); ++k) {
      const Complex s = order.poles[k];
      ModeCandidate c;
      c.pole.order = order.order;
      c.pole.frequency = std::abs(s) / kTau;
      c.pole.damping = -s.real() / std::abs(s);
      c.shape = order.shapes[k];
      if (!(s.imag() > 0.0) || c.pole.frequency < low || c.pole.frequency > high ||
          std::abs(c.pole.damping) > options.max_damping) {
        continue;
      }
      const ModeCandidate* before = nullptr;
      if (!out.empty()) {
        for (const ModeCandidate& b : out.back()) {
          if (before == nullptr || std::abs(b.pole.frequency - c.pole.frequency) <
                                       std::abs(before->pole.frequency - c.pole.frequency)) {
            before = &b;
          }
        }
      }
      if (before != nullptr) {
        c.pole.stable_frequency = std::abs(before->pole.frequency - c.pole.frequency) <=
                                  options.frequency_tolerance * c.pole.frequency;
        c.pole.stable_damping =
            std::abs(before->pole.damping - c.pole.damping) <=
            std::max(kSameDamping, options.damping_tolerance * std::abs(c.pole.damping));
        c.pole.stable_shape =
            ModalAssurance(before->shape, c.shape) >= 1.0 - options.shape_tolerance;
      }
      row.push_back(std::move(c));
    }
    out.push_back(std::move(row));
  }
  return out;
}

struct Cluster {
  std::vector<const ModeCandidate*> members;  // one of an order at most, rising orders
  double frequency() const {
    std::vector<double> f;
    for (const ModeCandidate* c : members) f.push_back(c->pole.frequency);
    return Median(f);
  }
  Complex pole() const {
    std::vector<double> d;
    for (const ModeCandidate* c : members) d.push_back(c->pole.damping);
    const double size = kTau * frequency();
    const double zeta = std::clamp(Median(d), -0.9, 0.9);
    return {-zeta * size, size * std::sqrt(1.0 - zeta * zeta)};
  }
};

std::vector<Cluster> Clusters(const std::vector<std::vector<ModeCandidate>>& diagram,
                              const ModalOptions& options) {
  constexpr std::size_t kFewest = 4;  // stable poles
  std::vector<Cluster> clusters;
  for (const auto& row : diagram) {
    for (const ModeCandidate& c : row) {
      if (!c.pole.stable()) continue;
      Cluster* home = nullptr;
      for (Cluster& cluster : clusters) {
        const ModeCandidate* last = cluster.members.back();
        if (last->pole.order == c.pole.order || !Near(*last, c, options)) continue;
        if (home == nullptr ||
            std::abs(last->pole.frequency - c.pole.frequency) <
                std::abs(home->members.back()->pole.frequency - c.pole.frequency)) {
          home = &cluster;
        }
      }
      if (home == nullptr) home = &clusters.emplace_back();
      home->members.push_back(&c);
    }
  }
  const int last_order = 2 * static_cast<int>(diagram.size());
  std::erase_if(clusters, [&](const Cluster& c) {
    const double orders = 0.5 * (last_order - c.members.front()->pole.order) + 1.0;
    // Noise-free records have few orders, and then half of those will do.
    const std::size_t fewest = std::min<std::size_t>(kFewest, (diagram.size() + 1) / 2);
    return c.members.size() < fewest ||
           static_cast<double>(c.members.size()) < options.persistence * orders;
  });
  std::stable_sort(clusters.begin(), clusters.end(), [](const Cluster& a, const Cluster& b) {
    return a.members.size() > b.members.size();
  });
  return clusters;
}

// Bayesian information criterion: what an extra pole and its amplitudes must explain.
double EvidenceAsked(std::size_t signals, std::size_t samples) {
  return (2.0 * static_cast<double>(signals) + 2.0) *
         std::log(static_cast<double>(std::max<std::size_t>(samples, 2)));
}

// Index of a mode that is none, or that another already stands for; -1 when all are good.
int WorstMode(const DecayFit& fit, std::size_t signals, double low, double high, double duration,
              const ModalOptions& options) {
  constexpr double kLeastShare = 1e-12;  // a millionth of the amplitude: round-off of exact records
  int worst = -1;
  double least = std::numeric_limits<double>::infinity();
  const double asked = EvidenceAsked(signals, fit.samples);
  for (std::size_t k = 0; k < fit.modes.size(); ++k) {
    const Mode& m = fit.modes[k];
    bool bad = !(m.evidence >= asked) || m.share < kLeastShare || m.frequency < low ||
               m.frequency > high || m.damping > options.max_damping ||
               m.damping < -3.0 * m.damping_sigma - 1e-6;
    for (std::size_t l = 0; l < fit.modes.size() && !bad; ++l) {
      // Two poles nearer than a tenth of what the record resolves are one mode split in two.
      bad = l != k && std::abs(fit.modes[l].pole - m.pole) < 0.1 * kTau / duration &&
            fit.modes[l].evidence >= m.evidence && (l < k || fit.modes[l].evidence > m.evidence);
    }
    const double evidence = std::isfinite(m.evidence) ? m.evidence : 0.0;
    if (bad && evidence < least) {
      least = evidence;
      worst = static_cast<int>(k);
    }
  }
  return worst;
}

// The time that the signals span [s].
double DurationOf(std::span<const DecaySignal> signals) {
  double first = std::numeric_limits<double>::infinity(), last = -first;
  for (const DecaySignal& s : signals) {
    if (s.t.empty()) continue;
    first = std::min(first, s.t.front());
    last = std::max(last, s.t.back());
  }
  return last - first;
}

// The poles of the stable clusters to begin with. Clusters of noise go at once, before anything is
// iterated: those whose amplitudes explain less than half of what a pole is asked to.
std::vector<Complex> StartingPoles(std::span<const DecaySignal> signals,
                                   std::vector<Cluster> clusters, double duration,
                                   const ModalOptions& options) {
  if (clusters.size() > static_cast<std::size_t>(options.most)) {
    clusters.resize(static_cast<std::size_t>(options.most));
  }
  std::vector<Complex> poles;
  for (const Cluster& c : clusters) {
    // Nothing grows in a free decay, but for what noise makes of a damping near zero.
    if (c.pole().real() * duration < 1.0) poles.push_back(c.pole());
  }
  if (poles.size() < 2) return poles;
  DecayOptions still = options.decay;
  still.max_iterations = 0;
  const DecayFit at_start = FitDecay(signals, poles, still);
  std::vector<Complex> strong;
  for (const Mode& m : at_start.modes) {
    if (m.evidence > 0.5 * EvidenceAsked(signals.size(), at_start.samples)) {
      strong.push_back(m.pole);
    }
  }
  return strong.empty() ? poles : strong;
}

int LeastEvident(const std::vector<Mode>& modes) {
  const auto least = std::min_element(modes.begin(), modes.end(), [](const Mode& a, const Mode& b) {
    return a.evidence < b.evidence;
  });
  return static_cast<int>(least - modes.begin());
}

// Backward elimination: fits all poles, drops the worst, and fits again until every one that is
// left is a mode. A fit that does not settle with none to blame loses the one of least evidence.
DecayFit Eliminate(std::span<const DecaySignal> signals, std::vector<Complex> poles, double low,
                   double high, double duration, const ModalOptions& options) {
  DecayFit fit = FitDecay(signals, poles, options.decay);
  while (!poles.empty()) {
    int drop = static_cast<int>(poles.size()) - 1;
    if (!fit.modes.empty()) {
      drop = WorstMode(fit, signals.size(), low, high, duration, options);
      if (drop < 0 && fit.Usable()) break;
      if (drop < 0) drop = LeastEvident(fit.modes);
      poles.clear();
      for (const Mode& m : fit.modes) poles.push_back(m.pole);
    }
    poles.erase(poles.begin() + drop);
    fit = FitDecay(signals, poles, options.decay);
  }
  if (fit.modes.empty() && fit.samples > 0) {
    fit.status = DecayStatus::kNothingFound;
    fit.message = "no pole stays where it is from order to order";
  }
  return fit;
}

// The poles of the diagram, each stable one with the mode that it is nearest to.
void AssignPoles(const std::vector<std::vector<ModeCandidate>>& diagram,
                 const ModalOptions& options, ModalFit* out) {
  for (const auto& row : diagram) {
    for (const ModeCandidate& c : row) {
      StabilisationPole pole = c.pole;
      double nearest = 2.0 * options.frequency_tolerance;
      for (std::size_t k = 0; k < out->decay.modes.size() && pole.stable(); ++k) {
        const double f = out->decay.modes[k].frequency;
        const double off = std::abs(f - pole.frequency) / f;
        if (off >= nearest) continue;
        nearest = off;
        pole.mode = static_cast<int>(k);
      }
      if (pole.mode >= 0) ++out->decay.modes[static_cast<std::size_t>(pole.mode)].members;
      out->poles.push_back(pole);
    }
  }
}

// The first samples of each signal.
std::vector<DecaySignal> FirstSamples(std::span<const DecaySignal> signals, std::size_t most) {
  std::vector<DecaySignal> out;
  for (const DecaySignal& s : signals) {
    const auto n = static_cast<std::ptrdiff_t>(std::min(most, s.t.size()));
    out.push_back({s.name,
                   {s.t.begin(), s.t.begin() + n},
                   {s.value.begin(), s.value.begin() + n},
                   {s.sigma.begin(), s.sigma.empty() ? s.sigma.end() : s.sigma.begin() + n}});
  }
  return out;
}

ModalFit IdentifyWhole(std::span<const DecaySignal> signals, const ModalOptions& options) {
  ModalFit out;
  const double duration = DurationOf(signals);
  if (signals.empty() || !(duration > 0.0)) {
    out.decay.message = "no samples";
    return out;
  }
  // 1. Poles of rising orders by the matrix pencil, and which of them stay from order to order.
  const EvenSignals even = OnEvenGrid(signals, options.decay.trend, options.high);
  out.step = even.step;
  out.low = options.low > 0.0 ? options.low : 1.0 / duration;
  out.high = std::min(options.high, even.high);
  const std::vector<PencilOrder> orders = MatrixPencil(even, options.max_order);
  if (orders.empty()) {
    out.decay.message = "no stretch without a gap is long enough";
    return out;
  }
  const auto diagram = Diagram(orders, out.low, out.high, options);
  // 2. Maximum likelihood from their clusters; what the data do not ask for is dropped.
  const std::vector<Complex> poles =
      StartingPoles(signals, Clusters(diagram, options), duration, options);
  out.decay = Eliminate(signals, poles, out.low, out.high, duration, options);
  // 3. The diagram, with the modes named.
  AssignPoles(diagram, options, &out);
  return out;
}

}  // namespace

ModalFit IdentifyModes(std::span<const DecaySignal> signals, const ModalOptions& options) {
  const bool cut = std::any_of(signals.begin(), signals.end(), [&](const DecaySignal& s) {
    return s.t.size() > options.most_samples;
  });
  if (!cut) return IdentifyWhole(signals, options);
  const std::vector<DecaySignal> first = FirstSamples(signals, options.most_samples);
  ModalFit out = IdentifyWhole(first, options);
  const double window = DurationOf(first), whole = DurationOf(signals);
  out.cut = true;
  out.until = -std::numeric_limits<double>::infinity();
  for (const DecaySignal& s : first) {
    if (!s.t.empty()) out.until = std::max(out.until, s.t.back());
  }
  for (Mode& mode : out.decay.modes) {
    mode.information = InformationShare(-mode.pole.real(), window, whole);
  }
  return out;
}

std::vector<ModePair> PairModes(const std::vector<Mode>& a, const std::vector<Mode>& b,
                                double tolerance) {
  constexpr double kAlike = 0.5;  // MAC: more in common than not
  std::vector<ModePair> candidates;
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (std::size_t j = 0; j < b.size(); ++j) {
      const double off = std::abs(a[i].frequency - b[j].frequency) / a[i].frequency;
      const bool same = a[i].shape.size() == b[j].shape.size();
      const double mac = same ? ModalAssurance(a[i].shape, b[j].shape) : 0.0;
      if (off <= tolerance && (!same || mac >= kAlike)) {
        candidates.push_back({static_cast<int>(i), static_cast<int>(j), mac});
      }
    }
  }
  auto off = [&](const ModePair& p) {
    const double f = a[static_cast<std::size_t>(p.a)].frequency;
    return std::abs(b[static_cast<std::size_t>(p.b)].frequency - f) / f;
  };
  std::stable_sort(candidates.begin(), candidates.end(),
                   [&](const ModePair& x, const ModePair& y) { return off(x) < off(y); });
  std::vector<int> partner_a(a.size(), -1), partner_b(b.size(), -1);
  std::vector<double> mac(a.size(), 0.0);
  for (const ModePair& p : candidates) {
    auto& pa = partner_a[static_cast<std::size_t>(p.a)];
    auto& pb = partner_b[static_cast<std::size_t>(p.b)];
    if (pa >= 0 || pb >= 0) continue;
    pa = p.b;
    pb = p.a;
    mac[static_cast<std::size_t>(p.a)] = p.mac;
  }
  std::vector<ModePair> out;
  for (std::size_t i = 0; i < a.size(); ++i) {
    out.push_back({static_cast<int>(i), partner_a[i], mac[i]});
  }
  for (std::size_t j = 0; j < b.size(); ++j) {
    if (partner_b[j] < 0) out.push_back({-1, static_cast<int>(j), 0.0});
  }
  return out;
}

}  // namespace unfurl::correlate
