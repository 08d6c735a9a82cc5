#pragma once

#include <Eigen/Core>
#include <vector>

#include "correlate/observations.h"

namespace unfurl::correlate {

/// Where the residual rows of a registration stand: three per sample of a mark, in the order of the
/// observations; those of the residual kinds, one kind after the other; one each for what is known
/// of frame, offset and drift beforehand; then those of the calibration's draw. It refers to the
/// observations, which must outlive it.
struct RowLayout {
  explicit RowLayout(const Observations& observations);

  /// Of the marks, then of the kinds.
  std::vector<RowSeries> series;
  /// First row of each residual kind.
  std::vector<Eigen::Index> others;
  /// First unknown of each residual kind, and after the last: into Registration::own.
  std::vector<Eigen::Index> unknowns;
  Eigen::Index priors = 0;  ///< first row of what is known of frame and clock
  Eigen::Index draws = 0;   ///< first row of the draw
  Eigen::Index rows = 0;    ///< all

  /// Axes of the series before, all together: where a series begins among those of a noise model.
  std::vector<std::size_t> first_axis;
  std::size_t axes = 0;  ///< of all series

  /// Of all kinds' unknowns, those of one.
  Eigen::VectorXd OwnOf(std::size_t kind, const Eigen::VectorXd& own) const {
    return own.segment(unknowns[kind], unknowns[kind + 1] - unknowns[kind]);
  }

  /// A^T A of the rows that no series holds, those of the draw left out: independent, of
  /// variance 1.
  Eigen::MatrixXd IndependentGram(const Eigen::MatrixXd& A) const;
  /// How many rows are independent ones, those of the draw left out.
  Eigen::Index IndependentRows() const;
};

}  // namespace unfurl::correlate
