// Sets of cameras against each other. Faults are found one camera after another, and one camera may
// be found in place of two others that were bumped at once: with four cameras and marks that hardly
// move any camera's shift looks like that of two others together. So the faults of each moment are
// held against those of all other sets of cameras, no larger than by one.
#include "measure/health_rivals.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <optional>
#include <utility>

#include "base/statistics.h"
#include "measure/camera_sets.h"
#include "measure/health_view.h"

namespace unfurl::measure {

namespace {

constexpr std::size_t kMostSets = 300;  // of cameras that are looked at: two of 24
// Flashes whose readings contradict each other are looked into from this on: a sound trial has as
// many as cameras have wrong readings [-, of the chance that one is wrong by itself and camera].
constexpr double kContradicts = 2.0;

// Sets of one camera, of two, ..., as many as may be looked at.
std::vector<std::uint32_t> SetsUpTo(int most, std::size_t cameras) {
  std::vector<std::uint32_t> out;
  const auto n = static_cast<unsigned>(cameras);
  for (int size = 1; size <= most; ++size) {
    std::vector<std::uint32_t> of;
    for (unsigned a = 0; a < n; ++a) {
      const std::uint32_t one = 1U << a;
      if (size == 1) of.push_back(one);
      for (unsigned b = a + 1; b < n && size > 1; ++b) {
        const std::uint32_t two = one | 1U << b;
        if (size == 2) of.push_back(two);
        for (unsigned c = b + 1; c < n && size > 2; ++c) of.push_back(two | 1U << c);
      }
    }
    if (out.size() + of.size() > kMostSets) break;
    out.insert(out.end(), of.begin(), of.end());
  }
  return out;
}

// An explanation: sets of cameras, by event, and which others explain it as well.
struct EventExplanation {
  CameraSets::Fit fit;
  double price = HUGE_VAL;     // -2 ln of its probability, beside others of its events [-]
  double apart = 0.0;          // of that, what is not its loss [-]
  std::size_t event = 0;       // that is in doubt
  std::uint32_t doubtful = 0;  // cameras that may be wrong in it; 0: it is certain
  bool several = false;        // more than one at once
};

constexpr int kMostTogether = 3;  // cameras of one moment

// The sets of an event against each other, those of the other events as they are. Where `sure`,
// what is known was found for certain among as many cameras at a time: only more at once are held
// against it.
EventExplanation JudgeEvent(const CameraSets& sets, const HealthOptions& options, std::size_t event,
                            std::size_t cameras, const std::vector<std::uint32_t>& known,
                            bool sure) {
  std::vector<CameraSets::Fit> fits;
  const int most = std::min(std::popcount(known[event]) + 1, kMostTogether);
  for (const std::uint32_t set : SetsUpTo(most, cameras)) {
    std::vector<std::uint32_t> all = known;
    all[event] = set;
    fits.push_back(sets.Solve(all));
  }
  const auto least = std::min_element(fits.begin(), fits.end(),
                                      [](const auto& a, const auto& b) { return a.loss < b.loss; });
  const double wide = least->wide;
  EventExplanation best;
  best.event = event;
  for (const CameraSets::Fit& fit : fits) {
    const double price = sets.Price(fit, wide);
    if (price < best.price) best = {fit, price, price - fit.loss / wide, event, 0, false};
  }
  const std::uint32_t found = best.fit.sets[event];
  double others = 0.0;
  std::uint32_t seen = found;
  best.several = std::popcount(found) > 1;
  for (const CameraSets::Fit& fit : fits) {
    if ((fit.sets[event] & found) == found) continue;
    if (sure && found == known[event] && std::popcount(fit.sets[event]) == std::popcount(found)) {
      continue;
    }
    const double share = std::exp(-0.5 * (sets.Price(fit, wide) - best.price));
    others += share;
    if (!(share > options.doubt)) continue;
    seen |= fit.sets[event];
    best.several = best.several || std::popcount(fit.sets[event]) > 1;
  }
  if (others > options.doubt) best.doubtful = seen;
  // Where too few are left that could contradict each other, it has to be a law.
  std::vector<std::uint32_t> all = known;
  all[event] = 0;
  if (cameras < 4 + static_cast<std::size_t>(std::popcount(found)) &&
      !sets.Explains(best.fit, sets.Solve(all), event)) {
    best.doubtful = (1U << cameras) - 1U;
  }
  return best;
}

// Event by event, until one is in doubt.
EventExplanation Judge(const CameraSets& sets, const HealthOptions& options, std::size_t cameras,
                       bool sure) {
  std::vector<std::uint32_t> known;
  for (const CameraEvent& event : sets.events()) known.push_back(event.cameras);
  EventExplanation out;
  for (std::size_t e = 0; e < known.size() && out.doubtful == 0; ++e) {
    out = JudgeEvent(sets, options, e, cameras, known, sure);
    known[e] = out.fit.sets[e];
  }
  if (known.empty()) {
    out.fit = sets.Solve({});
    out.price = sets.Price(out.fit, out.fit.wide);
    out.apart = out.price - out.fit.loss / out.fit.wide;
  }
  return out;
}

std::vector<CameraEvent> EventsOf(const std::vector<Fault>& faults, double span) {
  std::vector<CameraEvent> out;
  for (const Fault& fault : faults) {
    const std::uint32_t camera = 1U << static_cast<unsigned>(fault.camera);
    const auto same = std::find_if(out.begin(), out.end(),
                                   [&](const CameraEvent& event) { return event.Holds(fault); });
    if (same != out.end()) {
      same->cameras |= camera;
      continue;
    }
    out.push_back({fault.kind, fault.from, fault.earliest, fault.latest, fault.at, span, camera});
  }
  return out;
}

std::vector<Fault> FaultsOf(const CameraSets& sets, const EventExplanation& by) {
  std::vector<Fault> out = sets.FaultsOf(by.fit);
  if (by.doubtful == 0) return out;
  // One of them stands for all; what is left cannot be told from it.
  const CameraEvent& event = sets.events()[by.event];
  const auto its = [&](const Fault& fault) { return event.Holds(fault); };
  Fault one = *std::find_if(out.begin(), out.end(), its);
  for (int c = 0; c < 32; ++c) {  // bits
    if ((by.doubtful >> c & 1U) != 0 && c != one.camera) one.suspects.push_back(c);
  }
  one.several = by.several;
  out.erase(std::remove_if(out.begin(), out.end(), its), out.end());
  out.push_back(one);
  return out;
}

// From when on readings contradict each other, and in which share of the flashes of that time.
struct Contradiction {
  CameraEvent event{FaultKind::kMoved, Fault{}.from, Fault{}.from, Fault{}.from};
  double share = 0.0;  // [-]
};

Contradiction FindContradiction(const HealthEvidence& evidence, const Triangulator& triangulator,
                                std::size_t marks) {
  std::vector<Eigen::Vector3d> last(marks, triangulator.centre());
  std::array<double, CameraBank::kMaxCameras> u{}, s{};
  const std::size_t cameras = triangulator.cameras();
  std::vector<double> t;
  std::vector<int> bad = {0};  // so far
  for (std::size_t i = 0; i < evidence.size(); ++i) {
    if (evidence.mark(i) < 0) continue;
    for (std::size_t c = 0; c < cameras; ++c) {
      u[c] = evidence.At(i, c).u_px;
      s[c] = evidence.At(i, c).s_px;
    }
    Eigen::Vector3d& at = last[static_cast<std::size_t>(evidence.mark(i))];
    const PointSolution point = triangulator.Solve({u.data(), cameras}, {s.data(), cameras}, at);
    if (point.readings < 4) continue;
    if (point.outcome == PointOutcome::kSolved) at = point.p;
    t.push_back(evidence.t(i));
    bad.push_back(bad.back() + (point.outcome != PointOutcome::kSolved));
  }
  // -2 ln of the likelihood of two shares, before and after flash j, less than that of one.
  const auto n = static_cast<double>(t.size());
  const auto surprise = [](double all, double of) {
    const double p = std::clamp(of / std::max(all, 1.0), 1e-3, 1.0 - 1e-3);
    return -2.0 * (of * std::log(p) + (all - of) * std::log(1.0 - p));
  };
  std::vector<double> loss;
  for (std::size_t j = 0; j <= t.size(); ++j) {
    const auto before = static_cast<double>(j), wrong = static_cast<double>(bad[j]);
    loss.push_back(surprise(before, wrong) + surprise(n - before, bad.back() - wrong));
  }
  Contradiction out;
  const auto j =
      static_cast<std::size_t>(std::min_element(loss.begin(), loss.end()) - loss.begin());
  constexpr double kSure = 9.0;  // of -2 ln of the likelihood: three sigmas
  out.share = n > 0.0 ? bad.back() / n : 0.0;
  if (j == 0 || j == t.size() || loss[0] < loss[j] + kSure) return out;
  std::size_t first = j, end = j;
  while (first > 1 && loss[first - 1] < loss[j] + kSure) --first;
  while (end + 1 < t.size() && loss[end + 1] < loss[j] + kSure) ++end;
  out.event.from = t[j];
  out.event.earliest = t[first - 1];
  out.event.latest = t[end];
  out.share = (bad.back() - bad[j]) / (n - static_cast<double>(j));
  return out;
}

// Explanations of unlike events.
struct Rival {
  double loss = 0.0, wide = 1.0, apart = 0.0;
  std::vector<Fault> faults;
};

// All by the overdispersion of what misfits least: by its own a misfit would excuse itself.
const Rival& Likeliest(const std::vector<Rival>& rivals) {
  const double wide =
      std::min_element(rivals.begin(), rivals.end(), [](const auto& a, const auto& b) {
        return a.loss < b.loss;
      })->wide;
  return *std::min_element(rivals.begin(), rivals.end(), [&](const auto& a, const auto& b) {
    return a.loss / wide + a.apart < b.loss / wide + b.apart;
  });
}

}  // namespace

void JudgeRivals(const HealthEvidence& raw, const Triangulator& triangulator,
                 const HealthOptions& options, std::size_t marks, std::vector<Fault>* faults) {
  const std::size_t cameras = triangulator.cameras();
  HealthEvidence evidence = raw;
  std::vector<Fault> offsets, late;
  for (const Fault& fault : *faults) {
    (fault.kind == FaultKind::kLate ? late : offsets).push_back(fault);
    if (fault.kind != FaultKind::kLate) continue;
    evidence.Correct({.camera = fault.camera, .from = fault.from, .lag = fault.lag});
  }
  const bool one = late.empty() && offsets.size() == 1;
  Contradiction at;
  if (!one) at = FindContradiction(raw, triangulator, marks);
  if (faults->empty() && at.share < kContradicts * options.wild * static_cast<double>(cameras))
    return;
  const double span = std::max(raw.t(raw.size() - 1) - raw.t(0), 1e-9);
  const CameraSets found(evidence, triangulator, options, marks, EventsOf(offsets, span));
  const bool sure = one && offsets[0].certain();
  const EventExplanation by = Judge(found, options, cameras, sure);
  // Each lag has a price: any number of lines of any camera, from any moment on.
  const double lag = static_cast<double>(2 * options.most_lag) * static_cast<double>(cameras) *
                     static_cast<double>(found.flashes());
  std::vector<Rival> rivals = {{by.fit.loss, by.fit.wide, by.apart, FaultsOf(found, by)}};
  rivals[0].apart += 2.0 * static_cast<double>(late.size()) * std::log(lag);
  rivals[0].faults.insert(rivals[0].faults.begin(), late.begin(), late.end());
  if (!one) {
    // What happened at one moment to one camera or two instead of all that.
    std::vector<CameraEvent> moments = EventsOf(offsets, span);
    moments.push_back(at.event);
    moments.push_back(Contradiction{}.event);
    const std::size_t none =
        CameraSets(raw, triangulator, options, marks, {}).Solve({}).unexplained;
    // As sure as any fault has to be, of all moments and sets that are looked at.
    const double surely =
        2.0 * std::log(static_cast<double>(moments.size() * kMostSets) / options.false_alarm);
    for (CameraEvent& moment : moments) {
      if (moment.kind != FaultKind::kMoved) continue;
      moment.cameras = 1U;
      const CameraSets instead(raw, triangulator, options, marks, {moment});
      const EventExplanation other = Judge(instead, options, cameras, false);
      // It explains most of what contradicts itself without any fault, and not a few by chance.
      if (2 * other.fit.unexplained > none) continue;
      rivals.push_back({other.fit.loss, other.fit.wide,
                        other.apart + (faults->empty() ? surely : 0.0), FaultsOf(instead, other)});
    }
  }
  *faults = Likeliest(rivals).faults;
}

std::vector<double> ShiftsThatShow(const HealthEvidence& evidence, const Triangulator& triangulator,
                                   const HealthOptions& options, std::size_t marks) {
  constexpr double kFound = 0.9;  // of trials [-], as where distances are kept
  const double sigmas = SigmasOfAnOffset(options, triangulator.cameras()) + NormalQuantile(kFound);
  const CameraSets sets(evidence, triangulator, options, marks, {Contradiction{}.event});
  std::vector<double> out;
  for (std::size_t c = 0; c < triangulator.cameras(); ++c) {
    const CameraSets::Fit fit = sets.Solve({1U << static_cast<unsigned>(c)});
    out.push_back(sigmas * std::sqrt(fit.wide * fit.covariance(0, 0)));
  }
  return out;
}

}  // namespace unfurl::measure
