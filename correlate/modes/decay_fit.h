#pragma once

#include <Eigen/Core>
#include <complex>
#include <span>
#include <string>
#include <vector>

namespace unfurl::correlate {

// One channel of a free decay: a mark's coordinate, a body's angle. Channels of one fit share their
// unit and their time axis, not their stamps: those may be uneven, have gaps and differ in rate.
struct DecaySignal {
  std::string name;
  std::vector<double> t;      // n, ascending [s]
  std::vector<double> value;  // n [unit]
  std::vector<double> sigma;  // n; empty: unknown, the scatter gives the scale [unit]
};

// A damped sine common to all signals: signal j is Re(c_j exp(s (t - start))), s = -a + i w.
struct Mode {
  std::complex<double> pole;     // s [1/s]
  double frequency = 0.0;        // undamped natural, |s| / 2 pi [Hz]
  double frequency_sigma = 0.0;  // [Hz]
  double damping = 0.0;          // ratio, a / |s| [-]
  double damping_sigma = 0.0;    // [-]
  Eigen::VectorXcd amplitude;    // c, one per signal, at the fit's start [unit of the signals]
  // c over its largest entry, with the standard errors of real and imaginary parts [-].
  Eigen::VectorXcd shape;
  Eigen::Matrix2Xd shape_sigma;
  double share = 0.0;  // of the signals' mean square about their trends [-]
  // Squared amplitudes over their own errors, summed: chi-square of 2 per signal were there none.
  double evidence = 0.0;  // [-]
  // Of what the whole record tells of its frequency, the part that the samples fitted tell [-].
  double information = 1.0;
  int members = 0;  // stable poles of its cluster; 0 where it was not sought by a diagram
};

/// Of the fit of damped sines.
struct DecayOptions {
  int trend = 1;            // degree of each signal's own polynomial trend; -1: none
  int max_iterations = 60;  // of Levenberg and Marquardt
};

/// How a fit of damped sines ended.
enum class DecayStatus { kGood, kTooLittle, kNothingFound, kNotConverged };
const char* Name(DecayStatus status);

/// Damped sines that explain a free decay, and how well.
struct DecayFit {
  DecayStatus status = DecayStatus::kTooLittle;
  std::string message;
  /// The modes may be believed, within their standard errors.
  bool Usable() const { return status == DecayStatus::kGood; }

  std::vector<Mode> modes;     // by rising frequency
  Eigen::MatrixXd covariance;  // of f1, zeta1, f2, zeta2, ..: 2 per mode [Hz, -]
  double start = 0.0;          // earliest stamp, the amplitudes' time [s]
  std::size_t samples = 0;
  double explained = 0.0;     // share of the motion about the trends, in [0, 1]
  double residual_rms = 0.0;  // [unit of the signals]
  double chi2_per_dof = 0.0;  // 0 where a signal has no sigma [-]
  double whiteness = 1.0;     // p-value of the least white residual, times their number [-]
  double effective = 1.0;     // independent values per sample, for the residuals' correlation [-]
};

// Maximum likelihood for white noise: least squares over all poles, amplitudes and trends, the
// linear ones projected out [Golub and Pereyra 1973], from the poles given (Im > 0). Standard
// errors are the Cramer-Rao bound [Kay 1993], widened where the residuals are larger than their
// sigmas or correlated in time (sandwich, see autocorrelation.h).
DecayFit FitDecay(std::span<const DecaySignal> signals, std::span<const std::complex<double>> poles,
                  const DecayOptions& options = {});

// Modal assurance criterion |a^H b|^2 / (a^H a b^H b): 1 for shapes that differ by a factor, 0 for
// orthogonal ones [Allemang 2003].
double ModalAssurance(const Eigen::VectorXcd& a, const Eigen::VectorXcd& b);

}  // namespace unfurl::correlate
