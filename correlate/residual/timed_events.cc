#include "correlate/residual/timed_events.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/fixed_number.h"

namespace unfurl::correlate {

namespace {

// The event of a model's list that another one names; its end: it never happened.
template <typename Iterator>
Iterator FindEvent(Iterator begin, Iterator end, const TimedEvent& named) {
  int left = named.count;
  return std::find_if(begin, end, [&](const ModelEvent& e) {
    return e.kind == named.kind && e.where == named.where && --left <= 0;
  });
}

}  // namespace

Eigen::VectorXd TimedEvents::NumbersOf(const Prediction& prediction) const {
  Eigen::VectorXd out(rows());
  for (Eigen::Index i = 0; i < out.size(); ++i) {
    const auto found = FindEvent(prediction.events.begin(), prediction.events.end(),
                                 events_[static_cast<std::size_t>(i)]);
    out(i) = found != prediction.events.end() ? found->t : std::numeric_limits<double>::quiet_NaN();
  }
  return out;
}

void TimedEvents::Add(const Eigen::VectorXd& more, Prediction* prediction) const {
  for (Eigen::Index i = 0; i < more.size(); ++i) {
    const auto found = FindEvent(prediction->events.begin(), prediction->events.end(),
                                 events_[static_cast<std::size_t>(i)]);
    if (found != prediction->events.end()) found->t += more(i);
  }
}

void TimedEvents::Evaluate(const Eigen::VectorXd& numbers, const Clocks& clocks,
                           const Eigen::VectorXd& /*unknowns*/, Rows* rows) const {
  for (Eigen::Index i = 0; i < numbers.size(); ++i) {
    const TimedEvent& e = events_[static_cast<std::size_t>(i)];
    const double predicted = std::isnan(numbers(i)) ? clocks.last : numbers(i);
    rows->residual(i) = (clocks.at.ModelTime(e.t, clocks.pivot) - predicted) / e.sigma;
    rows->by_time(i) = 1.0 / e.sigma;
  }
}

Eigen::VectorXd TimedEvents::Response(const Eigen::VectorXd& change, const Clocks& /*clocks*/,
                                      const Eigen::VectorXd& /*unknowns*/) const {
  Eigen::VectorXd out(change.size());
  for (Eigen::Index i = 0; i < out.size(); ++i) {
    out(i) = -change(i) / events_[static_cast<std::size_t>(i)].sigma;
  }
  return out;
}

std::shared_ptr<const ResidualKind> TimedEvents::Within(const Window& window) const {
  std::vector<TimedEvent> left = events_;
  std::erase_if(left, [&](const TimedEvent& e) { return !window.Contains(e.t); });
  return left.empty() ? nullptr : std::make_shared<TimedEvents>(std::move(left));
}

std::shared_ptr<const ResidualKind> TimedEvents::WithoutDrift(double drift, double pivot) const {
  std::vector<TimedEvent> moved = events_;
  for (TimedEvent& e : moved) e.t = pivot + (e.t - pivot) / (1.0 + drift);
  return std::make_shared<TimedEvents>(std::move(moved));
}

std::vector<std::string> TimedEvents::Words(const Eigen::VectorXd& numbers, const Clocks& clocks,
                                            const Eigen::VectorXd& /*unknowns*/,
                                            const std::string& of) const {
  std::vector<std::string> out;
  for (Eigen::Index i = 0; i < numbers.size(); ++i) {
    const TimedEvent& e = events_[static_cast<std::size_t>(i)];
    std::string kind = e.kind;
    std::replace(kind.begin(), kind.end(), '_', ' ');
    const std::string what =
        fmt::format("The {} of {}{}{}", kind, e.where,
                    e.count > 1 ? fmt::format(", number {},", e.count) : "", of);
    const double off = clocks.at.ModelTime(e.t, clocks.pivot) - numbers(i);
    out.push_back(
        std::isfinite(off)
            ? fmt::format("{} was observed at {} s, {:+.2g} ms ({:+.2g} of its sigma) from the "
                          "model's.",
                          what, FixedNumber(e.t), 1e3 * off, off / e.sigma)
            : fmt::format("{} was observed at {} s; the model has none.", what, FixedNumber(e.t)));
  }
  return out;
}

}  // namespace unfurl::correlate
