#pragma once

#include <algorithm>

namespace unfurl::sim {

// Which of two methods takes the steps, an explicit and an implicit one, by what each has shown to
// cost where the motion is now: time gained per right side. As in codes that detect stiffness while
// they run (Petzold 1983; Hairer and Wanner, Solving ODEs II, IV.2), the explicit one is doubted
// where its steps are near the edge of stability; the other is then not predicted but tried, for
// some steps, and kept if it is faster. Trials that lose become rarer, so that all of them together
// cost a small part of the run, and a run no more than a little above the better method. Counts
// work, not seconds: the same run takes the same steps on any machine.
class MethodSwitch {
 public:
  explicit MethodSwitch(bool implicit) : implicit_(implicit) {}

  // After an accepted step of the method in use: the time it gained [s], what it cost, in right
  // sides, with the steps refused before it, and whether it is near the edge of stability. True:
  // the other method takes over.
  bool Note(double gained, double cost, bool unstable);

  bool implicit() const { return implicit_; }
  // The explicit method became another one: what it has shown counts no more.
  void Restart();
  // Whether the explicit method is about to be tried.
  bool AboutToTryExplicit() const { return trying_ && !implicit_ && steps_ == 0; }
  // Whether a trial of the explicit method, which gains at most `reach` per right side [s] before
  // stability stops it, would be lost. It then counts as lost, and the implicit one goes on.
  bool Spare(double reach);

 private:
  // Steps over which a speed is measured: some tens, so that a few impacts or a rejected step do
  // not decide; of a trial fewer, after those in which its step size settles (fivefold a step: four
  // decades in six).
  static constexpr int kWindow = 64, kSettling = 8, kTrial = 24;
  // A trial that has cost this much is over, however few its steps: twice what it costs when all
  // are accepted, at 25 right sides a step.
  static constexpr double kTrialCost = 2.0 * 25.0 * kTrial;
  // Faster by so much is worth the change.
  static constexpr double kGain = 1.25;
  // Right sides before the first trial, and between trials at most. A trial costs some 500.
  static constexpr double kFirstWait = 1000.0, kLongestWait = 32000.0;

  double Speed() const;
  bool EndTrial();
  bool EndWindow();
  bool Change();
  void Clear();

  bool implicit_;
  bool trying_ = false;
  int steps_ = 0, unstable_ = 0;
  double gained_ = 0.0, cost_ = 0.0;  // of this window or trial [s], [evaluations]
  double trial_cost_ = 0.0;           // [evaluations]
  double speed_[2] = {0.0, 0.0};      // of the explicit and the implicit one [s]; 0: not known
  double since_ = 0.0, wait_ = kFirstWait;  // [evaluations]
};

}  // namespace unfurl::sim
