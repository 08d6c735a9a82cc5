#include "study/cost_reference.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/text.h"
#include "base/worker_pool.h"

namespace unfurl::study {
namespace {

// Errors fall with these powers of segments (tests/verification) and of a smooth beam's shapes
// (docs/decisions/010-second-beam.md).
constexpr double kOfSegments = 2.0, kOfShapes = 3.0;
constexpr double kLooser = 10.0;  // tolerance that shows what time stepping does to the reference
// A finer rung is dearer by this power of its size, before two tell: more work a step, more steps.
constexpr double kDearer = 2.0;
constexpr double kNoTime = 1e-9;  // of a run, that no clock sees [s]
// The check by another method may take so many times the run that it checks, and so long anyway.
constexpr double kCheckTimes = 10.0, kCheckSeconds = 1.0;

CostDistance operator*(double factor, const CostDistance& d) {
  return {factor * d.rms, factor * d.largest};
}

CostDistance Larger(const CostDistance& a, const CostDistance& b) {
  return {std::max(a.rms, b.rms), std::max(a.largest, b.largest)};
}

}  // namespace

std::vector<double> CostReference::Ladder::Sizes() const {
  std::vector<double> sizes;
  for (std::size_t k = 0; k < rungs.size(); ++k) {
    sizes.push_back(regular ? std::exp2(static_cast<double>(k)) : meshes[k].order);
  }
  return sizes;
}

double CostReference::Ladder::NextCost() const {
  const std::size_t n = rungs.size();
  if (n == 0) return 0.0;
  double growth = regular ? std::exp2(kDearer)
                          : std::pow((meshes[n - 1].order + 2.0) / meshes[n - 1].order, kDearer);
  if (n > 1) {
    growth = std::max(1.0, rungs[n - 1].seconds / std::max(kNoTime, rungs[n - 2].seconds));
  }
  return growth * rungs[n - 1].seconds;
}

CostReference::CostReference(const CostBench& bench, const data::Scene& scene,
                             const CostMeshes& meshes, double rtol)
    : bench_(bench), scene_(scene), rtol_(rtol) {
  const auto add = [&](const std::vector<CostMesh>& rungs, double power, bool regular) {
    if (rungs.empty()) return;
    Ladder ladder;
    ladder.meshes = rungs;
    ladder.power = power;
    ladder.regular = regular;
    ladders_.push_back(std::move(ladder));
  };
  add(meshes.segments, kOfSegments, true);
  add(meshes.smooth, kOfShapes, false);
  rigid_ = ladders_.empty();
  if (rigid_) add({CostMesh()}, 1.0, false);
}

void CostReference::Climb(Ladder* ladder, double share) {
  double& spent = ladder->seconds;
  std::size_t dropped = 0;  // too coarse to be run
  const std::size_t wanted = ladder->meshes.size();
  while (ladder->rungs.size() < wanted && !ladder->ended) {
    // The check of the first takes as long as it and more.
    const double until = spent + ladder->NextCost() + ladder->FirstCost();
    ladder->stopped = until > share || (bench_.Over() && !ladder->rungs.empty());
    ladder->needs = until / share;
    if (ladder->stopped) return;
    const CostMesh& mesh = ladder->meshes[ladder->rungs.size()];
    CostOutcome run = bench_.Run(mesh, "auto", rtol_, {share - spent, 0.0});
    spent += run.seconds;
    if (run.usable) {
      ladder->rungs.push_back(std::move(run));
      continue;
    }
    ladder->message = mesh.words + ": " + run.message;
    ladder->stopped = run.stopped;
    if (run.stopped) ladder->needs = 0.0;
    ladder->ended = run.stopped || !ladder->rungs.empty() || ++dropped == wanted || rigid_ ||
                    !HasFinerMesh(ladder->meshes.back());
    if (ladder->ended) return;
    ladder->meshes.erase(ladder->meshes.begin());
    ladder->meshes.push_back(FinerMesh(scene_, ladder->meshes.back()));
  }
}

void CostReference::CheckTime(Ladder* ladder, double left) const {
  const CostOutcome& own = ladder->rungs.front();
  const CostMesh& mesh = ladder->meshes.front();
  const double limit = std::max(kCheckSeconds, kCheckTimes * own.seconds);
  const CostOutcome looser = bench_.Run(mesh, "auto", kLooser * rtol_, {limit, 0.0});
  const CostOutcome other =
      bench_.Run(mesh, "partitioned", rtol_, {std::min(limit, left - looser.seconds), 0.0});
  ladder->seconds += looser.seconds + other.seconds;
  ladder->time.clear();
  for (std::size_t q = 0; q < bench_.quantities().size(); ++q) {
    const CostValues mine = bench_.OnClock(own, q, own.events);
    CostDistance error;
    // An error falls with the tolerance, so that the difference is nine times the tighter run's.
    if (looser.usable) {
      const CostDistance d = DistanceOf(mine, bench_.OnClock(looser, q, own.events));
      error = (1.0 / (kLooser - 1.0)) * d;
    }
    if (other.usable) {
      error = Larger(error, DistanceOf(mine, bench_.OnClock(other, q, own.events)));
    }
    ladder->time.push_back(error);
  }
}

CostLimit CostReference::LimitOn(const Ladder& ladder, std::size_t quantity) const {
  std::vector<CostValues> values;
  values.reserve(ladder.rungs.size());
  for (const CostOutcome& run : ladder.rungs)
    values.push_back(bench_.OnClock(run, quantity, clock_));
  CostLimit limit = LimitOf(values, ladder.Sizes(), ladder.power, ladder.regular);
  if (rigid_ && !limit.values.a.empty()) limit.error = {};
  const CostDistance time = limit.spread * ladder.time[quantity];
  limit.error = {limit.error.rms + time.rms, limit.error.largest + time.largest};
  return limit;
}

void CostReference::FindLimits() {
  limits_.clear();
  clock_.clear();
  std::size_t most = 0;
  for (const Ladder& ladder : ladders_) {
    if (ladder.rungs.size() <= most) continue;
    most = ladder.rungs.size();
    clock_ = ladder.rungs.back().events;
  }
  for (std::size_t q = 0; q < bench_.quantities().size(); ++q) {
    CostLimit limit;
    limit.error.rms = limit.error.largest = std::numeric_limits<double>::infinity();
    for (const Ladder& ladder : ladders_) {
      if (ladder.rungs.empty()) continue;
      const CostLimit other = LimitOn(ladder, q);
      if (other.values.a.empty()) continue;
      limit = limit.values.a.empty() ? other : Joined(limit, other);
    }
    limits_.push_back(std::move(limit));
  }
}

void CostReference::Make(std::size_t workers, double share,
                         const std::function<void(double, const std::string&)>& progress) {
  if (progress) progress(0.0, "the reference");
  ParallelFor(ladders_.size(), workers, [&](std::size_t k) {
    const double own = share / static_cast<double>(ladders_.size());
    Climb(&ladders_[k], own);
    if (!ladders_[k].rungs.empty()) CheckTime(&ladders_[k], own - ladders_[k].seconds);
  });
  std::string message;
  bool any = false, stopped = false;
  for (const Ladder& ladder : ladders_) {
    seconds_ += ladder.seconds;
    any = any || !ladder.rungs.empty();
    stopped = stopped || ladder.stopped;
    if (!ladder.message.empty()) message = ladder.message;
  }
  if (!any && !stopped) {
    throw Error("the reference run fails: " + message, scene_.path,
                "see `unfurl simulate`, or shorten --duration");
  }
  if (any) FindLimits();
}

bool CostReference::Extend(double allowance,
                           const std::function<void(double, const std::string&)>& progress) {
  Ladder* next = nullptr;
  for (Ladder& ladder : ladders_) {
    if (ladder.ended || ladder.rungs.empty() || rigid_) continue;
    if (ladder.rungs.size() == ladder.meshes.size() && !HasFinerMesh(ladder.meshes.back()))
      continue;
    if (next == nullptr || ladder.NextCost() < next->NextCost()) next = &ladder;
  }
  if (next == nullptr || next->NextCost() > allowance) return false;
  if (next->rungs.size() == next->meshes.size()) {
    next->meshes.push_back(FinerMesh(scene_, next->meshes.back()));
  }
  const CostMesh& mesh = next->meshes[next->rungs.size()];
  if (progress) progress(1.0, "a finer reference, " + mesh.words);
  // What was foretold, twice over, and no more.
  CostOutcome run = bench_.Run(mesh, "auto", rtol_, {2.0 * allowance, 0.0});
  seconds_ += run.seconds;
  next->ended = !run.usable;
  if (!run.usable) return true;
  next->rungs.push_back(std::move(run));
  FindLimits();
  return true;
}

const CostOutcome* CostReference::RunOn(const CostMesh& mesh) const {
  for (const Ladder& ladder : ladders_) {
    for (std::size_t k = 0; k < ladder.rungs.size(); ++k) {
      if (ladder.meshes[k].words == mesh.words) return &ladder.rungs[k];
    }
  }
  return nullptr;
}

bool CostReference::ShortOfTime() const {
  return std::any_of(ladders_.begin(), ladders_.end(),
                     [](const Ladder& ladder) { return ladder.stopped; });
}

std::string CostReference::problem() const {
  const bool known = std::any_of(limits_.begin(), limits_.end(), [](const CostLimit& limit) {
    return std::isfinite(limit.error.rms);
  });
  if (!limits_.empty() && (known || !ShortOfTime())) return "";
  double needs = 0.0;
  for (const Ladder& ladder : ladders_) {
    if (ladder.needs > 1.0 && (needs == 0.0 || ladder.needs < needs)) needs = ladder.needs;
  }
  return "the budget of time ended before there was a reference, which needs " +
         (needs > 0.0 ? fmt::format("some {:.2g} times as much", needs) : "far more");
}

std::string CostReference::Words() const {
  std::vector<std::string> parts;
  for (const Ladder& ladder : ladders_) {
    if (ladder.rungs.empty() || rigid_) continue;
    std::vector<std::string> sizes;
    for (std::size_t k = 0; k < ladder.rungs.size(); ++k) sizes.push_back(ladder.meshes[k].words);
    parts.push_back(JoinWords(sizes) +
                    (ladder.regular && sizes.size() > 2 ? ", extrapolated" : ""));
  }
  const std::string beams = parts.empty() ? "" : fmt::format("{}; ", fmt::join(parts, "; "));
  return fmt::format("{}rtol {:g}", beams, rtol_);
}

}  // namespace unfurl::study
