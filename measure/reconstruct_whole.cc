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

data::Tracks ReconstructBlocks(
    Reconstructor* reconstructor, std::size_t size, const ReconstructOptions& options,
    const std::function<void(std::size_t, std::size_t, data::Tracks*)>& process,
    ReconstructSummary* summary) {
  constexpr std::size_t kBlock = 512;  // lines held at once
  data::Tracks all = reconstructor->layout(), tracks;
  for (std::size_t first = 0; first < size; first += kBlock) {
    ThrowIfInterrupted();
    const std::size_t count = std::min(kBlock, size - first);
    process(first, count, &tracks);
    AppendTracks(tracks, &all);
    if (options.progress) {
      options.progress(static_cast<double>(first + count) / static_cast<double>(size));
    }
  }
  TrimTracks(&all);
  if (summary != nullptr) *summary = reconstructor->summary();
  return all;
}

data::Tracks Reconstruct(const data::TrialReader& trial, const data::Rig& rig,
                         const ReconstructOptions& options, ReconstructSummary* summary) {
  Reconstructor reconstructor(trial, rig, "the rig", options);
  data::TrialBlock block;
  const auto process = [&](std::size_t first, std::size_t count, data::Tracks* tracks) {
    trial.Read(first, count, &block);
    reconstructor.Process(block, tracks);
  };
  return ReconstructBlocks(&reconstructor, trial.size(), options, process, summary);
}

data::Tracks Reconstruct(const data::TrialReadings& readings, const data::Rig& rig,
                         const ReconstructOptions& options, ReconstructSummary* summary) {
  Reconstructor reconstructor(readings, rig, "the rig", options);
  const auto process = [&](std::size_t first, std::size_t count, data::Tracks* tracks) {
    reconstructor.Process(readings, first, count, tracks);
  };
  return ReconstructBlocks(&reconstructor, readings.size(), options, process, summary);
}

}  // namespace unfurl::measure
