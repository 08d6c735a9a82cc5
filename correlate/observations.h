#pragma once

#include <Eigen/Core>
#include <limits>
#include <string>
#include <vector>

#include "correlate/model.h"
#include "correlate/placement.h"
#include "correlate/residual/residual_kind.h"
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

// What is compared with a model: the usable samples, mark by mark, and what was recorded beside
// them.
struct Observations {
  std::vector<MarkSeries> marks;
  ResidualKinds others;
  int shared_rank = 0;       // k
  bool has_sigma = true;     // false: cov is a unit weight only, and the scatter gives the scale
  bool held_before = false;  // before the first stamp the marks stood still (a run before release)
  std::string frame;
  Placement placement;  // what is known of its clock and frame beforehand

  std::size_t size() const;                     // samples of all marks
  std::size_t readings() const;                 // those, and what else follows in time
  double Start() const;                         // of the earliest of these, record's clock [s]
  double End() const;                           // of the latest, likewise
  double ShortestStep() const;                  // least median step of all series [s]; 0: none
  int FindMark(const std::string& name) const;  // -1 when absent
  double Pivot() const;                         // of the clock's drift [s]
  // The stamps of all samples by the model's clock.
  Stamps StampsAt(const Clock& clock) const;
  // How many numbers of clock and frame have a normal prior: each is a row of a registration.
  Eigen::Index PriorRows() const;
  // Unknowns of the residual kinds, all together.
  Eigen::Index OtherUnknowns() const;
};

// `marks` empty: all of them. Throws Error for a mark that is not there, a mark without usable
// samples, a covariance that is not positive definite. Stamps of one mark must ascend.
Observations FromTracks(const data::Tracks& tracks, const std::vector<std::string>& marks = {},
                        const Window& window = {});
// A run's marks, planar (z = 0), without a sigma.
Observations FromRun(const data::Run& run, const std::vector<std::string>& marks = {},
                     const Window& window = {});

// The part of `all` within the window, other kinds too; the drift's pivot stays.
Observations Cut(const Observations& all, const Window& window);

// The same samples, without what their errors have in common.
Observations WithoutDraw(Observations record);

// The same samples by a clock that runs at the model's rate: t becomes pivot + (t - pivot) / (1 +
// drift), `drift` being by how much the record's clock runs fast [-]. What was known of the drift
// beforehand is from then on of what is left of it.
Observations WithoutDrift(Observations record, double drift, double pivot);

// 6 entries to the symmetric matrix.
Eigen::Matrix3d Symmetric(const Eigen::Matrix<double, 6, 1>& c);

}  // namespace unfurl::correlate
