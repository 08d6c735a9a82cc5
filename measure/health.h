#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "data/trial_health.h"
#include "measure/correction.h"
#include "measure/kept_distances.h"
#include "measure/light_fault.h"
#include "measure/triangulate.h"
#include "measure/vouching.h"

namespace unfurl::measure {

/// How a trial's health is judged.
struct HealthOptions {
  /// Chance that a sound trial is told to have any fault [-].
  double false_alarm = 1e-3;
  /// Chance, by the likelihoods, that another camera is the one, above which none is named [-].
  double doubt = 1e-3;
  /// Chance that what moved one camera moved another at the same moment [-]: two stand on one beam,
  /// or one who leans on a wall leans on both.
  double together = 1e-4;
  /// Lags looked for, either way [lines]: two rounds of a usual strobe.
  int most_lag = 10;
  /// Chance that a reading is wrong by itself (a reflection), as AssociateOptions::miss [-].
  double wild = 0.02;
  /// Changes of light or of the spots' width by less are not told [-]: the error of a reading goes
  /// with its light and its width, and changes by no larger share.
  double least_light = 0.1;
  bool light = true;  ///< changes of light and focus are looked for
  /// Chance that readings which scatter as stated are told to scatter more [-].
  double scatter_alarm = 0.01;
  /// By which share squared errors may be larger than stated with no harm [-]: of ellipsoids of 95%
  /// 93% then hold. No finder of spots states its errors better.
  double scatter_harmless = 0.1;
  std::vector<KeptDistance> distances;  ///< that marks on rigid bodies keep
  /// Throws Error that names a value which makes no sense.
  void Check() const;
};

/// What is wrong with a camera.
enum class FaultKind : std::int32_t {
  kMoved = 0,     // its readings are off by a constant, from a moment on
  kDrifting = 1,  // its readings move on in proportion to time
  kLate = 2,      // its lines are others' lines of earlier
};
const char* Name(FaultKind kind);  ///< one word

/// A fault, as the other cameras show it.
struct Fault {
  FaultKind kind = FaultKind::kMoved;
  int camera = 0;             ///< the likeliest
  std::vector<int> suspects;  ///< others that explain it nearly as well; empty: it is that camera
  bool several = false;       ///< more than one of them may be wrong, in place of that camera
  /// From when on [s]: between `earliest` and `latest`; before the first flash: -infinity.
  double from = -std::numeric_limits<double>::infinity();
  double earliest = from, latest = from;
  double offset_px = 0.0;    ///< reading less what the others predict; of a drift at `at` [px]
  double sigma_px = 0.0;     ///< its standard deviation, calibration and model errors included [px]
  double slope = 0.0;        ///< of a drift [px/s]
  double slope_sigma = 0.0;  ///< [px/s]
  double at = 0.0;           ///< of a drift: the moment of `offset_px` [s]
  int lag = 0;               ///< lines that it is late by; negative: early
  bool certain() const { return suspects.empty(); }
};

/// One camera in a slice of time, as the others see it; NaN where nothing tells.
struct HealthSlice {
  double t = 0.0;          ///< middle [s]
  double offset_px = 0.0;  ///< of its readings, lag and faults of other cameras taken out [px]
  double sigma_px = 0.0;   ///< by the scatter within the slice [px]
  double gain = 0.0;       ///< brightness of its spots over the trial's median, mark by mark [-]
  double width_px = 0.0;   ///< of its spots, median [px]
};

/// By how much readings scatter over what is stated of them: what follows no smooth way, so neither
/// the calibration's errors nor a fault of the camera is in it.
struct Scatter {
  double factor = std::numeric_limits<double>::quiet_NaN();  ///< NaN: nothing tells [-]
  double sigma = std::numeric_limits<double>::quiet_NaN();   ///< its standard deviation [-]
};

/// Whose readings scatter: those of all alike, of some cameras, some marks, or of some cameras of
/// some marks.
enum class ScatterOwner { kAll, kCameras, kMarks, kCells };

/// A reading that departs from the course of its mark in time, of a flash of three readings: none
/// is left over to vouch for it.
struct WrongReading {
  std::size_t line = 0;  ///< of the record
  int mark = -1, camera = -1;
};

/// The same of a trial.
struct ScatterReport {
  std::string unknown;  ///< why nothing can be told; empty: it was looked at
  Scatter all;          ///< of all readings alike
  bool wide = false;    ///< readings scatter more than stated, beyond chance and harm
  ScatterOwner owner = ScatterOwner::kAll;  ///< whose they likely are, where `wide`
  /// Where `wide`, none below 1: by camera (over the marks), by mark (over the cameras), and of
  /// each camera's readings of each mark (mark x cameras + camera). What the record does not tell
  /// apart is shared among those that may be meant, with a large sigma. Empty where all is as
  /// stated.
  std::vector<Scatter> cameras, marks, cells;
  std::vector<WrongReading> wrong;  ///< in the order of lines
  /// Marks of which nothing can be told, and why; others may tell of their cameras.
  std::vector<std::pair<int, std::string>> untold;
};

/// What readings leave over for flashes on end that neither their noise nor the calibration's
/// errors nor any fault explains: another finder of spots than the calibration's, a lens that
/// warmed, a mount that sways.
struct MisfitReport {
  bool wide = false;    ///< beyond chance and harm
  double all_px = 0.0;  ///< of all readings alike, standard deviation [px]
  /// By mark and camera (mark x cameras + camera): what it is at most, were it that camera's alone
  /// [px], and by which factor that makes stated sigmas too small [-]. Empty where there is none.
  std::vector<double> px, factors;
};

/// What a trial says of its cameras.
struct HealthReport {
  std::string unknown;            ///< why nothing can be told; empty: it was looked at
  Unvouched unvouched;            ///< where it could not: what an unseen fault would do
  DistanceReport distances;       ///< of HealthOptions::distances
  std::vector<Fault> faults;      ///< in order of their weight
  std::vector<LightFault> light;  ///< likewise; looked for wherever spots were measured
  ScatterReport scatter;          ///< of the readings, over what is stated
  MisfitReport misfit;            ///< of the readings in use; by FindMisfit
  std::vector<std::vector<HealthSlice>> cameras;  ///< by camera and slice
  std::size_t flashes = 0;                        ///< that were looked at
};

/// Readings of flashes of one mark, as they were found, whatever became of them; of long records
/// every so many stretches of lines, so that memory does not grow.
class HealthEvidence {
 public:
  HealthEvidence() = default;
  HealthEvidence(std::size_t cameras, std::size_t lines);
  /// Of a record without end: all of the last `lines`, and of those before at most as many.
  static HealthEvidence OfLast(std::size_t cameras, std::size_t lines);

  /// One reading; NaN: none. `flux` and `width_px` 0 where nobody measured them.
  struct Reading {
    double u_px = std::numeric_limits<double>::quiet_NaN();
    float s_px = 1.0F, flux = 0.0F, width_px = 0.0F;
  };
  /// The next line, by camera; `mark` -1 where not one mark was lit.
  void Add(double t, int mark, std::span<const Reading> readings);
  /// Which readings a mark's point was made from, by camera (NaN: none), of a line of some time
  /// ago: of several spots of a camera the brightest may have been another light's [px].
  void Took(double t, std::span<const double> u_px);

  std::size_t size() const { return t_.size(); }              ///< lines kept
  double t(std::size_t i) const { return t_[i]; }             ///< of the i-th [s]
  std::size_t line(std::size_t i) const { return line_[i]; }  ///< of the record
  int mark(std::size_t i) const { return mark_[i]; }          ///< that was lit in it; -1: not one
  std::size_t Marks() const;                                  ///< up to the last that was lit alone
  /// Of camera c in it.
  const Reading& At(std::size_t i, std::size_t c) const { return readings_[i * cameras_ + c]; }
  /// The kept line that was recorded `lag` lines after the i-th; -1: there is none.
  std::ptrdiff_t After(std::size_t i, int lag) const;
  /// Takes a fault out.
  void Correct(const Correction& correction);
  /// Takes away the readings that are not used: of a camera that is left out, or in doubtful time.
  void LeaveOut(const Correction& correction);
  /// Takes the readings of two cameras for each other's.
  void Exchange(std::size_t a, std::size_t b);
  /// Multiplies the readings' sigmas, by mark and camera (mark x cameras + camera).
  void Widen(std::span<const double> factors);

 private:
  std::size_t cameras_ = 0, next_ = 0, every_ = 1;
  std::size_t last_ = 0;  // lines that are kept of a record without end; 0: it has one
  std::vector<double> t_;
  std::vector<int> mark_;
  std::vector<std::size_t> line_;
  std::vector<Reading> readings_;
};

/// Which cameras moved, drifted or are late. `evidence` has what `known` says taken out already.
/// Beside any one camera three others must see a mark: of three cameras nothing is told but what
/// the distances that marks keep say. `marks`: names, where there are such distances.
HealthReport Diagnose(const HealthEvidence& evidence, const Triangulator& triangulator,
                      const HealthOptions& options = {}, std::span<const std::string> marks = {});

/// How readings scatter over what is stated, by how they follow one another in time and, where four
/// cameras or more see a mark in three of its flashes in a row, by what no place of it explains.
ScatterReport FindScatter(const HealthEvidence& evidence, const Triangulator& triangulator,
                          const HealthOptions& options = {});

/// What the readings that are in use leave over, by what no place explains of three flashes in a
/// row that four cameras or more see. `evidence` has faults taken out, and no sigmas widened;
/// `corrections` say what is left out. Adds it to what Diagnose found.
void FindMisfit(const HealthEvidence& evidence, const Triangulator& triangulator,
                std::span<const Correction> corrections, const HealthOptions& options,
                HealthReport* report);

/// By which factor scatter makes stated sigmas too small, by mark and camera (mark x cameras +
/// camera); 1 where they are not known to be.
std::vector<double> WideningsOf(const ScatterReport& scatter, std::size_t cells);

/// "readings of camera west scatter 2.03 +- 0.05 times what is stated"; also where they do not.
std::string Describe(const ScatterReport& scatter, std::span<const std::string> cameras,
                     std::span<const std::string> marks);

/// "readings depart by 0.21 px from where the calibration puts them ..."; empty: they do not.
std::string Describe(const MisfitReport& misfit);

/// "readings depart from the course of their mark ...: 12 of camera west"; empty: there are none.
std::string DescribeWrong(std::span<const WrongReading> wrong,
                          std::span<const std::string> cameras);

/// The report as the file of tracks keeps it.
data::TrialHealth RecordOf(const HealthReport& report, const std::vector<std::string>& cameras,
                           const std::vector<std::string>& marks, bool corrected,
                           std::span<const KeptDistance> distances = {});

// "1.03 +- 0.02": to the second digit of the sigma.
std::string WithSigma(double value, double sigma);

/// "camera north_west moved by 1.02 +- 0.03 px at 3.21 s".
std::string Describe(const Fault& fault, std::span<const std::string> cameras);

/// What takes the faults out: with `correct` the readings are put right, otherwise those cameras
/// are left out while they are wrong. Where it cannot be told which camera it is, samples of the
/// time lose their positions.
std::vector<Correction> CorrectionsOf(std::span<const Fault> faults, bool correct);
/// What widens the sigmas of readings that scatter more than stated, or do not fit. It takes the
/// place of what did so before.
void AddWidenings(const ScatterReport& scatter, const MisfitReport& misfit, std::size_t cameras,
                  std::vector<Correction>* corrections);

}  // namespace unfurl::measure
