#include "study/scene_motion.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/progress.h"
#include "correlate/sampled_model.h"
#include "sim/methods/events.h"

namespace unfurl::study {

namespace {

// A channel joins what it asks for by cubics: of half its distance they are off by a sixteenth of
// what it adds itself. Uneven stamps have no distance: 0.
double StepFor(const correlate::Stamps& stamps) {
  constexpr double kEven = 1e-3;  // of a distance: no rounding of stamps is as large
  double step = std::numeric_limits<double>::infinity();
  for (const correlate::QuantityStamps& q : stamps.quantities) {
    if (q.t.size() < 3) return 0.0;
    const double first = q.t[1] - q.t[0];
    for (std::size_t i = 2; i < q.t.size(); ++i) {
      if (std::abs(q.t[i] - q.t[i - 1] - first) > kEven * first) return 0.0;
    }
    step = std::min(step, 0.5 * first);
  }
  return std::isfinite(step) ? step : 0.0;
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
  out.step = StepFor(stamps);
  if (stamps.Last() > 0.0) out.duration = RoundedUp(stamps.Last());
  return out;
}

class SceneMotion::Collector : public sim::Observer {
 public:
  Collector(const sim::Model& model, const MotionRequest& wanted, double rtol, SceneMotion* out)
      : model_(model), out_(*out) {
    // Of what a step leaves: no sum of the two differs by as much as a change of the steps does.
    constexpr double kPart = 0.1;
    if (!wanted.marks.empty()) {
      std::vector<int> marks;
      for (const std::string& name : wanted.marks) marks.push_back(model.FindMark(name));
      out_.marks_.emplace(model, std::move(marks), kPart * rtol * model.length_scale);
    }
    if (wanted.quantities.empty()) return;  // then they cost nothing
    out_.quantities_.emplace(model, wanted.quantities, kPart * rtol, wanted.step);
  }
  void OnStep(sim::StepMotion& step) override {
    if (out_.marks_) out_.marks_->Take(step);
    if (out_.quantities_) out_.quantities_->Take(step);
    Watch(step);
  }
  void OnProgress(double) override { ThrowIfInterrupted(); }
  // Energies lost and work done are sums over the way: they are columns of noughts in a run that
  // was not asked to add them up.
  bool WantsEnergy() const {
    if (!out_.quantities_) return false;
    const std::vector<data::Quantity>& all = out_.quantities_->quantities();
    return std::any_of(all.begin(), all.end(),
                       [](const data::Quantity& q) { return q.name.starts_with("energy."); });
  }

 private:
  // Rates of turning, of all bodies, as long as there are no marks to look at.
  void Watch(sim::StepMotion& step) {
    if (out_.marks_) return;
    if (first_) out_.first_rate_ = Turning(step.At(step.from));
    first_ = false;
    out_.highest_rate_ =
        std::max({out_.highest_rate_, out_.first_rate_, Turning(step.At(step.to))});
  }
  double Turning(const double* state) const {
    double rate = 0.0;
    for (int body = 0; body < model_.index.n; ++body) {
      rate = std::max(rate, std::abs(state[model_.index.omega(body)]));
    }
    return rate;
  }

  const sim::Model& model_;
  SceneMotion& out_;
  bool first_ = true;
};

SceneMotion::SceneMotion(const sim::Model& model, const MotionRequest& wanted, double rtol) {
  constexpr double kShort = 0.01;  // of the time scale: one of the longest steps
  sim::SimulateOptions simulate;
  simulate.rtol = rtol;
  simulate.duration = wanted.duration > 0.0 ? wanted.duration : kShort * model.time_scale;
  // One sample, or the most there may be: those wanted are read off the steps.
  simulate.rate = std::min(1.0 / simulate.duration, 1e7);
  Collector collector(model, wanted, rtol, this);
  simulate.track_energy = collector.WantsEnergy();
  simulate.track_forces = false;
  const sim::SimulateReport report = sim::Simulate(model, simulate, &collector);
  if (marks_) marks_->End();
  warnings_ = model.warnings;
  warnings_.insert(warnings_.end(), report.warnings.begin(), report.warnings.end());
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
  if (marks_) first = highest = 0.0;
  for (std::size_t m = 0; marks_ && m < marks_->marks(); ++m) {
    const std::vector<MarkSample>& s = marks_->Of(m);
    first = std::max(first, std::hypot(s.front().vx, s.front().vy));
    for (const MarkSample& at : s) highest = std::max(highest, std::hypot(at.vx, at.vy));
  }
  return first <= kRoundOff * highest;
}

// Before the start the marks are held, or unknown where they move at the start; past the end
// unknown.
correlate::MarkMotion SceneMotion::MarkAt(std::size_t mark,
                                          const std::vector<double>& stamps) const {
  const std::vector<double>& times = marks_->t();
  const std::vector<MarkSample>& s = marks_->Of(mark);
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
    if (t < 0.0 || t > times.back() || times.size() < 2) {
      out.known[static_cast<std::size_t>(i)] = 0;
      continue;
    }
    // At a jump the later of its two samples; at the end the last interval.
    const auto after =
        std::clamp<std::ptrdiff_t>(std::upper_bound(times.begin(), times.end(), t) - times.begin(),
                                   1, static_cast<std::ptrdiff_t>(times.size()) - 1);
    const auto k = static_cast<std::size_t>(after);
    const MarkSample at = AtTime(t, times[k - 1], s[k - 1], times[k], s[k]);
    out.p.col(i) << at.x, at.y, 0.0;
    out.v.col(i) << at.vx, at.vy, 0.0;
  }
  return out;
}

// Before the start: what a held structure has, else nothing; as past the end.
Eigen::VectorXd SceneMotion::QuantityAt(const correlate::QuantityStamps& asked) const {
  const std::vector<data::Quantity>& all = quantities_->quantities();
  const auto found = std::find_if(
      all.begin(), all.end(), [&](const data::Quantity& q) { return q.name == asked.quantity; });
  if (found == all.end()) return correlate::ValuesAt({}, {}, false, asked.t);
  const bool held = held_ && correlate::KnownWhileHeld(found->units);
  return quantities_->At(static_cast<std::size_t>(found - all.begin()), held, asked.t);
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
  std::size_t out = 0;
  if (marks_) out += marks_->t().size() * (sizeof(double) + sizeof(MarkSample) * marks_->marks());
  if (quantities_) {
    out += quantities_->t().size() * sizeof(double) * (1 + quantities_->quantities().size());
  }
  return out;
}

std::shared_ptr<const SceneMotion> MotionStore::Get(
    const MotionRequest& wanted, const std::function<std::shared_ptr<const SceneMotion>()>& make) {
  {
    const std::lock_guard lock(mutex_);
    for (const Kept& kept : kept_) {
      if (kept.request == wanted) return kept.motion;
    }
  }
  auto made = make();
  if (made->bytes() > most_bytes_) return made;
  const std::lock_guard lock(mutex_);
  kept_.push_back({wanted, made});
  bytes_ += made->bytes();
  while (bytes_ > most_bytes_) {
    bytes_ -= kept_.front().motion->bytes();
    kept_.pop_front();
  }
  return made;
}

std::optional<std::vector<std::string>> MotionStore::WarningsNear(
    std::span<const double> theta) const {
  const std::lock_guard lock(mutex_);
  const SceneMotion* nearest = nullptr;
  double least = std::numeric_limits<double>::infinity();
  for (const Kept& kept : kept_) {
    double distance = 0.0;
    for (std::size_t j = 0; j < theta.size(); ++j) {
      const double size = std::max(std::abs(theta[j]), std::abs(kept.request.theta[j]));
      if (size > 0.0) distance += std::pow((theta[j] - kept.request.theta[j]) / size, 2);
    }
    if (distance > least) continue;
    least = distance;
    nearest = kept.motion.get();
  }
  if (nearest == nullptr) return std::nullopt;
  return nearest->warnings();
}

}  // namespace unfurl::study
