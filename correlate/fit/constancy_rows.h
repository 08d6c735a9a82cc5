#pragma once

#include <Eigen/Core>
#include <vector>

#include "correlate/fit/constancy.h"
#include "correlate/fit/series_noise.h"

namespace unfurl::correlate {

/// An orthonormal basis of what `columns` span beyond `basis`.
Eigen::MatrixXd Beyond(const Eigen::MatrixXd& basis, Eigen::MatrixXd columns);

/// The fit's own columns, those of a question in groups, and the residuals.
struct QuestionRows {
  Eigen::MatrixXd own;  // the draw's last
  std::vector<Eigen::MatrixXd> groups;
  Eigen::VectorXd residual;
  double count = 0.0;      // that take part
  Eigen::Index added = 0;  // columns of all groups
  Eigen::Index draws = 0;
  bool one_sided = false;  // groups of one column, of which there can be no less than none

  // All columns, the draw's last.
  Eigen::MatrixXd All() const {
    Eigen::MatrixXd all(own.rows(), own.cols() + added);
    Eigen::Index at = own.cols() - draws;
    all.leftCols(at) = own.leftCols(at);
    for (const Eigen::MatrixXd& g : groups) {
      all.middleCols(at, g.cols()) = g;
      at += g.cols();
    }
    all.rightCols(draws) = own.rightCols(draws);
    return all;
  }
  void Whiten(const RowWhitening& whitening) {
    if (whitening.identity()) return;
    whitening.Apply(own);
    for (Eigen::MatrixXd& g : groups) whitening.Apply(g);
    Eigen::MatrixXd r = residual;
    whitening.Apply(r);
    residual = r.col(0);
  }
};

/// Without a question.
QuestionRows OwnRows(const ConstancyInput& in);
/// Whether the values stay the same: of the parameters, the clock and the motion's size.
QuestionRows RowsOfValues(const ConstancyInput& in, const QuestionRows& own);
/// A group for each rival law that could be asked; `index`: which.
QuestionRows RowsOfRivals(const ConstancyInput& in, const QuestionRows& own,
                          std::vector<int>* index);

}  // namespace unfurl::correlate
