#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "correlate/residual/held_readings.h"
#include "correlate/residual/lowpass.h"
#include "correlate/residual/residual_kind.h"

namespace unfurl::correlate {

/// What an instrument recorded, and what is known of the instrument: its reading at its own time t
/// is  gain * q(t_record) + bias + noise,  q being a quantity of the model behind the instrument's
/// filter and  t_record = pivot + (t - pivot) / (1 + drift) - delay  (pivot: the channel's middle).
/// Of gain, bias, delay and drift, what nothing is said of is known: 1, 0, 0, 0.
struct ChannelRecord {
  std::string name;       ///< "encoder"
  std::string quantity;   ///< a column of the model's run: "hinge.theta"
  std::string unit;       ///< of the readings
  double scale = 1.0;     ///< unit of the reading over that of the quantity (rad to deg: 57.3)
  std::vector<double> t;  ///< n stamps, ascending [s]
  Eigen::VectorXd y;      ///< n readings [unit]
  Eigen::VectorXd sigma;  ///< n standard deviations [unit]; empty: none is stated
  Prior gain;             ///< on top of `scale` [-]
  Prior bias;             ///< [unit]
  Prior delay;            ///< by which the channel's clock is behind the record's [s]
  Prior drift;            ///< by which it runs fast [-]
  LowPass filter;         ///< of the instrument
  /// Readings that were left out of these, which the words name.
  std::vector<HeldRun> held;
  /// Its resolution [unit]; 0: ResolutionOf(y).
  double resolution = 0.0;
  /// Ends of the instrument's range [unit]: a reading there says "this or beyond". NaN: RangeOf.
  double lowest = std::numeric_limits<double>::quiet_NaN();
  double highest = std::numeric_limits<double>::quiet_NaN();
  /// Stamp at which its drift has no effect [s]; NaN: the middle of its readings.
  double pivot = std::numeric_limits<double>::quiet_NaN();
  /// Of the model's grid, to a median step of the readings; 0: as many as keep the cubic between
  /// them within a tenth of a sigma, at 99 of 100 readings, by how the readings bend; 4 to 16.
  int points_per_step = 0;
};

/// Leaves out the readings at which the instrument dropped out (FindHeldRuns), and says so in
/// `held`.
void LeaveOutHeld(ChannelRecord* record);

/// Standard deviation of the noise of readings that a smooth motion underlies: from their third
/// differences, whose median ignores impacts. Of quantised readings that hardly change, that of the
/// quantisation. 0: there is none to be seen [unit of y].
double NoiseOf(const Eigen::VectorXd& y);

/// Resolution of the instrument, where the readings show it: their values lie on a lattice, and
/// each is taken several times. 0: they do not [unit of y].
double ResolutionOf(const Eigen::VectorXd& y);

/// Ends of a range within which readings lie.
struct Range {
  double low = -std::numeric_limits<double>::infinity();  ///< [unit]
  double high = std::numeric_limits<double>::infinity();  ///< [unit]
};

/// Ends of the instrument's range, where readings show that they have met them: with noise of more
/// than a step of their resolution no value is taken again and again, except where they are cut
/// off. Infinite: an end that they do not show.
Range RangeOf(const Eigen::VectorXd& y);

/// A channel as residuals: one row a reading, then one for each normal prior of its unknowns.
///
/// Its numbers are the quantity on an even grid of the model's time over the record and a margin to
/// either side, so that the filter can be applied, and clock and delay move without asking the
/// model again. Between the points of the grid: a local cubic.
class Channel : public ResidualKind {
 public:
  /// Throws Error, placed at `where`, for stamps that do not ascend, values that are not finite, a
  /// sigma that is not positive, readings too scattered in time for an even grid.
  explicit Channel(ChannelRecord record, const std::string& where = "channel");
  /// As it was given; without a stated sigma, with the one that is in use.
  const ChannelRecord& record() const { return record_; }
  /// Whether a sigma was stated.
  bool has_sigma() const { return has_sigma_; }

  Eigen::Index rows() const override;
  double TimeOf(Eigen::Index row) const override;
  std::vector<RowSeries> series() const override;
  std::vector<Unknown> unknowns() const override;
  Window Span() const override { return {placed_.front(), placed_.back()}; }
  double Carries() const override { return 0.5 * margin_; }
  void Ask(const Clock& clock, double pivot, Stamps* stamps) const override;
  void AskOver(double low, double high, Stamps* stamps) const override;
  Eigen::VectorXd NumbersOf(const Prediction& prediction) const override;
  void Add(const Eigen::VectorXd& more, Prediction* prediction) const override;
  void Evaluate(const Eigen::VectorXd& numbers, const Clocks& clocks,
                const Eigen::VectorXd& unknowns, Rows* rows) const override;
  Eigen::VectorXd Response(const Eigen::VectorXd& change, const Clocks& clocks,
                           const Eigen::VectorXd& unknowns) const override;
  std::shared_ptr<const ResidualKind> Within(const Window& window) const override;
  std::shared_ptr<const ResidualKind> WithoutDrift(double drift, double pivot) const override;
  std::shared_ptr<const ResidualKind> Rescaled(const Eigen::VectorXd& residual) const override;
  Eigen::VectorXd Readings() const override { return record_.y.cwiseQuotient(record_.sigma); }
  std::shared_ptr<const ResidualKind> Without(
      const std::vector<std::size_t>& samples) const override;
  bool MayBeSilent() const override { return clipped_ > 0; }
  double NoiseOverMotion() const override;
  /// What its own clock shows when the record's shows t, by what is known of it beforehand [s].
  double OwnTime(double t) const;
  /// The model as the instrument would show it, at each reading; NaN: the model has none there
  /// [unit].
  Eigen::VectorXd Simulated(const Eigen::VectorXd& numbers, const Clocks& clocks,
                            const Eigen::VectorXd& unknowns) const;
  std::vector<std::string> Words(const Eigen::VectorXd& numbers, const Clocks& clocks,
                                 const Eigen::VectorXd& unknowns,
                                 const std::string& of) const override;

 private:
  // Values of the instrument's unknowns, whether fitted or known.
  struct Values {
    double gain = 1.0, bias = 0.0, delay = 0.0, drift = 0.0;  // [-], [unit], [s], [-]
  };
  // One of them that is fitted, and what is known of it; in the order of their columns.
  struct Fitted {
    const char* name;
    std::string unit;
    Prior prior;
    double Values::*value;
  };
  Values ValuesOf(const Eigen::VectorXd& unknowns) const;
  // What the filter shows, and over which points [first, end) the model has numbers.
  struct Shown {
    Eigen::VectorXd values;
    Eigen::Index first = 0, end = 0;
  };
  // Where readings are looked at.
  struct At {
    const Values& values;
    const Clocks& clocks;
    const Shown& shown;
    double start;  // of the grid
  };
  // The model's reading, short of gain and bias, and its slope by time; false: it has none there.
  bool ReadingAt(Eigen::Index i, const At& at, double* value, double* slope) const;
  // Whether a reading is at an end of the range, and the model at it or beyond.
  bool IsBeyond(Eigen::Index i, double model) const;
  Rows RowsAt(const Eigen::VectorXd& numbers, const Clocks& clocks,
              const Eigen::VectorXd& unknowns) const;
  double RecordTime(double t, const Values& at) const;       // on the record's clock [s]
  double GridStart(const Clock& clock, double pivot) const;  // [s] by the model
  std::vector<double> GridFrom(double start) const;
  // The cubic at a reading: first of four points, weights of value and slope; -1: off the grid.
  struct Place {
    Eigen::Index first = -1;
    double value[4], slope[4];  // [-], [1/s]
  };
  Place PlaceAt(double time, double start) const;
  // The noise [in sigmas in use] of readings that state none: what their residuals show, and no
  // less than a simulation's tolerance of the motion: smaller residuals are the simulation's as
  // much as the instrument's.
  double NoiseInUse(double shown) const;
  Shown Show(const Eigen::VectorXd& numbers) const;

  ChannelRecord record_;
  // Its stamps on the record's clock, by what is known of its own beforehand [s].
  std::vector<double> placed_;
  bool has_sigma_ = true;
  double step_ = 0.0;    // of the grid [s]
  double margin_ = 0.0;  // of it, to either side of the record [s]
  Eigen::Index count_ = 0;
  std::vector<Fitted> fitted_;
  Eigen::Index prior_rows_ = 0;
  std::vector<std::uint8_t> aside_;  // by reading; empty: none
  Eigen::Index clipped_ = 0;         // readings at an end of the range
};

}  // namespace unfurl::correlate
