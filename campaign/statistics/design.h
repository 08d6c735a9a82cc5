#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace unfurl::campaign {

enum class DesignKind { kRandom, kLatin, kSobol, kGrid, kSaltelli, kMorris };

/// What a design is made from; equal specs make equal designs on every machine.
struct DesignSpec {
  DesignKind kind = DesignKind::kRandom;
  std::uint64_t runs = 0;  // wanted; a grid ignores it, Saltelli and Morris take whole rows of it
  std::uint64_t seed = 1;
  int dimensions = 1;
  std::vector<int> levels;  // of a grid: one number for all dimensions, or one each
  /// Independently randomised replicates of a Latin or Sobol design, 2 to 4096: run i is of block
  /// i % blocks, and the scatter of the blocks' means is the error. Where runs are fewer than two
  /// a block, there are fewer blocks (Latin only; Sobol points do not depend on `runs`).
  int blocks = 16;
  int morris_levels = 4;  // of each input in Morris' design: even, 2 or more
};

/// Points of the unit cube, each a pure function of the spec and its index: O(dimensions) work, no
/// table, so that a shard of any design needs no other. Coordinates lie strictly inside (0, 1).
///
/// kRandom    independent points; extendable: point i does not depend on `runs`.
/// kLatin     in each block and dimension one point in each of as many strata as the block has
///            points [McKay, Beckman and Conover 1979].
/// kSobol     a scrambled Sobol sequence a block (sobol_sequence.h); extendable.
/// kGrid      middles of `levels` equal cells a dimension, the last dimension fastest.
/// kSaltelli  rows of d + 2 points: A, B, and A with coordinate k of B for k = 1 .. d
///            [Saltelli et al. 2010]; A and B from one Sobol sequence of 2 d dimensions, or random
///            where that has too many; extendable by rows.
/// kMorris    trajectories of d + 1 points, each changing one coordinate of the last by 1/2
///            [Morris 1991] on middles of `morris_levels` cells; extendable by trajectories.
class Design {
 public:
  /// Throws Error on a spec that makes no design, or one of more than 2^63 runs.
  explicit Design(DesignSpec spec);

  /// What it was made from, with the levels of every input.
  const DesignSpec& spec() const { return spec_; }
  /// Runs that the design truly has.
  std::uint64_t size() const { return size_; }
  /// Runs of one row (Saltelli: d + 2, Morris: d + 1), otherwise 1.
  std::uint64_t row() const { return row_; }
  /// Blocks of replicates, 0 where runs are independent or there is no randomness.
  int blocks() const { return blocks_; }
  /// The block of a run, 0 where there are none.
  int Block(std::uint64_t index) const {
    return blocks_ == 0 ? 0 : static_cast<int>(index % static_cast<std::uint64_t>(blocks_));
  }
  /// Point `index` < size() into u, of `dimensions` numbers.
  void Point(std::uint64_t index, std::span<double> u) const;

 private:
  void LatinPoint(std::uint64_t index, std::span<double> u) const;
  void GridPoint(std::uint64_t index, std::span<double> u) const;
  void SaltelliPoint(std::uint64_t index, std::span<double> u) const;
  void MorrisPoint(std::uint64_t index, std::span<double> u) const;
  double SobolCoordinate(std::uint64_t index, int dimension) const;

  DesignSpec spec_;
  std::uint64_t size_ = 0, row_ = 1;
  int blocks_ = 0;
  struct Sobol;  // the sequence, and a key for each block and dimension
  std::shared_ptr<const Sobol> sobol_;
};

/// The inputs whose change makes a row's points: of Morris' trajectory `trajectory`, coordinate k
/// changes at step step[k] = 1 .. d (from point step - 1 to point step).
std::vector<int> MorrisSteps(const DesignSpec& spec, std::uint64_t trajectory);

}  // namespace unfurl::campaign
