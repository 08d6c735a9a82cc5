#pragma once

#include "data/fit.h"
#include "data/h5.h"

namespace unfurl::data {

// The group /repeat of a fit's file; not there for a fit of one value for all trials.
void WriteRepeat(const FitRecord& fit, H5Writer& w);
void ReadRepeat(const H5Reader& r, FitRecord* fit);

}  // namespace unfurl::data
