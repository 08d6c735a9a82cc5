#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "cli/tracks_digest.h"
#include "data/rig.h"
#include "report/page.h"

namespace unfurl::cli {

// "x", or "x - 580000" where coordinates are counted from a far origin [m]; and values so counted.
std::string TracksAxisName(std::size_t axis, double origin);
std::vector<double> LessOrigin(std::vector<double> values, double origin);

// Where the marks were: in motion, in space with the cameras, from above and from the side.
void AddTracksViews(const data::Rig& rig, const TracksDigest& digest, report::Page* page);

}  // namespace unfurl::cli
