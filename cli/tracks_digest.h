#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "data/tracks.h"

namespace unfurl::cli {

// What a page shows of tracks of any length, in constant memory: every so many samples a dot, and
// counts of all samples in slices of time, so that nothing that went wrong falls between the dots.
class TracksDigest {
 public:
  // `duration` [s] and `samples` of the whole record, as far as known beforehand.
  TracksDigest(const data::Tracks& layout, double start, double duration, std::size_t samples);

  // `residuals`: samples x cameras, or empty [px].
  void Add(const data::Tracks& block, std::span<const float> residuals);

  struct Dots {
    std::vector<double> t, sigma;               // [s], of the distance [m]
    std::array<std::vector<double>, 3> p;       // NaN where unsolvable [m]
    std::array<std::vector<double>, 3> axis;    // sigma of each axis, both parts [m]
    std::vector<Eigen::Matrix3d> covariance;    // both parts; zero where unsolvable [m^2]
    std::vector<std::uint32_t> used, left_out;  // bit c: camera c
  };
  struct Slice {
    std::array<std::size_t, 4> status{};
  };
  struct Incident {  // a sample that was not plainly good
    double t = 0.0;  // [s]
    int mark = 0;
    data::SampleStatus status = data::SampleStatus::kGood;
    data::SampleReason reason = data::SampleReason::kNone;
    std::uint32_t left_out = 0;
  };
  static constexpr std::size_t kSlices = 150;  // of the record's duration, in the chart of statuses

  // Of each axis, what charts take off: marks in a surveyor's grid lie far from zero [m].
  std::array<double, 3> FarOrigins() const;
  // Least and largest coordinate of an axis; infinite and reversed where there is none [m].
  std::pair<double, double> Extent(std::size_t axis) const;

  std::vector<std::string> marks, cameras;
  double start = 0.0, slice = 0.0;                 // [s]
  std::vector<Dots> dots;                          // by mark
  std::vector<std::array<Slice, kSlices>> slices;  // by mark
  std::vector<std::vector<double>> residual_t;     // by camera [s]
  std::vector<std::vector<double>> residual;       // by camera [px]
  std::vector<double> residual_squared;            // by camera, of all samples [px^2]
  std::vector<std::size_t> residual_count;
  std::vector<std::array<std::size_t, data::kSampleReasons>> reasons;  // by mark
  std::vector<Incident> incidents;  // the first of every stretch of alike ones
  std::size_t more_incidents = 0;

 private:
  void AddIncident(const data::Tracks& block, std::size_t i);
  void AddResiduals(double t, bool shown, std::size_t i, std::span<const float> residuals);
  void AddDot(const data::Tracks& block, std::size_t i);

  std::size_t every_ = 1;
  std::vector<std::size_t> seen_;  // by mark
  std::vector<Incident> last_;     // by mark
};

}  // namespace unfurl::cli
