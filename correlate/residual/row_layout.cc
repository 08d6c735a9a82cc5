#include "correlate/residual/row_layout.h"

namespace unfurl::correlate {

RowLayout::RowLayout(const Observations& observations) {
  for (const MarkSeries& mark : observations.marks) {
    series.push_back({mark.name, &mark.t, rows, 3, observations.has_sigma});
    rows += 3 * static_cast<Eigen::Index>(mark.size());
  }
  unknowns = {0};
  for (const auto& kind : observations.others) {
    others.push_back(rows);
    unknowns.push_back(unknowns.back() + static_cast<Eigen::Index>(kind->unknowns().size()));
    for (RowSeries& s : kind->series()) {
      s.first += rows;
      series.push_back(std::move(s));
    }
    rows += kind->rows();
  }
  priors = rows;
  draws = priors + observations.PriorRows();
  rows = draws + observations.shared_rank;
  for (const RowSeries& s : series) {
    first_axis.push_back(axes);
    axes += static_cast<std::size_t>(s.axes);
  }
}

Eigen::MatrixXd RowLayout::IndependentGram(const Eigen::MatrixXd& A) const {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(A.cols(), A.cols());
  // The gaps between series; they lie in the order of the rows.
  Eigen::Index row = 0;
  auto add_until = [&](Eigen::Index end) {
    if (end > row)
      out.noalias() += A.middleRows(row, end - row).transpose() * A.middleRows(row, end - row);
  };
  for (const RowSeries& s : series) {
    add_until(s.first);
    row = s.Row(s.size());
  }
  add_until(draws);
  return out;
}

Eigen::Index RowLayout::IndependentRows() const {
  Eigen::Index n = draws;
  for (const RowSeries& s : series) n -= s.axes * static_cast<Eigen::Index>(s.size());
  return n;
}

}  // namespace unfurl::correlate
