#pragma once

#include <vector>

#include "sim/model/aligned.h"

namespace unfurl::sim {

// Legendre polynomials P_0 to P_n at z, -1 to 1.
std::vector<double> Legendre(int n, double z);

// Gauss's points and weights on [0, 1].
void GaussPoints(int n, Array* x, Array* weight);

}  // namespace unfurl::sim
