#pragma once

#include "measure/spot_fit.h"

namespace unfurl::measure {

// The Cramer-Rao bound of a spot's centre [px]: Fisher's sum over every pixel that its light
// reaches, with centre, width, flux and constant all free. `flux` [count], `centre` and `width`
// [px]; the noise as FitGaussians takes it.
double CentreBound(double centre, double width, double flux, const PixelNoise& noise);

}  // namespace unfurl::measure
