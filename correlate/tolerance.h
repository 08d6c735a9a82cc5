#pragma once

namespace unfurl::correlate {

/// The loosest relative tolerance that a fit simulates with [-].
inline constexpr double kLoosestTolerance = 1e-5;

}  // namespace unfurl::correlate
