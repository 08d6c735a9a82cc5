// Coverage of the errors of operational modes, and what is found and missed, over many seeds.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "tests/correlate/ambient_cases.h"

namespace unfurl::correlate::ambient_slow_test {
namespace {

using Output = DrivenStructure::Output;

TEST(AmbientSlow, Covers) {
  constexpr int kRuns = 250;
  Eigen::Matrix2d pair;
  pair << 1.0, 1.0, 1.0, -1.0;
  pair /= std::sqrt(2.0);
  const std::vector<AmbientCase> cases = {{"3 masses, 2 of them, 1% noise",
                                           DrivenStructure::Chain(3, 0.8, 0.02),
                                           0.1,
                                           6000,
                                           {0, 2},
                                           Output::kRate,
                                           0.01},
                                          {"4 masses, 4, 5%",
                                           DrivenStructure::Chain(4, 0.8, 0.02),
                                           0.1,
                                           6000,
                                           {0, 1, 2, 3},
                                           Output::kAcceleration,
                                           0.05},
                                          {"4 masses, 4, 20%, low-passed forces",
                                           DrivenStructure::Chain(4, 0.8, 0.02),
                                           0.1,
                                           6000,
                                           {0, 1, 2, 3},
                                           Output::kAcceleration,
                                           0.2,
                                           1.0},
                                          {"5 masses, 5, 10%, 1% damping",
                                           DrivenStructure::Chain(5, 0.8, 0.01),
                                           0.08,
                                           15000,
                                           {0, 1, 2, 3, 4},
                                           Output::kAcceleration,
                                           0.1},
                                          {"6 masses, 8 signals, 10%",
                                           DrivenStructure::Chain(6, 0.6, 0.015),
                                           0.1,
                                           9000,
                                           {0, 1, 2, 3, 4, 5, 0, 3},
                                           Output::kAcceleration,
                                           0.1},
                                          {"2% apart, 2, 5%",
                                           {pair, {1.0, 1.02}, {0.01, 0.01}},
                                           0.1,
                                           20000,
                                           {0, 1},
                                           Output::kAcceleration,
                                           0.05},
                                          {"1% apart, 2, 5%",
                                           {pair, {1.0, 1.01}, {0.01, 0.01}},
                                           0.1,
                                           20000,
                                           {0, 1},
                                           Output::kAcceleration,
                                           0.05},
                                          {"20 and 1% damping, 2, 5%",
                                           {pair, {1.0, 2.5}, {0.2, 0.01}},
                                           0.05,
                                           20000,
                                           {0, 1},
                                           Output::kRate,
                                           0.05},
                                          {"10 and 12% damping, 2, 5%",
                                           {pair, {1.0, 2.5}, {0.1, 0.12}},
                                           0.05,
                                           20000,
                                           {0, 1},
                                           Output::kRate,
                                           0.05}};
  for (const AmbientCase& c : cases) {
    const AmbientTally t = Tally(c, kRuns, 20000);
    int found = 0, frequency = 0, damping = 0;
    for (std::size_t k = 0; k < t.found.size(); ++k) {
      found += t.found[k];
      frequency += t.frequency[k];
      damping += t.damping[k];
    }
    const int planted = kRuns * static_cast<int>(t.found.size());
    fmt::print(
        "{}: found {} of {}, not planted {}; intervals hold frequency {:.1f}%, damping {:.1f}%, "
        "shape {:.1f}%; doubts of {} modes, {} harmonic, of {} records; {} neither found nor "
        "told, {} told needlessly\n",
        c.name, found, planted, t.spurious, 100.0 * frequency / found, 100.0 * damping / found,
        100.0 * t.shapes / t.shape_parts, t.doubts, t.harmonic, t.of_record, t.hidden, t.needless);
    EXPECT_LE(t.hidden, planted / 100) << c.name;
    EXPECT_LE(t.needless, kRuns / 50) << c.name;
    // Of broad peaks the first-order errors, a mean over the orders, are a little too large.
    const int most = c.structure.damping()[0] > 0.05 ? 99 : 98;
    EXPECT_GT(found, planted * 97 / 100) << c.name;
    EXPECT_LT(t.spurious, kRuns / 50) << c.name;
    for (const int held : {frequency, damping}) {
      EXPECT_GT(held, found * 93 / 100) << c.name;
      EXPECT_LT(held, found * most / 100) << c.name;
    }
  }
}

}  // namespace
}  // namespace unfurl::correlate::ambient_slow_test
