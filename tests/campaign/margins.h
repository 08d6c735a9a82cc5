#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>
#include <numbers>
#include <ostream>
#include <string>
#include <vector>

#include "base/probability.h"
#include "base/statistics.h"
#include "campaign/statistics/counter_random.h"

namespace unfurl::campaign {

/// A margin of normal scores whose probability of being negative is known.
struct MarginCase {
  std::string name;
  int dimensions;
  double probability;
  std::function<double(const std::vector<double>&)> margin;
};

inline void PrintTo(const MarginCase& c, std::ostream* out) { *out << c.name; }

inline double Sum(const std::vector<double>& z) {
  double sum = 0.0;
  for (double x : z) sum += x;
  return sum;
}

/// beta - (z1 + ... + zd) / sqrt(d): Phi(-beta).
inline MarginCase Linear(int d, double p) {
  const double beta = -NormalQuantile(p);
  return {"linear_" + std::to_string(d), d, p,
          [=](const std::vector<double>& z) { return beta - Sum(z) / std::sqrt(d); }};
}

/// Two opposite half spaces.
inline MarginCase TwoSided(int d, double p) {
  const double beta = -NormalQuantile(p / 2.0);
  return {"two_sided_" + std::to_string(d), d, p,
          [=](const std::vector<double>& z) { return beta - std::abs(Sum(z)) / std::sqrt(d); }};
}

/// The four-branch series system of Waarts (2000), with all branches farther by `shift`; its
/// probability by the midpoint rule over the plane.
inline MarginCase FourBranch(double shift) {
  const auto margin = [=](const std::vector<double>& z) {
    const double x = z[0], y = z[1], r = std::numbers::sqrt2;
    const double bent = 3.0 + 0.1 * (x - y) * (x - y);
    return std::min({bent - (x + y) / r, bent + (x + y) / r, x - y + 7.0 / r, y - x + 7.0 / r}) +
           shift;
  };
  constexpr int kCells = 1600;
  constexpr double kEnd = 8.0, kCell = 2.0 * kEnd / kCells;
  double p = 0.0;
  for (int i = 0; i < kCells; ++i) {
    for (int j = 0; j < kCells; ++j) {
      const double x = -kEnd + kCell * (i + 0.5), y = -kEnd + kCell * (j + 0.5);
      if (margin({x, y}) < 0.0) p += std::exp(-0.5 * (x * x + y * y));
    }
  }
  return {"four_branch", 2, p * kCell * kCell / (2.0 * std::numbers::pi), margin};
}

/// Outside a sphere: a chi-square tail, with failures in all directions.
inline MarginCase Sphere(int d, double p) {
  const double square = ChiSquareQuantile(1.0 - p, d);
  return {"sphere_" + std::to_string(d), d, p, [=](const std::vector<double>& z) {
            double sum = 0.0;
            for (double x : z) sum += x * x;
            return square - sum;
          }};
}

/// A sum of exponential variables: a gamma tail, bent in every direction.
inline MarginCase Exponentials(int d, double p) {
  const double most = ChiSquareQuantile(1.0 - p, 2.0 * d) / 2.0;
  return {"exponentials_" + std::to_string(d), d, p, [=](const std::vector<double>& z) {
            double sum = 0.0;
            for (double x : z) sum -= std::log(NormalCdf(-x));
            return most - sum;
          }};
}

/// Half spaces across the first axes: 1 - prod Phi(beta_k).
inline MarginCase Planes(int d, const std::vector<double>& beta) {
  double none = 1.0;
  for (double b : beta) none *= 1.0 - NormalCdf(-b);
  return {"planes_" + std::to_string(d), d, 1.0 - none, [=](const std::vector<double>& z) {
            double least = beta[0] - z[0];
            for (std::size_t k = 1; k < beta.size(); ++k) least = std::min(least, beta[k] - z[k]);
            return least;
          }};
}

/// Two inputs that must both be large: Phi(-beta)^2, with an edge.
inline MarginCase Corner(int d, double p) {
  const double beta = -NormalQuantile(std::sqrt(p));
  return {"corner_" + std::to_string(d), d, p,
          [=](const std::vector<double>& z) { return std::max(beta - z[0], beta - z[1]); }};
}

/// A linear margin in steps of a quarter standard deviation.
inline MarginCase Steps(int d, double beta) {
  return {"steps_" + std::to_string(d), d, NormalCdf(-beta), [=](const std::vector<double>& z) {
            const double margin = beta - Sum(z) / std::sqrt(d);
            return std::ceil(4.0 * margin) / 4.0 - (margin < 0.0 ? 0.25 : 0.0);
          }};
}

/// A linear margin with noise of 0.3 that no other run has: what a solver's tolerance can do.
inline MarginCase Noisy(int d, double p) {
  constexpr double kNoise = 0.3;  // over the margin's own standard deviation
  const double beta = -NormalQuantile(p) * std::hypot(1.0, kNoise);
  return {"noisy_" + std::to_string(d), d, p, [=](const std::vector<double>& z) {
            std::uint64_t hash = 1;
            for (double x : z) hash = SplitMix(hash, std::bit_cast<std::uint64_t>(x));
            return beta - Sum(z) / std::sqrt(d) + kNoise * NormalQuantile(OpenUniform(hash >> 12));
          }};
}

/// Runs a state machine of points of the unit cube to its end.
template <typename Machine>
void Drive(Machine* machine, const std::function<double(const std::vector<double>&)>& margin) {
  std::vector<double> margins, z;
  while (!machine->Done()) {
    margins.clear();
    for (const std::vector<double>& u : machine->Batch()) {
      z.clear();
      for (double v : u) z.push_back(NormalQuantile(v));
      margins.push_back(margin(z));
    }
    machine->Answer(margins);
  }
}

}  // namespace unfurl::campaign
