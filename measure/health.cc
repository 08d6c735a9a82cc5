#include "measure/health.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "base/refuse_option.h"
#include "base/statistics.h"
#include "base/text.h"
#include "measure/health_light.h"
#include "measure/health_rivals.h"
#include "measure/health_view.h"

namespace unfurl::measure {

namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t kSlices = 100;  // of a record's time, in the charts

Correction TakenOut(const Fault& fault) {
  return {.camera = fault.camera,
          .from = fault.from,
          .offset_px = fault.offset_px,
          .slope = fault.slope,
          .at = fault.at,
          .sigma_px = fault.sigma_px,
          .slope_sigma = fault.slope_sigma,
          .lag = fault.lag};
}

// The likeliest explanation of what is left in the evidence, of all cameras: a lag that is beyond
// chance, or an offset that has to be judged yet. `flashes`: how many were looked at.
Hypothesis Explain(const HealthEvidence& evidence, const Triangulator& triangulator,
                   const HealthOptions& options, std::size_t marks, std::size_t* flashes) {
  Hypothesis best;
  best.gain = -HUGE_VAL;
  for (std::size_t c = 0; c < triangulator.cameras(); ++c) {
    const CameraView view = ViewOf(evidence, triangulator, static_cast<int>(c), marks);
    if (view.size() == 0) continue;
    *flashes = std::max(*flashes, view.size());
    std::vector<Residuals> by_lag;
    for (int lag = -options.most_lag; lag <= options.most_lag; ++lag) {
      by_lag.push_back(ResidualsOf(evidence, triangulator, view, lag, options.wild));
    }
    const Hypothesis off =
        BestOffset(view, by_lag[static_cast<std::size_t>(options.most_lag)], options.wild);
    const Hypothesis late = BestLag(view, by_lag, options, triangulator.cameras());
    for (const Hypothesis& one : {off, late}) {
      if (one.gain > best.gain) best = one;
    }
  }
  return best;
}

// Slices of a record's time.
struct Slices {
  double from = 0.0, span = 1.0;  // [s]
  std::size_t Of(double t) const {
    return std::min(kSlices - 1, static_cast<std::size_t>((t - from) / span * kSlices));
  }
  double Middle(std::size_t k) const {
    return from + (static_cast<double>(k) + 0.5) * span / kSlices;
  }
};
using BySlice = std::vector<std::vector<double>>;

double MedianOrNone(const std::vector<double>& x) { return x.empty() ? kNone : Median(x); }

// Brightness over the mark's median, and width, of a camera's spots.
void FollowSpots(const HealthEvidence& evidence, std::size_t camera, const Slices& slices,
                 BySlice* gain, BySlice* width) {
  const auto known = [&](std::size_t i) {
    const HealthEvidence::Reading& reading = evidence.At(i, camera);
    return evidence.mark(i) >= 0 && !std::isnan(reading.u_px) && reading.flux > 0.0F;
  };
  std::map<int, std::vector<double>> flux;  // by mark
  for (std::size_t i = 0; i < evidence.size(); ++i) {
    if (known(i)) flux[evidence.mark(i)].push_back(evidence.At(i, camera).flux);
  }
  std::map<int, double> usual;
  for (const auto& [mark, values] : flux) usual[mark] = Median(values);
  for (std::size_t i = 0; i < evidence.size(); ++i) {
    if (!known(i)) continue;
    const std::size_t slice = slices.Of(evidence.t(i));
    (*gain)[slice].push_back(evidence.At(i, camera).flux / usual[evidence.mark(i)]);
    (*width)[slice].push_back(evidence.At(i, camera).width_px);
  }
}

// A camera by slices of time, against what the others predict once all faults but its own are taken
// out.
std::vector<HealthSlice> Follow(const HealthEvidence& raw, const Triangulator& triangulator,
                                const HealthOptions& options, const std::vector<Fault>& faults,
                                std::size_t marks, std::size_t camera) {
  HealthEvidence evidence = raw;
  for (const Fault& fault : faults) {
    Correction taken = TakenOut(fault);
    if (static_cast<std::size_t>(fault.camera) == camera) taken.offset_px = taken.slope = 0.0;
    evidence.Correct(taken);
  }
  const double from = raw.t(0);
  const Slices slices{from, std::max(raw.t(raw.size() - 1) - from, 1e-9)};
  const CameraView view = ViewOf(evidence, triangulator, static_cast<int>(camera), marks);
  const Residuals in = ResidualsOf(evidence, triangulator, view, 0, options.wild);
  BySlice offset(kSlices), gain(kSlices), width(kSlices);
  for (std::size_t i = 0; i < view.size(); ++i) {
    if (in.weight[i] > 0.0) offset[slices.Of(view.t[i])].push_back(in.r[i]);
  }
  FollowSpots(evidence, camera, slices, &gain, &width);
  std::vector<HealthSlice> out;
  for (std::size_t k = 0; k < kSlices; ++k) {
    const std::size_t n = offset[k].size();
    // The median's scatter: 1.2533 times that of a mean.
    const double sigma =
        n < 2 ? kNone : 1.2533 * RobustSigma(offset[k]) / std::sqrt(static_cast<double>(n));
    out.push_back({slices.Middle(k), MedianOrNone(offset[k]), sigma, MedianOrNone(gain[k]),
                   MedianOrNone(width[k])});
  }
  return out;
}

}  // namespace

void HealthOptions::Check() const {
  const RefuseOption refuse("HealthOptions");
  const auto chance = [&](const char* name, double value) {
    if (value > 0.0 && value < 0.5) return;
    refuse(name, fmt::format("{} is not between 0 and 0.5", value), "give a chance");
  };
  chance("false_alarm", false_alarm);
  chance("doubt", doubt);
  chance("together", together);
  chance("wild", wild);
  chance("scatter_alarm", scatter_alarm);
  if (!(scatter_harmless >= 0.0) || !std::isfinite(scatter_harmless)) {
    refuse("scatter_harmless", "is not a share of the squared error", "give 0 or more");
  }
  if (!(least_light > 0.0 && least_light < 1.0)) {
    refuse("least_light", "is not between 0 and 1", "give a share");
  }
  if (most_lag < 0 || most_lag > 1000) {
    refuse("most_lag", "is not from 0 to 1000", "give a number of lines");
  }
}

const char* Name(FaultKind kind) {
  constexpr std::array<const char*, 3> kNames = {"moved", "drifting", "late"};
  return kNames[static_cast<std::size_t>(kind)];
}

Hypothesis BestLag(const CameraView& view, std::span<const Residuals> by_lag,
                   const HealthOptions& options, std::size_t cameras) {
  Hypothesis best;
  best.fault.kind = FaultKind::kLate;
  best.fault.camera = view.camera;
  best.gain = -HUGE_VAL;
  const std::size_t n = view.size();
  const auto middle = static_cast<int>(by_lag.size() / 2);
  const Residuals& now = by_lag[static_cast<std::size_t>(middle)];
  // ln of the number of lags, cameras and moments that may be the one, over the chance of an alarm.
  const double price =
      2.0 * std::log(static_cast<double>(by_lag.size() * cameras * std::max<std::size_t>(n, 1)) /
                     options.false_alarm);
  // Of a mark that stands still two flashes tell the same but for their noise, and the loss of the
  // one less that of the other, two chi-squares of one, has the variance 4.
  const double noise = 2.0 * NormalQuantile(1.0 - options.false_alarm /
                                                      static_cast<double>(by_lag.size() * cameras));
  for (int k = 0; k < static_cast<int>(by_lag.size()); ++k) {
    if (k == middle) continue;
    const Residuals& then = by_lag[static_cast<std::size_t>(k)];
    // What is gained from flash j on.
    std::vector<double> gained(n + 1, 0.0);
    for (std::size_t j = n; j-- > 0;) {
      gained[j] = gained[j + 1];
      if (!(now.weight[j] > 0.0) || !(then.weight[j] > 0.0)) continue;
      gained[j] += LossOf(view, now, j, 0.0) - LossOf(view, then, j, 0.0);
    }
    const auto at = std::max_element(gained.begin(), gained.end());
    const auto from = static_cast<std::size_t>(at - gained.begin());
    const double least = std::max(price, noise * std::sqrt(static_cast<double>(n - from)));
    if (*at <= least || *at - price <= best.gain) continue;
    double over_no_law = 0.0;
    for (std::size_t j = from; j < n; ++j) {
      over_no_law += OverNoLaw(then, j, LossOf(view, then, j, 0.0), options.wild);
    }
    if (over_no_law <= 0.0) continue;
    best.gain = *at - price;
    best.fault.lag = k - middle;
    constexpr double kSure = 9.0;  // of -2 ln of the likelihood: three sigmas
    std::size_t first = from, last = from;
    while (first > 0 && gained[first - 1] >= *at - kSure) --first;
    while (last + 1 < n && gained[last + 1] >= *at - kSure) ++last;
    if (first == 0) {  // from the beginning, as far as anybody can see
      best.fault.from = best.fault.earliest = best.fault.latest = Fault{}.from;
    } else {
      best.fault.from = view.t[from];
      best.fault.earliest = view.t[first - 1];
      best.fault.latest = view.t[last];
    }
  }
  return best;
}

namespace {

// What moved, drifts or is late, one after another.
void FindFaults(const HealthEvidence& raw, const Triangulator& triangulator,
                const HealthOptions& options, std::size_t marks, HealthReport* report) {
  const std::size_t cameras = triangulator.cameras();
  if (cameras < 4) {
    report->unknown = "three cameras leave no reading over to check the others with";
    return;
  }
  HealthEvidence evidence = raw;
  // Beside those that are wrong three must vouch; each may be wrong in two ways, and twice.
  const std::size_t most = 4 * (cameras - 3);
  for (std::size_t round = 0; round < most; ++round) {
    const Hypothesis likeliest = Explain(evidence, triangulator, options, marks, &report->flashes);
    if (report->flashes == 0) {
      report->unknown = "no mark is seen by four cameras at once";
      return;
    }
    if (!std::isfinite(likeliest.gain)) break;
    Fault fault = likeliest.fault;
    if (fault.kind != FaultKind::kLate &&
        !JudgeOffsets(evidence, triangulator, likeliest, options, marks, &fault)) {
      break;
    }
    report->faults.push_back(fault);
    if (!fault.certain()) break;  // what is left cannot be told from it
    evidence.Correct(TakenOut(fault));
  }
  JudgeRivals(raw, triangulator, options, marks, &report->faults);
}

}  // namespace

HealthReport Diagnose(const HealthEvidence& stated, const Triangulator& triangulator,
                      const HealthOptions& options, std::span<const std::string> names) {
  options.Check();
  HealthReport report;
  const std::size_t marks = stated.Marks();
  if (marks == 0) {
    report.unknown = report.scatter.unknown = "no line shows one mark alone";
    return report;
  }
  report.scatter = FindScatter(stated, triangulator, options);
  HealthEvidence raw = stated;
  raw.Widen(WideningsOf(report.scatter, marks * triangulator.cameras()));
  FindFaults(raw, triangulator, options, marks, &report);
  report.distances = JudgeDistances(raw, triangulator, options.distances, names, options);
  if (!report.unknown.empty()) {
    report.unvouched = FindUnvouched(raw, triangulator);
    if (!report.distances.shows_px.empty()) report.unvouched.Narrow(report.distances.shows_px);
  } else if (report.faults.empty()) {
    std::vector<double> shows = ShiftsThatShow(raw, triangulator, options, marks);
    for (std::size_t c = 0; c < std::min(shows.size(), report.distances.shows_px.size()); ++c) {
      shows[c] = std::min(shows[c], report.distances.shows_px[c]);
    }
    report.unvouched = FindUnvouched(raw, triangulator);
    report.unvouched.Weigh(shows);
  }
  if (options.light) report.light = FindLightFaults(raw, triangulator, options);
  for (std::size_t c = 0; c < triangulator.cameras(); ++c) {
    report.cameras.push_back(Follow(raw, triangulator, options, report.faults, marks, c));
  }
  return report;
}
namespace {

std::string When(const Fault& fault) {
  if (!std::isfinite(fault.earliest)) return "from the first line on";
  return fmt::format("at {} s", WithSigma(0.5 * (fault.latest + fault.earliest),
                                          0.5 * (fault.latest - fault.earliest)));
}

}  // namespace

std::string WithSigma(double value, double sigma) {
  const int digits =
      sigma > 0.0 ? std::clamp(1 - static_cast<int>(std::floor(std::log10(sigma))), 0, 6) : 3;
  return fmt::format("{:.{}f} +- {:.{}f}", value, digits, sigma, digits);
}

std::string Describe(const Fault& fault, std::span<const std::string> cameras) {
  std::string text = fmt::format("camera {} ", cameras[static_cast<std::size_t>(fault.camera)]);
  switch (fault.kind) {
    case FaultKind::kMoved:
      text +=
          fmt::format("moved by {} px {}", WithSigma(fault.offset_px, fault.sigma_px), When(fault));
      break;
    case FaultKind::kDrifting:
      text += fmt::format("drifts by {} px/s, and is off by {} px at {:.4g} s",
                          WithSigma(fault.slope, fault.slope_sigma),
                          WithSigma(fault.offset_px, fault.sigma_px), fault.at);
      break;
    case FaultKind::kLate:
      text += fmt::format("is {} by {} line{} {}", fault.lag > 0 ? "late" : "early",
                          std::abs(fault.lag), std::abs(fault.lag) == 1 ? "" : "s", When(fault));
      break;
  }
  if (fault.certain()) return text;
  std::vector<std::string> others;
  for (const int c : fault.suspects) others.push_back(cameras[static_cast<std::size_t>(c)]);
  if (fault.several) {
    return text + fmt::format(
                      ", or something happened to others, several at once it may be, of it "
                      "and {}: it cannot be told which",
                      JoinWords(others));
  }
  return text + fmt::format(", or it is {}: it cannot be told which", JoinWords(others));
}

std::vector<Correction> CorrectionsOf(std::span<const Fault> faults, bool correct) {
  std::vector<Correction> out;
  for (const Fault& fault : faults) {
    Correction taken = TakenOut(fault);
    if (!fault.certain()) {
      out.push_back({.camera = -1, .from = fault.earliest});
      continue;
    }
    out.push_back(taken);
    Correction away{.camera = fault.camera, .from = fault.from, .leave_out = true};
    if (!correct) {
      away.from = std::isfinite(fault.from) ? fault.earliest : fault.from;
      if (fault.kind == FaultKind::kDrifting) away.from = Fault{}.from;
      out.push_back(away);
    } else if (std::isfinite(fault.from)) {
      // While it is not known whether it had happened.
      away.from = fault.earliest;
      away.to = std::nextafter(fault.latest, HUGE_VAL);
      out.push_back(away);
    }
  }
  return out;
}

}  // namespace unfurl::measure
