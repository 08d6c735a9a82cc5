#pragma once

#include <cstdint>
#include <utility>
#include <vector>

namespace unfurl::sim {

// L D L^T of a sparse symmetric positive definite matrix whose pattern never changes. Order of
// elimination (least degree first, the oldest among equals, so that independent chains are worked
// on in turn) and fill are found once; factoring then walks flat lists, allocates nothing, and on a
// chain or tree takes O(n).
//
// A saddle-point matrix [W J^T; J 0] with W definite may be factored too: rows of J wait until all
// that they couple is eliminated, and then have negative pivots.
//
// Values: the diagonal by row, and off-diagonal entries at storage indices that the caller chose;
// indices for fill are added after them.
class SparseLdlt {
 public:
  struct Pair {
    int row, column;  // different; each pair once
    int place;        // in the off-diagonal values
  };

  SparseLdlt() = default;
  // Rows not in `active` have no equation and are left alone. `places`: how many the caller has
  // taken. `constraint`, where given, marks the rows of J. Work and memory are O(rows + fill).
  SparseLdlt(int rows, const std::vector<std::uint8_t>& active, const std::vector<Pair>& pairs,
             int places, const std::vector<std::uint8_t>& constraint = {});

  int places() const { return places_; }  // with those of the fill
  int size() const { return static_cast<int>(steps_.size()); }
  int nonzeros() const { return static_cast<int>(entries_.size()); }  // of L, below the diagonal

  // Factors in place: `diagonal` becomes D, `off` L, and `inverse` 1 / D; forward-substitutes `x`
  // on the way (L z = x, then z / D).
  void FactorAndForward(double* diagonal, double* off, double* inverse, double* x) const;
  // The same for another right side, after FactorAndForward.
  void Forward(const double* off, const double* inverse, double* x) const;
  // L^T x = z.
  void Backward(const double* off, double* x) const;

  // Row eliminated at step k.
  int RowAt(int k) const { return steps_[k].row; }

 private:
  struct Step {
    int row;
    int count;  // of the entries of its column, below the diagonal
  };
  struct Entry {
    int place;
    int row;
  };
  int places_ = 0;
  std::vector<Step> steps_;
  std::vector<Entry> entries_;  // step after step
  std::vector<int> target_;     // place of each pair of a column's entries, in order of use
};

}  // namespace unfurl::sim
