#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "sim/dynamics/observables.h"
#include "sim/methods/simulate.h"
#include "sim/model/model.h"

namespace unfurl::study {

/// Where a mark is, and how it moves.
struct MarkSample {
  double x, y, vx, vy;  // [m], [m/s]
};

/// Marks of a run, sampled as its own steps go: cubics through positions and velocities are the
/// motion to within a tolerance. Of a time at which velocities jump there are two samples.
class MarkSamples {
 public:
  /// `tolerance`: of a position [m].
  MarkSamples(const sim::Model& model, std::vector<int> marks, double tolerance);
  void Take(sim::StepMotion& step);
  void End();

  const std::vector<double>& t() const { return t_; }  // [s]
  /// Of a mark, by sample.
  const std::vector<MarkSample>& Of(std::size_t mark) const { return samples_[mark]; }
  std::size_t marks() const { return marks_.size(); }

 private:
  struct Point {
    double t = 0.0;  // [s]
    std::vector<MarkSample> at;
  };
  Point PointAt(sim::StepMotion& step, double t) const;
  void Keep(const Point& point);
  bool Fits(const Point& end) const;
  void Split(sim::StepMotion& step, const Point& end, int depth);

  const sim::Model& model_;
  std::vector<int> marks_;
  double tolerance_;
  std::vector<double> t_;
  std::vector<std::vector<MarkSample>> samples_;  // by mark
  Point kept_;                                    // the last of them
  std::vector<Point> between_;                    // it and open_
  std::optional<Point> open_;                     // seen last, and not kept
  double fits_ = 0.0;  // the longest interval that was found to fit since the last jump [s]
};

MarkSample AtTime(double t, double t_a, const MarkSample& a, double t_b, const MarkSample& b);

/// Quantities of a run, as its own steps go: cubics through four samples are the quantity. No finer
/// than `least` [s], whatever the steps are: who asks for a quantity at even stamps joins them by
/// cubics of his own.
class QuantitySamples {
 public:
  /// `part`: of the largest value so far, by which a cubic may be off [-].
  QuantitySamples(const sim::Model& model, const std::vector<std::string>& wanted, double part,
                  double least);
  void Take(sim::StepMotion& step);

  const std::vector<data::Quantity>& quantities() const { return observables_.quantities(); }
  const std::vector<double>& t() const { return t_; }  // [s]
  /// NaN past the end, and before the start, unless it is `held` there: no cubic joins what lies
  /// beyond a jump.
  Eigen::VectorXd At(std::size_t quantity, bool held, std::span<const double> wanted) const;

 private:
  using Rows = std::vector<std::vector<double>>;
  void Keep(double t, const std::vector<double>& row);
  std::vector<double> RowAt(sim::StepMotion& step, double t);
  // Fourth differences over what is allowed, the largest.
  double Roughness(const Rows& rows) const;
  void TakeWhole(sim::StepMotion& step);

  sim::Observables observables_;
  double part_, least_;
  std::vector<double> t_, largest_;  // largest_: by quantity, of its values
  std::vector<std::vector<double>> columns_;
  std::vector<std::size_t> jumps_;  // the samples with which stretches begin
};

}  // namespace unfurl::study
