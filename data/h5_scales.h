#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "data/h5_handle.h"

namespace unfurl::data {

/// A dataset and, by dimension, the path of the dataset that labels it.
struct H5Labelled {
  std::string path;
  std::vector<std::string> scales;
};

/// Marks the scales, and attaches them, as the HDF5 Dimension Scales specification 1.2 says, so
/// that netCDF4 and xarray show them as coordinates. Written here and not by H5DSattach_scale,
/// which writes all of a scale's references anew for every dataset: O(n^2) for a run of n series.
/// All datasets must exist. `letters` are the scales of the second dimension of scales that are
/// text. `bare` scales only name a dimension and say nothing of its places: to
/// netCDF they are no variables. False where HDF5 refused.
bool H5AttachScales(hid_t file, const std::vector<H5Labelled>& datasets,
                    const std::map<std::string, std::string>& letters,
                    const std::set<std::string>& bare);

/// Whether an attribute is one of those that the above writes, or tells netCDF4 of text: of no
/// interest to people.
bool H5IsScaleAttribute(const std::string& name);

}  // namespace unfurl::data
