// Fits of a model that is not what made the data, a hundred of each: what is rejected, and how far
// off the values are.
#include <gtest/gtest.h>

#include "tests/correlate/wrong_model.h"

namespace unfurl::correlate {
namespace {

constexpr int kSeeds = 100;
constexpr double kUsable = 0.97;  // at least; the rest do not converge and say so
constexpr double kFine = 5e-4;    // marks that show another law or mesh in every trial [m]

TEST(WrongModelSlow, ContactLaws) {
  const char* const names[] = {"the scene's own", "Hunt and Crossley", "Kelvin and Voigt",
                               "Newton, rigid"};
  for (double sigma : {2e-4, 1e-3}) {
    for (StopLaw law :
         {StopLaw::kScene, StopLaw::kHuntCrossley, StopLaw::kKelvinVoigt, StopLaw::kNewton}) {
      const WrongModelCount count = CountWrong(FitToLaw(law, kSeeds, 1, sigma), 4);
      fmt::print("marks' sigma {:g} m, {}: {}\n", sigma, names[static_cast<int>(law)],
                 count.Words(Pendulum::Parameters()));
      std::fflush(stdout);
      if (law == StopLaw::kScene) {
        EXPECT_GE(count.usable, kUsable * kSeeds);
        const auto [low, high] =
            BinomialInterval(static_cast<std::size_t>(count.Outcome(Explained::kNo)), kSeeds, 0.99);
        EXPECT_LE(low, kGoodnessLevel);
        for (std::size_t j = 0; j < 4; ++j) {
          // Three standard errors of the mean.
          EXPECT_LT(std::abs(count.bias_sigmas[j]), 3.0 * count.scatter[j] / std::sqrt(kSeeds));
        }
      } else {
        // A fit that gives no result says nothing wrong. At 1 mm the parameters make up for most of
        // Kelvin and Voigt's law, and no test of residuals can tell: the figures are printed.
        if (sigma < kFine) {
          EXPECT_EQ(count.Outcome(Explained::kNo), count.usable);
          EXPECT_EQ(count.determined, 0);
        }
      }
    }
  }
}

TEST(WrongModelSlow, FinerMesh) {
  struct Case {
    int segments;
    bool checked;
  };
  for (double sigma : {2e-4, 1e-3}) {
    for (const Case& c : {Case{4, true}, Case{16, true}, Case{16, false}}) {
      const WrongModelCount count =
          CountWrong(FitToMesh(c.segments, c.checked, kSeeds, 1, sigma), 3);
      fmt::print("marks' sigma {:g} m, made with {} segments, {} check of the mesh: {}\n", sigma,
                 c.segments, c.checked ? "with" : "without",
                 count.Words(FlexibleArm::Parameters()));
      std::fflush(stdout);
      EXPECT_GE(count.usable, kUsable * kSeeds);
      if (c.checked) {
        EXPECT_EQ(count.determined_wrongly, 0);
      } else if (sigma < kFine) {
        EXPECT_EQ(count.Outcome(Explained::kNo), kSeeds);
      }
    }
  }
}

}  // namespace
}  // namespace unfurl::correlate
