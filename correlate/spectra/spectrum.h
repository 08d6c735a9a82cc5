#pragma once

#include <complex>
#include <span>
#include <string>
#include <vector>

#include "correlate/window.h"

namespace unfurl::correlate {

/// What is taken out of a signal before its transform.
enum class Detrend { kNone, kMean, kLine };

/// How a signal is prepared for its spectrum.
struct SpectrumOptions {
  SpectralWindow window = SpectralWindow::kHann;
  Detrend detrend = Detrend::kLine;
};

// Single-sided amplitude spectrum: a sine of amplitude A that falls on a bin shows as A there,
// whatever the window (its coherent gain is divided out) and whether n is even or odd.
struct Spectrum {
  std::vector<double> frequency;            // n/2 + 1 bins, k / (n dt) [Hz]
  std::vector<double> amplitude;            // [unit of the signal]
  std::vector<std::complex<double>> value;  // the same with its phase at the first sample
  double resolution = 0.0;                  // spacing of the bins, 1 / (n dt) [Hz]
  double noise_bandwidth = 0.0;             // of the window [Hz]; 1 bin for the rectangular one
  double dt = 0.0;                          // [s]
  std::size_t n = 0;                        // samples
  SpectralWindow window = SpectralWindow::kHann;
  std::string convention;  // all of this in words
};

// `x` evenly spaced by `dt`; `unit` goes into the words. At least 8 samples, or throws Error.
Spectrum AmplitudeSpectrum(std::span<const double> x, double dt, const std::string& unit,
                           const SpectrumOptions& options = {});

// `x` less its mean or its straight line, by least squares.
std::vector<double> Detrended(std::span<const double> x, Detrend how);
const char* Name(Detrend how);  // "a straight line taken out"

// A sine's frequency between two bins, from the ratio of its two highest ones; exact for one pure
// sine far from 0 and from the Nyquist frequency.
struct Peak {
  double frequency = 0.0;  // [Hz]
  double amplitude = 0.0;  // corrected for its place between the bins [unit of the signal]
  std::size_t bin = 0;
};

/// What counts as a peak.
struct PeakOptions {
  int most = 6;                // peaks, strongest first
  double over_floor = 5.0;     // times the median amplitude around it (a quarter of the band) [-]
  double over_largest = 0.01;  // part of the largest peak [-]
  double low = 0.0;  // [Hz]; the first two bins never count: they hold what detrending left
};
std::vector<Peak> FindPeaks(const Spectrum& spectrum, const PeakOptions& options = {});

// Peaks of two spectra that belong together: within `bins` bins of each other, nearest first, each
// used once. Indices into the two lists; -1: no partner.
struct PeakPair {
  int a = -1;
  int b = -1;
};
std::vector<PeakPair> PairPeaks(const std::vector<Peak>& a, const std::vector<Peak>& b,
                                double resolution, double bins = 2.0);

// The longest stretch of stamps without a gap: each step within 1% of the median step.
struct EvenStretch {
  std::size_t first = 0;
  std::size_t count = 0;
  double dt = 0.0;     // [s]
  bool whole = false;  // true: there is no gap at all
};
EvenStretch LongestEvenStretch(std::span<const double> t);
// All of them, in order of time; of one sample each where no step is like the median.
std::vector<EvenStretch> EvenStretches(std::span<const double> t);

}  // namespace unfurl::correlate
