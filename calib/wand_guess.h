#pragma once

#include <Eigen/Core>
#include <functional>
#include <string>
#include <vector>

#include "calib/initial_guess.h"
#include "calib/wand_data.h"
#include "data/rig.h"

namespace unfurl::calib {

/// Of the search for a bar's poses and the cameras without a start.
struct WandGuessOptions {
  int fewest_poses = 20;  // that three cameras see whole; 15 numbers of three pinholes are unknown
  int starts = 60;        // of each three cameras, beside the one from parallel projection
  int rounds = 2;         // each with four times as many starts, while none leads to a fit
  int ends = 4;           // of their searches that are followed up in a round, at most
  int triples = 12;       // of cameras that are tried, at most

  // Throws Error that names a value which makes no sense.
  void Check() const;
};

/// Cameras and marks found from a bar's readings alone, in a frame of their own: right up to a
/// rigid motion and a mirror, which no readings of linear cameras tell.
struct WandGuess {
  std::vector<CameraGuess> cameras;  // c
  Eigen::Matrix3Xd marks;            // 3 x (n m), NaN: not found [m]
  double misfit = 0.0;               // median of the cameras' robust residuals, over their rows [-]
};

// Three cameras first. Parallel projection makes the readings' differences along the bar, a
// 3-vector d for each pose, satisfy d' Q d = length^2, linear in Q, whose root is the affine
// camera; perspective follows by minimising the misfit of the lengths of a bar between points found
// from three readings, over the seven numbers of each pinhole, from there and from random views.
// Then every camera by GuessCameras on the points so found. What searches end at is passed to
// `enough`, three cameras after three others, until that returned true for any end of three. Throws
// Error where no three cameras see enough poses, or nothing leads to cameras that fit.
void GuessWand(const WandData& data, const GuessOptions& cameras, const WandGuessOptions& options,
               const std::string& where, const std::function<bool(const WandGuess&)>& enough);

/// Where all readings of a mark that disagree put it, or all of them but one.
struct RoughMark {
  int mark = 0;       // its column in what LocateMarks gives
  Eigen::Vector3d p;  // [m]
};

// Marks that at least three of some cameras find: camera k is `number[k]` of the marks', its
// readings good to `sigma_px`. `near`: places of the kind, NaN ones passed over, which say how
// large the volume is. 3 x (n m), NaN: not found [m]. `rough`, when not null, gets places for those
// that are not found as their readings disagree.
Eigen::Matrix3Xd LocateMarks(const Observations& marks, const std::vector<data::RigCamera>& cameras,
                             const std::vector<int>& number, const std::vector<double>& sigma_px,
                             const Eigen::Matrix3Xd& near, std::vector<RoughMark>* rough = nullptr);

// The same where cameras are known about: the marks from them, and every camera anew.
WandGuess GuessWandFrom(const WandData& data, const std::vector<data::RigCamera>& start,
                        const GuessOptions& cameras, const std::string& where);

}  // namespace unfurl::calib
