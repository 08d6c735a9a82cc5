// The integral of an expression: Chebyshev series of the rate on pieces that are halved until the
// series has ended, integrated term by term.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "base/error.h"
#include "data/time_function_impl.h"

namespace unfurl::data {
namespace {

using TimeIntegralImpl = TimeFunction::Impl;

constexpr int kTerms = 17;                    // of a piece's series
constexpr int kFirstPieces = 16;              // smooth rates need no more: their series end early
constexpr int kMostHalvings = 46;             // of a first piece, towards a jump
constexpr std::size_t kMostPieces = 1 << 17;  // some 20 MB
// A series is held against the rate at the ends of these parts of the duration as well, as many as
// Edges() looks at (expression_edges.cc), and of the cells that bounds of the rate ask for: a pulse
// between the points of the series is seen.
constexpr int kLooks = 4096;
// Of the rate's area, that such a cell may hide; and how many there are at most, some 10 ms of
// work.
constexpr double kHidden = 1e-9;
constexpr std::size_t kMostCells = 1 << 13;
// Difference there, against the largest value of the rate, that the series may have: far more than
// kEnd and what rounding adds, far less than a pulse that matters.
constexpr double kSeen = 1e-9;
// The last two terms of a series, against the largest value of the rate. What is left out is as
// small as they are, and it is integrated over one piece.
constexpr double kEnd = 3e-14;

// Of a series at such a place, in roundings of the rate's own values: sums of some of them.
constexpr double kRoundings = 16.0;

struct Piece {
  double begin, end;
  double sum;                        // integral up to `begin`
  std::array<double, kTerms + 1> c;  // of the integral from `begin`, in Chebyshev polynomials
};

using Series = std::array<double, kTerms>;

// cos(pi j k / (kTerms - 1)).
const std::array<Series, kTerms>& Cosines() {
  static const std::array<Series, kTerms> table = [] {
    std::array<Series, kTerms> c;
    for (int j = 0; j < kTerms; ++j) {
      for (int k = 0; k < kTerms; ++k) {
        c[j][k] = std::cos(std::numbers::pi * (j * k % (2 * (kTerms - 1))) / (kTerms - 1));
      }
    }
    return c;
  }();
  return table;
}

// Through the function at the Chebyshev points of [a, b].
Series Fit(const TimeIntegralImpl& f, double a, double b) {
  constexpr int n = kTerms - 1;
  const auto& cosine = Cosines();
  Series values, c;
  for (int j = 0; j <= n; ++j) {
    values[j] = f.Value(0.5 * (a + b) + 0.5 * (b - a) * cosine[1][j]);
  }
  values[0] *= 0.5;
  values[n] *= 0.5;
  for (int k = 0; k <= n; ++k) {
    double sum = 0.0;
    for (int j = 0; j <= n; ++j) sum += values[j] * cosine[j][k];
    c[k] = sum * 2.0 / n;
  }
  c[0] *= 0.5;
  c[n] *= 0.5;
  return c;
}

// Sum c_k T_k(x), by Clenshaw.
template <std::size_t kCount>
double Evaluate(const std::array<double, kCount>& c, double x) {
  double b1 = 0.0, b2 = 0.0;
  for (std::size_t k = kCount - 1; k >= 1; --k) {
    const double b = 2.0 * x * b1 - b2 + c[k];
    b2 = b1;
    b1 = b;
  }
  return x * b1 - b2 + c[0];
}

struct SmoothIntegral : TimeIntegralImpl {
  std::shared_ptr<const TimeIntegralImpl> rate;
  double start = 0.0;
  std::vector<Piece> pieces;
  struct Look {
    double t, value;  // [s], of the rate
  };
  std::vector<Look> looks;  // in order; until the pieces are there

  std::vector<double> Edges(double duration) const override { return rate->Edges(duration); }
  std::optional<TimeFunction::Bounds> Bound(double a, double b, int derivative) const override {
    if (derivative == 0) return std::nullopt;  // nobody asks
    return rate->Bound(a, b, derivative - 1);
  }
  TimeValue At(double t) const override {
    const TimeValue r = rate->At(t);
    return {Value(t), r.value, r.rate};
  }
  double Value(double t) const override {
    const auto after = std::upper_bound(pieces.begin() + 1, pieces.end(), t,
                                        [](double at, const Piece& p) { return at < p.begin; });
    const Piece& p = *(after - 1);
    if (t > p.end) return start + p.sum + Evaluate(p.c, 1.0) + Beyond(p.end, t);
    const double x = (2.0 * t - p.begin - p.end) / (p.end - p.begin);
    return start + p.sum + Evaluate(p.c, x);
  }
  // Past the duration that was announced: three-point Gauss rule on steps like the mean piece.
  double Beyond(double from, double t) const {
    const double mean = pieces.back().end / static_cast<double>(pieces.size());
    const int steps = static_cast<int>(std::clamp((t - from) / mean * 4.0, 1.0, 1e6));
    const double h = (t - from) / steps, reach = std::sqrt(0.15);
    double sum = 0.0;
    for (int k = 0; k < steps; ++k) {
      const double middle = from + (k + 0.5) * h;
      sum += 8.0 * rate->Value(middle) + 5.0 * rate->Value(middle - reach * h) +
             5.0 * rate->Value(middle + reach * h);
    }
    return sum * h / 18.0;
  }
  std::shared_ptr<const TimeIntegralImpl> Integral(double, double) const override {
    throw Error("an integral of an integral", where, "give the function itself");
  }
  std::string text() const override { return rate->text(); }

  // Whether the series of [a, b] goes through what was seen of the rate, within what is allowed.
  bool GoesThrough(const Series& c, double a, double b, double allowed) const {
    const auto first = std::lower_bound(looks.begin(), looks.end(), a,
                                        [](const Look& look, double t) { return look.t < t; });
    for (auto look = first; look != looks.end() && look->t <= b; ++look) {
      const double x = std::clamp((2.0 * look->t - a - b) / (b - a), -1.0, 1.0);
      if (std::fabs(Evaluate(c, x) - look->value) > allowed) return false;
    }
    return true;
  }

  // Adds pieces for [a, b].
  void Add(double a, double b, double scale, int halvings) {
    const Series c = Fit(*rate, a, b);
    const double rest = std::fabs(c[kTerms - 1]) + std::fabs(c[kTerms - 2]);
    // A time t is a double: where the rate changes within a short piece, its values hold so much.
    double swing = 0.0;
    for (int k = 1; k < kTerms; ++k) swing += std::fabs(c[k]);
    const double rounding = std::numeric_limits<double>::epsilon() * swing * b / (b - a);
    if ((rest > kEnd * scale + rounding ||
         !GoesThrough(c, a, b, kSeen * scale + kRoundings * rounding)) &&
        halvings < kMostHalvings) {
      Add(a, 0.5 * (a + b), scale, halvings + 1);
      Add(0.5 * (a + b), b, scale, halvings + 1);
      return;
    }
    if (pieces.size() >= kMostPieces) {
      throw Error(fmt::format("\"{}\" changes too fast to be integrated over the run", text()),
                  where, "give the position instead of the rate, or a shorter duration");
    }
    Piece p{a, b, 0.0, {}};
    if (!pieces.empty()) p.sum = pieces.back().sum + Evaluate(pieces.back().c, 1.0);
    const double half = 0.5 * (b - a);
    const auto at = [&](int k) { return k < kTerms ? c[k] : 0.0; };
    for (int k = 1; k <= kTerms; ++k) {
      p.c[k] = half * ((k == 1 ? 2.0 : 1.0) * at(k - 1) - at(k + 1)) / (2.0 * k);
    }
    double at_begin = 0.0;
    for (int k = 1; k <= kTerms; ++k) at_begin += k % 2 == 0 ? p.c[k] : -p.c[k];
    p.c[0] = -at_begin;
    pieces.push_back(p);
  }
};

}  // namespace

std::shared_ptr<const TimeIntegralImpl> IntegrateSmooth(
    const std::shared_ptr<const TimeIntegralImpl>& rate, double start, double duration) {
  auto integral = std::make_shared<SmoothIntegral>();
  integral->rate = rate;
  integral->start = start;
  integral->where = rate->where;
  for (int k = 0; k <= kLooks; ++k) integral->looks.push_back({duration * k / kLooks, 0.0});
  for (const FunctionScan::Cell& cell : rate->Scan(0, duration, kHidden, kMostCells).cells) {
    integral->looks.push_back({cell.begin, 0.0});
  }
  std::sort(integral->looks.begin(), integral->looks.end(),
            [](const auto& a, const auto& b) { return a.t < b.t; });
  double scale = 1e-300;
  for (auto& look : integral->looks) {
    look.value = rate->Value(look.t);
    scale = std::max(scale, std::fabs(look.value));
  }
  for (int k = 0; k < kFirstPieces; ++k) {
    integral->Add(duration * k / kFirstPieces, duration * (k + 1) / kFirstPieces, scale, 0);
  }
  integral->looks = {};
  return integral;
}

}  // namespace unfurl::data
