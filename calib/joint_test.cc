#include "calib/joint_test.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "base/dense.h"
#include "base/statistics.h"

namespace unfurl::calib {
namespace {

constexpr double kPower = 0.9;  // of ShownAmount, to be seen and to be told apart
// Squared share of a shape, or of an effect, that is left beside others: less is rounding [-].
constexpr double kNothing = 1e-9;

// log of the evidence for an effect over that for none, sizes integrated out.
double LogGain(const Whitening::Products& of, double high) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(of.gram);
  const Eigen::VectorXd b = eigen.eigenvectors().transpose() * of.along;
  const double most = b.size() > 0 ? eigen.eigenvalues()(b.size() - 1) : 0.0;
  if (!(most > kNothing * of.whole)) return 0.0;
  std::vector<double> gains;
  for (double t = 1.0 / std::sqrt(most); t < 2.0 * high || gains.empty(); t *= 2.0) {
    double gain = 0.0;
    for (Eigen::Index k = 0; k < b.size(); ++k) {
      const double ratio = t * t * std::max(0.0, eigen.eigenvalues()(k));
      gain += 0.5 * (t * t * b(k) * b(k) / (1.0 + ratio) - std::log1p(ratio));
    }
    gains.push_back(gain);
  }
  const double best = *std::max_element(gains.begin(), gains.end());
  double sum = 0.0;
  for (const double gain : gains) sum += std::exp(gain - best);
  return best + std::log(sum / static_cast<double>(gains.size()));
}

bool IsOf(const Hypothesis& hypothesis, const FoundCause& cause) {
  return hypothesis.kind == cause.kind && hypothesis.index == cause.index;
}

}  // namespace

const char* Name(CauseKind kind) {
  switch (kind) {
    case CauseKind::kCamera:
      return "camera";
    case CauseKind::kPoint:
      return "point";
    case CauseKind::kReading:
      return "reading";
    case CauseKind::kFrame:
      return "frame";
  }
  return "";
}

JointTest::JointTest(const Eigen::VectorXd& e, const GroupedCovariance& C)
    : misfit_(e), whitening_(C), white_(whitening_.Whiten(e)) {}

double JointTest::Chance() const {
  return white_.size() == 0
             ? 1.0
             : ChiSquareTail(white_.squaredNorm(), static_cast<double>(white_.size()));
}

double JointTest::ChanceOf(const Whitening::Rest& rest) const {
  const auto freedom = static_cast<double>(white_.size() - rest.freed);
  return freedom > 0.0 ? ChiSquareTail(std::max(0.0, rest.square), freedom) : 1.0;
}

std::vector<double> JointTest::ChancesWithout(const std::vector<Effect>& each) const {
  const Eigen::MatrixXd none(white_.size(), 0);
  const Whitening::Against against = whitening_.MakeAgainst(white_, none);
  std::vector<double> out;
  out.reserve(each.size());
  for (const Effect& free : each) {
    out.push_back(ChanceOf(whitening_.WithoutLocal(free, against)));
  }
  return out;
}

double JointTest::ChanceWithoutAll(const std::vector<const Effect*>& free) const {
  return ChanceOf(whitening_.WithoutMany(free, misfit_));
}

double JointTest::ScanChance(const Eigen::MatrixXd& shapes) const {
  const Eigen::MatrixXd W = whitening_.Whiten(shapes);
  double least = 1.0, tried = 0.0;
  for (Eigen::Index j = 0; j < W.cols(); ++j) {
    const double norm = W.col(j).norm();
    if (!(norm > 0.0)) continue;
    const double along = W.col(j).dot(white_) / norm;
    least = std::min(least, ChiSquareTail(along * along, 1.0));
    tried += 1.0;
  }
  if (tried > 0.0) least = ChanceOfAny(least, tried);
  return ChanceOfAny(std::min(least, Chance()), tried > 0.0 ? 2.0 : 1.0);
}

JointTest::Amount JointTest::AmountOf(const Effect& shape) const {
  const Eigen::VectorXd w = whitening_.Whiten(shape);
  const double information = w.squaredNorm();
  if (!(information > 0.0)) return {0.0, std::numeric_limits<double>::infinity()};
  return {w.dot(white_) / information, 1.0 / std::sqrt(information)};
}

double JointTest::ShownAmount(const Eigen::MatrixXd& shapes, Eigen::Index j, double level) const {
  const Eigen::MatrixXd W = whitening_.Whiten(shapes);
  const double whole = W.col(j).squaredNorm(), rivals = static_cast<double>(W.cols() - 1);
  double beside = whole;  // of it beside its nearest rival
  for (Eigen::Index k = 0; k < W.cols(); ++k) {
    const double norm = W.col(k).squaredNorm();
    if (k == j || !(norm > 0.0)) continue;
    const double mixed = W.col(j).dot(W.col(k));
    beside = std::min(beside, whole - mixed * mixed / norm);
  }
  if (!(beside > kNothing * whole)) return std::numeric_limits<double>::infinity();
  const double each = ChanceOfEach(level, 2.0 * static_cast<double>(W.cols()));
  const double seen = NormalQuantile(1.0 - 0.5 * each) + NormalQuantile(kPower);
  // The two squared amounts differ by a^2 `beside` on average, with a scatter of 2 a sqrt(beside).
  const double named = rivals > 0.0 ? 2.0 * NormalQuantile(1.0 - (1.0 - kPower) / rivals) : 0.0;
  return std::max(seen / std::sqrt(whole), named / std::sqrt(beside));
}

// Weighs all hypotheses by the misfits that are left: the most probable cause and the next one.
// Several hypotheses may be of one cause: a camera that is shifted, or moved at will.
FoundCause JointTest::MostProbable(const std::vector<Hypothesis>& all,
                                   const std::vector<WideEffect>& wide, const Eigen::VectorXd& rest,
                                   const Eigen::MatrixXd& freed,
                                   const std::vector<FoundCause>& known) const {
  const Whitening::Against against = whitening_.MakeAgainst(rest, freed);
  std::vector<double> log_weight;
  std::vector<FoundCause> causes;
  std::vector<std::size_t> cause_of;
  std::map<std::pair<CauseKind, int>, std::size_t> seen;
  auto next = wide.begin();
  for (std::size_t k = 0; k < all.size(); ++k) {
    const auto [cause, is_new] = seen.try_emplace({all[k].kind, all[k].index}, causes.size());
    if (is_new) causes.push_back({all[k].kind, all[k].index});
    cause_of.push_back(cause->second);
    const bool is_wide = next != wide.end() && next->hypothesis == k;
    const Whitening::Products of =
        is_wide ? (next++)->ProductsWith(rest) : whitening_.ProductsOf(all[k].effect, against);
    const bool used = std::any_of(known.begin(), known.end(),
                                  [&](const FoundCause& c) { return IsOf(all[k], c); });
    log_weight.push_back(used ? -std::numeric_limits<double>::infinity()
                              : std::log(all[k].odds) + LogGain(of, all[k].high));
  }
  const double best = *std::max_element(log_weight.begin(), log_weight.end());
  double sum = 0.0;
  for (std::size_t k = 0; k < all.size(); ++k) {
    const double weight = std::exp(log_weight[k] - best);
    causes[cause_of[k]].probability += weight;
    sum += weight;
  }
  FoundCause out;
  for (FoundCause& cause : causes) {
    cause.probability /= sum;
    if (cause.probability > out.probability) {
      const FoundCause before = out;
      out = cause;
      cause = before;
    }
    if (cause.probability > out.other_probability) {
      out.other_kind = cause.kind;
      out.other_index = cause.index;
      out.other_probability = cause.probability;
    }
  }
  return out;
}

std::vector<FoundCause> JointTest::FindCauses(const std::vector<Hypothesis>& all, double enough,
                                              std::size_t most, bool* explained) const {
  std::vector<FoundCause> out;
  std::vector<WideEffect> wide;
  for (std::size_t k = 0; k < all.size(); ++k) {
    if (whitening_.IsLocal(all[k].effect)) continue;
    wide.push_back({k, whitening_.Whiten(all[k].effect)});
    wide.back().whole = wide.back().white.squaredNorm();
  }
  // Orthonormal columns of whatever the causes do, but for one of them.
  const auto free = [&](const FoundCause* but) {
    Eigen::MatrixXd columns(white_.size(), 0);
    for (const Hypothesis& one : all) {
      const bool in = std::any_of(out.begin(), out.end(),
                                  [&](const FoundCause& c) { return &c != but && IsOf(one, c); });
      if (!in) continue;
      columns.conservativeResize(Eigen::NoChange, columns.cols() + one.effect.rows.cols());
      columns.rightCols(one.effect.rows.cols()) = whitening_.Whiten(one.effect);
    }
    return SpanOf(columns);
  };
  const auto chance = [&](const Eigen::MatrixXd& Q) {
    const auto freedom = static_cast<double>(white_.size() - Q.cols());
    const double square = white_.squaredNorm() - (Q.transpose() * white_).squaredNorm();
    return freedom > 0.0 ? ChiSquareTail(std::max(0.0, square), freedom) : 0.0;
  };
  Eigen::VectorXd rest = white_;
  Eigen::MatrixXd freed(white_.size(), 0);
  *explained = false;
  while (out.size() < most && !*explained) {
    out.push_back(MostProbable(all, wide, rest, freed, out));
    freed = free(nullptr);
    rest = white_ - freed * (freed.transpose() * white_);
    for (WideEffect& one : wide) one.white -= freed * (freed.transpose() * one.white).eval();
    *explained = chance(freed) >= enough;
  }
  // One that was taken first for several together may have become needless.
  for (std::size_t k = 0; *explained && out.size() > 1 && k < out.size();) {
    if (chance(free(&out[k])) >= enough) {
      out.erase(out.begin() + static_cast<std::ptrdiff_t>(k));
    } else {
      ++k;
    }
  }
  return out;
}

}  // namespace unfurl::calib
