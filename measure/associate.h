#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "measure/motion.h"
#include "measure/triangulate.h"

namespace unfurl::measure {

// A reading that may be a mark's.
struct Candidate {
  double u_px = 0.0;  // where it is seen [px]
  double s_px = 0.0;  // its standard deviation [px]
};

/// What is expected of spots: missing ones, foreign ones, merged ones.
struct AssociateOptions {
  // Throws Error that names a value which makes no sense.
  void Check() const;
  double miss = 0.02;     // chance that a camera does not show a mark that is there [-]
  double clutter = 0.05;  // spots of no mark, expected per camera and line [-]
  // While one mark is lit, a camera's spots that are not taken stand for a wrong reading of it. Of
  // its error any order of magnitude is as likely, from so many sigmas of the reading [-] to the
  // row.
  double displaced_sigmas = 5.0;
  // Two marks that are expected as near as this in a camera make one spot there [px]: three widths
  // (sigmas) of a spot. Reconstructor takes them from the record; the default is of spots of 4 px.
  double merge_px = 12.0;
  // Below this chance of being right, a point counts as ambiguous [-]; also where the places that
  // it may have instead would add more than `spread` to its variance [-].
  double certainty = 0.99;
  double spread = 0.1;
  // Expected places are matched within this many sigmas [-].
  double gate_sigmas = 5.0;
};

// What is decided of one mark. `point.outcome` is kSolved, or why not: kAmbiguous, kTooFew.
struct Association {
  PointSolution point;
  double certainty = 0.0;  // chance of being right, among all that would explain the line [-]
  std::array<std::int8_t, CameraBank::kMaxCameras> chosen{};  // candidate by camera; -1: none
};

// Which spot of which camera belongs to which mark, for one line: every set of three readings or
// more, one from each of as many cameras, is a possible point; the residual test strikes out those
// of four that do not meet. What remains is weighed by
//   log integral of (where the mark is expected) x (its readings' densities) dp,
// cameras without a reading by the chance of missing it, spots that no mark claims as clutter. Of a
// mark that is expected somewhere, one or two readings may be right alone: no point comes of them,
// but their weight counts against the points of three that hold a wrong one. The best set of points
// that share no spot wins, and each point's certainty is its share of the weight of all sets.
// Nothing is decided that is less certain than `certainty`.
class Associator {
 public:
  static constexpr std::size_t kMostCandidates = 8;  // per camera; more are not looked at
  static constexpr std::int8_t kMerged = 100;        // instead of a candidate: Mark::merged

  Associator(const Triangulator& triangulator, const AssociateOptions& options = {});

  // One mark that a line shows.
  struct Mark {
    bool known = false;     // false: it may be anywhere in the volume
    bool followed = false;  // its last samples are fresh
    bool placed = false;    // followed, or expected to within what one spot covers
    bool lost = false;      // only points with a reading to spare, four or more, are believed
    // Bit c: in camera c another mark is expected in the same place. `merged[c]` is then what their
    // common spot tells of this one, NaN where there is none; it may serve several marks.
    std::uint32_t hidden = 0;
    std::array<Candidate, CameraBank::kMaxCameras> merged{};
    std::array<std::uint8_t, CameraBank::kMaxCameras> merged_spot{};  // which candidate that is
    Motion::Prediction expected;
  };

  // `cameras[c]` the candidates of camera c; `miss` the chance that camera c does not show a mark,
  // or shows it wrong, for each camera (empty: the option). Marks of which nothing is known are
  // distinguished by place alone: the points that they get ascend in x. `out` as many as marks.
  void Associate(std::span<const std::span<const Candidate>> cameras, std::span<const Mark> marks,
                 std::span<const double> miss, std::vector<Association>* out);

 private:
  struct Hypothesis {
    PointSolution point;   // of three readings or more; else kTooFew, at the likeliest place
    double score = 0.0;    // readings, cameras, clutter [-]
    double weighed = 0.0;  // with the mark's own expectation [-]
    std::array<std::int8_t, CameraBank::kMaxCameras> chosen{};
  };
  struct Set {           // one point, or none, for each mark
    double score = 0.0;  // [-]
    std::vector<int> choice;
  };

  void Enumerate(std::span<const std::span<const Candidate>> cameras, const Mark* mark,
                 std::span<const double> miss, std::vector<Hypothesis>* out);
  // The number of readings that the mark may have in a camera, and one of them.
  std::size_t Choices(std::span<const std::span<const Candidate>> cameras,
                      std::size_t camera) const;
  bool Choose(std::span<const std::span<const Candidate>> cameras, std::size_t camera,
              std::size_t k);
  void Unchoose(std::size_t camera);
  void Extend(std::span<const std::span<const Candidate>> cameras, std::size_t camera,
              const PointSolution& from, std::span<const double> miss, int readings,
              std::vector<Hypothesis>* out);
  void Push(const PointSolution& point, std::span<const double> miss,
            std::vector<Hypothesis>* out) const;
  void PushFew(std::span<const double> miss, std::vector<Hypothesis>* out) const;
  // log of the density of spots of no mark [1/px].
  double LogClutter(std::size_t camera) const {
    return std::log(options_.clutter / row_px_[camera]);
  }
  double Unclaimed(const Eigen::Vector3d& p, std::uint32_t claimed,
                   std::span<const double> miss) const;
  void Search(std::span<const Mark> marks, std::size_t depth, double score);
  // Takes the spots of a point for one mark; false if any is taken. The caller gives them back.
  bool Claim(const Mark& mark, const Hypothesis& at);
  bool Ascends(std::span<const Mark> marks, std::size_t depth, const Hypothesis& at) const;
  void Weigh(const Mark& mark, std::size_t m);
  void FindNear(std::span<const std::span<const Candidate>> cameras, const Mark& mark);
  struct Doubt {
    double certainty = 0.0;  // [-]
    double spread = 0.0;     // [m^2]
  };
  const Hypothesis* HypothesisOf(const Set& set, std::size_t m) const {
    const int choice = set.choice[m];
    return choice < 0 ? nullptr : &lists_[m][static_cast<std::size_t>(choice)];
  }
  Doubt DoubtOf(std::span<const Mark> marks, std::size_t m, const Set& best) const;
  void Conclude(std::span<const Mark> marks, std::vector<Association>* out) const;

  const Triangulator& triangulator_;
  AssociateOptions options_;
  double log_volume_;           // of where a mark may be [log m^3]
  std::vector<double> row_px_;  // by camera, over which clutter is spread [px]
  // Of the current line, kept so that nothing is allocated once they have grown [px].
  std::vector<double> u_, s_;
  std::span<const std::span<const Candidate>> lone_;  // the line's, while one mark is lit
  struct Seen {
    double u_px = 0.0;                                      // [px]
    Eigen::RowVector3d du_dp = Eigen::RowVector3d::Zero();  // [px/m]
    bool in_front = false;
  };
  std::vector<Seen> seen_;  // camera x way of moving, of the current mark
  std::array<std::int8_t, CameraBank::kMaxCameras> chosen_{};
  std::array<std::uint8_t, CameraBank::kMaxCameras>
      near_{};                                  // bit k: candidate k may be the mark's
  const Mark* mark_ = nullptr;                  // whose points are enumerated; null: of anyone
  std::vector<std::vector<Hypothesis>> lists_;  // by mark, best first; index -1 stands for none
  std::vector<double> none_;                    // score of "not seen", by mark [-]
  std::vector<bool> cut_;                       // there were more than are listed
  std::vector<double> best_rest_;               // of marks from here on [-]
  using Sets = std::array<std::uint8_t, CameraBank::kMaxCameras>;  // of candidates, by camera
  Sets taken_{}, shared_{};  // by one mark alone; by marks that share it
  std::vector<int> choice_;
  std::vector<Set> sets_;
  double best_ = 0.0;  // score [-]
  std::size_t visited_ = 0;
};

}  // namespace unfurl::measure
