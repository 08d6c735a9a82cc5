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

// Of an effect over none.
struct Gain {
  double log = 0.0;   // of the evidence, sizes integrated out [-]
  double size = 0.0;  // the most telling one; 0: none [unit of the unknowns]
};
Gain GainOf(const Whitening::Products& of, double high) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(of.gram);
  const Eigen::VectorXd b = eigen.eigenvectors().transpose() * of.along;
  const double most = b.size() > 0 ? eigen.eigenvalues()(b.size() - 1) : 0.0;
  if (!(most > kNothing * of.whole)) return {};
  std::vector<double> gains;
  Gain out;
  double best = 0.0;
  for (double t = 1.0 / std::sqrt(most); t < 2.0 * high || gains.empty(); t *= 2.0) {
    double gain = 0.0;
    for (Eigen::Index k = 0; k < b.size(); ++k) {
      const double ratio = t * t * std::max(0.0, eigen.eigenvalues()(k));
      gain += 0.5 * (t * t * b(k) * b(k) / (1.0 + ratio) - std::log1p(ratio));
    }
    if (gains.empty() || gain > best) {
      best = gain;
      out.size = t;
    }
    gains.push_back(gain);
  }
  double sum = 0.0;
  for (const double gain : gains) sum += std::exp(gain - best);
  out.log = best + std::log(sum / static_cast<double>(gains.size()));
  return out;
}

// The unknowns of an effect of that size, by least squares.
Eigen::VectorXd AmountsOf(const Whitening::Products& of, double size) {
  if (!(size > 0.0)) return Eigen::VectorXd::Zero(of.along.size());
  Eigen::MatrixXd A = of.gram;
  A.diagonal().array() += 1.0 / (size * size);
  return A.llt().solve(of.along);
}

bool IsOf(const Hypothesis& hypothesis, const FoundCause& cause) {
  return hypothesis.kind == cause.kind && hypothesis.index == cause.index;
}

bool IsAnyOf(const Hypothesis& hypothesis, const std::vector<FoundCause>& causes) {
  return std::any_of(causes.begin(), causes.end(),
                     [&](const FoundCause& cause) { return IsOf(hypothesis, cause); });
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
  return AmountOf(shape, Eigen::MatrixXd(white_.size(), 0));
}

JointTest::Amount JointTest::AmountOf(const Effect& shape, const Eigen::MatrixXd& freed) const {
  const Eigen::VectorXd whole = whitening_.Whiten(shape);
  const Eigen::VectorXd w = whole - freed * (freed.transpose() * whole);
  const double information = w.squaredNorm();
  if (!(information > kNothing * whole.squaredNorm()))
    return {0.0, std::numeric_limits<double>::infinity()};
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

Eigen::MatrixXd JointTest::Free(const std::vector<Hypothesis>& all,
                                const std::vector<FoundCause>& causes) const {
  Eigen::MatrixXd columns(white_.size(), 0);
  for (const Hypothesis& one : all) {
    if (!IsAnyOf(one, causes)) continue;
    columns.conservativeResize(Eigen::NoChange, columns.cols() + one.effect.rows.cols());
    columns.rightCols(one.effect.rows.cols()) = whitening_.Whiten(one.effect);
  }
  return SpanOf(columns);
}

double JointTest::ChanceBeside(const Eigen::MatrixXd& freed) const {
  const auto freedom = static_cast<double>(white_.size() - freed.cols());
  const double square = white_.squaredNorm() - (freed.transpose() * white_).squaredNorm();
  return freedom > 0.0 ? ChiSquareTail(std::max(0.0, square), freedom) : 0.0;
}

// Several hypotheses may be of one cause: a camera that is shifted, or moved at will.
std::vector<JointTest::Weighed> JointTest::Weigh(const std::vector<Hypothesis>& all,
                                                 const std::vector<WideEffect>& wide,
                                                 const std::vector<FoundCause>& known) const {
  const Eigen::MatrixXd freed = Free(all, known);
  const Eigen::VectorXd rest = white_ - freed * (freed.transpose() * white_);
  const Whitening::Against against = whitening_.MakeAgainst(rest, freed);
  std::vector<Weighed> out;
  std::vector<double> most;  // of the cause's hypotheses
  std::map<std::pair<CauseKind, int>, std::size_t> seen;
  auto next = wide.begin();
  for (std::size_t k = 0; k < all.size(); ++k) {
    const Eigen::MatrixXd* white =
        next != wide.end() && next->hypothesis == k ? &(next++)->white : nullptr;
    if (IsAnyOf(all[k], known)) continue;
    Whitening::Products of;
    if (white != nullptr) {
      const Eigen::MatrixXd beside = *white - freed * (freed.transpose() * *white);
      of = {beside.transpose() * beside, beside.transpose() * rest, white->squaredNorm()};
    } else {
      of = whitening_.ProductsOf(all[k].effect, against);
    }
    const Gain gain = GainOf(of, all[k].high);
    const double log_weight = std::log(all[k].odds) + gain.log;
    const auto [at, is_new] = seen.try_emplace({all[k].kind, all[k].index}, out.size());
    if (is_new) {
      out.push_back({{all[k].kind, all[k].index}, log_weight});
      most.push_back(-std::numeric_limits<double>::infinity());
    } else {
      double& whole = out[at->second].log_weight;
      whole = std::max(whole, log_weight) + std::log1p(std::exp(-std::abs(whole - log_weight)));
    }
    if (log_weight > most[at->second]) {
      most[at->second] = log_weight;
      out[at->second].cause.hypothesis = k;
      out[at->second].cause.amount = AmountsOf(of, gain.size);
    }
  }
  return out;
}

namespace {

// The most probable of them, with the next.
template <typename Weighed>
Weighed MostProbable(const std::vector<Weighed>& all) {
  const auto less = [](const Weighed& a, const Weighed& b) { return a.log_weight < b.log_weight; };
  const auto best = std::max_element(all.begin(), all.end(), less);
  double sum = 0.0;
  Weighed out = *best;
  for (auto one = all.begin(); one != all.end(); ++one) {
    const double weight = std::exp(one->log_weight - best->log_weight);
    sum += weight;
    if (one == best || !(weight > out.cause.other_probability)) continue;
    out.cause.other_kind = one->cause.kind;
    out.cause.other_index = one->cause.index;
    out.cause.other_probability = weight;
  }
  out.cause.probability = 1.0 / sum;
  out.cause.other_probability /= sum;
  return out;
}

}  // namespace

JointTest::Chain JointTest::Follow(const std::vector<Hypothesis>& all,
                                   const std::vector<WideEffect>& wide, const Weighed* first,
                                   double enough, std::size_t most) const {
  Chain out;
  while (out.causes.size() < most && !out.explained) {
    const Weighed next = first != nullptr && out.causes.empty()
                             ? *first
                             : MostProbable(Weigh(all, wide, out.causes));
    out.causes.push_back(next.cause);
    out.log_weight += next.log_weight;
    out.explained = ChanceBeside(Free(all, out.causes)) >= enough;
  }
  // One that was taken first for several together may have become needless.
  for (std::size_t k = 0; out.explained && out.causes.size() > 1 && k < out.causes.size();) {
    std::vector<FoundCause> fewer = out.causes;
    fewer.erase(fewer.begin() + static_cast<std::ptrdiff_t>(k));
    if (ChanceBeside(Free(all, fewer)) < enough) {
      ++k;
      continue;
    }
    out = {{}, true, 0.0};
    for (const FoundCause& cause : fewer) {
      for (const Weighed& one : Weigh(all, wide, out.causes)) {
        if (IsOf(all[one.cause.hypothesis], cause)) out.log_weight += one.log_weight;
      }
      out.causes.push_back(cause);
    }
  }
  return out;
}

void JointTest::Settle(const std::vector<Hypothesis>& all, const std::vector<WideEffect>& wide,
                       double enough, Chain* chain) const {
  const std::size_t rounds = chain->causes.size();
  bool changed = true;
  for (std::size_t round = 0; changed && round < rounds; ++round) {
    changed = false;
    for (FoundCause& cause : chain->causes) {
      std::vector<FoundCause> others;
      for (const FoundCause& one : chain->causes) {
        if (&one != &cause) others.push_back(one);
      }
      // What is more probable may not be enough: then it is none of those it is weighed among.
      std::vector<Weighed> rivals = Weigh(all, wide, others);
      FoundCause best = MostProbable(rivals).cause;
      while (!IsOf(all[best.hypothesis], cause)) {
        others.push_back(best);
        if (ChanceBeside(Free(all, others)) >= enough) {
          changed = true;
          break;
        }
        others.pop_back();
        std::erase_if(rivals,
                      [&](const Weighed& one) { return IsOf(all[one.cause.hypothesis], best); });
        best = MostProbable(rivals).cause;
      }
      cause = best;
    }
  }
}

std::vector<FoundCause> JointTest::FindCauses(const std::vector<Hypothesis>& all, double enough,
                                              std::size_t most, bool* explained) const {
  std::vector<WideEffect> wide;
  for (std::size_t k = 0; k < all.size(); ++k) {
    if (whitening_.IsLocal(all[k].effect)) continue;
    wide.push_back({k, whitening_.Whiten(all[k].effect)});
  }
  Chain best = Follow(all, wide, nullptr, enough, most);
  if (most > 1 && (!best.explained || best.causes.size() > 1)) {
    const auto better = [&](const Chain& other) {
      if (other.explained != best.explained) return other.explained;
      if (!other.explained) return false;
      if (other.causes.size() != best.causes.size()) {
        return other.causes.size() < best.causes.size();
      }
      return other.log_weight > best.log_weight;
    };
    for (const Weighed& first : Weigh(all, wide, {})) {
      if (whitening_.IsLocal(all[first.cause.hypothesis].effect)) continue;
      Chain other = Follow(all, wide, &first, enough, most);
      if (better(other)) best = std::move(other);
    }
    if (best.explained) Settle(all, wide, enough, &best);
  }
  *explained = best.explained;
  return best.causes;
}

}  // namespace unfurl::calib
