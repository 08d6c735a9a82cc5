#pragma once

namespace unfurl::data {

// Parts of scenes that several tests put together.
inline constexpr char kHead[] =
    "[scene]\nname = 's'\nduration = 2.0\n"
    "[body.bar]\nmass = 1.0\ninertia = 0.1\n"
    "[body.block]\nmass = 1.0\ninertia = 0.1\n";
inline constexpr char kPivot[] = "[joint.pivot]\ninner = 'ground'\nouter = 'bar'\n";
inline constexpr char kRod[] = "[beam.rod]\nlength = 1.0\nmass = 1.0\nEI = 10.0\n";

}  // namespace unfurl::data
