#pragma once

namespace unfurl::calib {

// The limits by which a calibration is judged. "Care" makes it "usable with care", "no" makes it
// "do not use".
struct VerdictOptions {
  // Error of a found point that is aimed at [m]; 0: a 2000th of the surveyed box (NeedOf).
  double need = 0.0;
  // The median predicted error above so many times the need: no [-].
  double need_factor_no = 10.0;
  // Share of the surveyed places whose predicted error may exceed the need, or that too few cameras
  // see: the corners of a volume that three cameras cover [-].
  double poor_share = 0.1;
  // Held-out errors in units of their prediction, of all and of the worst among them: below this
  // probability of chance, care [-].
  double chance = 1e-3;
  // Mean squared held-out error over its prediction, 1 where the covariance is true: above, error
  // bars are wrong by a factor of two, and no [-].
  double honesty = 4.0;
  // Share of gross errors: the robust loss stands the second with some margin [-].
  double gross_care = 0.05, gross_no = 0.3;
  // A camera's model floor over its row: 0.3 px of 2000; above, its lens is not of the model's
  // kind, or its readings are worse than stated [-].
  double floor_care = 1.5e-4;
  // The survey's scatter over its stated sigmas, which is 1 unless chance does not explain it:
  // places that are off together, as those of a second set-up, do the same, and wider bars do not
  // hold that.
  double survey_care = 1.0;    // [-]
  double common_sigmas = 4.0;  // a common error of the survey over its estimate's scatter [-]
  // With which probability one of faultless set-ups is called off, all of them together [-].
  double set_up_level = 0.01;
  // With which probability one of lenses that stayed what they were is called another.
  double lens_level = 0.01;
  // Fewer redundant numbers leave chi-square and held-out check little to say (their relative
  // standard deviation is then a quarter).
  double fewest_redundant = 30.0;  // [-]
  // Share of the row that the readings of half of the cameras cover: with less, most of what a
  // camera sees is extrapolated, where a lens model fitted to the rest says nothing [-].
  double least_row = 0.5;

  // Throws Error that names a value which makes no sense.
  void Check() const;
};

}  // namespace unfurl::calib
