#include "measure/camera_sets.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <map>
#include <utility>

#include "base/dense.h"
#include "base/statistics.h"

namespace unfurl::measure {

namespace {

// Flashes: what stays the same for a while is in few as well.
constexpr std::size_t kMostCounted = 500;
// Of what the calibration's errors may do over all flashes, in sigmas squared [-]: less is nothing.
constexpr double kNothing = 1e-2;
constexpr int kHalvings = 8;  // of the loss at which a flash counts half: from all to the good ones
constexpr int kSettle = 3;    // rounds with those alone

// Unknowns of a set of cameras, from weighted flashes.
class FlashSolver {
 public:
  FlashSolver(std::span<const FlashTerms> terms, std::vector<Eigen::MatrixXd> D,
              Eigen::Index unknowns, double row)
      : terms_(terms), D_(std::move(D)), unknowns_(unknowns), row_(row) {}
  void Step(std::span<const double> weight) {
    const Eigen::Index n = D_.empty() ? unknowns_ : D_[0].cols();
    A_ = Eigen::MatrixXd::Zero(n, n);
    Eigen::VectorXd b = Eigen::VectorXd::Zero(n);
    for (std::size_t i = 0; i < terms_.size(); ++i) {
      if (!(weight[i] > 0.0)) continue;
      const Eigen::MatrixXd PD = weight[i] * (terms_[i].P * D_[i]);
      A_.noalias() += D_[i].transpose() * PD;
      b.noalias() += PD.transpose() * terms_[i].r;
    }
    A_.diagonal().tail(n - unknowns_).array() += 1.0;
    // What no reading tells stays where it is.
    A_.diagonal().head(unknowns_).array() += 1.0 / (row_ * row_);
    x_ = A_.ldlt().solve(b);
  }
  Eigen::VectorXd Left(std::size_t i) const { return terms_[i].r - D_[i] * x_; }
  double Loss(std::size_t i) const {
    const Eigen::VectorXd e = Left(i);
    return e.dot(terms_[i].P * e);
  }
  // By the flashes that are not wrong by themselves, each of which costs a cap; from `far` by all
  // of them first, and by those that fit worse less and less.
  void Find(std::span<const double> cap, bool far) {
    std::vector<double> weight(terms_.size(), 1.0);
    Step(weight);
    if (far) {
      std::vector<double> shares;
      for (std::size_t i = 0; i < terms_.size(); ++i) shares.push_back(Loss(i) / cap[i]);
      double scale = shares.empty() ? 1.0 : std::max(1.0, Median(shares));
      for (int round = 0; round < kHalvings; ++round, scale = std::max(0.5 * scale, 0.25)) {
        for (std::size_t i = 0; i < terms_.size(); ++i) {
          const double share = scale * cap[i] / (scale * cap[i] + Loss(i));
          weight[i] = share * share;
        }
        Step(weight);
      }
    }
    for (int round = 0; round < kSettle; ++round) {
      for (std::size_t i = 0; i < terms_.size(); ++i) weight[i] = Loss(i) < cap[i] ? 1.0 : 0.0;
      Step(weight);
    }
  }
  const Eigen::VectorXd& x() const { return x_; }
  Eigen::MatrixXd Covariance() const {
    return A_.ldlt()
        .solve(Eigen::MatrixXd::Identity(A_.rows(), A_.rows()))
        .topLeftCorner(unknowns_, unknowns_);
  }

 private:
  std::span<const FlashTerms> terms_;
  std::vector<Eigen::MatrixXd> D_;  // of readings by unknowns and the calibration's errors
  Eigen::Index unknowns_;
  double row_;  // [px]
  Eigen::MatrixXd A_;
  Eigen::VectorXd x_;
};

}  // namespace

double CameraEvent::Shape(int k, double t) const {
  if (k == 1) return (t - at) / span;
  return kind == FaultKind::kDrifting || t >= from ? 1.0 : 0.0;
}

bool CameraEvent::Holds(const Fault& fault) const {
  if (kind != fault.kind) return false;
  if (!std::isfinite(from) || !std::isfinite(fault.from)) return from == fault.from;
  return earliest <= fault.latest && fault.earliest <= latest;
}

CameraSets::CameraSets(const HealthEvidence& evidence, const Triangulator& triangulator,
                       const HealthOptions& options, std::size_t marks,
                       std::vector<CameraEvent> events)
    : evidence_(evidence),
      triangulator_(triangulator),
      options_(options),
      marks_(marks),
      errors_(triangulator),
      events_(std::move(events)) {
  std::size_t lit = 0;
  for (std::size_t i = 0; i < evidence.size(); ++i) lit += evidence.mark(i) >= 0;
  // An odd stride meets all marks of a turn of any length but its own multiples.
  const std::size_t stride = std::max<std::size_t>(1, lit / kMostCounted) | 1U;
  std::size_t k = 0;
  for (std::size_t i = 0; i < evidence.size(); ++i) {
    if (evidence.mark(i) >= 0 && k++ % stride == 0) lines_.push_back(i);
  }
  Reduce();
}

CameraSets::Fit CameraSets::Solve(const std::vector<std::uint32_t>& sets) const {
  Fit out;
  out.sets = sets;
  for (std::size_t e = 0; e < events_.size(); ++e) {
    for (int c = 0; c < static_cast<int>(triangulator_.cameras()); ++c) {
      for (int k = 0; k < events_[e].shapes(); ++k) {
        if ((sets[e] >> c & 1U) != 0) out.unknowns.push_back({e, c, k});
      }
    }
  }
  out.value = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(out.unknowns.size()));
  // Twice, the second time about what was found: readings are not quite linear in large moves.
  for (const bool far : {true, false}) Refine(Terms(out), far, &out);
  for (std::size_t k = 0; k < out.unknowns.size(); ++k) {
    const auto camera = static_cast<std::size_t>(out.unknowns[k].camera);
    // Further it would see none of what it did. Two so far off fit anything, with marks elsewhere.
    if (std::abs(out.value(static_cast<Eigen::Index>(k))) <
        triangulator_.rig().cameras[camera].pixels)
      continue;
    out.loss = most_ * static_cast<double>(lines_.size());
    out.unexplained = lines_.size();
    out.flashes.assign(lines_.size(), {.loss = most_});
  }
  return out;
}

double CameraSets::Price(const Fit& fit, double wide) const {
  double price = fit.loss / wide;
  price += static_cast<double>(fit.unknowns.size()) * std::log(static_cast<double>(flashes()));
  for (const std::uint32_t set : fit.sets) {
    price -= 2.0 * std::max(0, std::popcount(set) - 1) * std::log(options_.together);
  }
  return price;
}

std::vector<Fault> CameraSets::FaultsOf(const Fit& fit) const {
  std::vector<Fault> faults;
  for (std::size_t k = 0; k < fit.unknowns.size(); ++k) {
    const Unknown& one = fit.unknowns[k];
    const CameraEvent& event = events_[one.event];
    if (one.shape != 0) continue;
    const auto j = static_cast<Eigen::Index>(k);
    Fault fault{.kind = event.kind,
                .camera = one.camera,
                .from = event.from,
                .earliest = event.earliest,
                .latest = event.latest,
                .offset_px = fit.value(j),
                .sigma_px = std::sqrt(fit.wide * fit.covariance(j, j))};
    if (event.kind == FaultKind::kDrifting) {
      fault.at = event.at;
      fault.slope = fit.value(j + 1) / event.span;
      fault.slope_sigma = std::sqrt(fit.wide * fit.covariance(j + 1, j + 1)) / event.span;
    }
    faults.push_back(fault);
  }
  return faults;
}

bool CameraSets::Explains(const Fit& fit, const Fit& without, std::size_t event) const {
  // Of a camera that sways, steps in time with it explain 8/pi^2 of the squares.
  constexpr double kMostOfAWave = 8.0 / (M_PI * M_PI);
  double end = HUGE_VAL;
  for (const CameraEvent& other : events_) {
    if (other.kind == FaultKind::kMoved && other.from > events_[event].from) {
      end = std::min(end, other.from);
    }
  }
  double left = 0.0, was = 0.0, numbers = 0.0;
  for (std::size_t k = 0; k < lines_.size(); ++k) {
    const double t = evidence_.t(lines_[k]);
    if (events_[event].kind == FaultKind::kMoved && (t < events_[event].from || t >= end)) continue;
    left += fit.flashes[k].loss;
    was += without.flashes[k].loss;
    numbers += fit.flashes[k].numbers;
  }
  if (left < ChiSquareQuantile(1.0 - options_.false_alarm, std::max(numbers, 1.0))) return true;
  return was - left > kMostOfAWave * (was - numbers);
}

double CameraSets::Taken(const Fit& fit, int camera, double t) const {
  double sum = 0.0;
  for (std::size_t k = 0; k < fit.unknowns.size(); ++k) {
    const Unknown& one = fit.unknowns[k];
    if (one.camera != camera) continue;
    sum += fit.value(static_cast<Eigen::Index>(k)) * events_[one.event].Shape(one.shape, t);
  }
  return sum;
}

std::vector<FlashTerms> CameraSets::Terms(const Fit& fit) const {
  std::vector<FlashTerms> out;
  std::vector<Eigen::Vector3d> last(marks_, triangulator_.centre());
  std::array<double, CameraBank::kMaxCameras> taken{};
  for (const std::size_t i : lines_) {
    for (std::size_t c = 0; c < triangulator_.cameras(); ++c) {
      taken[c] = Taken(fit, static_cast<int>(c), evidence_.t(i));
    }
    auto terms =
        errors_.TermsOf(evidence_, i, taken, &last[static_cast<std::size_t>(evidence_.mark(i))]);
    if (!terms) continue;
    if (directions_.size() > 0) terms->G = (terms->G * directions_).eval();
    out.push_back(std::move(*terms));
  }
  return out;
}

// The directions of the calibration's errors that do anything to these flashes.
void CameraSets::Reduce() {
  Eigen::MatrixXd GG = Eigen::MatrixXd::Zero(errors_.columns(), errors_.columns());
  std::vector<std::size_t> lines;
  for (const FlashTerms& flash : Terms({})) {
    GG.noalias() += flash.G.transpose() * (flash.P * flash.G);
    lines.push_back(flash.line);
    most_ = std::max(most_, Cap(flash));
  }
  lines_ = lines;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(GG);
  const auto kept = std::max<Eigen::Index>(1, (eigen.eigenvalues().array() > kNothing).count());
  directions_ = eigen.eigenvectors().rightCols(kept);
}

// Where a wrong reading, anywhere in a row, is as likely as a good one so far off.
double CameraSets::Cap(const FlashTerms& flash) const {
  const double weight = flash.P.diagonal().maxCoeff();
  const double row = triangulator_.rig().cameras[0].pixels;
  const double peak =
      (1.0 - options_.wild) * row * std::sqrt(weight / (2.0 * M_PI)) / options_.wild;
  return 2.0 * std::log(std::max(peak, M_E));
}

void CameraSets::Refine(const std::vector<FlashTerms>& terms, bool far, Fit* fit) const {
  const auto m = static_cast<Eigen::Index>(fit->unknowns.size());
  std::vector<Eigen::MatrixXd> D;
  std::vector<double> cap;
  for (const FlashTerms& flash : terms) {
    D.emplace_back(Eigen::MatrixXd::Zero(flash.P.rows(), m + directions_.cols()));
    for (Eigen::Index k = 0; k < m; ++k) {
      const Unknown& one = fit->unknowns[static_cast<std::size_t>(k)];
      D.back()(one.camera, k) = events_[one.event].Shape(one.shape, evidence_.t(flash.line));
    }
    D.back().rightCols(directions_.cols()) = flash.G;
    cap.push_back(Cap(flash));
  }
  FlashSolver solver(terms, std::move(D), m, triangulator_.rig().cameras[0].pixels);
  solver.Find(cap, far);
  fit->loss = solver.x().tail(directions_.cols()).squaredNorm();
  std::vector<FlashTerms> kept;
  std::map<std::size_t, Eigen::VectorXd> left;
  for (std::size_t i = 0; i < terms.size(); ++i) {
    const double loss = solver.Loss(i);
    fit->loss += std::min(loss, cap[i]);
    if (!(loss < cap[i])) continue;
    kept.push_back(terms[i]);
    left[terms[i].line] = solver.Left(i);
  }
  // What tells nothing once the rest is taken out is not explained either.
  fit->loss += most_ * static_cast<double>(lines_.size() - std::min(lines_.size(), terms.size()));
  fit->flashes.assign(lines_.size(), {.loss = most_});
  for (std::size_t i = 0, k = 0; i < terms.size(); ++i) {
    while (lines_[k] != terms[i].line) ++k;
    fit->flashes[k] = {std::min(solver.Loss(i), cap[i]), terms[i].readings - 3.0};
  }
  fit->unexplained = lines_.size() - std::min(lines_.size(), kept.size());
  fit->wide =
      Overdispersion(evidence_, kept, [&](const FlashTerms& flash) { return left[flash.line]; });
  fit->value += solver.x().head(m);
  fit->covariance = solver.Covariance();
}

}  // namespace unfurl::measure
