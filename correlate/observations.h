#pragma once

#include <Eigen/Core>
#include <limits>
#include <string>
#include <vector>

#include "correlate/model.h"
#include "correlate/placement.h"
#include "data/run.h"
#include "data/tracks.h"

namespace unfurl::correlate {

// One mark's samples, in order of time. The error of sample i is random_i + F_i z, see
// data::Tracks: random_i of covariance cov_i, z one draw common to all samples of all marks.
struct MarkSeries {
  std::string name;
  std::vector<double> t;                         // n [s]
  Eigen::Matrix3Xd p;                            // 3 x n [m]
  Eigen::Matrix<double, 6, Eigen::Dynamic> cov;  // xx, xy, xz, yy, yz, zz by n [m^2]
  Eigen::Matrix3Xd shared;                       // 3 x (n k) [m]

  std::size_t size() const { return t.size(); }  // n
};

// A moment that something else than the marks has told: a latch's switch, say.
struct TimedEvent {
  std::string kind;    // "latch", "contact_start", "contact_end", "watch"
  std::string where;   // the joint, or the watch
  int count = 1;       // the first, the second..
  double t = 0.0;      // on the record's clock [s]
  double sigma = 0.0;  // [s]
};

// What is compared with a model: the usable samples, mark by mark.
struct Observations {
  std::vector<MarkSeries> marks;
  std::vector<TimedEvent> events;
  int shared_rank = 0;       // k
  bool has_sigma = true;     // false: cov is a unit weight only, and the scatter gives the scale
  bool held_before = false;  // before the first stamp the marks stood still (a run before release)
  std::string frame;
  Placement placement;  // what is known of its clock and frame beforehand

  std::size_t size() const;                     // samples of all marks
  double Start() const;                         // of the earliest and the latest sample [s]
  double End() const;                           // likewise
  int FindMark(const std::string& name) const;  // -1 when absent
  double Pivot() const;                         // of the clock's drift [s]
  // The stamps of all samples by the model's clock.
  Stamps StampsAt(const Clock& clock) const;
  // How many numbers of clock and frame have a normal prior: each is a row of a registration.
  Eigen::Index PriorRows() const;
};

/// A part of a record, its ends included.
struct Window {
  double low = -std::numeric_limits<double>::infinity();  // [s], on the record's own clock
  double high = std::numeric_limits<double>::infinity();
  // Whether a stamp lies in it.
  bool Contains(double t) const { return t >= low && t <= high; }
};

// `marks` empty: all of them. Throws Error for a mark that is not there, a mark without usable
// samples, a covariance that is not positive definite. Stamps of one mark must ascend.
Observations FromTracks(const data::Tracks& tracks, const std::vector<std::string>& marks = {},
                        const Window& window = {});
// A run's marks, planar (z = 0), without a sigma.
Observations FromRun(const data::Run& run, const std::vector<std::string>& marks = {},
                     const Window& window = {});

// The part of `all` within the window, events too; the drift's pivot stays.
Observations Cut(const Observations& all, const Window& window);

// The same samples by a clock that runs at the model's rate: t becomes pivot + (t - pivot) / (1 +
// drift), `drift` being by how much the record's clock runs fast [-]. What was known of the drift
// beforehand is from then on of what is left of it.
Observations WithoutDrift(Observations record, double drift, double pivot);

// The event of a model's list that another one names; nullptr: it never happened.
const ModelEvent* FindEvent(const std::vector<ModelEvent>& events, const TimedEvent& named);
// When the model has each of the events, on its own clock; NaN: never, by the end of the stamps.
std::vector<double> EventTimes(const std::vector<TimedEvent>& events, const Prediction& prediction);

// 6 entries to the symmetric matrix.
Eigen::Matrix3d Symmetric(const Eigen::Matrix<double, 6, 1>& c);

}  // namespace unfurl::correlate
