// Sums at uneven places against the sums themselves.
#include "correlate/spectra/nonuniform_fft.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "base/random.h"

namespace unfurl::correlate::nonuniform_fft_test {
namespace {

// The largest error over sum |c_j|.
double ErrorOf(const std::vector<double>& x, const std::vector<std::complex<double>>& c,
               std::size_t count) {
  const auto sums = NonuniformFft(x, c, count);
  EXPECT_EQ(sums.size(), count);
  double size = 0.0, worst = 0.0;
  for (const auto& v : c) size += std::abs(v);
  for (std::size_t k = 0; k < sums.size(); ++k) {
    std::complex<double> sum;
    for (std::size_t j = 0; j < x.size(); ++j) {
      sum += c[j] * std::polar(1.0, static_cast<double>(k) * x[j]);
    }
    worst = std::max(worst, std::abs(sum - sums[k]));
  }
  return worst / size;
}

TEST(NonuniformFft, EqualsTheSums) {
  constexpr double kError = 1e-12;                                      // of the method: 2e-13
  constexpr double kRoundOff = std::numeric_limits<double>::epsilon();  // of a phase k x, over it
  Rng rng(5);
  for (const std::size_t n : {1u, 2u, 17u, 400u}) {
    for (const std::size_t count : {1u, 2u, 3u, 8u, 129u, 1000u}) {
      for (const double span : {0.01, 1.0, 2.0 * std::numbers::pi, 50.0}) {
        std::vector<double> x(n);
        std::vector<std::complex<double>> c(n);
        for (std::size_t j = 0; j < n; ++j) {
          x[j] = rng.Uniform(-span, span);
          c[j] = {rng.Normal(), rng.Normal()};
        }
        EXPECT_LT(ErrorOf(x, c, count), kError + kRoundOff * span * static_cast<double>(count))
            << n << " terms, " << count << " sums, " << span;
      }
    }
  }
}

TEST(NonuniformFft, TermsAtTheEndsOfTheCircle) {
  const double turn = 2.0 * std::numbers::pi;
  const std::vector<double> x = {0.0, turn, -turn, std::nextafter(turn, 0.0), -1e-300, 0.5 * turn};
  const std::vector<std::complex<double>> c(x.size(), {1.0, -2.0});
  for (const std::size_t count : {1u, 7u, 64u}) EXPECT_LT(ErrorOf(x, c, count), 1e-12);
  EXPECT_TRUE(NonuniformFft(x, c, 0).empty());
}

}  // namespace
}  // namespace unfurl::correlate::nonuniform_fft_test
