// The inner loop of spot fitting; compiled for this machine's vectors, so no Eigen type appears.
#include "measure/spot_fit.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "measure/normal_pack.h"

namespace unfurl::measure {

namespace {

template <int N>
using Matrix = std::array<std::array<double, N>, N>;  // lower triangle

// Symmetric positive definite; false when it is not.
template <int N>
bool Cholesky(Matrix<N>& A) {
  for (int j = 0; j < N; ++j) {
    for (int k = 0; k < j; ++k) A[j][j] -= A[j][k] * A[j][k];
    if (!(A[j][j] > 0.0)) return false;
    A[j][j] = std::sqrt(A[j][j]);
    for (int i = j + 1; i < N; ++i) {
      for (int k = 0; k < j; ++k) A[i][j] -= A[i][k] * A[j][k];
      A[i][j] /= A[j][j];
    }
  }
  return true;
}

template <int N>
void Solve(const Matrix<N>& L, std::array<double, N>& b) {
  for (int i = 0; i < N; ++i) {
    for (int k = 0; k < i; ++k) b[i] -= L[i][k] * b[k];
    b[i] /= L[i][i];
  }
  for (int i = N - 1; i >= 0; --i) {
    for (int k = i + 1; k < N; ++k) b[i] -= L[k][i] * b[k];
    b[i] /= L[i][i];
  }
}

// How far chi-square over its degrees of freedom lies in its tail, as sigmas of a normal variable
// [Wilson, Hilferty 1931].
double TailSigmas(double reduced, double dof) {
  const double variance = 2.0 / (9.0 * dof);
  return (std::cbrt(reduced) - (1.0 - variance)) / std::sqrt(variance);
}
// One spot in three millions of the right shape lies beyond.
constexpr double kShapeSigmas = 5.0;

// Q spots on one constant. Parameters: centre, width, flux of each, then the constant.
template <int Q>
class Fit {
 public:
  static constexpr int kParameters = 3 * Q + 1;  // all of them
  static constexpr int kConstant = 3 * Q;        // its index
  static constexpr int kPairs = kParameters * (kParameters + 1) / 2;

  Fit(std::span<const float> counts, int first, const PixelNoise& noise, const SpotOptions& options)
      : counts_(counts),
        first_(first),
        noise_(noise),
        weighted_(options.estimator != SpotEstimator::kLeastSquares) {}

  bool Run(const SpotOptions& options, std::span<Spot> spots) {
    if (!Begin(spots) || !Iterate() || !InWindow()) return false;
    Report(options, spots);
    return true;
  }

 private:
  // The guessed shapes; flux and constant are linear in the model, so one pass gives them. There is
  // no model yet: the weights come from the counts.
  bool Begin(std::span<const Spot> spots) {
    for (int q = 0; q < Q; ++q) {
      c_[q] = spots[q].u_px;
      s_[q] = std::max(spots[q].width_px, 0.5);
      flux_[q] = 0.0;
    }
    level_ = 0.0;
    Pass(true);
    if (used_ <= kParameters) return false;
    for (int q = 0; q < Q; ++q) A_[3 * q][3 * q] = A_[3 * q + 1][3 * q + 1] = 1.0;
    if (!Cholesky<kParameters>(A_)) return false;
    Solve<kParameters>(A_, g_);
    for (int q = 0; q < Q; ++q) {
      flux_[q] = g_[3 * q + 2];
      if (!(flux_[q] > 0.0)) return false;
    }
    level_ = g_[kConstant];
    return true;
  }

  // Gauss-Newton with the weights renewed in every step; steps of centre and width are limited to a
  // part of the width, so that a spot does not pass its neighbour.
  bool Iterate() {
    // Far more than it takes from within a few widths at 0.7 of a width a step: the rest is for two
    // spots that part slowly.
    constexpr int kMaxSteps = 40;
    // Squared length of a step in units of the parameters' own sigmas; the next one would square
    // it.
    constexpr double kConverged = 1e-4;
    constexpr double kNarrowest = 0.15;  // width that a pixel can still tell from a point [px]
    for (int step = 0; step < kMaxSteps; ++step) {
      Pass(false);
      const std::array<double, kParameters> gradient = g_;
      if (!Cholesky<kParameters>(A_)) return false;
      Solve<kParameters>(A_, g_);
      double length = 0.0;
      for (int a = 0; a < kParameters; ++a) length += gradient[a] * g_[a];
      for (int q = 0; q < Q; ++q) {
        c_[q] += std::clamp(g_[3 * q], -0.7 * s_[q], 0.7 * s_[q]);
        const double ds = std::clamp(g_[3 * q + 1], -0.4 * s_[q], 0.6 * s_[q]);
        s_[q] = std::max(s_[q] + ds, kNarrowest);
        flux_[q] += g_[3 * q + 2];
        if (!(flux_[q] > 0.0)) return false;
      }
      level_ += g_[kConstant];
      if (length < kConverged * (weighted_ ? 1.0 : noise_.dark_variance)) return true;
    }
    return false;
  }

  bool InWindow() const {
    const double n = static_cast<double>(counts_.size());
    for (int q = 0; q < Q; ++q) {
      if (!(c_[q] >= first_ - 0.5 && c_[q] <= first_ + n - 0.5 && s_[q] <= n)) return false;
    }
    return true;
  }

  // Of the q-th centre: from the inverse of the normal matrix, or, with equal weights, from
  // (J'J)^-1 J'VJ (J'J)^-1.
  double CentreVariance(int q) {
    std::array<double, kParameters> e{};
    e[3 * q] = 1.0;
    Solve<kParameters>(A_, e);
    if (weighted_) return e[3 * q];
    double variance = 0.0;
    for (int a = 0; a < kParameters; ++a) {
      for (int b = 0; b < kParameters; ++b) {
        variance += e[a] * (a >= b ? V_[a][b] : V_[b][a]) * e[b];
      }
    }
    return variance;
  }

  // With the matrix and chi-square of the last step: the solution was a hundredth of a sigma away.
  void Report(const SpotOptions& options, std::span<Spot> spots) {
    const double dof = used_ - kParameters;
    const double misfit = chi_square_ / dof;
    const bool misfits = misfit > 1.0 + options.misfit_sigmas * std::sqrt(2.0 / dof);
    for (int q = 0; q < Q; ++q) {
      Spot& spot = spots[q];
      spot.u_px = c_[q];
      spot.width_px = s_[q];
      spot.flux = flux_[q];
      spot.misfit = misfit;
      spot.s_px = std::sqrt(CentreVariance(q) * (misfits ? misfit : 1.0));
      // Nowhere to within its own width: there is no reading in it.
      if (!(spot.s_px <= spot.width_px + 0.5)) spot.flags |= kSpotPoorFit;
      if (TailSigmas(misfit, dof) > kShapeSigmas) spot.flags |= kSpotShape;
    }
  }

  // Left edges of a pack's pixels, in widths from each centre, with density and distribution there.
  struct Edges {
    std::array<Pack, Q> z, pdf, cdf;
  };
  // What a pass sums up, lane by lane.
  struct Sums {
    std::array<Pack, kPairs> A{}, V{};
    std::array<Pack, kParameters> g{};
    Pack chi_square{}, used{};
  };

  // Normal matrix, gradient and chi-square at the present parameters.
  void Pass(bool from_counts) {
    Sums sums;
    const Pack zero{}, one = Broadcast(1.0);
    const Pack dark = Broadcast(noise_.dark_variance);
    const double per_electron = 1.0 / noise_.electrons_per_count;
    Edges edges;
    for (int q = 0; q < Q; ++q) {
      edges.z[q] = Broadcast((first_ - 0.5 - c_[q]) / s_[q]);
      Normal(edges.z[q], &edges.pdf[q], &edges.cdf[q]);
    }
    const int n = static_cast<int>(counts_.size());
    for (int k = 0; k < n; k += kLanes) {
      Pack y;
      for (int lane = 0; lane < kLanes; ++lane) {
        y[lane] = k + lane < n ? counts_[static_cast<std::size_t>(k + lane)] : kLeftOut;
      }
      const PackInt seen = y == y;
      y = seen ? y : zero;
      std::array<Pack, kParameters> J;
      const Pack model = Model((first_ + k + 0.5) + Pack{0, 1, 2, 3, 4, 5, 6, 7}, &edges, &J);
      const Pack light = from_counts ? y : model;
      const Pack variance = dark + (light > zero ? light : zero) * per_electron;
      const Pack exact = seen ? 1.0 / variance : zero;
      const Pack r = y - model;
      AddToNormals(J, weighted_ ? exact : (seen ? one : zero), variance, r, &sums);
      sums.chi_square += exact * r * r;
      sums.used += seen ? one : zero;
    }
    int pair = 0;
    for (int a = 0; a < kParameters; ++a) {
      g_[a] = Sum(sums.g[a]);
      for (int b = 0; b <= a; ++b, ++pair) {
        A_[a][b] = Sum(sums.A[pair]);
        if (!weighted_) V_[a][b] = Sum(sums.V[pair]);
      }
    }
    chi_square_ = Sum(sums.chi_square);
    used_ = static_cast<int>(Sum(sums.used));  // a sum of ones, exact
  }

  // The model at a pack of pixels with these right edges, and its derivatives: Gaussians integrated
  // over each pixel, on a constant. `edges` moves on by one pack.
  [[gnu::always_inline]] Pack Model(const Pack& right, Edges* edges,
                                    std::array<Pack, kParameters>* J) const {
    Pack model = Broadcast(level_);
    for (int q = 0; q < Q; ++q) {
      const double per_width = 1.0 / s_[q];
      const Pack z = (right - c_[q]) * per_width;
      Pack pdf, cdf;
      Normal(z, &pdf, &cdf);
      const Pack low_pdf = Shifted(edges->pdf[q], pdf), low_cdf = Shifted(edges->cdf[q], cdf);
      const Pack low_z = Shifted(edges->z[q], z);
      edges->pdf[q] = pdf, edges->cdf[q] = cdf, edges->z[q] = z;
      const Pack share = cdf - low_cdf;
      const double slope = -flux_[q] * per_width;
      (*J)[3 * q] = slope * (pdf - low_pdf);
      (*J)[3 * q + 1] = slope * (z * pdf - low_z * low_pdf);
      (*J)[3 * q + 2] = share;
      model += flux_[q] * share;
    }
    (*J)[kConstant] = Broadcast(1.0);
    return model;
  }

  // J'WJ and J'Wr; with equal weights J'VJ too, of which the covariance is made.
  [[gnu::always_inline]] void AddToNormals(const std::array<Pack, kParameters>& J, const Pack& w,
                                           const Pack& variance, const Pack& r, Sums* sums) const {
    int pair = 0;
    for (int a = 0; a < kParameters; ++a) {
      const Pack wJ = w * J[a];
      sums->g[a] += wJ * r;
      for (int b = 0; b <= a; ++b) sums->A[pair++] += wJ * J[b];
    }
    if (weighted_) return;
    pair = 0;
    for (int a = 0; a < kParameters; ++a) {
      const Pack vJ = w * variance * J[a];
      for (int b = 0; b <= a; ++b) sums->V[pair++] += vJ * J[b];
    }
  }

  // The values one pixel to the left: the last of the pack before, then the first seven of this.
  static Pack Shifted(const Pack& before, const Pack& here) {
    return __builtin_shufflevector(before, here, 7, 8, 9, 10, 11, 12, 13, 14);
  }

  static constexpr double kLeftOut = std::numeric_limits<double>::quiet_NaN();

  std::span<const float> counts_;
  int first_;
  const PixelNoise& noise_;
  bool weighted_;
  std::array<double, Q> c_, s_, flux_;
  double level_ = 0.0;
  Matrix<kParameters> A_, V_;
  std::array<double, kParameters> g_;
  double chi_square_ = 0.0;
  int used_ = 0;
};

template <int Q>
bool FitOf(std::span<const float> counts, int first, const PixelNoise& noise,
           const SpotOptions& options, std::span<Spot> spots) {
  return Fit<Q>(counts, first, noise, options).Run(options, spots);
}

}  // namespace

void FitGaussians(std::span<const float> counts, int first, const PixelNoise& noise,
                  const SpotOptions& options, std::span<Spot> spots) {
  constexpr decltype(&FitOf<1>) kFits[] = {FitOf<1>, FitOf<2>, FitOf<3>, FitOf<4>};
  static_assert(std::size(kFits) == kMostJoint);
  if (!kFits[spots.size() - 1](counts, first, noise, options, spots)) {
    for (Spot& spot : spots) spot.flags |= kSpotPoorFit;
  }
}

}  // namespace unfurl::measure
