#pragma once

#include <complex>
#include <cstddef>
#include <span>
#include <vector>

namespace unfurl::correlate {

// FFTW behind two calls. Forward: X_k = sum_j x_j exp(-2 pi i j k / n), k = 0 .. n/2, unscaled.
std::vector<std::complex<double>> RealFft(std::span<const double> x);
// Its inverse, scaled by 1/n: `n` is the length in time (even and odd differ only in it).
std::vector<double> InverseRealFft(std::span<const std::complex<double>> X, std::size_t n);

// A length >= n that FFTW is fast at (2^a 3^b 5^c).
std::size_t FastLength(std::size_t n);

// c_l = sum_i x_i y_(i + l), for l = -(n_x - 1) .. n_y - 1: entry l + n_x - 1 of the result.
std::vector<double> CrossCorrelation(std::span<const double> x, std::span<const double> y);

}  // namespace unfurl::correlate
