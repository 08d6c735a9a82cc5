// A record reconstructed in one call, its samples collected.
#include <algorithm>

#include "base/progress.h"
#include "measure/reconstruct.h"

namespace unfurl::measure {

void AppendTracks(const data::Tracks& block, data::Tracks* all) {
  const auto n = static_cast<Eigen::Index>(all->size());
  const auto more = static_cast<Eigen::Index>(block.size());
  const Eigen::Index rank = block.shared_rank;
  const auto add = [](const auto& from, auto* to) {
    to->insert(to->end(), from.begin(), from.end());
  };
  add(block.t, &all->t);
  add(block.mark, &all->mark);
  add(block.status, &all->status);
  add(block.used, &all->used);
  add(block.left_out, &all->left_out);
  add(block.reason, &all->reason);
  // Doubling keeps what is copied in proportion.
  if (all->p.cols() < n + more) {
    const Eigen::Index room = std::max(n + more, 2 * n);
    all->p.conservativeResize(3, room);
    all->cov.conservativeResize(6, room);
    all->shared.conservativeResize(3, room * rank);
  }
  all->p.middleCols(n, more) = block.p;
  all->cov.middleCols(n, more) = block.cov;
  all->shared.middleCols(n * rank, more * rank) = block.shared;
}

void TrimTracks(data::Tracks* all) {
  const auto n = static_cast<Eigen::Index>(all->size());
  all->p.conservativeResize(3, n);
  all->cov.conservativeResize(6, n);
  all->shared.conservativeResize(3, n * all->shared_rank);
}

data::Tracks ReconstructPasses(const OpenPass& open, const ProcessBlock& process, std::size_t size,
                               const ReconstructOptions& options, ReconstructSummary* summary,
                               bool correct, HealthReport* health) {
  constexpr std::size_t kBlock = 512;  // lines held at once
  ReconstructOptions now = options;
  HealthLoop loop(correct);
  for (;;) {
    const std::unique_ptr<Reconstructor> pass = open(now);
    data::Tracks all = pass->layout(), tracks;
    for (std::size_t first = 0; first < size; first += kBlock) {
      ThrowIfInterrupted();
      const std::size_t count = std::min(kBlock, size - first);
      process(first, count, pass.get(), &tracks);
      AppendTracks(tracks, &all);
      if (options.progress) {
        options.progress(static_cast<double>(first + count) / static_cast<double>(size));
      }
    }
    if (loop.Again(*pass, &now)) continue;
    TrimTracks(&all);
    if (summary != nullptr) *summary = pass->summary();
    if (health != nullptr) *health = loop.report();
    return all;
  }
}

data::Tracks Reconstruct(const data::TrialReader& trial, const data::Rig& rig,
                         const ReconstructOptions& options, ReconstructSummary* summary,
                         bool correct, HealthReport* health) {
  data::TrialBlock block;
  return ReconstructPasses(
      [&](const ReconstructOptions& now) {
        return std::make_unique<Reconstructor>(trial, rig, "the rig", now);
      },
      [&](std::size_t first, std::size_t count, Reconstructor* pass, data::Tracks* tracks) {
        ReadLines(trial, pass->options().corrections, first, count, &block);
        pass->Process(block, tracks);
      },
      trial.size(), options, summary, correct, health);
}

data::Tracks Reconstruct(const data::TrialReadings& readings, const data::Rig& rig,
                         const ReconstructOptions& options, ReconstructSummary* summary,
                         bool correct, HealthReport* health) {
  return ReconstructPasses(
      [&](const ReconstructOptions& now) {
        return std::make_unique<Reconstructor>(readings, rig, "the rig", now);
      },
      [&](std::size_t first, std::size_t count, Reconstructor* pass, data::Tracks* tracks) {
        pass->Process(readings, first, count, tracks);
      },
      readings.size(), options, summary, correct, health);
}

}  // namespace unfurl::measure
