#include "study/step_samples.h"

#include <algorithm>
#include <cmath>

#include "correlate/sampled_model.h"

namespace unfurl::study {

MarkSample AtTime(double t, double t_a, const MarkSample& a, double t_b, const MarkSample& b) {
  const double h = t_b - t_a, u = (t - t_a) / h;
  const double h00 = (1 + 2 * u) * (1 - u) * (1 - u), h01 = u * u * (3 - 2 * u);
  const double h10 = h * u * (1 - u) * (1 - u), h11 = -h * u * u * (1 - u);
  const double d = 6 * u * (1 - u) / h, d0 = (1 - u) * (1 - 3 * u), d1 = u * (3 * u - 2);
  return {h00 * a.x + h10 * a.vx + h01 * b.x + h11 * b.vx,
          h00 * a.y + h10 * a.vy + h01 * b.y + h11 * b.vy, d * (b.x - a.x) + d0 * a.vx + d1 * b.vx,
          d * (b.y - a.y) + d0 * a.vy + d1 * b.vy};
}

MarkSamples::MarkSamples(const sim::Model& model, std::vector<int> marks, double tolerance)
    : model_(model), marks_(std::move(marks)), tolerance_(tolerance), samples_(marks_.size()) {}

MarkSamples::Point MarkSamples::PointAt(sim::StepMotion& step, double t) const {
  const double* state = step.At(t);
  Point out;
  out.t = t;
  out.at.reserve(marks_.size());
  for (const int mark : marks_) {
    const sim::PointMotion at =
        sim::MotionOf(model_, model_.marks[static_cast<std::size_t>(mark)].point, state);
    out.at.push_back({at.x, at.y, at.vx, at.vy});
  }
  return out;
}

void MarkSamples::Keep(const Point& point) {
  t_.push_back(point.t);
  for (std::size_t m = 0; m < marks_.size(); ++m) samples_[m].push_back(point.at[m]);
  kept_ = point;
  between_.clear();
  open_.reset();
}

// Whether what was seen since the last sample lies on the cubics from there to `end`.
bool MarkSamples::Fits(const Point& end) const {
  for (const Point& p : between_) {
    for (std::size_t m = 0; m < marks_.size(); ++m) {
      const MarkSample on = AtTime(p.t, kept_.t, kept_.at[m], end.t, end.at[m]);
      if (!(std::hypot(on.x - p.at[m].x, on.y - p.at[m].y) <= tolerance_)) return false;
    }
  }
  return true;
}

// From the last sample, which lies within the step, to `end`, in halves until they fit.
void MarkSamples::Split(sim::StepMotion& step, const Point& end, int depth) {
  const double length = end.t - kept_.t;
  // A cubic's error goes with the fourth power: of half an interval that fits it is a sixteenth.
  if (2.0 * length <= fits_) {
    open_ = end;
    return;
  }
  const Point middle = PointAt(step, kept_.t + 0.5 * length);
  between_ = {middle};
  if (depth == 0 || Fits(end)) {
    fits_ = std::max(fits_, length);
    open_ = end;
    return;
  }
  Split(step, middle, depth - 1);
  Keep(middle);
  Split(step, end, depth - 1);
}

void MarkSamples::Take(sim::StepMotion& step) {
  constexpr std::size_t kMostBetween = 8;  // steps are seldom shorter, and each is looked at again
  constexpr int kDepth = 12;               // of halves: 4096 parts of a step
  if (step.jumped || t_.empty()) {
    End();
    Keep(PointAt(step, step.from));
    fits_ = 0.0;
  }
  const Point end = PointAt(step, step.to);
  if (open_ && between_.size() < kMostBetween) {
    between_.push_back(*open_);
    if (2.0 * (step.to - step.from) > end.t - kept_.t) {
      between_.push_back(PointAt(step, 0.5 * (step.from + step.to)));
    }
    if (Fits(end)) {
      fits_ = std::max(fits_, end.t - kept_.t);
      open_ = end;
      return;
    }
    fits_ = std::min(fits_, end.t - kept_.t);
  }
  if (open_) Keep(Point(*open_));
  Split(step, end, kDepth);
}

void MarkSamples::End() {
  if (open_) Keep(Point(*open_));
}

QuantitySamples::QuantitySamples(const sim::Model& model, const std::vector<std::string>& wanted,
                                 double part, double least)
    : observables_(model, wanted),
      part_(part),
      least_(least),
      largest_(observables_.quantities().size(), 0.0),
      columns_(largest_.size()) {}

void QuantitySamples::Keep(double t, const std::vector<double>& row) {
  t_.push_back(t);
  for (std::size_t q = 0; q < row.size(); ++q) columns_[q].push_back(row[q]);
}

std::vector<double> QuantitySamples::RowAt(sim::StepMotion& step, double t) {
  const std::vector<double>& row = observables_.Row(t, step.At(t), step.modes());
  for (std::size_t q = 0; q < row.size(); ++q) {
    largest_[q] = std::max(largest_[q], std::fabs(row[q]));
  }
  return row;
}

double QuantitySamples::Roughness(const Rows& rows) const {
  double worst = 0.0;
  for (std::size_t q = 0; q < largest_.size(); ++q) {
    if (!(largest_[q] > 0.0)) continue;
    for (std::size_t i = 4; i < rows.size(); ++i) {
      const double fourth = rows[i][q] - 4.0 * rows[i - 1][q] + 6.0 * rows[i - 2][q] -
                            4.0 * rows[i - 3][q] + rows[i - 4][q];
      worst = std::max(worst, std::fabs(fourth) / largest_[q]);
    }
  }
  return worst;
}

// In even parts, as many as a cubic needs.
void QuantitySamples::TakeWhole(sim::StepMotion& step) {
  // A cubic through four of the points is off by up to 0.042 of their fourth difference at the ends
  // of a stretch, by 0.07 beside parts four times as long.
  constexpr double kOfFourth = 0.1;
  constexpr double kFalls = 4.0;      // by the half, at the least: what falls less is not smooth
  constexpr std::size_t kMost = 256;  // parts of a step
  const double length = step.to - step.from;
  auto at = [&](std::size_t k, std::size_t n) {
    return k == n ? step.to : step.from + length * static_cast<double>(k) / static_cast<double>(n);
  };
  std::size_t parts = 4;
  Rows rows;
  rows.push_back({});
  for (std::size_t q = 0; q < columns_.size(); ++q) rows[0].push_back(columns_[q].back());
  for (std::size_t k = 1; k <= parts; ++k) rows.push_back(RowAt(step, at(k, parts)));
  double rough = Roughness(rows);
  while (kOfFourth * rough > part_ && parts < kMost && length >= 2.0 * least_ * parts) {
    Rows finer;
    for (std::size_t k = 0; k < parts; ++k) {
      finer.push_back(std::move(rows[k]));
      finer.push_back(RowAt(step, at(2 * k + 1, 2 * parts)));
    }
    finer.push_back(std::move(rows[parts]));
    rows = std::move(finer);
    parts *= 2;
    const double now = Roughness(rows);
    const bool falls = kFalls * now <= rough;
    rough = now;
    if (!falls) break;
  }
  for (std::size_t k = 1; k <= parts; ++k) Keep(at(k, parts), rows[k]);
}

void QuantitySamples::Take(sim::StepMotion& step) {
  if (step.jumped || t_.empty()) {
    jumps_.push_back(t_.size());
    Keep(step.from, RowAt(step, step.from));
  }
  if (step.to - step.from >= 4.0 * least_) {
    TakeWhole(step);
    return;
  }
  // Of short steps some samples only, and the end of a stretch.
  for (double t = t_.back() + least_; t <= step.to; t += least_) Keep(t, RowAt(step, t));
  if (!step.ends || !(step.to > t_.back())) return;
  // Beside the end a sample would make a cubic of differences that are mostly rounding.
  constexpr double kBeside = 0.25;  // of a distance
  if (step.to - t_.back() < kBeside * least_ && t_.size() - 1 > jumps_.back()) {
    t_.pop_back();
    for (std::vector<double>& c : columns_) c.pop_back();
  }
  Keep(step.to, RowAt(step, step.to));
}

Eigen::VectorXd QuantitySamples::At(std::size_t quantity, bool held,
                                    std::span<const double> wanted) const {
  Eigen::VectorXd out(static_cast<Eigen::Index>(wanted.size()));
  std::size_t done = 0;
  for (std::size_t k = 0; k < jumps_.size(); ++k) {
    const bool last = k + 1 == jumps_.size();
    const std::size_t begin = jumps_[k], end = last ? t_.size() : jumps_[k + 1];
    std::size_t until = wanted.size();
    if (!last) {
      until = static_cast<std::size_t>(
          std::lower_bound(wanted.begin() + static_cast<std::ptrdiff_t>(done), wanted.end(),
                           t_[end]) -
          wanted.begin());
    }
    out.segment(static_cast<Eigen::Index>(done), static_cast<Eigen::Index>(until - done)) =
        correlate::ValuesAt(std::span(t_).subspan(begin, end - begin),
                            std::span(columns_[quantity]).subspan(begin, end - begin),
                            held && k == 0, wanted.subspan(done, until - done));
    done = until;
  }
  return out;
}

}  // namespace unfurl::study
