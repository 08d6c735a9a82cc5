#include "sim/methods/load_peaks.h"

#include <algorithm>
#include <cmath>

#include "sim/dynamics/observables.h"

namespace unfurl::sim {
namespace {

constexpr int kMostTops = 3;  // looked at in a step
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
    if (loads[k] > peaks_[k].value) peaks_[k] = {loads[k], t};
  }
}

void LoadPeaks::Begin(double t, const double* state, bool counts) {
  Read(state, &start_);
  if (counts) Note(start_, t);
  h_before_ = 0.0;
}

void LoadPeaks::ReadEnd(const double* trial) { Read(trial, &end_); }

void LoadPeaks::ReadAt(Stepper* stepper, double t, double h, double sigma,
                       std::vector<double>* loads) {
  if (stepper->Sample(sigma, state_.data())) ++evaluations_;
  dynamics_.RightSide(t + sigma * h, state_.data(), rates_.data());
  ++evaluations_;
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

bool LoadPeaks::Step(Stepper* stepper, double t, double h, double sigma, bool inside) {
  bool made = false;
  const double taken = sigma * h;
  if (pins_ && sigma < 1.0) {
    ReadAt(stepper, t, h, sigma, &end_);
    made = true;
  } else {
    Note(end_, t + taken);
  }
  if (pins_ && inside && MayBeInside(taken)) {
    made = true;
    LookInside(stepper, t, h, sigma);
  }
  h_before_ = taken;
  std::swap(before_, start_);
  std::swap(start_, end_);
  return made;
}

}  // namespace unfurl::sim
