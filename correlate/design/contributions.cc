#include "correlate/design/contributions.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/dense.h"
#include "correlate/design/standard_errors.h"
#include "correlate/fit/normal_matrix.h"
#include "correlate/residual/row_layout.h"

namespace unfurl::correlate {

namespace {

// Which rows belong to which part of one division; -1: to none.
struct Division {
  std::vector<Contribution> parts;
  std::vector<int> of_row;

  explicit Division(Eigen::Index rows) : of_row(static_cast<std::size_t>(rows), -1) {}
  int Add(std::string name) {
    parts.push_back({});
    parts.back().name = std::move(name);
    return static_cast<int>(parts.size()) - 1;
  }
  // `axes` rows of one reading.
  void Put(Eigen::Index row, Eigen::Index axes, int part) {
    std::fill_n(of_row.begin() + row, axes, part);
    ++parts[static_cast<std::size_t>(part)].readings;
  }
};

struct Divisions {
  Division series, times, lines;
  explicit Divisions(Eigen::Index rows) : series(rows), times(rows), lines(rows) {}
};

// " of A" where there are several trials.
std::string OfTrial(const FitResult& fit, std::size_t t) {
  return fit.trials.size() > 1 ? " of " + fit.trials[t].name : std::string();
}

void DivideTrial(const Observations& o, const RegistrationFit& rows, Eigen::Index first,
                 const std::string& of, int stretches, Divisions* out) {
  const RowLayout layout(o);
  const double start = o.Start(), span = std::max(1e-12, o.End() - start);
  const int first_stretch = static_cast<int>(out->times.parts.size());
  for (int s = 0; s < stretches; ++s) {
    const double width = span / stretches;
    const double from = start + s * width, to = start + (s + 1) * width;
    out->times.Add(fmt::format("{:.3g} to {:.3g} s{}", from, to, of));
    out->times.parts.back().from = from;
    out->times.parts.back().to = to;
  }
  auto stretch = [&](double t) {
    const int s = static_cast<int>((t - start) / span * stretches);
    return first_stretch + std::clamp(s, 0, stretches - 1);
  };
  const Strobe strobe = FindStrobe(o);
  std::vector<int> line(strobe.slots.size(), -1);
  for (std::size_t s = 0; s < strobe.slots.size(); ++s) {
    if (strobe.slots[s].empty()) continue;
    line[s] = out->lines.Add(fmt::format("line {}, {}{}", s + 1, strobe.slots[s], of));
  }
  for (std::size_t m = 0; m < layout.series.size(); ++m) {
    const RowSeries& series = layout.series[m];
    const int part = out->series.Add(series.name + of);
    for (std::size_t i = 0; i < series.size(); ++i) {
      if (!series.Known(rows.residual, i)) continue;
      const Eigen::Index row = first + series.Row(i);
      const double t = (*series.t)[i];
      out->series.Put(row, series.axes, part);
      out->times.Put(row, series.axes, stretch(t));
      const int slot = m < o.marks.size() ? strobe.SlotAt(t) : -1;
      if (slot >= 0 && line[static_cast<std::size_t>(slot)] >= 0) {
        out->lines.Put(row, series.axes, line[static_cast<std::size_t>(slot)]);
      }
    }
  }
  // Rows that no series holds and that have a time: events.
  int events = -1;
  for (std::size_t k = 0; k < o.others.size(); ++k) {
    for (Eigen::Index i = 0; i < o.others[k]->rows(); ++i) {
      const Eigen::Index row = first + layout.others[k] + i;
      const double t = o.others[k]->TimeOf(i);
      if (std::isnan(t) || out->series.of_row[static_cast<std::size_t>(row)] >= 0) continue;
      if (!o.others[k]->series().empty()) continue;  // a reading without a counterpart
      if (events < 0) events = out->series.Add("events" + of);
      out->series.Put(row, 1, events);
      out->times.Put(row, 1, stretch(t));
    }
  }
}

// Of all rows: what a part of them is weighed against.
struct Whole {
  Eigen::MatrixXd H;
  StandardErrors all;
  Eigen::Index p = 0;
};

// The part whose rows are `own`: its share, and standard errors without it.
void Weigh(const Whole& whole, const Eigen::MatrixXd& own, Contribution* c) {
  const Eigen::MatrixXd gains = own * whole.all.inverse.leftCols(whole.p);
  const StandardErrors left = StandardErrorsOf(whole.H - Gram(own), whole.p);
  for (Eigen::Index j = 0; j < whole.p; ++j) {
    c->share.push_back(gains.col(j).squaredNorm() / std::max(1e-300, whole.all.inverse(j, j)));
    c->without.push_back(left.sigma(j) / whole.all.sigma(j));
  }
}

void WeighParts(const Whole& whole, const Eigen::MatrixXd& A, Division* division) {
  for (std::size_t part = 0; part < division->parts.size(); ++part) {
    std::vector<Eigen::Index> rows;
    for (std::size_t i = 0; i < division->of_row.size(); ++i) {
      if (division->of_row[i] == static_cast<int>(part)) rows.push_back(static_cast<long>(i));
    }
    Eigen::MatrixXd own(static_cast<Eigen::Index>(rows.size()), A.cols());
    for (std::size_t i = 0; i < rows.size(); ++i) {
      own.row(static_cast<Eigen::Index>(i)) = A.row(rows[i]);
    }
    Weigh(whole, own, &division->parts[part]);
  }
}

// A sample's information is that of its cameras' readings, cov^-1 = sum_c w_c g_c g_c^T, w_c the
// inverse variance of a reading: with cov = L L^T and s_c = L^T g_c, I = sum_c w_c s_c s_c^T, which
// gives the w_c by least squares (least norm where cameras are many). The three whitened rows a
// then hold for camera c the row sqrt(w_c) s_c^T a.
void AddCameraRows(const MarkSeries& mark, std::size_t i, const Eigen::MatrixXd& a,
                   const CameraSights& cameras,
                   std::vector<std::vector<Eigen::RowVectorXd>>* rows) {
  const auto column = static_cast<Eigen::Index>(i);
  const Eigen::Matrix3d L = Symmetric(mark.cov.col(column)).llt().matrixL();
  const auto count = static_cast<Eigen::Index>(cameras.names.size());
  Eigen::MatrixXd products(9, count);
  Eigen::Matrix3Xd sights(3, count);
  for (Eigen::Index c = 0; c < count; ++c) {
    sights.col(c) =
        L.transpose() * cameras.gradient(static_cast<std::size_t>(c), mark.p.col(column));
    const Eigen::Matrix3d product = sights.col(c) * sights.col(c).transpose();
    products.col(c) = product.reshaped();
  }
  const Eigen::Matrix3d identity = Eigen::Matrix3d::Identity();
  const Eigen::VectorXd wanted = identity.reshaped();
  const Eigen::VectorXd weight = products.completeOrthogonalDecomposition().solve(wanted);
  for (Eigen::Index c = 0; c < count; ++c) {
    // A reading that was left out has none, up to rounding.
    constexpr double kNone = 1e-6;  // of the sample's information
    if (!(weight(c) * sights.col(c).squaredNorm() > kNone)) continue;
    (*rows)[static_cast<std::size_t>(c)].push_back(std::sqrt(weight(c)) *
                                                   sights.col(c).transpose() * a);
  }
}

std::vector<Contribution> WeighCameras(const FitProblem& problem, const FitResult& fit,
                                       const StackedRows& stacked, const Whole& whole,
                                       const CameraSights& cameras) {
  std::vector<std::vector<Eigen::RowVectorXd>> rows(cameras.names.size());
  for (std::size_t t = 0; t < fit.trials.size(); ++t) {
    const Observations& o = *problem.trials[t].observations;
    const RowLayout layout(o);
    for (std::size_t m = 0; m < o.marks.size(); ++m) {
      for (std::size_t i = 0; i < o.marks[m].size(); ++i) {
        if (!layout.series[m].Known(fit.trials[t].registration.residual, i)) continue;
        const Eigen::Index row = stacked.blocks[t].row + layout.series[m].Row(i);
        AddCameraRows(o.marks[m], i, stacked.A.middleRows(row, 3), cameras, &rows);
      }
    }
  }
  std::vector<Contribution> out;
  for (std::size_t c = 0; c < rows.size(); ++c) {
    Eigen::MatrixXd own(static_cast<Eigen::Index>(rows[c].size()), stacked.A.cols());
    for (std::size_t i = 0; i < rows[c].size(); ++i) own.row(static_cast<long>(i)) = rows[c][i];
    out.push_back({});
    out.back().name = cameras.names[c];
    out.back().readings = rows[c].size();
    Weigh(whole, own, &out.back());
  }
  return out;
}

}  // namespace

Contributions ContributionsOf(const FitProblem& problem, const FitResult& fit, int stretches,
                              const CameraSights* cameras) {
  const auto p = static_cast<Eigen::Index>(problem.parameters.size());
  std::vector<Eigen::MatrixXd> jacobian;
  for (const TrialResult& t : fit.trials) jacobian.push_back(t.registration.jacobian);
  const StackedRows stacked = StackRows(fit.sensitivity, jacobian);
  Divisions divisions(stacked.A.rows());
  for (std::size_t t = 0; t < fit.trials.size(); ++t) {
    DivideTrial(*problem.trials[t].observations, fit.trials[t].registration, stacked.blocks[t].row,
                OfTrial(fit, t), stretches, &divisions);
  }
  Whole whole;
  whole.H = Gram(stacked.A);
  whole.all = StandardErrorsOf(whole.H, p);
  whole.p = p;
  Contributions out;
  for (const Parameter& q : problem.parameters) out.parameters.push_back(q.name);
  out.sigma.assign(whole.all.sigma.begin(), whole.all.sigma.end());
  for (Division* d : {&divisions.series, &divisions.times, &divisions.lines}) {
    WeighParts(whole, stacked.A, d);
  }
  if (cameras != nullptr) {
    out.cameras = WeighCameras(problem, fit, stacked, whole, *cameras);
  }
  out.series = std::move(divisions.series.parts);
  out.times = std::move(divisions.times.parts);
  out.lines = std::move(divisions.lines.parts);
  out.priors.assign(static_cast<std::size_t>(p), 1.0);
  for (const Contribution& c : out.series) {
    for (std::size_t j = 0; j < c.share.size(); ++j) out.priors[j] -= c.share[j];
  }
  for (double& share : out.priors) share = std::max(0.0, share);
  return out;
}

}  // namespace unfurl::correlate
