#pragma once

#include <Eigen/Core>
#include <cmath>
#include <string>
#include <vector>

#include "calib/joint_test.h"
#include "calib/observations.h"
#include "data/rig.h"
#include "data/survey.h"
#include "data/survey_points.h"

namespace unfurl::calib {

// Is a calibration still valid?
struct CheckOptions {
  // A misfit whose probability is below the first says that something has changed, one between the
  // two that it might have. One check in a hundred of a valid rig is so called "doubtful", one in
  // ten thousand "no longer valid" [-].
  double invalid = 1e-4, doubtful = 1e-2;
  // Error of a found point that matters [m]; 0: see NeedOf in calib/verdict.h. Where the check
  // itself is coarser than that, it is said.
  double need = 0.0;
  // What is expected to be wrong before the data speak, each against nothing being wrong: a camera
  // since it was calibrated, a surveyed place (or a placement of a bar), a reading, and the frame
  // of all points (or the bar's length) [-]. They weigh where the data do not decide.
  double camera_odds = 0.05, point_odds = 0.01, reading_odds = 0.003, frame_odds = 0.01;

  // Throws Error that names a value which makes no sense.
  void Check() const;
};

/// A camera's part in it.
struct CheckedCamera {
  std::string name;
  int readings = 0;
  double rms_px = 0.0;            // of readings from what rig and survey predict [px]
  double rms_predicted_px = 0.0;  // [px]
  double chance_without = 0.0;    // of the rest, without this camera [-]
  // By how much all its readings are off, and what this check shows of it and tells from another
  // camera's nine times in ten; infinity: it cannot [px].
  double shift_px = 0.0, shift_sigma_px = 0.0, shows_px = 0.0;
};

/// A surveyed point's, or a placement of the bar's.
struct CheckedPoint {
  std::string id;
  double error = 0.0;           // found less surveyed [m]; NaN: not found
  double predicted = 0.0;       // its sigma, 3-D [m]
  double chance_without = 0.0;  // of the rest, without this point [-]
  // Where it was found, of a bar its middle, in W [m]; NaN: not found.
  Eigen::Vector3d at = Eigen::Vector3d::Constant(NAN);
};

/// A reading's.
struct CheckedReading {
  int camera = 0, point = 0;  // indices into cameras and points
  double u_px = 0.0;          // [px]
  double misfit_px = 0.0;     // from what rig and survey predict [px]
  double predicted_px = 0.0;  // its sigma [px]
};

/// What is wrong, where the whole is improbable.
struct CheckedCause {
  CauseKind kind = CauseKind::kCamera;
  int camera = -1, point = -1;  // indices into cameras and points; -1: does not apply
  double size = 0.0;            // of a camera or a reading [px], else [m]
  double sigma = 0.0;           // its standard deviation [likewise]
  double probability = 0.0;     // of all that may be wrong [-]
  std::string text;             // a sentence
};

/// Whether the calibration is still valid, and who says so.
struct CheckResult {
  double chance = 0.0;                    // of so large a misfit, were the calibration valid [-]
  double rms = 0.0, rms_predicted = 0.0;  // of found points, or of lengths [m]
  std::vector<CheckedCamera> cameras;
  std::vector<CheckedPoint> points;
  std::vector<CheckedReading> readings;  // none of a bar
  // The causes that explain the misfit, most telling first; empty where all is well.
  std::vector<CheckedCause> causes;
  bool explained = false;  // without them the rest is probable
  CheckOptions options;    // by which it was judged
  bool invalid = false;
  std::string verdict;  // "still valid", "doubtful", "no longer valid"
  std::vector<std::string> reasons;
};

// Against points of known place: readings less what the rig predicts at the surveyed places, all at
// once, with the covariance of rig, survey and readings. Where the whole, or a shift of one camera,
// is improbable, cameras, points, single readings and the frame compete as its cause
// (calib/joint_test.h). Throws Error where cameras differ from the rig's.
CheckResult CheckPoints(const data::Rig& rig, const Observations& data, const std::string& where,
                        const CheckOptions& options = {});
// The same of a survey as it was read: readings are first found where it holds lines.
CheckResult CheckPoints(const data::Rig& rig, data::Survey survey, const std::string& where,
                        const CheckOptions& options = {});

// Against a bar of known length: all readings of all placements and the length at once, the places
// being free; ends that fewer than three cameras see take part. `data` holds two points for each
// placement, one after the other; their places and covariances are not used, but as where the
// search starts.
struct Bar {
  double length = 0.0, sigma = 0.0;  // [m]
};
CheckResult CheckBar(const data::Rig& rig, const Observations& data, const Bar& bar,
                     const std::string& where, const CheckOptions& options = {});
// The same of readings whose ids name a placement and an end: 1a, 1b, 2a, 2b, ...
CheckResult CheckBar(const data::Rig& rig, const data::ReadingTable& readings, const Bar& bar,
                     const std::string& where, const CheckOptions& options = {});

}  // namespace unfurl::calib
