#include "correlate/design/planned_record.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "base/error.h"
#include "correlate/fit/workers.h"
#include "correlate/residual/timed_events.h"

namespace unfurl::correlate {

namespace {

// Errors of samples by place: those of the record's sample that lies nearest.
class ErrorsByPlace {
 public:
  ErrorsByPlace(const Observations& like, const TrialResult& found)
      : like_(like), found_(found), stride_(std::max<std::size_t>(1, like.size() / kLooked)) {}

  // Of a mark's sample at p [m] and stamp t [s], into its column i.
  void Take(const Eigen::Vector3d& p, double t, std::size_t i, MarkSeries* out) const {
    const MarkSeries* nearest = nullptr;
    std::size_t at = 0;
    double least = std::numeric_limits<double>::infinity();
    for (const MarkSeries& m : like_.marks) {
      for (std::size_t s = 0; s < m.size(); s += stride_) {
        const double distance = (m.p.col(static_cast<Eigen::Index>(s)) - p).squaredNorm();
        if (distance < least) least = distance, nearest = &m, at = s;
      }
    }
    if (nearest == nullptr) return;
    const auto from = static_cast<Eigen::Index>(at), to = static_cast<Eigen::Index>(i);
    out->cov.col(to) = nearest->cov.col(from) / WeightAt(out->name, t);
    const Eigen::Index k = like_.shared_rank;
    out->shared.middleCols(to * k, k) = nearest->shared.middleCols(from * k, k);
  }

 private:
  // A record's errors change over decimetres; more samples than these tell no more of them.
  static constexpr std::size_t kLooked = 2000;

  // Where the model's own noise made the fit count samples for less, it will again: of a mark that
  // was not there, as of the worst.
  double WeightAt(const std::string& mark, double t) const {
    const bool known = like_.FindMark(mark) >= 0;
    double weight = 1.0;
    for (const LessWeight& less : found_.less_weight) {
      if ((less.mark == mark || !known) && t >= less.from && t <= less.to) {
        weight = std::min(weight, less.weight);
      }
    }
    return weight;
  }

  const Observations& like_;
  const TrialResult& found_;
  std::size_t stride_;
};

// Stamps and sizes, without values: what a model has to be asked for.
Observations Blank(const PlannedContent& content, const Observations& like,
                   const TrialResult& found, const FitOptions& options) {
  Observations out;
  out.shared_rank = like.shared_rank;
  out.held_before = like.held_before;
  out.frame = like.frame;
  out.placement = like.placement;
  if (found.drift.called) out.placement.drift = Prior::Normal(0.0, options.clock_sigma);
  out.placement.pivot = like.Pivot();
  for (const PlannedMark& mark : content.marks) {
    MarkSeries m;
    m.name = mark.name;
    m.t = mark.t;
    const auto n = static_cast<Eigen::Index>(m.size());
    m.p = Eigen::Matrix3Xd::Zero(3, n);
    m.cov = Eigen::Matrix<double, 6, Eigen::Dynamic>::Zero(6, n);
    m.shared = Eigen::Matrix3Xd::Zero(3, n * like.shared_rank);
    out.marks.push_back(std::move(m));
  }
  for (const ChannelRecord& record : content.channels) {
    ChannelRecord blank = record;
    const auto n = static_cast<Eigen::Index>(blank.t.size());
    blank.y = Eigen::VectorXd::Zero(n);
    if (blank.sigma.size() != n) throw Error("has no sigma", "channel." + blank.name, "give one");
    blank.points_per_step = 16;  // the most that a channel takes: how readings bend is not known
    out.others.push_back(std::make_shared<Channel>(blank, "channel." + blank.name));
  }
  return out;
}

Prediction Ask(const Model& model, const std::vector<double>& theta, const Observations& record,
               const Clock& clock) {
  Prediction answer = EvaluateChecked(model, theta, record.StampsAt(clock));
  if (answer.status != ModelStatus::kGood) {
    throw Error("the model does not run: " + answer.message, "plan",
                "see what `unfurl simulate` says of the scene");
  }
  return answer;
}

// When the record's clock shows what the model's shows at t [s].
double RecordTime(double t, const Clock& clock, double pivot) {
  return pivot + (t + clock.offset - pivot) * (1.0 + clock.drift);
}

// The events of the record at hand, at the times that the model has them; what does not happen is
// not timed.
std::shared_ptr<const ResidualKind> EventsOf(const ResidualKinds& at_hand, const Prediction& answer,
                                             const Clock& clock, double pivot) {
  std::vector<TimedEvent> planned;
  for (const auto& kind : at_hand) {
    const auto* events = dynamic_cast<const TimedEvents*>(kind.get());
    if (events == nullptr) continue;
    for (TimedEvent e : events->events()) {
      int count = 0;
      for (const ModelEvent& m : answer.events) {
        if (m.kind != e.kind || m.where != e.where || ++count != e.count) continue;
        e.t = RecordTime(m.t, clock, pivot);
        planned.push_back(e);
      }
    }
  }
  return std::make_shared<TimedEvents>(std::move(planned));
}

// All that a switch would see until the record's end.
std::shared_ptr<const ResidualKind> SeenBy(const PlannedSwitch& one, const Prediction& answer,
                                           const Clock& clock, const Observations& record) {
  std::vector<TimedEvent> planned;
  int count = 0;
  for (const ModelEvent& m : answer.events) {
    if (m.kind != one.kind || m.where != one.where) continue;
    const double t = RecordTime(m.t, clock, record.placement.pivot);
    ++count;
    if (t <= record.End()) planned.push_back({one.kind, one.where, count, t, one.sigma});
  }
  return std::make_shared<TimedEvents>(std::move(planned));
}

// The channel with the readings that the instrument would show; stamps at which nothing is known of
// the model (an acceleration before the release) are taken out.
std::shared_ptr<const ResidualKind> Shown(const Channel& blank, ChannelRecord record,
                                          const Prediction& answer,
                                          const ResidualKind::Clocks& clocks) {
  Eigen::VectorXd unknowns(static_cast<Eigen::Index>(blank.unknowns().size()));
  for (Eigen::Index i = 0; i < unknowns.size(); ++i) {
    unknowns(i) = blank.unknowns()[static_cast<std::size_t>(i)].start;
  }
  const Eigen::VectorXd y = blank.Simulated(blank.NumbersOf(answer), clocks, unknowns);
  std::vector<double> t;
  Eigen::Index n = 0;
  const Eigen::VectorXd sigma = record.sigma;
  record.y.resize(y.size());
  for (Eigen::Index i = 0; i < y.size(); ++i) {
    if (!std::isfinite(y(i))) continue;
    t.push_back(record.t[static_cast<std::size_t>(i)]);
    record.y(n) = y(i);
    record.sigma(n++) = sigma(i);
  }
  record.t = std::move(t);
  record.y.conservativeResize(n);
  record.sigma.conservativeResize(n);
  if (record.t.size() < 4) {  // a cubic takes four
    throw Error("the model has no values of " + record.quantity, "channel." + record.name,
                "see the columns of a run: unfurl info run.h5");
  }
  return std::make_shared<Channel>(std::move(record), "channel." + blank.record().name);
}

}  // namespace

Observations PlanRecord(const Model& model, const std::vector<double>& theta,
                        const PlannedContent& content, const Observations& like,
                        const TrialResult& found, const FitOptions& options) {
  Observations out = Blank(content, like, found, options);
  const Clock clock = found.at.clock();
  const Prediction answer = Ask(model, theta, out, clock);
  const ErrorsByPlace errors(like, found);
  for (std::size_t m = 0; m < out.marks.size(); ++m) {
    MarkSeries& mark = out.marks[m];
    for (std::size_t i = 0; i < mark.size(); ++i) {
      const auto column = static_cast<Eigen::Index>(i);
      mark.p.col(column) = found.at.X_WM * answer.marks[m].p.col(column);
      errors.Take(mark.p.col(column), mark.t[i], i, &mark);
    }
  }
  const ResidualKind::Clocks clocks = ClocksOf(out, clock, clock);
  for (std::size_t c = 0; c < content.channels.size(); ++c) {
    const auto& blank = static_cast<const Channel&>(*out.others[c]);
    out.others[c] = Shown(blank, content.channels[c], answer, clocks);
  }
  const Observations marks_and_channels = out;
  for (const PlannedSwitch& one : content.switches) {
    out.others.push_back(SeenBy(one, answer, clock, marks_and_channels));
  }
  if (content.events) {
    out.others.push_back(EventsOf(like.others, answer, clock, out.placement.pivot));
  }
  return out;
}

}  // namespace unfurl::correlate
