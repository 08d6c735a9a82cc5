#pragma once

#include <string>

#include "data/tracks.h"

namespace unfurl::data {

// Tracks in the formats of other fields. Each reader throws Error for a file that is not what its
// name says, cut off, or contradicts itself.

// C3D (biomechanics and motion capture; https://www.c3d.org): points in frames of one rate, [mm] in
// 32-bit floats, with a residual that takes the sigma (root mean square over the axes, up to 2.5
// mm) and a mask of the cameras that entered (the first seven). No covariances, no shared part.
// Stamps must lie on a grid; each mark's delay within its frame stands in UNFURL:DELAYS, which
// others do not read: to them, all marks of a frame are of one instant.
void WriteTracksC3d(const std::string& path, const Tracks& tracks);
// `sigma` [m] of one axis where the file states none; 0: such a file is refused.
Tracks ReadTracksC3d(const std::string& path, double sigma = 0.0);

// Universal file, dataset 58 (structural dynamics): one function of time per mark and direction, in
// SI, doubles, and the six covariances and the status as functions of their own. No shared part.
void WriteTracksUff(const std::string& path, const Tracks& tracks);
Tracks ReadTracksUff(const std::string& path, double sigma = 0.0);

}  // namespace unfurl::data
