// What a change of the model does to the rows of a registration.
#include <cmath>

#include "correlate/align/registration.h"
#include "correlate/align/sample_whitener.h"
#include "correlate/residual/row_layout.h"

namespace unfurl::correlate {

ResidualKind::Clocks ClocksOf(const Observations& observations, const Clock& reference,
                              const Clock& at) {
  const double pivot = observations.Pivot();
  return {at, reference, pivot, reference.ModelTime(observations.End(), pivot)};
}

namespace {

std::vector<Eigen::Index> SilentRows(const ResidualKind& kind, const Prediction& prediction,
                                     const ResidualKind::Clocks& clocks,
                                     const Eigen::VectorXd& own) {
  ResidualKind::Rows rows;
  rows.residual.resize(kind.rows());
  rows.by_time.resize(kind.rows());
  rows.by_unknown.resize(kind.rows(), own.size());
  kind.Evaluate(kind.NumbersOf(prediction), clocks, own, &rows);
  std::vector<Eigen::Index> out;
  for (const RowSeries& s : kind.series()) {
    for (std::size_t i = 0; i < s.size(); ++i) {
      if (!s.Known(rows.residual, i)) out.push_back(s.Row(i));
    }
  }
  return out;
}

}  // namespace

Eigen::MatrixXd WhitenedSensitivity(const Observations& observations, const Prediction& prediction,
                                    const Clock& reference, const Registration& at,
                                    const std::vector<Change>& change) {
  const auto columns = static_cast<Eigen::Index>(change.size());
  const RowLayout layout(observations);
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(layout.rows, columns);
  const Eigen::Matrix3d R = at.X_WM.linear();
  Eigen::Index row = 0;
  for (std::size_t m = 0; m < observations.marks.size(); ++m) {
    const MarkSeries& series = observations.marks[m];
    const MarkMotion& motion = prediction.marks[m];
    for (Eigen::Index i = 0; i < series.p.cols(); ++i, row += 3) {
      if (!Known(motion, i)) continue;
      const Eigen::Matrix3d WR = Whitener(series, motion, i, R) * R;
      for (Eigen::Index j = 0; j < columns; ++j) {
        out.block<3, 1>(row, j) = -WR * change[static_cast<std::size_t>(j)].marks[m].col(i);
      }
    }
  }
  const ResidualKind::Clocks clocks = ClocksOf(observations, reference, at.clock());
  for (std::size_t k = 0; k < observations.others.size(); ++k) {
    const ResidualKind& kind = *observations.others[k];
    const Eigen::VectorXd own = layout.OwnOf(k, at.own);
    std::vector<Eigen::Index> silent;
    if (kind.MayBeSilent()) silent = SilentRows(kind, prediction, clocks, own);
    for (Eigen::Index j = 0; j < columns; ++j) {
      out.col(j).segment(layout.others[k], kind.rows()) =
          kind.Response(change[static_cast<std::size_t>(j)].others[k], clocks, own);
      for (const Eigen::Index row : silent) out(layout.others[k] + row, j) = 0.0;
    }
  }
  return out;
}

std::vector<Eigen::Matrix3Xd> ResidualsInModelFrame(const Observations& observations,
                                                    const Prediction& prediction,
                                                    const Clock& reference,
                                                    const Registration& at) {
  const int k = observations.shared_rank;
  const double pivot = observations.Pivot();
  std::vector<Eigen::Matrix3Xd> out;
  for (std::size_t m = 0; m < observations.marks.size(); ++m) {
    const MarkSeries& series = observations.marks[m];
    const MarkMotion& motion = prediction.marks[m];
    Eigen::Matrix3Xd e = Eigen::Matrix3Xd::Zero(3, series.p.cols());
    for (Eigen::Index i = 0; i < series.p.cols(); ++i) {
      if (!Known(motion, i)) continue;
      const double ahead =
          Ahead(series.t[static_cast<std::size_t>(i)], pivot, reference, at.clock());
      const Eigen::Vector3d y = motion.p.col(i) - ahead * motion.v.col(i);
      Eigen::Vector3d w = series.p.col(i) - at.X_WM * y;
      if (k > 0 && at.z.size() == k) w -= series.shared.middleCols(i * k, k) * at.z;
      e.col(i) = at.X_WM.linear().transpose() * w;
    }
    out.push_back(std::move(e));
  }
  return out;
}

}  // namespace unfurl::correlate
