#pragma once

#include <complex>
#include <cstddef>
#include <span>
#include <vector>

namespace unfurl::correlate {

/// Sums F_k = sum_j c_j exp(i k x_j), k = 0 .. count - 1, at any x_j [rad], in n + count log count
/// steps instead of n times count: the terms are spread on an even grid by Gaussians, transformed,
/// and the Gaussians divided out [Greengard and Lee 2004]. The error is some 1e-12 of sum |c_j|.
std::vector<std::complex<double>> NonuniformFft(std::span<const double> x,
                                                std::span<const std::complex<double>> c,
                                                std::size_t count);

}  // namespace unfurl::correlate
