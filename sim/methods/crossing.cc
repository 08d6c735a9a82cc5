#include "sim/methods/crossing.h"

#include <algorithm>

namespace unfurl::sim {
namespace {

constexpr int kMost = DensePolynomial::kMostCoefficients;
constexpr int kBisections = 52;  // down to rounding of sigma
constexpr int kHalvings = 40;    // two zeros nearer than that are a touch, not a crossing

using Coefficients = std::array<double, kMost>;

// From powers of s in [0, 1]: b_i = sum_k C(i, k) / C(n, k) c_k.
Coefficients Bernstein(const DensePolynomial& p) {
  const int n = p.count - 1;
  Coefficients b = p.c;
  double binomial = 1.0;
  for (int k = 1; k <= n; ++k) {
    binomial *= static_cast<double>(n - k + 1) / k;
    b[k] = p.c[k] / binomial;
  }
  for (int level = 1; level <= n; ++level) {
    for (int k = n; k >= level; --k) b[k] += b[k - 1];
  }
  return b;
}

// de Casteljau at s: what is left of it stays in `b`, what is right of it goes to `right`.
void Split(int n, double s, Coefficients* b, Coefficients* right) {
  Coefficients w = *b;
  (*right)[n] = w[n];
  for (int level = 1; level <= n; ++level) {
    for (int k = 0; k <= n - level; ++k) w[k] += s * (w[k + 1] - w[k]);
    (*b)[level] = w[0];
    (*right)[n - level] = w[n - level];
  }
}

// p(low) <= 0 < p(high): the upper end of the last bracket, where p > 0.
double Bisect(const DensePolynomial& p, double low, double high) {
  for (int k = 0; k < kBisections; ++k) {
    const double middle = 0.5 * (low + high);
    (p(middle) > 0.0 ? high : low) = middle;
  }
  return high;
}

DensePolynomial Derivative(const DensePolynomial& p) {
  DensePolynomial d;
  d.count = std::max(p.count - 1, 1);
  for (int k = 1; k < p.count; ++k) d.c[k - 1] = k * p.c[k];
  return d;
}

DensePolynomial Negative(DensePolynomial p) {
  for (double& c : p.c) c = -c;
  return p;
}

}  // namespace

double FirstAbove(const DensePolynomial& p, double from) {
  if (!(from < 1.0)) return -1.0;
  const int n = p.count - 1;
  struct Piece {
    double low, high;
    int halvings;
    Coefficients b;
  };
  std::array<Piece, kHalvings + 2> stack;
  int depth = 1;
  stack[0] = {0.0, 1.0, 0, Bernstein(p)};
  if (from > 0.0) {
    Coefficients right{};
    Split(n, from, &stack[0].b, &right);
    stack[0] = {from, 1.0, 0, right};
  }
  stack[0].b[0] = std::min(stack[0].b[0], 0.0);
  while (depth > 0) {
    Piece& piece = stack[depth - 1];
    int changes = 0;
    bool positive = piece.b[0] > 0.0;
    for (int k = 1; k <= n; ++k) {
      const bool next = piece.b[k] > 0.0;
      changes += next != positive ? 1 : 0;
      positive = next;
    }
    if (changes == 0 && piece.b[0] <= 0.0) {
      --depth;
      continue;
    }
    if (piece.b[0] > 0.0) return piece.low;  // between two pieces
    if (changes == 1) return Bisect(p, piece.low, piece.high);
    if (piece.halvings >= kHalvings) {
      --depth;
      continue;
    }
    const double middle = 0.5 * (piece.low + piece.high);
    Piece right{middle, piece.high, piece.halvings + 1, {}};
    Piece left{piece.low, middle, piece.halvings + 1, piece.b};
    Split(n, 0.5, &left.b, &right.b);
    stack[depth - 1] = right;
    stack[depth++] = left;
  }
  return -1.0;
}

bool MayRise(const DensePolynomial& p, double margin) {
  const int n = p.count - 1;
  const Coefficients b = Bernstein(p);
  double highest = b[0], steepest = -HUGE_VAL;
  for (int k = 1; k <= n; ++k) {
    highest = std::max(highest, b[k]);
    steepest = std::max(steepest, n * (b[k] - b[k - 1]));
  }
  return highest >= -margin && steepest >= -margin;
}

double FirstRise(const DensePolynomial& p) {
  if (p.c[0] <= 0.0) return FirstAbove(p, 0.0);
  const DensePolynomial slope = Derivative(p);
  if (slope.c[0] >= 0.0) return 0.0;
  const double bottom = FirstAbove(slope, 0.0);
  if (bottom < 0.0) return -1.0;
  return p(bottom) > 0.0 ? bottom : FirstAbove(p, bottom);
}

double FirstUpcrossing(const DensePolynomial& p, bool above) {
  double from = 0.0;
  if (above) {
    if (p.c[0] <= 0.0 && p.count > 1 && p.c[1] > 0.0) from = std::max(FirstAbove(p, 0.0), 0.0);
    if (p(from) > 0.0 || from > 0.0) from = FirstAbove(Negative(p), from);
    if (from < 0.0) return -1.0;
  }
  return FirstAbove(p, from);
}

}  // namespace unfurl::sim
