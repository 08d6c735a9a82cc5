#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "correlate/model.h"
#include "correlate/placement.h"

namespace unfurl::correlate {

/// A part of a record, its ends included.
struct Window {
  double low = -std::numeric_limits<double>::infinity();  ///< [s], on the record's own clock
  double high = std::numeric_limits<double>::infinity();  ///< likewise [s]
  /// Whether a stamp lies in it.
  bool Contains(double t) const { return t >= low && t <= high; }
};

/// Residual rows that follow one another in time, so that their noise may be correlated: those of a
/// mark, or of a channel. Sample by sample, axis by axis.
struct RowSeries {
  std::string name;                        ///< of the mark or the channel
  const std::vector<double>* t = nullptr;  ///< n stamps, ascending, on the record's clock [s]
  Eigen::Index first = 0;                  ///< its first row
  Eigen::Index axes = 3;                   ///< rows of a sample
  bool has_sigma = true;                   ///< false: rows are in units of a guess of it
  double step = 0.0;  ///< the instrument's resolution, in a row's units; 0: none
  /// By sample, whether it is put aside, so that its rows are 0; null: none is.
  const std::vector<std::uint8_t>* aside = nullptr;

  /// Samples.
  std::size_t size() const { return t->size(); }
  /// Of sample i, its row of an axis.
  Eigen::Index Row(std::size_t i, Eigen::Index axis = 0) const {
    return first + axes * static_cast<Eigen::Index>(i) + axis;
  }
  /// Whether sample i takes part: rows of exactly 0 are those of one without a counterpart.
  bool Known(const Eigen::VectorXd& residual, std::size_t i) const {
    return residual.segment(Row(i), axes).squaredNorm() > 0.0;
  }
};

/// Something that a record holds beside marks, and how it is compared with a model: the times of
/// events, a channel. Of one record, and never changed once made. Everything that a fit does with
/// its rows (registration, differences, ladder, noise, covariance, words) goes through this.
///
/// Its `numbers` are what it takes of a model's prediction; its residuals, in standard deviations,
/// follow from them, from how the clocks lie, and from unknowns of its own (a gain, a bias).
class ResidualKind {
 public:
  /// How the record's clock lies to the model's.
  struct Clocks {
    Clock at;            ///< the record's
    Clock reference;     ///< the one that the prediction was made for
    double pivot = 0.0;  ///< of the drift, on the record's clock [s]
    double last = 0.0;   ///< the last stamp of the record, on the model's clock [s]
  };
  /// Residuals and their derivatives.
  struct Rows {
    Eigen::VectorXd residual;    ///< rows() [-]
    Eigen::VectorXd by_time;     ///< by the model's time at the row's stamp [1/s]
    Eigen::MatrixXd by_unknown;  ///< rows() x unknowns [1/unit]
    Eigen::Index known = 0;      ///< rows of its series that the model has numbers for
  };
  /// One of its own.
  struct Unknown {
    std::string name;    ///< "gain of encoder"
    std::string unit;    ///< "1"
    double start = 0.0;  ///< [unit]
  };

  virtual ~ResidualKind() = default;

  /// How many residual rows there are, those of priors on its unknowns included.
  virtual Eigen::Index rows() const = 0;
  /// The stamp of a row on the record's clock [s]; NaN: it has none (a prior).
  virtual double TimeOf(Eigen::Index row) const = 0;
  /// Which of the rows follow one another in time, the first row being 0; the others are
  /// independent and of variance 1.
  virtual std::vector<RowSeries> series() const { return {}; }
  /// What is solved for together with frame and clock.
  virtual std::vector<Unknown> unknowns() const { return {}; }

  /// What it covers, by what is known of its clock beforehand; empty (low above high): moments.
  virtual Window Span() const {
    return {std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
  }
  /// By how much a clock may move before the model has to be asked again [s].
  virtual double Carries() const { return std::numeric_limits<double>::infinity(); }

  /// Adds what it wants of a model to `stamps`.
  virtual void Ask(const Clock& /*clock*/, double /*pivot*/, Stamps* /*stamps*/) const {}
  /// The same where nothing is known of the clocks: over all of a model's time [s].
  virtual void AskOver(double /*low*/, double /*high*/, Stamps* /*stamps*/) const {}
  /// What it takes of a model; NaN: the model has none.
  virtual Eigen::VectorXd NumbersOf(const Prediction& prediction) const = 0;
  /// Adds to those in a prediction what a ladder's finer rung has more of them.
  virtual void Add(const Eigen::VectorXd& more, Prediction* prediction) const = 0;

  /// Residuals for those numbers, and values of the unknowns.
  virtual void Evaluate(const Eigen::VectorXd& numbers, const Clocks& clocks,
                        const Eigen::VectorXd& unknowns, Rows* rows) const = 0;
  /// d residual / d x for a change d numbers / d x.
  virtual Eigen::VectorXd Response(const Eigen::VectorXd& change, const Clocks& clocks,
                                   const Eigen::VectorXd& unknowns) const = 0;

  /// The part of it within a window; null: nothing is left.
  virtual std::shared_ptr<const ResidualKind> Within(const Window& window) const = 0;
  /// The same by a clock that runs at the model's rate, see correlate::WithoutDrift.
  virtual std::shared_ptr<const ResidualKind> WithoutDrift(double drift, double pivot) const = 0;

  /// The same with the noise that these residuals of its rows show, where none was stated; null: it
  /// was.
  virtual std::shared_ptr<const ResidualKind> Rescaled(const Eigen::VectorXd& /*residual*/) const {
    return nullptr;
  }

  /// What it holds beside the model: rows of its series, in their sigmas; empty: they are no
  /// readings. A residual is one of these less the model's.
  virtual Eigen::VectorXd Readings() const { return {}; }
  /// The same with these samples of its series put aside, and no others; null: it has no readings.
  virtual std::shared_ptr<const ResidualKind> Without(
      const std::vector<std::size_t>& /*samples*/) const {
    return nullptr;
  }
  /// Whether the model decides which of its rows tell something: one whose residual is 0 then
  /// responds to nothing.
  virtual bool MayBeSilent() const { return false; }

  /// Its noise over its motion, RMS over RMS [-]; infinity: it is nothing that moves.
  virtual double NoiseOverMotion() const { return std::numeric_limits<double>::infinity(); }

  /// How each thing observed lies to the model, a sentence each; `of` names the trial (" of A"), or
  /// is empty.
  virtual std::vector<std::string> Words(const Eigen::VectorXd& numbers, const Clocks& clocks,
                                         const Eigen::VectorXd& unknowns,
                                         const std::string& of) const = 0;
};

/// All that a record holds beside marks, kind by kind.
using ResidualKinds = std::vector<std::shared_ptr<const ResidualKind>>;

}  // namespace unfurl::correlate
