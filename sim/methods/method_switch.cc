#include "sim/methods/method_switch.h"

namespace unfurl::sim {

bool MethodSwitch::Note(double gained, double cost, bool unstable) {
  ++steps_;
  trial_cost_ += cost;
  since_ += cost;
  if (!trying_ || steps_ > kSettling) {
    gained_ += gained;
    cost_ += cost;
    unstable_ += unstable ? 1 : 0;
  }
  if (trying_) return (steps_ >= kTrial || trial_cost_ > kTrialCost) && EndTrial();
  return steps_ >= kWindow && EndWindow();
}

// Time gained per right side. That of an explicit pair at the edge of stability counts in full:
// 4(3) and 8(5,3) are stable along the imaginary axis too, and err no more there than an implicit
// step.
double MethodSwitch::Speed() const {
  if (!(cost_ > 0.0)) return 0.0;
  return gained_ / cost_;
}

void MethodSwitch::Restart() {
  Clear();
  trying_ = false;
  speed_[0] = 0.0;
}

bool MethodSwitch::EndTrial() {
  const double speed = Speed();
  const bool better = speed > kGain * speed_[implicit_ ? 0 : 1];
  speed_[implicit_ ? 1 : 0] = speed;
  trying_ = false;
  since_ = 0.0;
  wait_ = better ? kFirstWait : std::min(2.0 * wait_, kLongestWait);
  if (!better) return Change();
  Clear();
  return false;
}

bool MethodSwitch::Spare(double reach) {
  if (reach > kGain * speed_[1]) return false;
  implicit_ = true;
  trying_ = false;
  speed_[0] = reach;
  since_ = 0.0;
  wait_ = std::min(2.0 * wait_, kLongestWait);
  return true;
}

bool MethodSwitch::EndWindow() {
  speed_[implicit_ ? 1 : 0] = Speed();
  const double other = speed_[implicit_ ? 0 : 1];
  const bool doubted = implicit_ || 2 * unstable_ > steps_;
  Clear();
  if (!doubted) return false;
  // What the other showed is believed until it is seen again; back to an explicit method only
  // after a while, as what it showed may have been a moment without anything stiff.
  if (other > kGain * speed_[implicit_ ? 1 : 0] && (!implicit_ || since_ > kFirstWait)) {
    since_ = 0.0;
    return Change();
  }
  if (since_ < wait_) return false;
  trying_ = true;
  return Change();
}

bool MethodSwitch::Change() {
  implicit_ = !implicit_;
  Clear();
  return true;
}

void MethodSwitch::Clear() {
  steps_ = unstable_ = 0;
  gained_ = cost_ = trial_cost_ = 0.0;
}

}  // namespace unfurl::sim
