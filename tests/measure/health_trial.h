#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <vector>

#include "base/random.h"
#include "data/rig.h"
#include "data/tracks.h"
#include "data/trial_readings.h"
#include "measure/health.h"
#include "measure/virtual_rig.h"

namespace unfurl::measure {

// What is done to one camera of a trial.
struct Harm {
  int camera = -1;     // -1: nothing
  double px = 0.0;     // its sensor moves by so much
  double from = 0.0;   // [s]; before the first line: all the time
  double per_s = 0.0;  // its readings move on so fast [px/s], from the first line on
  int lag = 0;         // its lines are so many late, from `from` on
};

// The shipped laboratory with cameras on a ring. Lens axes of neighbours are across each other, and
// every `every` cameras turned by 0.3 rad more.
data::Lab RingOfCameras(std::size_t cameras, std::size_t every);

// Cameras on a ring above the shipped volume, through glass; four marks that swing, one lit in each
// line in turn and then none, as true readings without noise. Made once, drawn from many times.
class HealthTrial {
 public:
  // `cameras` from 3 on; `lines` at 1 kHz. Rows are of `pixels` pixels on the same sensor.
  // `still`: the marks stay in one place.
  HealthTrial(std::size_t cameras, int lines, int pixels = 2160, bool still = false);
  // Marks that go other ways: where a mark is at a time, and how long after each other lines are.
  using Way = std::function<Eigen::Vector3d(int mark, double t)>;
  HealthTrial(std::size_t cameras, int lines, int pixels, const Way& way, double interval = 1e-3);
  HealthTrial(data::Lab lab, int lines, int pixels, const Way& way, double interval = 1e-3);
  // The way of the swinging marks.
  static Eigen::Vector3d Swing(int mark, double t);

  // A calibration of the undisturbed cameras: its errors are a draw from its covariance, what 120
  // points of 0.3 mm and readings of 0.02 px (of a row of 2160) leave unknown.
  data::Rig DrawRig(Rng* rng) const;
  // Readings with noise of `sigma_px` [px], through glass that is where `harm` has put it.
  data::TrialReadings Draw(const Harm& harm, double sigma_px, Rng* rng) const;
  // Readings that state `sigma_px` [px] and scatter by `factor` times that, of one camera or of
  // all (-1); the others by what they state.
  data::TrialReadings Scattered(int camera, double factor, double sigma_px, Rng* rng) const;
  // The same of one mark in all cameras.
  data::TrialReadings MarkScattered(int mark, double factor, double sigma_px, Rng* rng) const;
  // Where the mark of each lit line was [m].
  const std::vector<Eigen::Vector3d>& truth() const { return truth_; }

 private:
  void Calibrate(const Eigen::Matrix3Xd& points, double scale);
  double Read(std::size_t camera, const Eigen::Vector3d& p, double shift_px) const;

  std::vector<LensCamera> cameras_;
  data::Rig rig_;  // laid through what the cameras truly see
  Eigen::MatrixXd covariance_, factor_;
  std::vector<double> t_;
  std::vector<int> mark_;
  std::vector<Eigen::Vector3d> truth_, place_;
  std::vector<double> true_u_;  // line x camera, NaN where dark [px]
};

// Of one sample, with all that is claimed of it.
struct SampleError {
  Eigen::Vector3d e;  // [m]
  Eigen::Matrix3d C;  // what the calibration shares included [m^2]
  double Squared() const { return e.dot(C.inverse() * e) / 3.0; }  // over what is claimed [-]
};
// How the readings of four marks scatter over a stated sigma [px].
ScatterReport ScatterOf(const data::Rig& rig, const data::TrialReadings& readings, double sigma_px);
SampleError ErrorOf(const data::Tracks& tracks, std::size_t i, const Eigen::Vector3d& truth);

}  // namespace unfurl::measure
