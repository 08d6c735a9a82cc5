#pragma once

#include <string>
#include <vector>

#include "correlate/residual/residual_kind.h"

namespace unfurl::correlate {

/// A moment that something else than the marks has recorded: a latch's switch, say.
struct TimedEvent {
  std::string kind;    ///< "latch", "contact_start", "contact_end", "watch"
  std::string where;   ///< the joint, or the watch
  int count = 1;       ///< the first, the second..
  double t = 0.0;      ///< on the record's clock [s]
  double sigma = 0.0;  ///< [s]
};

/// Times of events, each independent of the others: a row (t by the model's clock - the model's
/// time of it) / sigma. An event that the model does not have counts as one at the last stamp.
class TimedEvents : public ResidualKind {
 public:
  explicit TimedEvents(std::vector<TimedEvent> events) : events_(std::move(events)) {}
  /// As they were given.
  const std::vector<TimedEvent>& events() const { return events_; }

  Eigen::Index rows() const override { return static_cast<Eigen::Index>(events_.size()); }
  double TimeOf(Eigen::Index row) const override {
    return events_[static_cast<std::size_t>(row)].t;
  }
  Eigen::VectorXd NumbersOf(const Prediction& prediction) const override;  // times [s]
  void Add(const Eigen::VectorXd& more, Prediction* prediction) const override;
  void Evaluate(const Eigen::VectorXd& numbers, const Clocks& clocks,
                const Eigen::VectorXd& unknowns, Rows* rows) const override;
  Eigen::VectorXd Response(const Eigen::VectorXd& change, const Clocks& clocks,
                           const Eigen::VectorXd& unknowns) const override;
  std::shared_ptr<const ResidualKind> Within(const Window& window) const override;
  std::shared_ptr<const ResidualKind> WithoutDrift(double drift, double pivot) const override;
  std::vector<std::string> Words(const Eigen::VectorXd& numbers, const Clocks& clocks,
                                 const Eigen::VectorXd& unknowns,
                                 const std::string& of) const override;

 private:
  std::vector<TimedEvent> events_;
};

}  // namespace unfurl::correlate
