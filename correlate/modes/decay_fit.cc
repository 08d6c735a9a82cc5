#include "correlate/modes/decay_fit.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/count.h"
#include "base/dense.h"
#include "correlate/fit/autocorrelation.h"
#include "correlate/modes/decay_problem.h"
#include "correlate/modes/turn.h"
#include "correlate/sampled_model.h"

namespace unfurl::correlate {

namespace {

using Complex = std::complex<double>;

// Residual series of every signal, for their autocorrelation; rows as stacked.
ResidualNoise Noise(const DecayProblem& problem, const std::vector<DecayChannel>& channels,
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
void FillShape(const std::vector<DecayChannel>& channels, const std::vector<Eigen::MatrixXd>& own,
               const Eigen::MatrixXd& pole_covariance, Eigen::Index k, Mode* mode) {
  const auto count = static_cast<Eigen::Index>(channels.size());
  mode->amplitude.resize(count);
  // A cos + B sin = Re((A - i B) exp(i w t)).
  const Eigen::Matrix2d flip = Eigen::Vector2d(1.0, -1.0).asDiagonal();
  std::vector<Eigen::Matrix2d> cov;
  std::vector<Eigen::MatrixXd> by_pole;
  for (std::size_t j = 0; j < channels.size(); ++j) {
    const DecayChannel& c = channels[j];
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

namespace {

Eigen::VectorXd PolesAsVector(std::span<const Complex> poles) {
  Eigen::VectorXd out(2 * static_cast<Eigen::Index>(poles.size()));
  for (std::size_t k = 0; k < poles.size(); ++k) {
    out(2 * static_cast<Eigen::Index>(k)) = -poles[k].real();
    out(2 * static_cast<Eigen::Index>(k) + 1) = poles[k].imag();
  }
  return out;
}

// By rising frequency, whatever they were given as.
Eigen::VectorXd ByFrequency(const Eigen::VectorXd& pole) {
  std::vector<Complex> sorted(static_cast<std::size_t>(pole.size() / 2));
  for (std::size_t k = 0; k < sorted.size(); ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    sorted[k] = {-pole(2 * i), std::abs(pole(2 * i + 1))};
  }
  std::sort(sorted.begin(), sorted.end(), [](Complex a, Complex b) { return a.imag() < b.imag(); });
  return PolesAsVector(sorted);
}

// Squares of the signals at the poles: what the model leaves, the motion about the trend, and each
// mode's part of it.
struct DecaySquares {
  double left = 0.0, motion = 0.0;
  double metres = 0.0;  // what is left, without the weights
  std::vector<double> share;
};

DecaySquares Squares(const DecayProblem& problem, const std::vector<DecayChannel>& channels,
                     std::size_t modes) {
  DecaySquares out;
  out.share.assign(modes, 0.0);
  for (std::size_t j = 0; j < channels.size(); ++j) {
    const DecayChannel& c = channels[j];
    out.left += c.residual.squaredNorm();
    out.metres += c.residual.cwiseQuotient(problem.weight(j)).squaredNorm();
    const Eigen::MatrixXd& p = problem.polynomial(j);
    Eigen::VectorXd about = problem.value(j);
    const Eigen::HouseholderQR<Eigen::MatrixXd> trend(p);
    if (p.cols() > 0) about -= p * trend.solve(about);
    out.motion += about.squaredNorm();
    for (std::size_t k = 0; k < modes; ++k) {
      // What a trend could have shown as well is not the mode's.
      const Eigen::Index first = 2 * static_cast<Eigen::Index>(k);
      Eigen::VectorXd own = c.basis.middleCols(first, 2) * c.coefficient.segment<2>(first);
      if (p.cols() > 0) own -= p * trend.solve(own);
      out.share[k] += own.squaredNorm();
    }
  }
  return out;
}

// Of each channel's amplitudes at fixed poles, with the residuals' own correlation.
std::vector<Eigen::MatrixXd> AmplitudeCovariances(const std::vector<DecayChannel>& channels,
                                                  const ResidualNoise& noise) {
  std::vector<Eigen::MatrixXd> own;
  for (std::size_t j = 0; j < channels.size(); ++j) {
    ResidualNoise one;
    one.series.push_back(noise.series[j]);
    for (std::size_t i = 0; i < one.series[0].row.size(); ++i) {
      one.series[0].row[i] = static_cast<Eigen::Index>(i);
    }
    own.push_back(channels[j].inverse * one.Middle(channels[j].basis) * channels[j].inverse);
  }
  return own;
}

}  // namespace

namespace {

// Whether there is anything to fit; else the fit says what is missing.
bool IsEnough(std::span<const DecaySignal> signals, Eigen::Index modes, std::size_t fewest,
              DecayFit* fit) {
  for (const DecaySignal& s : signals) {
    if (s.t.size() < fewest) {
      fit->message =
          fmt::format("{} has {} samples, too few for {} modes", s.name, s.t.size(), modes);
      return false;
    }
  }
  if (signals.empty() || modes == 0) {
    fit->status = signals.empty() ? DecayStatus::kTooLittle : DecayStatus::kNothingFound;
    fit->message = signals.empty() ? "no signals" : "no modes to fit";
    return false;
  }
  return true;
}

}  // namespace

DecayFit FitDecay(std::span<const DecaySignal> signals, std::span<const Complex> poles,
                  const DecayOptions& options) {
  DecayFit fit;
  const DecayProblem problem(signals, options.trend);
  fit.start = problem.start();
  fit.samples = problem.samples();
  const auto modes = static_cast<Eigen::Index>(poles.size());
  const auto per_signal = static_cast<std::size_t>(2 * modes + options.trend + 1);
  if (!IsEnough(signals, modes, 2 * per_signal + 4, &fit)) return fit;
  // Variable projection [Golub and Pereyra 1973]: the poles alone are searched for.
  Eigen::VectorXd pole = PolesAsVector(poles);
  const bool converged = Minimise(problem, options.max_iterations, &pole);
  pole = ByFrequency(pole);

  std::vector<DecayChannel> channels;
  for (std::size_t j = 0; j < signals.size(); ++j) {
    channels.push_back(problem.Solve(j, pole));
  }
  const DecaySquares squares = Squares(problem, channels, poles.size());
  const auto n = static_cast<double>(fit.samples);
  const double dof = std::max(
      1.0, n - static_cast<double>(per_signal * signals.size()) - 2.0 * static_cast<double>(modes));
  fit.explained = squares.motion > 0.0 ? 1.0 - squares.left / squares.motion : 0.0;
  fit.residual_rms = std::sqrt(squares.metres / n);
  fit.chi2_per_dof = problem.weighted() ? squares.left / dof : 0.0;

  const ResidualNoise noise = Noise(problem, channels, problem.weighted() ? 1.0 : 0.0);
  fit.whiteness = noise.smallest_p;
  fit.effective = noise.effective_share;
  Eigen::MatrixXd J(static_cast<Eigen::Index>(fit.samples), 2 * modes);
  Eigen::Index row = 0;
  for (const DecayChannel& c : channels) {
    J.middleRows(row, c.jacobian.rows()) = c.jacobian;
    row += c.jacobian.rows();
  }
  const Eigen::MatrixXd H = J.transpose() * J;
  const Eigen::MatrixXd inverse = H.ldlt().solve(Eigen::MatrixXd::Identity(2 * modes, 2 * modes));
  const Eigen::MatrixXd covariance = inverse * noise.Middle(J) * inverse;
  const std::vector<Eigen::MatrixXd> own = AmplitudeCovariances(channels, noise);

  Eigen::MatrixXd to_modal = Eigen::MatrixXd::Zero(2 * modes, 2 * modes);
  for (Eigen::Index k = 0; k < modes; ++k) {
    const double a = pole(2 * k), w = pole(2 * k + 1), size = std::hypot(a, w);
    Mode mode;
    mode.pole = {-a, w};
    mode.frequency = size / kTau;
    mode.damping = a / size;
    mode.share =
        squares.motion > 0.0 ? squares.share[static_cast<std::size_t>(k)] / squares.motion : 0.0;
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
    mode.frequency_sigma = std::sqrt(std::max(fit.covariance(2 * k, 2 * k), 0.0));
    mode.damping_sigma = std::sqrt(std::max(fit.covariance(2 * k + 1, 2 * k + 1), 0.0));
  }
  fit.status = converged ? DecayStatus::kGood : DecayStatus::kNotConverged;
  fit.message = converged ? fmt::format("{:.3f}% of the motion about its trend is explained by {}",
                                        100.0 * fit.explained,
                                        Counted(static_cast<std::size_t>(modes), "mode"))
                          : "the poles did not settle";
  return fit;
}

}  // namespace unfurl::correlate
