#pragma once

#include "data/fit.h"
#include "data/h5.h"

namespace unfurl::data {

// The group /ladder of a fit's file; not there for a fit without one.
void WriteLadder(const FitRecord& fit, Eigen::Index p, H5Writer& w);
void ReadLadder(const H5Reader& r, FitRecord* fit);

}  // namespace unfurl::data
