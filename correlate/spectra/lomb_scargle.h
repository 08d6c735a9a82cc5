#pragma once

#include <span>
#include <string>
#include <vector>

#include "correlate/spectra/spectrum.h"

namespace unfurl::correlate {

// Amplitudes by least squares at any stamps: gaps and unevenness are taken as they are. At each
// frequency a sine and a constant are fitted with weights 1 / sigma^2 (the generalised Lomb-Scargle
// periodogram [Zechmeister and Kuerster 2009]) to the signal less its straight line.
struct LombOptions {
  double low = 0.0;    // [Hz]; 0: one period of the record
  double high = 0.0;   // [Hz]; 0: half the median rate
  int oversample = 5;  // frequencies per 1 / duration
};

struct LombSpectrum {
  std::vector<double> frequency;  // [Hz]
  std::vector<double> amplitude;  // of the fitted sine [unit]
  std::vector<double> power;      // share of the weighted squares that the sine explains, [0, 1]
  double resolution = 0.0;        // 1 / duration [Hz]: nearer peaks are not told apart
  std::size_t n = 0;
  std::string convention;  // all of this in words
};

// `sigma` may be empty (equal weights). At least 8 samples, or throws Error.
LombSpectrum LombScargle(std::span<const double> t, std::span<const double> x,
                         std::span<const double> sigma, const std::string& unit,
                         const LombOptions& options = {});

// Sines in a signal, strongest first: the highest maximum is refined between the frequencies, all
// lines found so far are fitted together and taken out, each with an exponential rise or fall of
// its own, and the rest is searched again, so that neither the side lobes of gaps nor the flanks of
// decays are taken for peaks, or hide some. Amplitudes are of steady sines, as a spectrum's; what
// lies within four resolutions of one five times as large is no peak. `chance`: probability that
// noise alone shows one as high anywhere in the band; the search ends where it exceeds 1%.
struct LombPeak {
  double frequency = 0.0;  // [Hz]
  double amplitude = 0.0;
  double chance = 0.0;
};
std::vector<LombPeak> FindLombPeaks(std::span<const double> t, std::span<const double> x,
                                    std::span<const double> sigma, const LombOptions& options = {},
                                    int most = 6);

}  // namespace unfurl::correlate
