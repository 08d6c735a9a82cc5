#include "correlate/decay_fit.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "correlate/autocorrelation.h"
#include "correlate/sampled_model.h"

namespace unfurl::correlate {

namespace {

using Complex = std::complex<double>;

// One signal at given poles: the best amplitudes, what is left, and the derivatives of what is left
// by decay and frequency of each mode, all in units of sigma.
struct Channel {
  Eigen::MatrixXd basis;        // n x q: cos and sin part of each mode, then the trend
  Eigen::VectorXd coefficient;  // q
  Eigen::VectorXd residual;     // n
  Eigen::MatrixXd jacobian;     // n x 2K, projected on what the amplitudes cannot imitate
  Eigen::MatrixXd imitation;    // q x 2K: change of the amplitudes with the poles
  Eigen::MatrixXd inverse;      // q x q: covariance of the amplitudes at fixed poles, unit noise
};

class Problem {
 public:
  Problem(std::span<const DecaySignal> signals, int trend) : signals_(signals), trend_(trend) {
    start_ = std::numeric_limits<double>::infinity();
    end_ = -start_;
    for (const DecaySignal& s : signals) {
      if (s.t.empty()) continue;
      start_ = std::min(start_, s.t.front());
      end_ = std::max(end_, s.t.back());
      samples_ += s.t.size();
      weighted_ = weighted_ && s.sigma.size() == s.t.size();
    }
    for (const DecaySignal& s : signals) {
      const auto n = static_cast<Eigen::Index>(s.t.size());
      Eigen::VectorXd w = Eigen::VectorXd::Ones(n);
      if (weighted_) w = Eigen::Map<const Eigen::VectorXd>(s.sigma.data(), n).cwiseInverse();
      weight_.push_back(w);
      value_.push_back(w.cwiseProduct(Eigen::Map<const Eigen::VectorXd>(s.value.data(), n)));
      Eigen::MatrixXd p(n, trend + 1);
      for (Eigen::Index i = 0; i < n; ++i) {
        const double x =
            2.0 * (s.t[static_cast<std::size_t>(i)] - start_) / std::max(end_ - start_, 1e-300) -
            1.0;
        double power = w(i);
        for (int d = 0; d <= trend; ++d, power *= x) p(i, d) = power;
      }
      polynomial_.push_back(std::move(p));
    }
  }

  double start() const { return start_; }
  double duration() const { return end_ - start_; }
  std::size_t samples() const { return samples_; }
  bool weighted() const { return weighted_; }
  std::size_t channels() const { return signals_.size(); }
  const DecaySignal& signal(std::size_t j) const { return signals_[j]; }
  const Eigen::VectorXd& weight(std::size_t j) const { return weight_[j]; }
  const Eigen::VectorXd& value(std::size_t j) const { return value_[j]; }
  const Eigen::MatrixXd& polynomial(std::size_t j) const { return polynomial_[j]; }

  Channel Solve(std::size_t j, const Eigen::VectorXd& pole, bool derivatives) const {
    const DecaySignal& s = signals_[j];
    const auto n = static_cast<Eigen::Index>(s.t.size());
    const Eigen::Index modes = pole.size() / 2;
    Channel out;
    out.basis.resize(n, 2 * modes + trend_ + 1);
    for (Eigen::Index i = 0; i < n; ++i) {
      const double t = s.t[static_cast<std::size_t>(i)] - start_;
      for (Eigen::Index k = 0; k < modes; ++k) {
        const double e = weight_[j](i) * std::exp(-pole(2 * k) * t);
        out.basis(i, 2 * k) = e * std::cos(pole(2 * k + 1) * t);
        out.basis(i, 2 * k + 1) = e * std::sin(pole(2 * k + 1) * t);
      }
    }
    out.basis.rightCols(trend_ + 1) = polynomial_[j];
    const Eigen::HouseholderQR<Eigen::MatrixXd> qr(out.basis);
    const Eigen::Index q = out.basis.cols();
    const auto R = qr.matrixQR().topRows(q).triangularView<Eigen::Upper>();
    Eigen::VectorXd y = qr.householderQ().adjoint() * value_[j];
    out.coefficient = R.solve(y.head(q));
    y.head(q).setZero();
    out.residual = qr.householderQ() * y;
    if (!derivatives) return out;
    Eigen::MatrixXd D(n, pole.size());
    for (Eigen::Index i = 0; i < n; ++i) {
      const double t = s.t[static_cast<std::size_t>(i)] - start_;
      for (Eigen::Index k = 0; k < modes; ++k) {
        const double c = out.basis(i, 2 * k), d = out.basis(i, 2 * k + 1);
        const double A = out.coefficient(2 * k), B = out.coefficient(2 * k + 1);
        D(i, 2 * k) = t * (A * c + B * d);  // of the residual: minus the model's
        D(i, 2 * k + 1) = t * (A * d - B * c);
      }
    }
    Eigen::MatrixXd P = qr.householderQ().adjoint() * D;
    out.imitation = R.solve(P.topRows(q));
    P.topRows(q).setZero();
    out.jacobian = qr.householderQ() * P;
    const Eigen::MatrixXd inverse_R = R.solve(Eigen::MatrixXd::Identity(q, q));
    out.inverse = inverse_R * inverse_R.transpose();
    return out;
  }

 private:
  std::span<const DecaySignal> signals_;
  int trend_;
  double start_ = 0.0, end_ = 0.0;
  std::size_t samples_ = 0;
  bool weighted_ = true;
  std::vector<Eigen::VectorXd> weight_, value_;
  std::vector<Eigen::MatrixXd> polynomial_;
};

double SumOfSquares(const Problem& problem, const Eigen::VectorXd& pole) {
  double sum = 0.0;
  for (std::size_t j = 0; j < problem.channels(); ++j) {
    sum += problem.Solve(j, pole, false).residual.squaredNorm();
  }
  return sum;
}

// Levenberg and Marquardt on (a, w) of each mode. True when the last step was below a thousandth of
// the unknowns' own standard errors, or of what round-off lets be known.
bool Minimise(const Problem& problem, int max_iterations, Eigen::VectorXd* pole) {
  constexpr double kSmall = 1e-3;      // of a standard error: nothing a user could see
  constexpr double kRoundOff = 1e-11;  // relative; noise-free signals have no standard error
  constexpr double kGrowth = 5.0;  // e-folds over the record: no free decay grows so, and overflows
  const Eigen::Index unknowns = pole->size();
  double lambda = 1e-3;
  double current = -1.0;
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(unknowns, unknowns);
    Eigen::VectorXd g = Eigen::VectorXd::Zero(unknowns);
    double sum = 0.0;
    for (std::size_t j = 0; j < problem.channels(); ++j) {
      const Channel c = problem.Solve(j, *pole, true);
      H.noalias() += c.jacobian.transpose() * c.jacobian;
      g.noalias() += c.jacobian.transpose() * c.residual;
      sum += c.residual.squaredNorm();
    }
    current = sum;
    const Eigen::MatrixXd inverse = H.ldlt().solve(Eigen::MatrixXd::Identity(unknowns, unknowns));
    const double unit =
        problem.weighted() ? 1.0
                           : sum / static_cast<double>(std::max<std::size_t>(1, problem.samples()));
    bool accepted = false;
    for (int attempt = 0; attempt < 12 && !accepted; ++attempt) {
      Eigen::MatrixXd damped = H;
      damped.diagonal() *= 1.0 + lambda;
      const Eigen::VectorXd step = -damped.ldlt().solve(g);
      if (!step.allFinite()) return false;
      const Eigen::VectorXd trial = *pole + step;
      bool bounded = true;
      for (Eigen::Index i = 0; i < unknowns; i += 2) {
        bounded = bounded && trial(i) * problem.duration() > -kGrowth;
      }
      const double next = bounded ? SumOfSquares(problem, trial) : 2.0 * current + 1.0;
      bool small = true;
      for (Eigen::Index i = 0; i < unknowns; ++i) {
        const double sigma = std::sqrt(std::max(0.0, unit * inverse(i, i)));
        const double size = std::hypot((*pole)(i - i % 2), (*pole)(i - i % 2 + 1));
        small = small && std::abs(step(i)) <= std::max(kSmall * sigma, kRoundOff * size);
      }
      if (next <= current) {
        *pole = trial;
        lambda = std::max(1e-12, 0.1 * lambda);
        accepted = true;
      } else {
        lambda *= 10.0;
      }
      if (small) return true;
    }
    if (!accepted) return false;
  }
  return false;
}

// Residual series of every signal, for their autocorrelation; rows as stacked.
ResidualNoise Noise(const Problem& problem, const std::vector<Channel>& channels,
                    double unit_variance) {
  constexpr int kLags = 20;  // of the whiteness test
  ResidualNoise noise;
  Eigen::Index first = 0;
  double effective = 0.0, total = 0.0;
  for (std::size_t j = 0; j < channels.size(); ++j) {
    const std::vector<double>& t = problem.signal(j).t;
    const double step = MedianStep(t);
    ResidualNoise::Series s;
    s.mark = problem.signal(j).name;
    std::size_t slot = 0;
    for (std::size_t i = 0; i < t.size(); ++i) {
      // A long gap decorrelates; its true length would only cost memory.
      if (i > 0) {
        slot += static_cast<std::size_t>(
            std::clamp(step > 0.0 ? std::round((t[i] - t[i - 1]) / step) : 1.0, 1.0, 1000.0));
      }
      s.row.push_back(first + static_cast<Eigen::Index>(i));
      s.slot.push_back(slot);
    }
    std::vector<double> x(slot + 1, 0.0);
    std::vector<std::uint8_t> known(slot + 1, 0);
    for (std::size_t i = 0; i < t.size(); ++i) {
      x[s.slot[i]] = channels[j].residual(static_cast<Eigen::Index>(i));
      known[s.slot[i]] = 1;
    }
    s.model = FitAutoregression(x, known);
    s.p_value = WhitenessPValue(x, known, kLags);
    noise.smallest_p = std::min(noise.smallest_p, s.p_value);
    effective += s.model.EffectiveCount();
    total += static_cast<double>(t.size());
    // What the fit has taken out of the residuals is put back.
    const double dof =
        static_cast<double>(t.size()) - static_cast<double>(channels[j].coefficient.size()) -
        static_cast<double>(channels[j].jacobian.cols()) / static_cast<double>(channels.size());
    s.model.variance *= static_cast<double>(t.size()) / std::max(1.0, dof);
    s.model.variance = std::max(s.model.variance, unit_variance);
    first += static_cast<Eigen::Index>(t.size());
    noise.series.push_back(std::move(s));
  }
  noise.smallest_p = std::min(1.0, noise.smallest_p * static_cast<double>(channels.size()));
  noise.effective_share = total > 0.0 ? std::min(1.0, effective / total) : 1.0;
  return noise;
}

// Multiplication by z as a real 2 x 2 matrix on (Re, Im).
Eigen::Matrix2d Turn(Complex z) {
  Eigen::Matrix2d m;
  m << z.real(), -z.imag(), z.imag(), z.real();
  return m;
}

// Amplitudes and shape of mode k. Amplitude errors of two signals have in common what the poles'
// error does to both.
void FillShape(const std::vector<Channel>& channels, const std::vector<Eigen::MatrixXd>& own,
               const Eigen::MatrixXd& pole_covariance, Eigen::Index k, Mode* mode) {
  const auto count = static_cast<Eigen::Index>(channels.size());
  mode->amplitude.resize(count);
  // A cos + B sin = Re((A - i B) exp(i w t)).
  const Eigen::Matrix2d flip = Eigen::Vector2d(1.0, -1.0).asDiagonal();
  std::vector<Eigen::Matrix2d> cov;
  std::vector<Eigen::MatrixXd> by_pole;
  for (std::size_t j = 0; j < channels.size(); ++j) {
    const Channel& c = channels[j];
    mode->amplitude(static_cast<Eigen::Index>(j)) = {c.coefficient(2 * k),
                                                     -c.coefficient(2 * k + 1)};
    cov.push_back(flip * own[j].block<2, 2>(2 * k, 2 * k) * flip);
    by_pole.push_back(flip * c.imitation.middleRows(2 * k, 2));
    const Eigen::Vector2d value(c.coefficient(2 * k), -c.coefficient(2 * k + 1));
    mode->evidence += value.dot(cov.back().ldlt().solve(value));
  }
  Eigen::Index r = 0;
  mode->amplitude.cwiseAbs().maxCoeff(&r);
  const Complex largest = mode->amplitude(r);
  const auto reference = static_cast<std::size_t>(r);
  mode->shape = mode->amplitude / largest;
  mode->shape_sigma.setZero(2, count);
  const Eigen::Matrix2d over = Turn(1.0 / largest);
  for (Eigen::Index j = 0; j < count; ++j) {
    if (j == r) continue;
    const auto i = static_cast<std::size_t>(j);
    const Eigen::Matrix2d ratio = Turn(mode->shape(j));
    const Eigen::MatrixXd moved = by_pole[i] - ratio * by_pole[reference];
    const Eigen::Matrix2d total = cov[i] + ratio * cov[reference] * ratio.transpose() +
                                  moved * pole_covariance * moved.transpose();
    mode->shape_sigma.col(j) =
        (over * total * over.transpose()).diagonal().cwiseMax(0.0).cwiseSqrt();
  }
}

}  // namespace

const char* Name(DecayStatus status) {
  switch (status) {
    case DecayStatus::kGood:
      return "good";
    case DecayStatus::kTooLittle:
      return "too little data";
    case DecayStatus::kNothingFound:
      return "no vibration found";
    case DecayStatus::kNotConverged:
      return "not converged";
  }
  return "";
}

double ModalAssurance(const Eigen::VectorXcd& a, const Eigen::VectorXcd& b) {
  const double scale = a.squaredNorm() * b.squaredNorm();
  return scale > 0.0 ? std::norm(a.dot(b)) / scale : 0.0;
}

DecayFit FitDecay(std::span<const DecaySignal> signals, std::span<const Complex> poles,
                  const DecayOptions& options) {
  DecayFit fit;
  const Problem problem(signals, options.trend);
  fit.start = problem.start();
  fit.samples = problem.samples();
  const auto modes = static_cast<Eigen::Index>(poles.size());
  const auto per_signal = static_cast<std::size_t>(2 * modes + options.trend + 1);
  for (const DecaySignal& s : signals) {
    if (s.t.size() < 2 * per_signal + 4) {
      fit.message =
          fmt::format("{} has {} samples, too few for {} modes", s.name, s.t.size(), modes);
      return fit;
    }
  }
  if (signals.empty() || modes == 0) {
    fit.status = signals.empty() ? DecayStatus::kTooLittle : DecayStatus::kNothingFound;
    fit.message = signals.empty() ? "no signals" : "no modes to fit";
    return fit;
  }
  std::vector<Complex> sorted(poles.begin(), poles.end());
  Eigen::VectorXd pole(2 * modes);
  for (Eigen::Index k = 0; k < modes; ++k) {
    pole(2 * k) = -sorted[static_cast<std::size_t>(k)].real();
    pole(2 * k + 1) = sorted[static_cast<std::size_t>(k)].imag();
  }
  const bool converged = Minimise(problem, options.max_iterations, &pole);
  // By rising frequency, whatever they were given as.
  for (Eigen::Index k = 0; k < modes; ++k) {
    sorted[static_cast<std::size_t>(k)] = {-pole(2 * k), std::abs(pole(2 * k + 1))};
  }
  std::sort(sorted.begin(), sorted.end(), [](Complex a, Complex b) { return a.imag() < b.imag(); });
  for (Eigen::Index k = 0; k < modes; ++k) {
    pole(2 * k) = -sorted[static_cast<std::size_t>(k)].real();
    pole(2 * k + 1) = sorted[static_cast<std::size_t>(k)].imag();
  }

  std::vector<Channel> channels;
  double left = 0.0, motion = 0.0, metres = 0.0;
  std::vector<double> share(static_cast<std::size_t>(modes), 0.0);
  for (std::size_t j = 0; j < signals.size(); ++j) {
    Channel c = problem.Solve(j, pole, true);
    left += c.residual.squaredNorm();
    metres += c.residual.cwiseQuotient(problem.weight(j)).squaredNorm();
    const Eigen::MatrixXd& p = problem.polynomial(j);
    Eigen::VectorXd about = problem.value(j);
    if (p.cols() > 0) about -= p * p.householderQr().solve(about);
    motion += about.squaredNorm();
    for (Eigen::Index k = 0; k < modes; ++k) {
      share[static_cast<std::size_t>(k)] +=
          (c.basis.middleCols(2 * k, 2) * c.coefficient.segment<2>(2 * k)).squaredNorm();
    }
    channels.push_back(std::move(c));
  }
  const auto n = static_cast<double>(fit.samples);
  const double dof = std::max(
      1.0, n - static_cast<double>(per_signal * signals.size()) - 2.0 * static_cast<double>(modes));
  fit.explained = motion > 0.0 ? 1.0 - left / motion : 0.0;
  fit.residual_rms = std::sqrt(metres / n);
  fit.chi2_per_dof = problem.weighted() ? left / dof : 0.0;

  const ResidualNoise noise = Noise(problem, channels, problem.weighted() ? 1.0 : 0.0);
  fit.whiteness = noise.smallest_p;
  fit.effective = noise.effective_share;
  Eigen::MatrixXd J(static_cast<Eigen::Index>(fit.samples), 2 * modes);
  Eigen::Index row = 0;
  for (const Channel& c : channels) {
    J.middleRows(row, c.jacobian.rows()) = c.jacobian;
    row += c.jacobian.rows();
  }
  const Eigen::MatrixXd H = J.transpose() * J;
  const Eigen::MatrixXd inverse = H.ldlt().solve(Eigen::MatrixXd::Identity(2 * modes, 2 * modes));
  const Eigen::MatrixXd covariance = inverse * noise.Middle(J) * inverse;
  std::vector<Eigen::MatrixXd> own;  // amplitudes' covariance at fixed poles
  for (std::size_t j = 0; j < channels.size(); ++j) {
    ResidualNoise one;
    one.series.push_back(noise.series[j]);
    for (std::size_t i = 0; i < one.series[0].row.size(); ++i) {
      one.series[0].row[i] = static_cast<Eigen::Index>(i);
    }
    own.push_back(channels[j].inverse * one.Middle(channels[j].basis) * channels[j].inverse);
  }

  Eigen::MatrixXd to_modal = Eigen::MatrixXd::Zero(2 * modes, 2 * modes);
  constexpr double kTau = 2.0 * std::numbers::pi;
  for (Eigen::Index k = 0; k < modes; ++k) {
    const double a = pole(2 * k), w = pole(2 * k + 1), size = std::hypot(a, w);
    Mode mode;
    mode.pole = {-a, w};
    mode.frequency = size / kTau;
    mode.damping = a / size;
    mode.share = motion > 0.0 ? share[static_cast<std::size_t>(k)] / motion : 0.0;
    to_modal(2 * k, 2 * k) = a / (kTau * size);
    to_modal(2 * k, 2 * k + 1) = w / (kTau * size);
    to_modal(2 * k + 1, 2 * k) = w * w / (size * size * size);
    to_modal(2 * k + 1, 2 * k + 1) = -a * w / (size * size * size);
    FillShape(channels, own, covariance, k, &mode);
    fit.modes.push_back(std::move(mode));
  }
  fit.covariance = to_modal * covariance * to_modal.transpose();
  for (Eigen::Index k = 0; k < modes; ++k) {
    Mode& mode = fit.modes[static_cast<std::size_t>(k)];
    mode.frequency_sigma = std::sqrt(std::max(0.0, fit.covariance(2 * k, 2 * k)));
    mode.damping_sigma = std::sqrt(std::max(0.0, fit.covariance(2 * k + 1, 2 * k + 1)));
  }
  fit.status = converged ? DecayStatus::kGood : DecayStatus::kNotConverged;
  fit.message = converged ? fmt::format("{} modes explain {:.3f}% of the motion about its trend",
                                        modes, 100.0 * fit.explained)
                          : "the poles did not settle";
  return fit;
}

}  // namespace unfurl::correlate
