#include "study/scene_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <optional>

#include "base/cpu_time.h"
#include "base/error.h"
#include "base/progress.h"
#include "correlate/sampled_model.h"
#include "data/scene.h"
#include "sim/dynamics/observables.h"
#include "sim/methods/events.h"
#include "sim/methods/simulate.h"

namespace unfurl::study {

namespace {

constexpr double kRate = 2000.0;  // samples per second that the stamps are interpolated from

// Names of quantities, each once.
std::vector<std::string> QuantitiesOf(const correlate::Stamps& stamps) {
  std::vector<std::string> names;
  for (const correlate::QuantityStamps& q : stamps.quantities) {
    if (std::find(names.begin(), names.end(), q.quantity) == names.end()) {
      names.push_back(q.quantity);
    }
  }
  return names;
}

// Quantities on the sampling grid; without any it costs nothing.
class QuantityCollector {
 public:
  QuantityCollector(const sim::Model& model, const std::vector<std::string>& names) {
    if (!names.empty()) observables_.emplace(model, names);
  }
  void OnSample(double t, double* state, const std::vector<sim::LatchMode>& modes) {
    if (!observables_) return;
    t_.push_back(t);
    const std::vector<double>& row = observables_->Row(t, state, modes);
    columns_.resize(row.size());
    for (std::size_t q = 0; q < row.size(); ++q) columns_[q].push_back(row[q]);
  }
  // Before the start: what a held structure has, where `held`, else nothing; as past the end.
  Eigen::VectorXd At(const correlate::QuantityStamps& asked, bool held) const {
    const auto& all = observables_->quantities();
    const auto found = std::find_if(
        all.begin(), all.end(), [&](const data::Quantity& q) { return q.name == asked.quantity; });
    if (found == all.end()) return correlate::ValuesAt({}, {}, false, asked.t);
    return correlate::ValuesAt(t_, columns_[static_cast<std::size_t>(found - all.begin())],
                               held && correlate::KnownWhileHeld(found->units), asked.t);
  }

 private:
  std::optional<sim::Observables> observables_;
  std::vector<double> t_;                     // [s]
  std::vector<std::vector<double>> columns_;  // [units of the quantities]
};

// The wanted marks on the sampling grid.
class Collector : public sim::Observer {
 public:
  Collector(const sim::Model& model, const correlate::Stamps& stamps)
      : model_(model), quantities_(model, QuantitiesOf(stamps)) {
    for (const std::string& name : stamps.marks) points_.push_back(model.FindMark(name));
    samples_.resize(stamps.marks.size());
  }
  void OnSample(double t, double* state, const std::vector<sim::LatchMode>& modes) override {
    t_.push_back(t);
    Watch(state);
    quantities_.OnSample(t, state, modes);
    for (std::size_t m = 0; m < points_.size(); ++m) {
      const auto mark = static_cast<std::size_t>(points_[m]);
      samples_[m].push_back(sim::MotionOf(model_, model_.marks[mark].point, state));
    }
  }
  void OnProgress(double) override { ThrowIfInterrupted(); }

  // Whether the structure stands still at the start, so that it was held before it: to round-off of
  // the initial velocities, beside the highest speed of the run; of the marks, and where there are
  // none of the joints.
  bool StartsAtRest() const {
    constexpr double kRoundOff = 1e-9;  // of the highest speed
    double first = first_rate_, highest = highest_rate_;
    if (!samples_.empty()) first = highest = 0.0;
    for (const std::vector<sim::PointMotion>& s : samples_) {
      first = std::max(first, std::hypot(s.front().vx, s.front().vy));
      for (const sim::PointMotion& m : s) highest = std::max(highest, std::hypot(m.vx, m.vy));
    }
    return first <= kRoundOff * highest;
  }

  Eigen::VectorXd QuantityAt(const correlate::QuantityStamps& asked) const {
    return quantities_.At(asked, held_);
  }

  // Cubic Hermite through the samples; before the start the marks are held, or unknown where they
  // move at the start; past the end unknown.
  void At(std::size_t mark, double t, correlate::MarkMotion* out, Eigen::Index i) const {
    const std::vector<sim::PointMotion>& s = samples_[mark];
    if (t < 0.0 || (t == 0.0 && held_)) {
      if (!held_) {
        out->known[static_cast<std::size_t>(i)] = 0;
        return;
      }
      out->p.col(i) << s.front().x, s.front().y, 0.0;
      return;
    }
    if (t > t_.back() || t_.size() < 2) {
      out->known[static_cast<std::size_t>(i)] = 0;
      return;
    }
    const std::size_t after = std::clamp<std::size_t>(
        static_cast<std::size_t>(std::upper_bound(t_.begin(), t_.end(), t) - t_.begin()), 1,
        t_.size() - 1);
    const sim::PointMotion &a = s[after - 1], &b = s[after];
    const double h = t_[after] - t_[after - 1], u = (t - t_[after - 1]) / h;
    const double h00 = (1 + 2 * u) * (1 - u) * (1 - u), h01 = u * u * (3 - 2 * u);
    const double h10 = h * u * (1 - u) * (1 - u), h11 = -h * u * u * (1 - u);
    const double d = 6 * u * (1 - u) / h, d0 = (1 - u) * (1 - 3 * u), d1 = u * (3 * u - 2);
    out->p.col(i) << h00 * a.x + h10 * a.vx + h01 * b.x + h11 * b.vx,
        h00 * a.y + h10 * a.vy + h01 * b.y + h11 * b.vy, 0.0;
    out->v.col(i) << d * (b.x - a.x) + d0 * a.vx + d1 * b.vx,
        d * (b.y - a.y) + d0 * a.vy + d1 * b.vy, 0.0;
  }

  void Finish() { held_ = StartsAtRest(); }
  bool held() const { return held_; }

 private:
  // Rates of turning, of all bodies, as long as there are no marks to look at.
  void Watch(const double* state) {
    if (!samples_.empty()) return;
    double rate = 0.0;
    for (int body = 0; body < model_.index.n; ++body) {
      rate = std::max(rate, std::abs(state[model_.index.omega(body)]));
    }
    if (t_.size() == 1) first_rate_ = rate;
    highest_rate_ = std::max(highest_rate_, rate);
  }

  const sim::Model& model_;
  QuantityCollector quantities_;
  double first_rate_ = 0.0, highest_rate_ = 0.0;  // [rad/s]
  bool held_ = true;
  std::vector<int> points_;
  std::vector<double> t_;
  std::vector<std::vector<sim::PointMotion>> samples_;
};

}  // namespace

namespace {

// As finely as any channel wants it.
double RateFor(const correlate::Stamps& stamps) {
  double rate = kRate;
  for (const correlate::QuantityStamps& q : stamps.quantities) {
    if (q.t.size() > 1) rate = std::max(rate, 1.0 / (q.t[1] - q.t[0]));
  }
  return rate;
}

}  // namespace

SceneModel::SceneModel(SceneModelOptions options, std::span<const double> theta)
    : options_(std::move(options)), document_(options_.scene, options_.set, options_.texts) {
  options_.texts = nullptr;
  const data::Scene scene = FirstScene(theta);
  quantities_ = sim::Observables(sim::Compile(scene)).quantities();
  duration_ = scene.duration;
  files_ = scene.files;
  beams_ = scene.beams;
  for (const data::SceneMark& mark : scene.marks) marks_.push_back(mark.name);
  for (const data::SceneJoint& joint : scene.joints) joints_.push_back(joint.name);
  for (const data::SceneWatch& watch : scene.watches) watches_.push_back(watch.name);
}

data::Scene SceneModel::FirstScene(std::span<const double> theta) const {
  try {
    return SceneAt(theta);
  } catch (const Error&) {
    // What is wrong without the parameters, too, has a line in its file.
    data::ReadScene(document_.table(), options_.scene);
    throw;
  }
}

data::Scene SceneModel::SceneAt(std::span<const double> theta) const {
  std::vector<data::TomlDocument::Value> values;
  for (std::size_t j = 0; j < options_.keys.size(); ++j) {
    for (const std::string& key : options_.keys[j]) values.push_back({key, theta[j]});
  }
  return data::ReadScene(document_.With(values), options_.scene);
}

correlate::Prediction SceneModel::Evaluate(std::span<const double> theta,
                                           const correlate::Stamps& stamps) const {
  const double start = CpuSeconds(CLOCK_THREAD_CPUTIME_ID);
  correlate::Prediction out;
  const sim::Model model = sim::Compile(SceneAt(theta));
  const double last = stamps.Last();
  sim::SimulateOptions simulate;
  simulate.rate = RateFor(stamps);
  simulate.rtol = options_.rtol;
  simulate.track_energy = simulate.track_forces = false;
  simulate.duration =
      last + 2.0 / simulate.rate;  // so that the last stamp lies between two samples
  Collector collector(model, stamps);
  const sim::SimulateReport report = sim::Simulate(model, simulate, &collector);
  if (!report.Usable()) {
    out.status = correlate::ModelStatus::kFailed;
    out.message = report.message;
    return out;
  }
  collector.Finish();
  out.held_before = collector.held();
  for (std::size_t m = 0; m < stamps.marks.size(); ++m) {
    const auto n = static_cast<Eigen::Index>(stamps.t[m].size());
    correlate::MarkMotion motion;
    motion.p.setZero(3, n);
    motion.v.setZero(3, n);
    motion.known.assign(stamps.t[m].size(), 1);
    for (Eigen::Index i = 0; i < n; ++i) {
      collector.At(m, stamps.t[m][static_cast<std::size_t>(i)], &motion, i);
    }
    out.marks.push_back(std::move(motion));
  }
  for (const correlate::QuantityStamps& q : stamps.quantities) {
    out.quantities.push_back({q.key, collector.QuantityAt(q)});
  }
  for (const sim::Event& event : report.events) {
    out.events.push_back({event.t, sim::EventName(event.kind), sim::PlaceOf(model, event)});
  }
  out.seconds = CpuSeconds(CLOCK_THREAD_CPUTIME_ID) - start;
  return out;
}

}  // namespace unfurl::study
