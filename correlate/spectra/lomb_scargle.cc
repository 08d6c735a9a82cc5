#include "correlate/spectra/lomb_scargle.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <numeric>

#include "base/dense.h"
#include "base/error.h"
#include "correlate/sampled_model.h"
#include "correlate/spectra/nonuniform_fft.h"

namespace unfurl::correlate {

namespace {

// 1 / sigma^2, or all alike, that add up to 1.
std::vector<double> Weights(std::span<const double> sigma, std::size_t n) {
  std::vector<double> w(n, 1.0);
  if (sigma.size() == n) {
    for (std::size_t i = 0; i < n; ++i) w[i] = 1.0 / (sigma[i] * sigma[i]);
  }
  double total = 0.0;
  for (const double v : w) total += v;
  for (double& v : w) v /= total;
  return w;
}

// What a straight line by the same weights leaves.
std::vector<double> WithoutLine(std::span<const double> t, std::span<const double> x,
                                const std::vector<double>& w) {
  const std::size_t n = t.size();
  double mt = 0.0, mx = 0.0;
  for (std::size_t i = 0; i < n; ++i) mt += w[i] * t[i], mx += w[i] * x[i];
  double tt = 0.0, tx = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    tt += w[i] * (t[i] - mt) * (t[i] - mt);
    tx += w[i] * (t[i] - mt) * (x[i] - mx);
  }
  std::vector<double> y(n);
  for (std::size_t i = 0; i < n; ++i) y[i] = x[i] - mx - tx / tt * (t[i] - mt);
  return y;
}

}  // namespace

// [Zechmeister and Kuerster 2009]: weights and a constant fitted beside the sine.
LombSpectrum LombScargle(std::span<const double> t, std::span<const double> x,
                         std::span<const double> sigma, const std::string& unit,
                         const LombOptions& options) {
  const std::size_t n = t.size();
  if (n < 8 || x.size() != n || !(t.back() > t.front())) {
    throw Error(fmt::format("a periodogram of {} samples", n), "spectrum",
                "give at least 8 samples at rising stamps");
  }
  const std::vector<double> w = Weights(sigma, n);
  const std::vector<double> y = WithoutLine(t, x, w);
  double yy = 0.0;
  for (std::size_t i = 0; i < n; ++i) yy += w[i] * y[i] * y[i];

  // Below, cosine and sine are one column at these stamps; the sums are good to some 1e-12.
  constexpr double kOneColumn = 1e-9;
  LombSpectrum out;
  out.n = n;
  const double duration = t.back() - t.front();
  out.resolution = 1.0 / duration;
  const double low = options.low > 0.0 ? options.low : out.resolution;
  const double high = options.high > 0.0 ? options.high : 0.5 / MedianStep(t);
  const double step = out.resolution / std::max(1, options.oversample);
  std::size_t count = 0;
  while (low + static_cast<double>(count) * step <= high) ++count;
  // sum w y exp(i w t), sum w exp(i w t), and sum w exp(2 i w t), from which the squares come.
  const auto sums = [&](std::span<const double> values, double times) {
    std::vector<double> phase(n);
    std::vector<std::complex<double>> term(n);
    for (std::size_t i = 0; i < n; ++i) {
      const double turns = times * (t[i] - t[0]);
      phase[i] = 2.0 * std::numbers::pi * step * turns;
      term[i] = std::polar(values[i], 2.0 * std::numbers::pi * low * turns);
    }
    return NonuniformFft(phase, term, count);
  };
  std::vector<double> wy(n);
  for (std::size_t i = 0; i < n; ++i) wy[i] = w[i] * y[i];
  const auto signal = sums(wy, 1.0), weight = sums(w, 1.0), twice = sums(w, 2.0);
  for (std::size_t k = 0; k < count; ++k) {
    const double f = low + static_cast<double>(k) * step;
    const double c = weight[k].real(), s = weight[k].imag();
    const double cc = 0.5 * (1.0 + twice[k].real()), cs = 0.5 * twice[k].imag();
    const double yc = signal[k].real(), ys = signal[k].imag();
    // About the fitted constant; y has weighted mean zero.
    const double CC = cc - c * c, SS = 1.0 - cc - s * s, CS = cs - c * s;
    const double D = CC * SS - CS * CS;
    double a = 0.0, b = 0.0;
    if (D > kOneColumn) {
      a = (SS * yc - CS * ys) / D;
      b = (CC * ys - CS * yc) / D;
    }
    out.frequency.push_back(f);
    out.amplitude.push_back(std::hypot(a, b));
    out.power.push_back(yy > 0.0 ? std::clamp((a * yc + b * ys) / yy, 0.0, 1.0) : 0.0);
  }
  out.convention = fmt::format(
      "amplitude in {} of the sine that fits best at each frequency, beside a constant "
      "(Lomb-Scargle, "
      "no window); {} samples at their own stamps over {:.4g} s, gaps left as they are, a straight "
      "line taken out; peaks nearer than {:.4g} Hz are not told apart",
      unit, n, duration, out.resolution);
  return out;
}

namespace {

struct Highest {
  double frequency = 0.0;
  double chance = 1.0;
};

Highest HighestOf(const LombSpectrum& s) {
  Highest out;
  if (s.power.size() < 3) return out;
  const std::size_t k = static_cast<std::size_t>(
      std::max_element(s.power.begin() + 1, s.power.end() - 1) - s.power.begin());
  // So many independent frequencies; each power is a beta variable where there is only noise.
  const double band = (s.frequency.back() - s.frequency.front()) / s.resolution + 1.0;
  const double single = std::pow(1.0 - s.power[k], 0.5 * (static_cast<double>(s.n) - 4.0));
  out.chance = -std::expm1(band * std::log1p(-std::min(single, 1.0 - 1e-16)));
  const double before = s.power[k - 1], at = s.power[k], after = s.power[k + 1];
  const double bend = before - 2.0 * at + after;
  const double shift = bend < 0.0 ? std::clamp(0.5 * (before - after) / bend, -1.0, 1.0) : 0.0;
  out.frequency = s.frequency[k] + shift * (s.frequency[k + 1] - s.frequency[k]);
  return out;
}

// One sine whose amplitude grows or falls exponentially: what a decay is, so that nothing of its
// flanks is left where it is taken out.
struct Line {
  double frequency = 0.0;  // [Hz]
  double rate = 0.0;       // of the fall over half the record; below 0 it grows [-]
  double chance = 0.0;     // of the peak that it was found by
  double taken = 0.0;      // of the squares, when it was found [unit, squared]
};

// A record with the columns that lines are made of; u runs from -1 to 1 over it.
class LineFitter {
 public:
  LineFitter(std::span<const double> t, std::span<const double> x, std::span<const double> sigma)
      : x_(Eigen::Map<const Eigen::VectorXd>(x.data(), std::ssize(x))),
        w_(Eigen::VectorXd::Ones(std::ssize(x))),
        time_(std::ssize(x)) {
    const double middle = 0.5 * (t.front() + t.back());
    half_ = 0.5 * (t.back() - t.front());
    for (Eigen::Index i = 0; i < x_.size(); ++i) {
      time_(i) = t[static_cast<std::size_t>(i)] - middle;
      if (!sigma.empty()) w_(i) = 1.0 / sigma[static_cast<std::size_t>(i)];
    }
  }

  // What all lines at once, beside a straight line, leave; `keep`: the one that stays in, -1: none.
  // `amplitudes`, if asked for: of each.
  std::vector<double> Left(const std::vector<Line>& lines, int keep = -1,
                           std::vector<double>* amplitudes = nullptr) const {
    Eigen::MatrixXd basis(x_.size(), 2 + 2 * std::ssize(lines));
    basis.leftCols<2>() = Straight();
    for (Eigen::Index j = 0; j < std::ssize(lines); ++j) {
      basis.middleCols<2>(2 + 2 * j) = Columns(lines[static_cast<std::size_t>(j)]);
    }
    Eigen::VectorXd c = Solve(basis, x_);
    for (Eigen::Index j = 0; amplitudes != nullptr && j < std::ssize(lines); ++j) {
      amplitudes->push_back(c.segment<2>(2 + 2 * j).norm());
    }
    if (keep >= 0) c.segment<2>(2 + 2 * keep).setZero();
    const Eigen::VectorXd left = x_ - basis * c;
    return {left.data(), left.data() + left.size()};
  }

  // The line moved to where it leaves least of `own`. To first order a line that is off by a
  // complex rate d is (1 + d u) times itself, so d is the ratio of two fitted amplitudes.
  void Refine(const std::vector<double>& own, Line* line) const {
    constexpr int kSteps = 10;                     // four settle; more where the start is far off
    constexpr double kStarts[] = {0.0, 3.0, 9.0};  // more: steady, a decay, a short one
    constexpr double kMostRate = 1.5, kSmall = 1e-3;      // of one step [-]
    constexpr double kMostTurn = 0.5 * std::numbers::pi;  // at either end: half a resolution [rad]
    const bool fresh = line->rate == 0.0;
    Line best = *line;
    double most = -1.0;
    for (const double more : kStarts) {
      if (more > 0.0 && !fresh) break;
      Line now = *line;
      now.rate += more;
      for (int step = 0; step < kSteps; ++step) {
        std::complex<double> d;
        const double explained = Explained(own, now, &d);
        if (explained > most) most = explained, best = now;
        const double turn = std::clamp(d.imag(), -kMostTurn, kMostTurn);
        const double fall = std::clamp(-d.real(), -kMostRate, kMostRate);
        now.frequency += turn / (2.0 * std::numbers::pi * half_);
        now.rate += fall;
        const bool another = std::abs(now.frequency - line->frequency) * half_ > 1.0;
        if (another || (std::abs(turn) < kSmall && std::abs(fall) < kSmall)) break;
      }
    }
    *line = best;
  }

 private:
  Eigen::MatrixX2d Straight() const {
    Eigen::MatrixX2d out(x_.size(), 2);
    out.col(0).setOnes();
    out.col(1) = time_ / half_;
    return out;
  }
  Eigen::MatrixX2d Columns(const Line& line) const {
    Eigen::MatrixX2d out(x_.size(), 2);
    for (Eigen::Index i = 0; i < x_.size(); ++i) {
      const double phase = 2.0 * std::numbers::pi * line.frequency * time_(i);
      const double u = time_(i) / half_;
      const double size = std::exp(-line.rate * u - std::abs(line.rate));  // 1 where it is largest
      out.row(i) << size * std::cos(phase), size * std::sin(phase);
    }
    return out;
  }
  Eigen::VectorXd Solve(const Eigen::MatrixXd& basis, const Eigen::VectorXd& y) const {
    return (w_.asDiagonal() * basis).householderQr().solve(w_.cwiseProduct(y));
  }
  // How much of the squares of `y` a line explains beside a straight one; `off`: its complex rate
  // less the likeliest one, to first order.
  double Explained(const std::vector<double>& y, const Line& line,
                   std::complex<double>* off) const {
    const Eigen::MatrixX2d columns = Columns(line);
    Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
    Eigen::Matrix<double, 6, 1> right = Eigen::Matrix<double, 6, 1>::Zero();
    for (Eigen::Index i = 0; i < x_.size(); ++i) {
      const double u = time_(i) / half_, c = columns(i, 0), s = columns(i, 1);
      const Eigen::Matrix<double, 6, 1> v =
          w_(i) * (Eigen::Matrix<double, 6, 1>() << c, s, 1.0, u, u * c, u * s).finished();
      normal += v * v.transpose();
      right += w_(i) * y[static_cast<std::size_t>(i)] * v;
    }
    const Eigen::Matrix<double, 6, 1> c = normal.ldlt().solve(right);
    const std::complex<double> own(c(0), -c(1));
    *off = std::abs(own) > 0.0 ? std::complex(c(4), -c(5)) / own : 0.0;
    const Eigen::Vector4d line_and_straight = right.head<4>();
    return line_and_straight.dot(normal.topLeftCorner<4, 4>().ldlt().solve(line_and_straight));
  }

  Eigen::VectorXd x_, w_, time_;
  double half_ = 0.0;
};

double Squares(const std::vector<double>& x) {
  return std::inner_product(x.begin(), x.end(), x.begin(), 0.0);
}

// The lines as sines of one amplitude each, which is what a spectrum shows, without what lies in
// the flank of a much larger one: a decay that is no exponential leaves some there.
std::vector<LombPeak> AsSines(const LineFitter& fitter, std::vector<Line> lines, double duration) {
  constexpr double kFlank = 4.0;   // resolutions: a window's main lobe
  constexpr double kPart = 0.2;    // of the larger one
  constexpr double kLeast = 0.01;  // of the largest, as in a spectrum (PeakOptions)
  const std::vector<Line> all = lines;
  std::erase_if(lines, [&](const Line& line) {
    return std::any_of(all.begin(), all.end(), [&](const Line& other) {
      return line.taken < kPart * kPart * other.taken &&
             std::abs(line.frequency - other.frequency) * duration < kFlank;
    });
  });
  for (Line& line : lines) line.rate = 0.0;
  std::vector<double> amplitudes;
  fitter.Left(lines, -1, &amplitudes);
  std::vector<LombPeak> out;
  for (std::size_t j = 0; j < lines.size(); ++j) {
    out.push_back({lines[j].frequency, amplitudes[j], lines[j].chance});
  }
  std::stable_sort(out.begin(), out.end(),
                   [](const LombPeak& a, const LombPeak& b) { return a.amplitude > b.amplitude; });
  const double least = out.empty() ? 0.0 : kLeast * out.front().amplitude;
  std::erase_if(out, [&](const LombPeak& p) { return p.amplitude < least; });
  return out;
}

}  // namespace

std::vector<LombPeak> FindLombPeaks(std::span<const double> t, std::span<const double> x,
                                    std::span<const double> sigma, const LombOptions& options,
                                    int most) {
  constexpr double kChance = 0.01;  // probability of a peak as high in white noise [-]
  constexpr int kSweeps = 2;        // over all lines, each with the others taken out
  const double duration = t.back() - t.front();
  const LineFitter fitter(t, x, sigma);
  std::vector<Line> lines;
  std::vector<double> left(x.begin(), x.end());
  while (static_cast<int>(lines.size()) < most) {
    const Highest next = HighestOf(LombScargle(t, left, sigma, "1", options));
    if (next.chance > kChance) break;
    const bool known = std::any_of(lines.begin(), lines.end(), [&](const Line& line) {
      return std::abs(line.frequency - next.frequency) * duration < 1.0;
    });
    if (known) break;  // what is left there is no line: a flank
    lines.push_back({next.frequency, 0.0, next.chance});
    const double before = Squares(left);
    for (int sweep = 0; sweep < kSweeps; ++sweep) {
      for (std::size_t j = lines.size(); j-- > 0;) {
        fitter.Refine(fitter.Left(lines, static_cast<int>(j)), &lines[j]);
      }
    }
    left = fitter.Left(lines);
    lines.back().taken = before - Squares(left);
  }
  return AsSines(fitter, std::move(lines), duration);
}

}  // namespace unfurl::correlate
