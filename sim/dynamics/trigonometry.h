#pragma once

namespace unfurl::sim {

// sine and cosine of n angles [rad], n a multiple of kBlock, |theta| < 1e8: within 2 units in the
// last place. Reduction by three parts of pi/2 and the polynomials of the Cephes library; unlike
// the standard functions the loop has no branch and vectorises.
void SinCos(const double* theta, int n, double* sine, double* cosine);

}  // namespace unfurl::sim
