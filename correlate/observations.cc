#include "correlate/observations.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/error.h"
#include "base/text.h"
#include "correlate/sampled_model.h"

namespace unfurl::correlate {

namespace {

std::vector<std::string> Chosen(const std::vector<std::string>& wanted,
                                const std::vector<std::string>& there) {
  for (const std::string& name : wanted) {
    if (std::find(there.begin(), there.end(), name) == there.end()) {
      throw Error("there is no mark '" + name + "'", "marks", "the record has " + JoinWords(there));
    }
  }
  return wanted.empty() ? there : wanted;
}

MarkSeries Select(const MarkSeries& from, const std::vector<std::size_t>& keep, int rank) {
  MarkSeries to;
  to.name = from.name;
  const auto n = static_cast<Eigen::Index>(keep.size());
  to.p.resize(3, n);
  to.cov.resize(6, n);
  to.shared.resize(3, n * rank);
  to.t.reserve(keep.size());
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto k = static_cast<Eigen::Index>(keep[static_cast<std::size_t>(i)]);
    to.t.push_back(from.t[static_cast<std::size_t>(k)]);
    to.p.col(i) = from.p.col(k);
    to.cov.col(i) = from.cov.col(k);
    to.shared.middleCols(i * rank, rank) = from.shared.middleCols(k * rank, rank);
  }
  return to;
}

}  // namespace

Eigen::Matrix3d Symmetric(const Eigen::Matrix<double, 6, 1>& c) {
  Eigen::Matrix3d m;
  m << c(0), c(1), c(2), c(1), c(3), c(4), c(2), c(4), c(5);
  return m;
}

std::size_t Observations::size() const {
  std::size_t n = 0;
  for (const MarkSeries& m : marks) n += m.size();
  return n;
}

std::size_t Observations::readings() const {
  std::size_t n = size();
  for (const auto& kind : others) {
    for (const RowSeries& s : kind->series()) n += s.size();
  }
  return n;
}

double Observations::ShortestStep() const {
  double step = std::numeric_limits<double>::infinity();
  auto look = [&](const std::vector<double>& t) {
    const double median = MedianStep(t);
    if (median > 0.0) step = std::min(step, median);
  };
  for (const MarkSeries& m : marks) look(m.t);
  for (const auto& kind : others) {
    for (const RowSeries& s : kind->series()) look(*s.t);
  }
  return std::isfinite(step) ? step : 0.0;
}

double Observations::Start() const {
  double t = std::numeric_limits<double>::infinity();
  for (const MarkSeries& m : marks) {
    if (m.size() > 0) t = std::min(t, m.t.front());
  }
  for (const auto& kind : others) t = std::min(t, kind->Span().low);
  return t;
}

double Observations::End() const {
  double t = -std::numeric_limits<double>::infinity();
  for (const MarkSeries& m : marks) {
    if (m.size() > 0) t = std::max(t, m.t.back());
  }
  for (const auto& kind : others) t = std::max(t, kind->Span().high);
  return t;
}

int Observations::FindMark(const std::string& name) const {
  for (std::size_t m = 0; m < marks.size(); ++m) {
    if (marks[m].name == name) return static_cast<int>(m);
  }
  return -1;
}

double Observations::Pivot() const {
  return std::isnan(placement.pivot) ? 0.5 * (Start() + End()) : placement.pivot;
}

double Stamps::Last() const {
  double last = 0.0;
  for (const std::vector<double>& list : t) {
    if (!list.empty()) last = std::max(last, list.back());
  }
  for (const QuantityStamps& q : quantities) {
    if (!q.t.empty()) last = std::max(last, q.t.back());
  }
  return last;
}

Stamps Observations::StampsAt(const Clock& clock) const {
  Stamps stamps;
  const double pivot = Pivot();
  for (const MarkSeries& m : marks) {
    stamps.marks.push_back(m.name);
    stamps.t.push_back(m.t);
    for (double& t : stamps.t.back()) t = clock.ModelTime(t, pivot);
  }
  for (const auto& kind : others) kind->Ask(clock, pivot, &stamps);
  return stamps;
}

Eigen::Index Observations::PriorRows() const {
  constexpr Foreknowledge kNormal = Foreknowledge::kNormal;
  return (placement.frame.kind == kNormal && !marks.empty() ? 6 : 0) +
         (placement.offset.kind == kNormal ? 1 : 0) + (placement.drift.kind == kNormal ? 1 : 0);
}

Eigen::Index Observations::OtherUnknowns() const {
  std::size_t n = 0;
  for (const auto& kind : others) n += kind->unknowns().size();
  return static_cast<Eigen::Index>(n);
}

Observations FromTracks(const data::Tracks& tracks, const std::vector<std::string>& marks,
                        const Window& window) {
  Observations out;
  out.shared_rank = tracks.shared_rank;
  out.frame = tracks.frame;
  const int k = tracks.shared_rank;
  for (const std::string& name : Chosen(marks, tracks.marks)) {
    std::vector<std::size_t> keep;
    for (std::size_t i : tracks.SamplesOf(tracks.FindMark(name))) {
      if (window.Contains(tracks.t[i])) keep.push_back(i);
    }
    MarkSeries series;
    series.name = name;
    const auto n = static_cast<Eigen::Index>(keep.size());
    series.p.resize(3, n);
    series.cov.resize(6, n);
    series.shared.resize(3, n * k);
    for (Eigen::Index i = 0; i < n; ++i) {
      const std::size_t from = keep[static_cast<std::size_t>(i)];
      const auto column = static_cast<Eigen::Index>(from);
      if (!series.t.empty() && tracks.t[from] <= series.t.back()) {
        throw Error(fmt::format("the stamps of {} do not ascend at t = {} s", name, tracks.t[from]),
                    "tracks", "write the samples in order of time, one per stamp and mark");
      }
      const Eigen::LLT<Eigen::Matrix3d> llt(Symmetric(tracks.cov.col(column)));
      if (llt.info() != Eigen::Success) {
        throw Error(fmt::format("the covariance of {} at t = {} s is not positive definite", name,
                                tracks.t[from]),
                    "tracks", "give each sample its 3 x 3 covariance in m^2");
      }
      series.t.push_back(tracks.t[from]);
      series.p.col(i) = tracks.p.col(column);
      series.cov.col(i) = tracks.cov.col(column);
      if (k > 0) series.shared.middleCols(i * k, k) = tracks.shared.middleCols(column * k, k);
    }
    out.marks.push_back(std::move(series));
  }
  return out;
}

Observations FromRun(const data::Run& run, const std::vector<std::string>& marks,
                     const Window& window) {
  Observations out;
  out.has_sigma = false;
  out.held_before = true;
  out.frame = "model";
  std::vector<std::size_t> keep;
  for (std::size_t i = 0; i < run.t.size(); ++i) {
    if (window.Contains(run.t[i])) keep.push_back(i);
  }
  for (const std::string& name : Chosen(marks, run.marks)) {
    const std::vector<double>& x = run.Column(name + ".x");
    const std::vector<double>& y = run.Column(name + ".y");
    MarkSeries series;
    series.name = name;
    const auto n = static_cast<Eigen::Index>(keep.size());
    series.p = Eigen::Matrix3Xd::Zero(3, n);
    series.cov = Eigen::Matrix<double, 6, Eigen::Dynamic>::Zero(6, n);
    series.shared.resize(3, 0);
    for (Eigen::Index i = 0; i < n; ++i) {
      const std::size_t from = keep[static_cast<std::size_t>(i)];
      series.t.push_back(run.t[from]);
      series.p(0, i) = x[from];
      series.p(1, i) = y[from];
      series.cov.col(i) << 1.0, 0.0, 0.0, 1.0, 0.0, 1.0;
    }
    out.marks.push_back(std::move(series));
  }
  return out;
}

Observations Cut(const Observations& all, const Window& window) {
  Observations out = all;
  out.placement.pivot = all.Pivot();
  for (MarkSeries& series : out.marks) {
    std::vector<std::size_t> keep;
    for (std::size_t i = 0; i < series.size(); ++i) {
      if (window.Contains(series.t[i])) keep.push_back(i);
    }
    if (keep.size() < series.size()) series = Select(series, keep, all.shared_rank);
  }
  out.others.clear();
  for (const auto& kind : all.others) {
    if (auto part = kind->Within(window)) out.others.push_back(std::move(part));
  }
  return out;
}

Observations WithoutDraw(Observations record) {
  for (MarkSeries& series : record.marks) series.shared.resize(3, 0);
  record.shared_rank = 0;
  return record;
}

Observations WithoutDrift(Observations record, double drift, double pivot) {
  for (MarkSeries& series : record.marks) {
    for (double& t : series.t) t = pivot + (t - pivot) / (1.0 + drift);
  }
  for (auto& kind : record.others) kind = kind->WithoutDrift(drift, pivot);
  record.placement.pivot = pivot;
  Prior& known = record.placement.drift;
  if (known.Told()) {
    known.mean = (1.0 + known.mean) / (1.0 + drift) - 1.0;
    known.sigma /= 1.0 + drift;
  }
  return record;
}

}  // namespace unfurl::correlate
