#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "correlate/residual/lowpass.h"
#include "correlate/residual/residual_kind.h"

namespace unfurl::correlate {

/// What an instrument recorded, and what is known of the instrument: its reading at its own time t
/// is  gain * q(t_record) + bias + noise,  q being a quantity of the model behind the instrument's
/// filter and  t_record = pivot + (t - pivot) / (1 + drift) - delay  (pivot: the record's middle).
/// Of gain, bias, delay and drift, what nothing is said of is known: 1, 0, 0, 0.
struct ChannelRecord {
  std::string name;       ///< "encoder"
  std::string quantity;   ///< a column of the model's run: "hinge.theta"
  std::string unit;       ///< of the reading
  std::vector<double> t;  ///< n stamps, ascending [s]
  Eigen::VectorXd y;      ///< n readings [unit]
  Eigen::VectorXd sigma;  ///< n standard deviations [unit]
  bool has_sigma = true;  ///< false: sigma is a guess of it, and the fit finds its scale
  Prior gain;             ///< [unit of the reading / unit of the quantity]
  Prior bias;             ///< [unit]
  Prior delay;            ///< by which the channel's clock is behind the record's [s]
  Prior drift;            ///< by which it runs fast [-]
  LowPass filter;         ///< of the instrument
};

/// A channel as residuals: one row a reading, then one for each normal prior of its unknowns.
///
/// Its numbers are the quantity on an even grid of the model's time, four points to a reading, over
/// the record and a margin to either side: so that a filter can be applied, and clock and delay
/// move without asking the model again.
class Channel : public ResidualKind {
 public:
  /// Throws Error, placed at `where`, for stamps that do not ascend, values that are not finite, a
  /// sigma that is not positive.
  explicit Channel(ChannelRecord record, const std::string& where = "channel");
  /// As it was given.
  const ChannelRecord& record() const { return record_; }

  Eigen::Index rows() const override;
  double TimeOf(Eigen::Index row) const override;
  std::vector<RowSeries> series() const override;
  std::vector<Unknown> unknowns() const override;
  void Ask(const Clock& clock, double pivot, Stamps* stamps) const override;
  Eigen::VectorXd NumbersOf(const Prediction& prediction) const override;
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
};

}  // namespace unfurl::correlate
