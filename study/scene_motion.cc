#include "study/scene_motion.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "base/progress.h"
#include "correlate/sampled_model.h"
#include "sim/dynamics/observables.h"
#include "sim/methods/events.h"

namespace unfurl::study {

namespace {

constexpr double kRate = 2000.0;  // samples per second that the stamps are interpolated from

// As finely as any channel wants it.
double RateFor(const correlate::Stamps& stamps) {
  double rate = kRate;
  for (const correlate::QuantityStamps& q : stamps.quantities) {
    if (q.t.size() > 1) rate = std::max(rate, 1.0 / (q.t[1] - q.t[0]));
  }
  return rate;
}

// Up to the next of steps that grow with it, so that a horizon that moves by a sample seldom
// crosses one.
double RoundedUp(double duration) {
  constexpr double kStepsPerOctave = 64.0;  // a run is longer by 1.1% at most, 2^(1/64)
  return std::exp2(std::ceil(kStepsPerOctave * std::log2(duration)) / kStepsPerOctave);
}

}  // namespace

MotionRequest MotionRequest::For(std::span<const double> theta, const correlate::Stamps& stamps) {
  MotionRequest out;
  out.theta.assign(theta.begin(), theta.end());
  out.marks = stamps.marks;
  for (const correlate::QuantityStamps& q : stamps.quantities) {
    if (std::find(out.quantities.begin(), out.quantities.end(), q.quantity) ==
        out.quantities.end()) {
      out.quantities.push_back(q.quantity);
    }
  }
  out.rate = RateFor(stamps);
  // The last stamp lies between two samples.
  out.duration = RoundedUp(std::max(0.0, stamps.Last()) + 2.0 / out.rate);
  return out;
}

class SceneMotion::Collector : public sim::Observer {
 public:
  Collector(const sim::Model& model, const MotionRequest& wanted, SceneMotion* out)
      : model_(model), out_(*out) {
    for (const std::string& name : wanted.marks) points_.push_back(model.FindMark(name));
    out_.samples_.resize(wanted.marks.size());
    if (wanted.quantities.empty()) return;  // then they cost nothing
    observables_.emplace(model, wanted.quantities);
    out_.quantities_ = observables_->quantities();
    out_.columns_.resize(out_.quantities_.size());
  }
  void OnSample(double t, double* state, const std::vector<sim::LatchMode>& modes) override {
    out_.t_.push_back(t);
    Watch(state);
    if (observables_) {
      const std::vector<double>& row = observables_->Row(t, state, modes);
      for (std::size_t q = 0; q < row.size(); ++q) out_.columns_[q].push_back(row[q]);
    }
    for (std::size_t m = 0; m < points_.size(); ++m) {
      const auto mark = static_cast<std::size_t>(points_[m]);
      const sim::PointMotion at = sim::MotionOf(model_, model_.marks[mark].point, state);
      out_.samples_[m].push_back({at.x, at.y, at.vx, at.vy});
    }
  }
  void OnProgress(double) override { ThrowIfInterrupted(); }
  // Energies lost and work done are sums over the way: they are columns of noughts in a run that
  // was not asked to add them up.
  bool WantsEnergy() const {
    return std::any_of(out_.quantities_.begin(), out_.quantities_.end(),
                       [](const data::Quantity& q) { return q.name.starts_with("energy."); });
  }

 private:
  // Rates of turning, of all bodies, as long as there are no marks to look at.
  void Watch(const double* state) {
    if (!points_.empty()) return;
    double rate = 0.0;
    for (int body = 0; body < model_.index.n; ++body) {
      rate = std::max(rate, std::abs(state[model_.index.omega(body)]));
    }
    if (out_.t_.size() == 1) out_.first_rate_ = rate;
    out_.highest_rate_ = std::max(out_.highest_rate_, rate);
  }

  const sim::Model& model_;
  SceneMotion& out_;
  std::vector<int> points_;
  std::optional<sim::Observables> observables_;
};

SceneMotion::SceneMotion(const sim::Model& model, const MotionRequest& wanted, double rtol) {
  sim::SimulateOptions simulate;
  simulate.rate = wanted.rate;
  simulate.rtol = rtol;
  simulate.duration = wanted.duration;
  Collector collector(model, wanted, this);
  simulate.track_energy = collector.WantsEnergy();
  simulate.track_forces = false;
  const sim::SimulateReport report = sim::Simulate(model, simulate, &collector);
  if (!report.Usable()) {
    failure_ = report.message;
    return;
  }
  held_ = StartsAtRest();
  for (const sim::Event& event : report.events) {
    events_.push_back({event.t, sim::EventName(event.kind), sim::PlaceOf(model, event)});
  }
}

// To round-off of the initial velocities, beside the highest speed of the run; of the marks, and
// where there are none of the joints.
bool SceneMotion::StartsAtRest() const {
  constexpr double kRoundOff = 1e-9;  // of the highest speed
  double first = first_rate_, highest = highest_rate_;
  if (!samples_.empty()) first = highest = 0.0;
  for (const std::vector<Sample>& s : samples_) {
    first = std::max(first, std::hypot(s.front().vx, s.front().vy));
    for (const Sample& m : s) highest = std::max(highest, std::hypot(m.vx, m.vy));
  }
  return first <= kRoundOff * highest;
}

// Cubic Hermite through the samples; before the start the marks are held, or unknown where they
// move at the start; past the end unknown.
correlate::MarkMotion SceneMotion::MarkAt(std::size_t mark,
                                          const std::vector<double>& stamps) const {
  const std::vector<Sample>& s = samples_[mark];
  const auto n = static_cast<Eigen::Index>(stamps.size());
  correlate::MarkMotion out;
  out.p.setZero(3, n);
  out.v.setZero(3, n);
  out.known.assign(stamps.size(), 1);
  for (Eigen::Index i = 0; i < n; ++i) {
    const double t = stamps[static_cast<std::size_t>(i)];
    if (held_ && t <= 0.0) {
      out.p.col(i) << s.front().x, s.front().y, 0.0;
      continue;
    }
    if (t < 0.0 || t > t_.back() || t_.size() < 2) {
      out.known[static_cast<std::size_t>(i)] = 0;
      continue;
    }
    const std::size_t after = std::clamp<std::size_t>(
        static_cast<std::size_t>(std::upper_bound(t_.begin(), t_.end(), t) - t_.begin()), 1,
        t_.size() - 1);
    const Sample &a = s[after - 1], &b = s[after];
    const double h = t_[after] - t_[after - 1], u = (t - t_[after - 1]) / h;
    const double h00 = (1 + 2 * u) * (1 - u) * (1 - u), h01 = u * u * (3 - 2 * u);
    const double h10 = h * u * (1 - u) * (1 - u), h11 = -h * u * u * (1 - u);
    const double d = 6 * u * (1 - u) / h, d0 = (1 - u) * (1 - 3 * u), d1 = u * (3 * u - 2);
    out.p.col(i) << h00 * a.x + h10 * a.vx + h01 * b.x + h11 * b.vx,
        h00 * a.y + h10 * a.vy + h01 * b.y + h11 * b.vy, 0.0;
    out.v.col(i) << d * (b.x - a.x) + d0 * a.vx + d1 * b.vx,
        d * (b.y - a.y) + d0 * a.vy + d1 * b.vy, 0.0;
  }
  return out;
}

// Before the start: what a held structure has, else nothing; as past the end.
Eigen::VectorXd SceneMotion::QuantityAt(const correlate::QuantityStamps& asked) const {
  const auto found =
      std::find_if(quantities_.begin(), quantities_.end(),
                   [&](const data::Quantity& q) { return q.name == asked.quantity; });
  if (found == quantities_.end()) return correlate::ValuesAt({}, {}, false, asked.t);
  return correlate::ValuesAt(t_, columns_[static_cast<std::size_t>(found - quantities_.begin())],
                             held_ && correlate::KnownWhileHeld(found->units), asked.t);
}

correlate::Prediction SceneMotion::At(const correlate::Stamps& stamps) const {
  correlate::Prediction out;
  if (!failure_.empty()) {
    out.status = correlate::ModelStatus::kFailed;
    out.message = failure_;
    return out;
  }
  out.held_before = held_;
  for (std::size_t m = 0; m < stamps.marks.size(); ++m) out.marks.push_back(MarkAt(m, stamps.t[m]));
  for (const correlate::QuantityStamps& q : stamps.quantities) {
    out.quantities.push_back({q.key, QuantityAt(q)});
  }
  out.events = events_;
  return out;
}

std::size_t SceneMotion::bytes() const {
  const std::size_t row = sizeof(double) * (1 + columns_.size()) + sizeof(Sample) * samples_.size();
  return t_.size() * row;
}

std::shared_ptr<const SceneMotion> MotionStore::Get(
    const MotionRequest& wanted, const std::function<std::shared_ptr<const SceneMotion>()>& make) {
  // The 24 last of a deployment of 5 s with four marks: a point comes back after the differences
  // about it.
  constexpr std::size_t kMostBytes = 32'000'000;
  {
    const std::lock_guard lock(mutex_);
    for (const Kept& kept : kept_) {
      if (kept.request == wanted) return kept.motion;
    }
  }
  auto made = make();
  if (made->bytes() > kMostBytes) return made;
  const std::lock_guard lock(mutex_);
  kept_.push_back({wanted, made});
  bytes_ += made->bytes();
  while (bytes_ > kMostBytes) {
    bytes_ -= kept_.front().motion->bytes();
    kept_.pop_front();
  }
  return made;
}

}  // namespace unfurl::study
