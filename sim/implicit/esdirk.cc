#include "sim/implicit/esdirk.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/loop.h"

namespace unfurl::sim {
namespace {

// As of Rosenbrock: implicit steps are as long as the error allows and err the same way step after
// step.
constexpr double kStrictness = 10.0;
// Newton's method (Hairer and Wanner, Solving ODEs II, IV.8): a stage is solved when what is left,
// by the rate of convergence, is this part of the error allowed; given up where it will not be
// after so many iterations.
constexpr double kStagePart = 1e-3;
constexpr int kEsdirkMostIterations = 8;
// The part of that which a first iteration may leave without a second one to show the rate; and
// roundings of 1e-16 of a position that one iteration changes by, of which a velocity sees the part
// per h gamma.
constexpr double kNothing = 1e-3;
constexpr double kRoundings = 4.0;
// A run lasts so many time scales (docs/decisions/046-scales-from-the-scene.md).
constexpr double kTimeScales = 5.0;
// A step whose stages were not solved is followed by ones of this part of it, which may then grow
// by so much each.
constexpr double kBelowFailed = 0.5, kRelief = 1.1;
// The rate that steps are chosen for: three iterations gain some two digits and a half.
constexpr double kRateWanted = 0.15;

// Power iteration: so many steps bring a frequency within some ten percent, far better than what it
// is asked for needs; moved by this part of a length or of 1 rad, between rounding and bending.
constexpr int kProbeSteps = 10;
constexpr double kProbe = 1e-7;
constexpr double kGolden = 0.6180339887498949;

}  // namespace

const EsdirkTable& Ark436() {
  static const EsdirkTable table = [] {
    EsdirkTable t;
    t.name = "diagonally implicit Runge-Kutta method 4(3)";
    t.error_order = 4;
    t.gamma = 1.0 / 4;
    const double a[EsdirkTable::kStages][EsdirkTable::kStages] = {
        {},
        {1.0 / 4},
        {8611.0 / 62500, -1743.0 / 31250},
        {5012029.0 / 34652500, -654441.0 / 2922500, 174375.0 / 388108},
        {15267082809.0 / 155376265600, -71443401.0 / 120774400, 730878875.0 / 902184768,
         2285395.0 / 8070912},
        {82889.0 / 524892, 0.0, 15625.0 / 83664, 69875.0 / 102672, -2260.0 / 8211}};
    const double b_hat[] = {4586570599.0 / 29645900160, 0.0,
                            178811875.0 / 945068544,    814220225.0 / 1159782912,
                            -3700637.0 / 11593932,      61727.0 / 225920};
    const double c[] = {0.0, 1.0 / 2, 83.0 / 250, 31.0 / 50, 17.0 / 20, 1.0};
    for (int i = 0; i < EsdirkTable::kStages; ++i) {
      std::copy_n(a[i], EsdirkTable::kStages, t.a[i]);
      t.c[i] = c[i];
      t.b_hat[i] = b_hat[i];
    }
    return t;
  }();
  return table;
}

Esdirk::Esdirk(Dynamics& dynamics, const ErrorScale& scale, const EsdirkTable& table)
    : Stepper(dynamics, scale), table_(table), matrix_(dynamics) {
  for (Array& k : k_) k = Array(size_, 0.0);
  z_ = rate_ = delta_ = Array(size_, 0.0);
  sample_rate_ = sample_delta_ = sample_twice_ = z_;
  went_.assign(3 * n_, 0.0);
  lambda_ = end_lambda_ = Array(dynamics.model().constraints.rows() + kBlock, 0.0);
}

double Esdirk::Strictness() const { return kStrictness; }

double Esdirk::StepOverhead() const { return matrix_.FactorCost() + solves_ * matrix_.SolveCost(); }

void Esdirk::KeepMultipliers(Array* to) const {
  std::copy_n(dynamics_.constraint_work().lambda.begin(), dynamics_.model().constraints.rows(),
              to->begin());
}

void Esdirk::Refresh() {
  dynamics_.RightSide(t_, y_.data(), k_[0].data());
  ++evaluations_;
  KeepMultipliers(&lambda_);
  linearised_ = false;
}

// In units of the error allowed to a step.
double Esdirk::RoundingOf(double hg) const {
  constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
  return kStrictness * kRoundings * kEpsilon * scale_.length / (hg * scale_.rtol * scale_.speed);
}

// In axes that turn, what an iteration leaves along a stiff direction and what it leaves across
// one feed each other, so changes shrink by turns: the rate is that of two of them.
Esdirk::Newton Esdirk::Judge(double norm, double wanted, double enough) {
  if (!std::isfinite(norm)) return Newton::kFailed;
  if (norm <= enough) return Newton::kSolved;
  const double before = change_;
  change_ = norm;
  if (++iterations_ == 1) return Newton::kGoesOn;
  const double quotient = norm / before;
  double rate = std::max({quotient, slowest_, slowest_before_});
  if (iterations_ > 2) {
    rate = std::sqrt(quotient * quotient_);
    slowest_ = std::max(slowest_, rate);
    if (rate >= 1.0) return Newton::kFailed;
  }
  quotient_ = quotient;
  if (rate < 1.0 && rate / (1.0 - rate) * norm <= wanted) return Newton::kSolved;
  return iterations_ < kEsdirkMostIterations ? Newton::kGoesOn : Newton::kFailed;
}

// What stages leave is no noise but adds up, as many steps as there are; all of it together is to
// stay below the error allowed to a step.
double Esdirk::PartWanted() const {
  const double time = scale_.length / scale_.speed;
  return std::min(kStagePart, h_ / (kTimeScales * time));
}

// Y_i = y + h sum a_ij k_j + z.
void Esdirk::BeginStage(int i) {
  const double hg = h_ * table_.gamma;
  double* __restrict at = trial_.data();
  double* __restrict z = z_.data();
  const double* __restrict y = y_.data();
  const double* __restrict last = k_[i - 1].data();
  UNFURL_INDEPENDENT
  for (int k = 0; k < size_; ++k) {
    z[k] = hg * last[k];
    at[k] = y[k] + z[k];
  }
  for (int j = 0; j < i; ++j) {
    const double factor = h_ * table_.a[i][j];
    if (factor == 0.0) continue;
    const double* __restrict k_j = k_[j].data();
    UNFURL_INDEPENDENT
    for (int k = 0; k < size_; ++k) at[k] += factor * k_j[k];
  }
  change_ = 0.0;
  iterations_ = 0;
}

// z = h gamma f(Y_i). A stage's rate is z / (h gamma) and not f(Y_i), in which what Newton's method
// has left is as large as stiffness makes it.
bool Esdirk::SolveStage(int i) {
  const double hg = h_ * table_.gamma, inverse = 1.0 / hg;
  const double wanted = PartWanted();
  const double enough = std::max(kNothing * wanted, RoundingOf(hg));
  double* __restrict at = trial_.data();
  double* __restrict z = z_.data();
  double* __restrict rate = rate_.data();
  double* __restrict delta = delta_.data();
  BeginStage(i);
  Newton state = Newton::kGoesOn;
  while (state == Newton::kGoesOn) {
    dynamics_.RightSide(t_ + table_.c[i] * h_, trial_.data(), rate_.data());
    ++evaluations_;
    ++solves_;
    UNFURL_INDEPENDENT
    for (int k = 0; k < size_; ++k) rate[k] -= inverse * z[k];
    matrix_.Solve(rate_.data(), delta_.data());
    UNFURL_INDEPENDENT
    for (int k = 0; k < size_; ++k) {
      z[k] += delta[k];
      at[k] += delta[k];
    }
    // Energies follow the last evaluation: no part of the iteration.
    for (int k = 6 * n_; k < size_; ++k) delta[k] = 0.0;
    const double norm = Norm(y_.data(), at, [=](int k) { return delta[k]; });
    state = Judge(kStrictness * norm, wanted, enough);
  }
  double* __restrict k_i = k_[i].data();
  UNFURL_INDEPENDENT
  for (int k = 0; k < size_; ++k) k_i[k] = inverse * z[k];
  return state == Newton::kSolved;
}

// (I - h gamma A)^-1 h sum (b_i - b_hat_i) k_i: what is stiff in it is no error of the result
// (Hairer and Wanner, IV.8).
double Esdirk::EstimateError() {
  double* __restrict sum = rate_.data();
  std::fill(rate_.begin(), rate_.end(), 0.0);
  for (int i = 0; i < kStages; ++i) {
    const double b = i + 1 < kStages ? table_.a[kStages - 1][i] : table_.gamma;
    const double factor = (b - table_.b_hat[i]) / table_.gamma;
    if (factor == 0.0) continue;
    const double* __restrict k_i = k_[i].data();
    UNFURL_INDEPENDENT
    for (int k = 0; k < size_; ++k) sum[k] += factor * k_i[k];
  }
  matrix_.Solve(rate_.data(), delta_.data());
  const double* error = delta_.data();
  return kStrictness * Norm(y_.data(), trial_.data(), [=](int k) { return error[k]; });
}

double Esdirk::Try(double h) {
  h_ = h;
  solves_ = 1;
  slowest_before_ = slowest_;
  slowest_ = 0.0;
  if (!linearised_) {
    matrix_.Linearise(t_, y_.data(), lambda_.data());
    linearised_ = true;
    factored_h_ = 0.0;
  }
  if (factored_h_ != h) {
    matrix_.Factor(h * table_.gamma);
    factored_h_ = h;
  }
  for (int i = 1; i < kStages; ++i) {
    if (SolveStage(i)) continue;
    longest_solved_ = kBelowFailed * h;
    return kGivenUp;
  }
  for (int k = 0; k < 3 * n_; ++k) went_[k] = trial_[k] - y_[k];
  double norm = EstimateError();
  // Rates of convergence fall with the step.
  const double use = std::max(slowest_ / kRateWanted, h / longest_solved_);
  norm = std::max(norm, std::min(1.0, std::pow(use, table_.error_order)));
  // After thousands of steps it would overflow.
  if (longest_solved_ < std::numeric_limits<double>::max() / kRelief) longest_solved_ *= kRelief;
  if (norm <= 1.0) RefreshTrial();
  return norm;
}

double Esdirk::ErrorOf(int k) const { return delta_[k]; }

// The least change of the masses strains a stiff beam by what it moves its end: a vibration of that
// size, which then wants steps of its own. With the stiffness beside the masses it is moved as a
// whole.
void Esdirk::Project(double t, double* y) {
  if (factored_h_ == 0.0 || !dynamics_.model().kirchhoff.stretches()) {
    return Stepper::Project(t, y);
  }
  dynamics_.VelocityDrift(t, y);
  matrix_.RemoveDrift(y + 3 * n_);
  dynamics_.PositionDrift(t, y);
  matrix_.RemoveDrift(y);
}

double Esdirk::NormOfMasses(const double* x) const {
  double sum = 0.0;
  for (int block = 0; block < 3; ++block) {
    const double* mass = block < 2 ? mass_.data() : inertia_.data();
    for (int k = 0; k < n_; ++k) sum += mass[k] * x[block * n_ + k] * x[block * n_ + k];
  }
  return std::sqrt(sum);
}

// Power iteration on what the accelerations do when positions (block 0) or velocities (block 3)
// move along delta_: the largest |d a / d q| [1/s^2] or |d a / d v| [1/s]. z_ holds the rates at
// y_.
double Esdirk::Iterate(int block, int times) {
  const int n3 = 3 * n_, from = block * n_;
  double largest = 0.0;
  for (int i = 0; i < times; ++i) {
    const double before = NormOfMasses(delta_.data());
    if (!(before > 0.0) || !std::isfinite(before)) break;
    double most = 0.0;
    for (int k = 0; k < n3; ++k) most = std::max(most, std::fabs(delta_[k]));
    const double scale = kProbe * scale_.length / most;
    std::copy(y_.begin(), y_.end(), stage_.begin());
    for (int k = 0; k < n3; ++k) stage_[from + k] += scale * delta_[k];
    dynamics_.RightSide(t_, stage_.data(), rate_.data());
    ++evaluations_;
    for (int k = 0; k < n3; ++k) delta_[k] = rate_[n3 + k] - z_[n3 + k];
    largest = std::max(largest, NormOfMasses(delta_.data()) / (scale * before));
  }
  return largest;
}

double Esdirk::ProbeFastestRate() {
  dynamics_.RightSide(t_, y_.data(), z_.data());
  ++evaluations_;
  // Any direction that is none of the motion's own: Weyl's sequence.
  const auto pattern = [](int k) { return std::fmod(kGolden * (k + 1), 1.0) - 0.5; };
  for (int k = 0; k < 3 * n_; ++k) delta_[k] = mass_[k % n_] > 0.0 ? pattern(k) : 0.0;
  const double square = Iterate(0, kProbeSteps);
  // Material damping is fastest where stiffness is; other dampers need not be.
  double most = 0.0;
  for (int k = 0; k < 3 * n_; ++k) most = std::max(most, std::fabs(delta_[k]));
  // Where nothing is stiff, as with a damper alone, the pattern is all there is.
  const double inverse = most > 0.0 ? 1.0 / most : 0.0;
  for (int k = 0; k < 3 * n_; ++k) {
    delta_[k] = delta_[k] * inverse + (mass_[k % n_] > 0.0 ? pattern(k) : 0.0);
  }
  const double damping = Iterate(3, kProbeSteps);
  // What the dynamics hold is that of the state again.
  dynamics_.RightSide(t_, y_.data(), rate_.data());
  ++evaluations_;
  return std::max(std::sqrt(square), damping);
}

void Esdirk::RefreshTrial() {
  dynamics_.RightSide(t_ + h_, trial_.data(), rate_.data());
  ++evaluations_;
  KeepMultipliers(&end_lambda_);
}

void Esdirk::Accept(double t) {
  t_ = t;
  std::swap(y_, trial_);
  std::swap(k_[0], k_[kStages - 1]);
  std::swap(lambda_, end_lambda_);
  linearised_ = false;
}

void Esdirk::AcceptUntil(double sigma, double t) {
  Dense(sigma, stage_.data());
  std::swap(y_, stage_);
  t_ = t;
}

// Positions: the cubic through both states and their velocities. Velocities: its derivative, since
// the accelerations of stiff parts at either end are far greater than what the step went through.
// The rest: the cubic through values and rates.
DensePolynomial Esdirk::Polynomial(int k) {
  const int n3 = 3 * n_;
  if (k >= n3 && k < 2 * n3) {
    const double v0 = y_[k], v1 = trial_[k], d = went_[k - n3] / h_;
    return {{v0, 6.0 * d - 4.0 * v0 - 2.0 * v1, 3.0 * (v0 + v1 - 2.0 * d)}, 3};
  }
  const bool position = k < n3;
  const double r0 = h_ * (position ? y_[n3 + k] : k_[0][k]);
  const double r1 = h_ * (position ? trial_[n3 + k] : k_[kStages - 1][k]);
  const double d = trial_[k] - y_[k];
  return {{y_[k], r0, 3.0 * d - 2.0 * r0 - r1, r0 + r1 - 2.0 * d}, 4};
}

// By what the velocities' parabola differs from the straight line.
double Esdirk::DenseDoubt(double sigma) {
  const int n3 = 3 * n_;
  const double bend = 3.0 * sigma * (1.0 - sigma);
  const auto difference = [&](int k) {
    if (k < n3 || k >= 2 * n3) return 0.0;
    const double mean = went_[k - n3] / h_;
    return bend * (y_[k] + trial_[k] - 2.0 * mean);
  };
  return kStrictness * Norm(y_.data(), trial_.data(), difference);
}

// Between its ends the cubic is off by h^4, which is nothing in a place and may be everything in a
// stiff force. With A of the step's start and y' the cubic's rate, d = (f(y) - y') is taken out by
// Newton's step as far as it is stiff: -h gamma A (I - h gamma A)^-2 h gamma d, which leaves alone
// what a step resolves.
bool Esdirk::Sample(double sigma, double* out) {
  const int n6 = 6 * n_;
  for (int k = 0; k < size_; ++k) {
    const DensePolynomial p = Polynomial(k);
    out[k] = p(sigma);
    sample_twice_[k] = p.Slope(sigma) / h_;
  }
  dynamics_.RightSide(t_ + sigma * h_, out, sample_rate_.data());
  for (int k = 0; k < n6; ++k) sample_rate_[k] -= sample_twice_[k];
  for (int k = n6; k < size_; ++k) sample_rate_[k] = 0.0;
  matrix_.Solve(sample_rate_.data(), sample_delta_.data());
  std::copy(sample_delta_.begin(), sample_delta_.end(), sample_rate_.begin());
  matrix_.Solve(sample_rate_.data(), sample_twice_.data());
  const double inverse = 1.0 / (h_ * table_.gamma);
  for (int k = 0; k < n6; ++k) out[k] += sample_delta_[k] - inverse * sample_twice_[k];
  return true;
}

}  // namespace unfurl::sim
