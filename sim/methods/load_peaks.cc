#include "sim/methods/load_peaks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/count.h"
#include "sim/dynamics/observables.h"

namespace unfurl::sim {
namespace {

constexpr int kMostTops = 3;  // looked at in a step
// h |lambda| of the fastest that a step has to do with, from where its dense output is not of the
// motion: a step at the edge of stability keeps what is stiff as small as the tolerance at its ends
// alone, and loads are that times the stiffness.
constexpr double kResolved = 2.0;
// What is left of a step when the place of the smallest pivot in it is known, by golden sections.
constexpr double kPlaced = 1e-5, kGolden = 0.61803398874989485;
// Loads beside that place, at these parts of the room that the step leaves there: of what goes as
// one over the distance two such values are in the proportion kNearer, of what does not they are
// nearly alike; kGrows lies between. Those of a motion with an error grow too: to the run they are
// as little known.
constexpr double kNearer = 3.1622776601683795, kGrows = 1.7782794100383854;
constexpr double kFarthest = 0.1;
constexpr int kNearerPlaces = 4;  // to a thousandth
// Of the step, below which there is no room on a side.
constexpr double kLeastRoom = 1e-3;
// A pivot goes with the square of the distance. Where the smallest goes to no less than this part
// of what it is at the step's far end, loads that go as one over the distance grow by less than ten
// times in the step, and are read in it like others.
constexpr double kNoZero = 0.01;
// What the curvature of a load may be more than the three ends tell.
constexpr double kMoreCurved = 2.0;

bool InContact(const LatchMode& mode) { return (mode.upper_contact | mode.lower_contact) != 0; }

// By how much a parabola over a step rises above both its ends, which differ by `difference`;
// `sagitta`: how far its middle is from the chord.
double RiseAbove(double difference, double sagitta) {
  const double rest = 4.0 * sagitta - std::fabs(difference);
  return rest > 0.0 ? rest * rest / (16.0 * sagitta) : 0.0;
}

}  // namespace

LoadPeaks::LoadPeaks(const Model& model, Dynamics* dynamics, bool pins)
    : model_(model),
      dynamics_(*dynamics),
      pins_(pins),
      joints_(model.joints.size()),
      forces_(model),
      state_(model.index.size(), 0.0),
      rates_(model.index.size(), 0.0) {
  const std::size_t count = joints_ + static_cast<std::size_t>(model.latches.count());
  before_ = start_ = end_ = std::vector<double>(count, 0.0);
  low_.loads = middle_.loads = high_.loads = new_.loads = end_;
  peaks_.resize(count);
}

void LoadPeaks::Read(const double* state, std::vector<double>* loads) const {
  if (pins_) {
    const Motion motion = dynamics_.LastMotion();
    for (std::size_t j = 0; j < joints_; ++j) {
      const JointForces::Force force =
          forces_.Of(static_cast<int>(j), motion, dynamics_.JointMultipliers());
      (*loads)[j] = std::hypot(force.fx, force.fy);
    }
  }
  for (int k = 0; k < model_.latches.count(); ++k) {
    const LatchMode& mode = dynamics_.modes()[static_cast<std::size_t>(k)];
    (*loads)[joints_ + static_cast<std::size_t>(k)] =
        InContact(mode) ? std::fabs(LatchMoment(model_, k, state, mode)) : 0.0;
  }
}

void LoadPeaks::Note(const std::vector<double>& loads, double t) {
  for (std::size_t k = 0; k < loads.size(); ++k) {
    if (!(loads[k] > peaks_[k].value)) continue;
    peaks_[k].value = loads[k];
    if (!peaks_[k].unknown) peaks_[k].t = t;
  }
}

void LoadPeaks::Begin(double t, const double* state, bool counts) {
  Read(state, &start_);
  if (counts) Note(start_, t);
  h_before_ = 0.0;
}

void LoadPeaks::ReadEnd(const double* trial) { Read(trial, &end_); }

void LoadPeaks::EvaluateAt(Stepper* stepper, double t, double h, double sigma) {
  if (stepper->Sample(sigma, state_.data())) ++evaluations_;
  dynamics_.RightSide(t + sigma * h, state_.data(), rates_.data());
  ++evaluations_;
}

void LoadPeaks::ReadAt(Stepper* stepper, double t, double h, double sigma,
                       std::vector<double>* loads) {
  EvaluateAt(stepper, t, h, sigma);
  Read(state_.data(), loads);
  Note(*loads, t + sigma * h);
}

// Whether some load may be larger inside the step, of length h, than it ever was.
bool LoadPeaks::MayBeInside(double h) const {
  for (std::size_t k = 0; k < peaks_.size(); ++k) {
    const double high = std::max(start_[k], end_[k]), difference = end_[k] - start_[k];
    // After a jump nothing is known of the curvature; a contact may come and go within the step.
    double rise = high;
    if (h_before_ > 0.0) {
      const double bend = difference / h - (start_[k] - before_[k]) / h_before_;
      const double sagitta = std::fabs(bend) / (h + h_before_) * h * h / 4.0;
      rise = RiseAbove(difference, kMoreCurved * sagitta);
    } else if (k >= joints_ && InContact(dynamics_.modes()[k - joints_])) {
      return true;
    }
    if (rise > 0.0 && high + rise > (1.0 + kPeakFound) * std::max(peaks_[k].value, high)) {
      return true;
    }
  }
  return false;
}

double LoadPeaks::Top(const Place& low, const Place& middle, const Place& high, std::size_t* load,
                      double* gain) const {
  double at = middle.at;
  *gain = 0.0;
  for (std::size_t k = 0; k < peaks_.size(); ++k) {
    const double x = low.at - middle.at, z = high.at - middle.at;
    const double left = (low.loads[k] - middle.loads[k]) / x;
    const double right = (high.loads[k] - middle.loads[k]) / z;
    const double bend = (right - left) / (z - x);  // f = middle + slope s + bend s^2
    if (!(bend < 0.0)) continue;
    const double slope = left - bend * x, top = -0.5 * slope / bend;
    if (!(top > x && top < z)) continue;
    const double value = middle.loads[k] + 0.5 * slope * top;
    const double gained = value / std::max(peaks_[k].value, middle.loads[k]) - 1.0;
    if (!(gained > *gain)) continue;
    *gain = gained;
    *load = k;
    at = middle.at + top;
  }
  return at;
}

void LoadPeaks::LookInside(Stepper* stepper, double t, double h, double sigma) {
  low_.at = 0.0;
  low_.loads = start_;
  high_.at = sigma;
  high_.loads = end_;
  middle_.at = 0.5 * sigma;
  ReadAt(stepper, t, h, middle_.at, &middle_.loads);
  for (int k = 0; k < kMostTops; ++k) {
    double gain = 0.0;
    std::size_t load = 0;
    new_.at = Top(low_, middle_, high_, &load, &gain);
    if (!(gain > kPeakFound)) return;
    ReadAt(stepper, t, h, new_.at, &new_.loads);
    const bool left = new_.at < middle_.at;
    if (new_.loads[load] > middle_.loads[load]) {
      std::swap(left ? high_ : low_, middle_);
      std::swap(middle_, new_);
    } else {
      std::swap(left ? low_ : high_, new_);
    }
  }
}

bool LoadPeaks::Resolves(const Stepper& stepper) {
  return stepper.StabilityUse() * stepper.StabilityEdge() < kResolved;
}

bool LoadPeaks::Step(Stepper* stepper, double t, double h, double sigma) {
  bool made = false;
  const double taken = sigma * h;
  if (pins_ && sigma < 1.0) {
    ReadAt(stepper, t, h, sigma, &end_);
    made = true;
  } else {
    Note(end_, t + taken);
  }
  if (pins_ && MayBeInside(taken) && Resolves(*stepper)) {
    made = true;
    LookInside(stepper, t, h, sigma);
  }
  h_before_ = taken;
  std::swap(before_, start_);
  std::swap(start_, end_);
  return made;
}

double LoadPeaks::PivotAt(Stepper* stepper, double t, double h, double sigma) {
  EvaluateAt(stepper, t, h, sigma);
  return dynamics_.SmallestPivot(nullptr);
}

double LoadPeaks::NearestDependence(Stepper* stepper, double t, double h, double sigma) {
  double low = 0.0, high = sigma;
  double left = high - kGolden * (high - low), right = low + kGolden * (high - low);
  double at_left = PivotAt(stepper, t, h, left), at_right = PivotAt(stepper, t, h, right);
  while (high - low > kPlaced * sigma) {
    if (at_left < at_right) {
      high = right;
      right = left;
      at_right = at_left;
      left = high - kGolden * (high - low);
      at_left = PivotAt(stepper, t, h, left);
    } else {
      low = left;
      left = right;
      at_left = at_right;
      right = low + kGolden * (high - low);
      at_right = PivotAt(stepper, t, h, right);
    }
  }
  return 0.5 * (low + high);
}

// Places nearer and nearer, on a side that has this room [-].
void LoadPeaks::LookBeside(Stepper* stepper, double t, double h, double place, double room) {
  ReadAt(stepper, t, h, place + kFarthest * room, &low_.loads);
  high_.loads = low_.loads;
  double part = kFarthest;
  for (int k = 0; k < kNearerPlaces; ++k) {
    part /= kNearer;
    std::swap(middle_.loads, high_.loads);
    EvaluateAt(stepper, t, h, place + part * room);
    Read(state_.data(), &high_.loads);
    for (std::size_t j = 0; j < joints_; ++j) {
      const double load = high_.loads[j];
      if (!(load > kGrows * middle_.loads[j] && load > low_.loads[j])) continue;
      peaks_[j].t = t + place * h;
      peaks_[j].unknown = true;
    }
  }
}

bool LoadPeaks::LookAcross(Stepper* stepper, double t, double h, double sigma) {
  if (!pins_) return false;
  const double place = NearestDependence(stepper, t, h, sigma);
  const double least = PivotAt(stepper, t, h, place);
  const double beside = PivotAt(stepper, t, h, place < 0.5 * sigma ? sigma : 0.0);
  if (least > kNoZero * beside) return true;
  for (const double room : {-place, sigma - place}) {
    // It still falls towards an end of the step: another one has it.
    if (std::fabs(room) > kLeastRoom * sigma) LookBeside(stepper, t, h, place, room);
  }
  return true;
}

std::string LoadPeaks::Warning() const {
  std::size_t count = 0, worst = joints_;
  for (std::size_t j = 0; j < joints_; ++j) {
    if (!peaks_[j].unknown) continue;
    ++count;
    if (worst == joints_ || peaks_[j].value > peaks_[worst].value) worst = j;
  }
  if (count == 0) return {};
  return fmt::format(
      "the largest pin force of '{}'{} is not known: at {:.6g} s constraints come to depend on one "
      "another, and beside that it grows with no bound that rigid parts or the tolerance would "
      "give; flexible parts do",
      model_.joints[worst].name,
      count == 1 ? "" : fmt::format(" and of {} more", Counted(count - 1, "joint")),
      peaks_[worst].t);
}

void LoadPeaks::Fill(SimulateReport* report) const {
  for (std::size_t k = 0; k < peaks_.size(); ++k) {
    const Peak& peak = peaks_[k];
    (k < joints_ ? report->peak_pin_force : report->peak_moment).push_back(peak.value);
    (k < joints_ ? report->peak_pin_time : report->peak_time).push_back(peak.t);
    if (k < joints_) report->pin_force_unknown.push_back(peak.unknown ? 1 : 0);
  }
  const std::string warning = Warning();
  if (!warning.empty()) report->warnings.push_back(warning);
}

}  // namespace unfurl::sim
