// The inner loop of spot fitting; compiled for this machine's vectors, so no Eigen type appears.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "measure/spot.h"

namespace unfurl::measure {

namespace {

constexpr int kParameters = 4;  // centre, width, flux, constant

// Symmetric positive definite, lower triangle in `A`; false when it is not.
bool Cholesky(double A[kParameters][kParameters]) {
  for (int j = 0; j < kParameters; ++j) {
    for (int k = 0; k < j; ++k) A[j][j] -= A[j][k] * A[j][k];
    if (!(A[j][j] > 0.0)) return false;
    A[j][j] = std::sqrt(A[j][j]);
    for (int i = j + 1; i < kParameters; ++i) {
      for (int k = 0; k < j; ++k) A[i][j] -= A[i][k] * A[j][k];
      A[i][j] /= A[j][j];
    }
  }
  return true;
}

void Solve(const double L[kParameters][kParameters], double b[kParameters]) {
  for (int i = 0; i < kParameters; ++i) {
    for (int k = 0; k < i; ++k) b[i] -= L[i][k] * b[k];
    b[i] /= L[i][i];
  }
  for (int i = kParameters - 1; i >= 0; --i) {
    for (int k = i + 1; k < kParameters; ++k) b[i] -= L[k][i] * b[k];
    b[i] /= L[i][i];
  }
}

// Cumulative and density of the normal distribution at a pixel's edge.
struct Edge {
  double z, cdf, pdf;
};
Edge At(double x, double centre, double width) {
  const double z = (x - centre) / width;
  return {z, 0.5 * std::erfc(-z / std::numbers::sqrt2),
          std::exp(-0.5 * z * z) / std::sqrt(2.0 * std::numbers::pi)};
}

}  // namespace

void FitGaussian(std::span<const float> counts, int first, const PixelNoise& noise,
                 const SpotOptions& options, Spot* spot) {
  constexpr int kMaxSteps = 25;
  constexpr double kConverged = 1e-5;  // of the centre's step [px]
  constexpr double kNarrowest = 0.15;  // width that a pixel can still tell from a point [px]

  const int n = static_cast<int>(counts.size());
  double c = spot->u_px;
  double s = std::max(spot->width_px, 0.5);
  double flux = 0.0;
  double level = 0.0;
  double A[kParameters][kParameters];
  bool converged = false;
  // The first pass has no flux yet: weights then come from the counts themselves.
  bool have_flux = false;

  const auto pass = [&](double g[kParameters], double* chi_square, int* used) {
    for (auto& row : A) std::fill(std::begin(row), std::end(row), 0.0);
    std::fill(g, g + kParameters, 0.0);
    *chi_square = 0.0;
    *used = 0;
    Edge low = At(first - 0.5, c, s);
    for (int i = 0; i < n; ++i) {
      const Edge high = At(first + i + 0.5, c, s);
      const double share = high.cdf - low.cdf;
      const double by_c = -(high.pdf - low.pdf) / s;
      const double by_s = -(high.z * high.pdf - low.z * low.pdf) / s;
      low = high;
      const double y = counts[static_cast<std::size_t>(i)];
      if (std::isnan(y)) continue;
      const double model = flux * share + level;
      const double light = have_flux ? model : y;
      const double w =
          1.0 / (noise.dark_variance + std::max(light, 0.0) / noise.electrons_per_count);
      const double r = y - model;
      const double J[kParameters] = {flux * by_c, flux * by_s, share, 1.0};
      for (int a = 0; a < kParameters; ++a) {
        g[a] += w * J[a] * r;
        for (int b = 0; b <= a; ++b) A[a][b] += w * J[a] * J[b];
      }
      *chi_square += w * r * r;
      ++*used;
    }
  };

  double g[kParameters];
  double chi_square;
  int used;
  // Flux and constant are linear: one pass at the guessed shape gives them.
  pass(g, &chi_square, &used);
  if (used > kParameters) {
    A[0][0] = A[1][1] = 1.0;
    if (Cholesky(A)) {
      Solve(A, g);
      flux = g[2];
      level = g[3];
    }
  }
  have_flux = true;
  for (int step = 0; step < kMaxSteps && flux > 0.0 && used > kParameters; ++step) {
    pass(g, &chi_square, &used);
    if (!Cholesky(A)) break;
    Solve(A, g);
    if (converged) break;  // this pass has the Fisher matrix and chi-square at the solution
    const double limit = 0.7 * s;
    const double dc = std::clamp(g[0], -limit, limit);
    const double ds = std::clamp(g[1], -0.4 * s, 0.6 * s);
    c += dc;
    s = std::max(s + ds, kNarrowest);
    flux += g[2];
    level += g[3];
    converged = std::abs(dc) < kConverged && std::abs(ds) < 10.0 * kConverged;
  }
  spot->u_px = c;
  spot->width_px = s;
  spot->flux = flux;
  if (!converged || !(flux > 0.0) || c < first - 0.5 || c > first + n - 0.5 || s > n) {
    spot->flags |= kSpotPoorFit;
    return;
  }
  // First column of the inverse: the centre's variance.
  double e[kParameters] = {1.0, 0.0, 0.0, 0.0};
  Solve(A, e);
  const double dof = used - kParameters;
  spot->misfit = chi_square / dof;
  const bool misfits = spot->misfit > 1.0 + options.misfit_sigmas * std::sqrt(2.0 / dof);
  spot->s_px = std::sqrt(e[0] * (misfits ? spot->misfit : 1.0));
}

}  // namespace unfurl::measure
