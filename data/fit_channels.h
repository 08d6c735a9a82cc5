#pragma once

#include "data/fit.h"
#include "data/h5.h"

namespace unfurl::data {

// The group /channels of a fit's file; not there for a fit without channels.
void WriteChannels(const FitRecord& fit, H5Writer& w);
void ReadChannels(const H5Reader& r, FitRecord* fit);

}  // namespace unfurl::data
