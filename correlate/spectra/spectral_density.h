#pragma once

#include <complex>
#include <span>
#include <string>
#include <vector>

#include "correlate/spectra/spectrum.h"

namespace unfurl::correlate {

// Power and cross-power spectral densities by averaging [Welch 1967]. Segments lie within stretches
// without a gap, so nothing is filled in (unless BridgeGaps did before).
struct DensityOptions {
  SpectralWindow window = SpectralWindow::kHann;
  Detrend detrend = Detrend::kLine;  // of each segment
  std::size_t segment = 0;  // samples; 0: so that about eight overlapping segments come out
  double overlap = 0.5;     // of a segment, [0, 1) [-]
};

// Two signals x (measured) and y (reference) at the same stamps; single-sided densities: summed
// over the bins times their spacing they give the variance.
struct CrossSpectrum {
  std::vector<double> frequency;         // [Hz]
  std::vector<double> xx, yy;            // power spectral densities [unit^2 / Hz]
  std::vector<std::complex<double>> xy;  // mean of conj(X) Y: phase is that of y ahead of x
  std::vector<double> coherence;         // |xy|^2 / (xx yy), [0, 1]
  std::size_t segments = 0;              // averaged
  double effective_segments = 0.0;       // independent ones: what overlapping leaves of them [-]
  double no_coherence = 1.0;             // exceeded in 5% of the bins by unrelated noise [-]
  double resolution = 0.0;               // spacing of the bins [Hz]
  double noise_bandwidth = 0.0;          // of the window [Hz]
  double dt = 0.0;                       // [s]
  std::string convention;                // all of this in words
};

// With a single segment the coherence is 1 by arithmetic and says nothing; the words say so.
// Throws Error when no stretch holds eight samples.
CrossSpectrum WelchCrossSpectrum(std::span<const double> t, std::span<const double> x,
                                 std::span<const double> y, const std::string& unit,
                                 const DensityOptions& options = {});

// Where the density of what noise drives stands out, strongest first: maxima that rise above the
// higher of the two valleys beside them (each as far as the next point that is higher) by more than
// chance does, between any two bins, in one spectrum of twenty. Speckle of one resonance is no
// second one. `density`: xx or yy of `of`; a peak's amplitude is the root mean square of what lies
// between its valleys [unit of the signal].
std::vector<Peak> FindDensityPeaks(std::span<const double> density, const CrossSpectrum& of,
                                   int most = 6);

// Frequency response assurance criterion |sum a conj(b)|^2 / (sum |a|^2 sum |b|^2) of two complex
// spectra over a band: 1 when they differ by a factor only [Heylen and Lammens 1996].
double FrequencyResponseAssurance(std::span<const std::complex<double>> a,
                                  std::span<const std::complex<double>> b);

// The windowed Fourier sum sum w_i x_i exp(-2 pi i f (t_i - t_ref)) 2 / sum w_i of one signal at
// its own stamps, after taking out the straight line: its complex amplitude at any frequency, so
// that signals strobed one after another share a phase. Operating shapes are made of these.
std::complex<double> FourierAmplitude(std::span<const double> t, std::span<const double> x,
                                      double frequency, double t_ref);

}  // namespace unfurl::correlate
