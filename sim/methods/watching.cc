// What is read off a step that is taken: samples, what open latches go through, loads. None of it
// changes the steps.
#include <algorithm>

#include "sim/methods/integration.h"

namespace unfurl::sim {
namespace {

constexpr double kTimeRounding = 1e-12;  // of a time that is a quotient [-]
constexpr int kPartsOfWay = 4;           // of a step, at which open latches are looked at

}  // namespace

void Integration::SampleStep(double h, double t_new) {
  // The last sample is at the end, though rounding of its time may put it beyond.
  const double reach = t_new < end_ ? t_new : end_ * (1.0 + kTimeRounding);
  for (;;) {
    const double t = static_cast<double>(report_.samples) / options_.rate;
    if (t > reach) return;
    const double sigma = std::clamp((t - t_) / h, 0.0, 1.0);
    if (options_.track_forces) {
      sampled_ += stepper_->Sample(sigma, sample_.data()) ? 1 : 0;
    } else {
      stepper_->Dense(sigma, sample_.data());
    }
    Emit(std::min(t, end_));
  }
}

void Integration::ShowStep(double h, double t_new, bool event, bool whole) {
  // The trial is at hand where it is the step's end; other points may cost right sides.
  class Step : public StepMotion {
   public:
    Step(Integration* of, double end, double length, bool event, bool final)
        : StepMotion(of->t_, end, of->jumped_, final),
          h_(length),
          event_(event),
          stepper_(*of->stepper_),
          modes_(of->dynamics_.modes()),
          out_(of->sample_) {}
    double* At(double t) override {
      if (!event_ && t >= to) {
        std::copy_n(stepper_.trial(), out_.size(), out_.begin());
      } else {
        stepper_.Dense(std::clamp((t - from) / h_, 0.0, 1.0), out_.data());
      }
      return out_.data();
    }
    const std::vector<LatchMode>& modes() const override { return modes_; }

   private:
    double h_;  // of the step that was tried, which an event may end early [s]
    bool event_;
    Stepper& stepper_;
    const std::vector<LatchMode>& modes_;
    Array& out_;
  };
  if (observer_ == nullptr) return;
  Step step(this, t_new, h, event, event || whole);
  observer_->OnStep(step);
  jumped_ = event;
}

void Integration::ShowWay(double h, double sigma) {
  if (observer_ == nullptr || !options_.track_forces) return;
  const StateIndex& i = model_.index;
  const auto& modes = dynamics_.modes();
  for (int part = 1; part <= kPartsOfWay; ++part) {
    const double at = sigma * part / kPartsOfWay;
    bool open = false;
    for (int k = 0; k < model_.latches.count(); ++k) {
      if (modes[static_cast<std::size_t>(k)].latched) continue;
      open = true;
      const Hinge& hinge = model_.latches.hinge(k);
      for (const int body : {hinge.outer, hinge.inner}) {
        double margin = 0.0;
        for (const int entry : {i.theta(body), i.omega(body)}) {
          way_[entry] = stepper_->Cubic(entry, &margin)(at);
        }
      }
    }
    if (!open) return;
    observer_->OnWay(dynamics_.MotionAt(t_ + at * h, way_.data()), modes);
  }
}

void Integration::Emit(double t) {
  if (observer_ != nullptr) observer_->OnSample(t, sample_.data(), dynamics_.modes());
  ++report_.samples;
}

void Integration::WatchLoads(double h, double sigma, bool event) {
  bool moved = loads_.Step(stepper_, t_, h, sigma) || sampled_ > 0;
  if (is_near_ && loads_.LookAcross(stepper_, t_, h, sigma)) moved = true;
  looked_ += sampled_;
  sampled_ = 0;
  // What follows wants the right side at the trial to be the last.
  if (moved && !event) dynamics_.RightSide(t_ + h, stepper_->trial(), scratch_.data());
}

}  // namespace unfurl::sim
