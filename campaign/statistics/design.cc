#include "campaign/statistics/design.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "base/error.h"
#include "campaign/statistics/counter_random.h"
#include "campaign/statistics/sobol_sequence.h"

namespace unfurl::campaign {

namespace {

constexpr std::uint64_t kMostRuns = std::uint64_t{1} << 63;  // an index and its successors fit
constexpr int kMostBlocks = 4096;  // more replicates than any Student's t asks for

// What a random number is for: no two uses share one.
enum Stream : std::uint32_t {
  kPoints = 1,
  kStrata = 2,
  kJitter = 3,
  kScrambling = 4,
  kStart = 5,
  kOrder = 6,
};

[[noreturn]] void RefuseDesign(const std::string& what, const std::string& remedy) {
  throw Error(what, "", remedy);
}

std::uint64_t GridSize(const DesignSpec& spec) {
  std::uint64_t size = 1;
  for (int level : spec.levels) {
    if (level < 1)
      RefuseDesign(fmt::format("a grid of {} levels", level), "give one level or more");
    if (__builtin_mul_overflow(size, static_cast<std::uint64_t>(level), &size) ||
        size > kMostRuns) {
      RefuseDesign(
          fmt::format("a grid of {} dimensions with more than 2^63 points", spec.dimensions),
          "give fewer levels, or take a Sobol design");
    }
  }
  return size;
}

void CheckSpec(const DesignSpec& spec) {
  if (spec.dimensions < 1) {
    RefuseDesign(fmt::format("a design of {} dimensions", spec.dimensions), "give one or more");
  }
  if (spec.kind != DesignKind::kGrid && (spec.runs < 1 || spec.runs > kMostRuns)) {
    RefuseDesign(fmt::format("a design of {} runs", spec.runs), "give 1 to 2^63");
  }
  if (spec.blocks < 2 || spec.blocks > kMostBlocks) {
    RefuseDesign(fmt::format("a design of {} blocks", spec.blocks),
                 fmt::format("give 2 to {}", kMostBlocks));
  }
  if (spec.morris_levels < 2 || spec.morris_levels % 2 != 0) {
    RefuseDesign(fmt::format("a Morris design of {} levels", spec.morris_levels),
                 "give an even number, 4 as a rule");
  }
}

// Whole rows of `row` runs among the runs wanted.
std::uint64_t WholeRows(const DesignSpec& spec, std::uint64_t row, const char* name) {
  if (spec.runs < row) {
    RefuseDesign(
        fmt::format("a {} design of {} runs for {} inputs", name, spec.runs, spec.dimensions),
        fmt::format("give {} or more: a row is that long, and errors need many rows", row));
  }
  return spec.runs / row * row;
}

}  // namespace

struct Design::Sobol {
  Sobol(const DesignSpec& spec, int dimensions)
      : sequence(dimensions), keys(static_cast<std::size_t>(spec.blocks) * dimensions) {
    const CounterRandom random(spec.seed, kScrambling);
    for (int block = 0; block < spec.blocks; ++block) {
      for (int d = 0; d < dimensions; ++d) {
        keys[static_cast<std::size_t>(block) * dimensions + d] =
            random.Bits(static_cast<std::uint64_t>(block), static_cast<std::uint32_t>(d));
      }
    }
  }
  SobolSequence sequence;
  std::vector<std::uint64_t> keys;  // blocks x dimensions
};

Design::Design(DesignSpec spec) : spec_(std::move(spec)), size_(spec_.runs) {
  CheckSpec(spec_);
  const std::uint64_t d = static_cast<std::uint64_t>(spec_.dimensions);
  switch (spec_.kind) {
    case DesignKind::kRandom:
      break;
    case DesignKind::kLatin:
      blocks_ = static_cast<int>(
          std::clamp<std::uint64_t>(spec_.runs / 2, 1, static_cast<std::uint64_t>(spec_.blocks)));
      break;
    case DesignKind::kSobol:
      blocks_ = spec_.blocks;
      sobol_ = std::make_shared<Sobol>(spec_, spec_.dimensions);
      break;
    case DesignKind::kGrid:
      if (spec_.levels.size() == 1) spec_.levels.assign(d, spec_.levels[0]);
      if (spec_.levels.size() != d) {
        RefuseDesign(
            fmt::format("a grid of {} inputs with {} numbers of levels", d, spec_.levels.size()),
            "give one number for all, or one for each");
      }
      size_ = GridSize(spec_);
      break;
    case DesignKind::kSaltelli:
      row_ = d + 2;
      size_ = WholeRows(spec_, row_, "Saltelli");
      if (2 * d <= SobolSequence::kMostDimensions)
        sobol_ = std::make_shared<Sobol>(spec_, 2 * spec_.dimensions);
      break;
    case DesignKind::kMorris:
      row_ = d + 1;
      size_ = WholeRows(spec_, row_, "Morris");
      break;
  }
}

void Design::Point(std::uint64_t index, std::span<double> u) const {
  if (index >= size_ || u.size() != static_cast<std::size_t>(spec_.dimensions)) {
    RefuseDesign(fmt::format("point {} in {} numbers", index, u.size()),
                 fmt::format("the design has {} points of {}", size_, spec_.dimensions));
  }
  switch (spec_.kind) {
    case DesignKind::kRandom: {
      const CounterRandom random(spec_.seed, kPoints);
      for (std::uint32_t d = 0; d < u.size(); ++d) u[d] = random.Uniform(index, d);
      break;
    }
    case DesignKind::kLatin:
      return LatinPoint(index, u);
    case DesignKind::kSobol:
      for (std::size_t d = 0; d < u.size(); ++d) u[d] = SobolCoordinate(index, static_cast<int>(d));
      break;
    case DesignKind::kGrid:
      return GridPoint(index, u);
    case DesignKind::kSaltelli:
      return SaltelliPoint(index, u);
    case DesignKind::kMorris:
      return MorrisPoint(index, u);
  }
}

// Of the blocks interleaved: each has its own scrambling of the same sequence.
double Design::SobolCoordinate(std::uint64_t index, int dimension) const {
  const std::uint64_t blocks = static_cast<std::uint64_t>(spec_.blocks);
  const std::size_t at = (index % blocks) * sobol_->sequence.dimensions() + dimension;
  return sobol_->sequence.Scrambled(index / blocks, dimension, sobol_->keys[at]);
}

void Design::LatinPoint(std::uint64_t index, std::span<double> u) const {
  const std::uint64_t blocks = static_cast<std::uint64_t>(blocks_);
  const std::uint64_t block = index % blocks, place = index / blocks;
  const std::uint64_t strata = size_ / blocks + (block < size_ % blocks ? 1 : 0);
  const CounterRandom keys(spec_.seed, kStrata), jitter(spec_.seed, kJitter);
  for (std::uint32_t d = 0; d < u.size(); ++d) {
    const KeyedPermutation permutation(strata, keys.Bits(block, d));
    const double inside = static_cast<double>(permutation(place)) + jitter.Uniform(index, d);
    // Rounding may reach 1 in the last of very many strata.
    u[d] = std::min(inside / static_cast<double>(strata), 1.0 - 0x1p-53);
  }
}

void Design::GridPoint(std::uint64_t index, std::span<double> u) const {
  for (std::size_t d = u.size(); d-- > 0;) {
    const std::uint64_t levels = static_cast<std::uint64_t>(spec_.levels[d]);
    u[d] = (static_cast<double>(index % levels) + 0.5) / static_cast<double>(levels);
    index /= levels;
  }
}

void Design::SaltelliPoint(std::uint64_t index, std::span<double> u) const {
  const std::uint64_t n = index / row_, kind = index % row_;  // 0: A, 1: B, 2 + k: A with B's k
  const CounterRandom random(spec_.seed, kPoints);
  for (std::size_t d = 0; d < u.size(); ++d) {
    const bool from_b = kind == 1 || kind == d + 2;
    const std::size_t column = from_b ? u.size() + d : d;
    u[d] = sobol_ ? SobolCoordinate(n, static_cast<int>(column))
                  : random.Uniform(n, static_cast<std::uint32_t>(column));
  }
}

void Design::MorrisPoint(std::uint64_t index, std::span<double> u) const {
  const std::uint64_t trajectory = index / row_, step = index % row_;
  const int levels = spec_.morris_levels;
  const CounterRandom start(spec_.seed, kStart), order(spec_.seed, kOrder);
  const KeyedPermutation permutation(u.size(), order.Bits(trajectory, 0));
  for (std::size_t d = 0; d < u.size(); ++d) {
    int level = static_cast<int>(start.Uniform(trajectory, static_cast<std::uint32_t>(d)) * levels);
    // Half the levels away there is just one level inside the cube.
    if (permutation(d) < step) level += level < levels / 2 ? levels / 2 : -(levels / 2);
    u[d] = (level + 0.5) / levels;
  }
}

std::vector<int> MorrisSteps(const DesignSpec& spec, std::uint64_t trajectory) {
  const std::uint64_t d = static_cast<std::uint64_t>(spec.dimensions);
  const CounterRandom order(spec.seed, kOrder);
  const KeyedPermutation permutation(d, order.Bits(trajectory, 0));
  std::vector<int> steps(d);
  for (std::uint64_t k = 0; k < d; ++k) steps[k] = static_cast<int>(permutation(k)) + 1;
  return steps;
}

}  // namespace unfurl::campaign
