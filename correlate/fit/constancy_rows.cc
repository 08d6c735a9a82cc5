#include "correlate/fit/constancy_rows.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/dense.h"
#include "correlate/residual/row_layout.h"
#include "correlate/sampled_model.h"

namespace unfurl::correlate {

namespace {

// A value's rise or fall along the record, and its bend; more would take more of the noise with it
// than a missing effect adds.
constexpr int kDegree = 2;
// Of a column's square, after the fit's own columns are out of it: below, it is one of them but for
// the differences that these were made by (parts in a thousand).
constexpr double kOwn = 1e-6;

// Time of each row, the record being -1 to 1; NaN: it has none.
Eigen::VectorXd TimeOfRows(const Observations& o) {
  const RowLayout layout(o);
  Eigen::VectorXd x =
      Eigen::VectorXd::Constant(layout.rows, std::numeric_limits<double>::quiet_NaN());
  const double start = o.Start(), span = std::max(1e-12, o.End() - start);
  auto place = [&](double t) { return std::clamp(2.0 * (t - start) / span - 1.0, -1.0, 1.0); };
  for (const RowSeries& s : layout.series) {
    for (std::size_t i = 0; i < s.size(); ++i) {
      x.segment(s.Row(i), s.axes).setConstant(place((*s.t)[i]));
    }
  }
  return x;
}

// P_0 .. P_2 of each row's time, 0 where it has none.
Eigen::MatrixXd Legendre(const Eigen::VectorXd& x) {
  Eigen::MatrixXd p = Eigen::MatrixXd::Zero(x.size(), kDegree + 1);
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    const double t = x(i);
    if (std::isnan(t)) continue;
    p.row(i) << 1.0, t, 1.5 * t * t - 0.5;
  }
  return p;
}

// d residual / d offset of the record's clock.
Eigen::VectorXd ClockColumn(const ConstancyInput& in) {
  Observations free = *in.observations;
  free.placement.offset = Prior::Free();
  RegistrationOptions stay = in.registration;
  stay.max_iterations = 0;
  stay.with_others = true;
  const Eigen::Index column = WithPlacement(stay, free).fit_frame ? 6 : 0;
  return FitRegistration(free, *in.prediction, in.reference, in.at, stay)
      .jacobian.col(column)
      .head(in.residual->size());
}

// Of the motion about its mean by a part of itself.
Change SizeOf(const ConstancyInput& in) {
  Change size;
  for (const MarkMotion& m : in.prediction->marks) {
    size.marks.push_back(m.p.cols() > 0 ? (m.p.colwise() - m.p.rowwise().mean()).eval() : m.p);
  }
  for (const auto& kind : in.observations->others) {
    Eigen::VectorXd numbers = kind->NumbersOf(*in.prediction);
    const double n = static_cast<double>(numbers.array().isFinite().count());
    numbers = numbers.array().isFinite().select(numbers, 0.0);
    const double mean = numbers.sum() / std::max(1.0, n);
    numbers = kind->series().empty() ? Eigen::VectorXd::Zero(numbers.size()).eval()
                                     : (numbers.array() - mean).matrix().eval();
    size.others.push_back(std::move(numbers));
  }
  return size;
}

Eigen::MatrixXd Columns(const ConstancyInput& in, const Change& change) {
  return WhitenedSensitivity(*in.observations, *in.prediction, in.reference, in.at, {change});
}

}  // namespace

// An orthonormal basis of what `columns` span beyond `basis`.
Eigen::MatrixXd Beyond(const Eigen::MatrixXd& basis, Eigen::MatrixXd columns) {
  for (Eigen::Index c = 0; c < columns.cols(); ++c) {
    const double norm = columns.col(c).norm();
    if (norm > 0.0) columns.col(c) /= norm;
  }
  for (int twice = 0; twice < 2; ++twice) columns -= basis * (basis.transpose() * columns);
  if (columns.cols() == 0) return columns;
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(columns);
  qr.setThreshold(0.0);
  Eigen::Index rank = 0;
  while (rank < columns.cols() && std::abs(qr.matrixR()(rank, rank)) > std::sqrt(kOwn)) ++rank;
  return qr.householderQ() * Eigen::MatrixXd::Identity(columns.rows(), rank);
}

QuestionRows OwnRows(const ConstancyInput& in) {
  QuestionRows rows;
  rows.residual = *in.residual;
  rows.count = static_cast<double>((in.residual->array() != 0.0).count());
  rows.draws = in.observations->shared_rank;
  const Eigen::Index n = rows.residual.size();
  Eigen::MatrixXd known(n, 0);
  if (!in.known.empty()) known = Columns(in, in.known);
  rows.own.resize(n, in.sensitivity.cols() + known.cols() + in.jacobian->cols());
  rows.own << in.sensitivity, known, *in.jacobian;
  return rows;
}

QuestionRows RowsOfValues(const ConstancyInput& in, const QuestionRows& own) {
  QuestionRows rows = own;
  const Eigen::MatrixXd p = Legendre(TimeOfRows(*in.observations));
  auto add = [&](const Eigen::VectorXd& column, int from, int to) {
    rows.groups.emplace_back(p.middleCols(from, to - from + 1).array().colwise() * column.array());
    rows.added += rows.groups.back().cols();
  };
  // As many as leave ten rows to each.
  const auto groups = static_cast<double>(in.sensitivity.cols() + 2);
  const int degree = std::clamp(static_cast<int>(rows.count / (10.0 * groups)), 1, kDegree);
  for (Eigen::Index j = 0; j < in.sensitivity.cols(); ++j) add(in.sensitivity.col(j), 1, degree);
  add(ClockColumn(in), 0, 1);
  add(Columns(in, SizeOf(in)).col(0), 0, 1);
  return rows;
}

QuestionRows RowsOfRivals(const ConstancyInput& in, const QuestionRows& own,
                          std::vector<int>* index) {
  QuestionRows rows = own;
  rows.one_sided = true;
  for (std::size_t i = 0; in.rivals != nullptr && i < in.rivals->size(); ++i) {
    if ((*in.rivals)[i].empty()) continue;
    rows.groups.push_back(Columns(in, (*in.rivals)[i]));
    rows.added += 1;
    index->push_back(static_cast<int>(i));
  }
  return rows;
}

}  // namespace unfurl::correlate
