#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "measure/health.h"
#include "measure/scatter_components.h"

namespace unfurl::measure {

inline constexpr double kFewestNumbers = 8.0;  // of fewer a median is no scale

// Three flashes of a mark in a row, as numbers that its place does not change.
struct FlashTriple {
  Triple differs;             // the middle one less the line through the others'
  Triple mean;                // of the three; parts are those of stated sigmas
  std::size_t line = 0;       // of the middle one, among those that are kept
  Eigen::Vector3d p;          // its place [m]
  std::uint32_t cameras = 0;  // bit c: camera c is in it
  Eigen::MatrixXd left;       // m x C, rows are orthonormal and explain no move of the mark
};

// At most some `most` of them, spread over the record; none shares a flash with another.
std::vector<FlashTriple> TriplesOf(const HealthEvidence& evidence, const Triangulator& triangulator,
                                   std::size_t most);

}  // namespace unfurl::measure
