#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "data/rig.h"

namespace unfurl::measure {

// A rig's cameras side by side, so that all are evaluated at once: what Project gives, without the
// derivatives by the camera's own parameters. Plain arrays, for it is compiled for the machine's
// widest vectors.
class CameraBank {
 public:
  static constexpr std::size_t kMaxCameras = 32;  // bits of a camera set

  explicit CameraBank(std::span<const data::RigCamera> cameras);

  std::size_t lanes() const { return lanes_; }  // cameras, rounded up to a multiple of four

  // Sums of one Gauss-Newton step at a point: with J = du/dp and r = u - u(p), over cameras of
  // weight > 0.
  struct Sums {
    double JwJ[6];      // sum w J' J: xx, xy, xz, yy, yz, zz [1/m^2]
    double JJ[6];       // the same with every weight 1 [px^2/m^2]
    double Jwr[3];      // sum w J' r [1/m]
    double chi_square;  // sum w r^2 [-]
    bool in_front;      // of every camera of weight > 0; otherwise the sums tell nothing
  };
  // `p` 3 [m]; `u` and `w` of `lanes()` entries [px], [1/px^2]; w = 0 leaves a camera out.
  void Accumulate(const double* p, const double* u, const double* w, Sums* sums) const;

  // Readings that a point has, NaN where it is not in front; `u` of `lanes()` entries [px].
  void Readings(const double* p, double* u) const;

 private:
  // Per camera: R, p_WC, e, f, u0, terms.
  static constexpr std::size_t kConstants = 15 + data::kLensTerms;
  // The sums, and the readings, of the cameras that have this lens.
  template <typename Lens, std::size_t count>
  void AddLens(const double* p, const double* u, const double* w, double (*sum)[4],
               double* behind) const;
  template <typename Lens>
  void ReadLens(const double* p, double* u) const;

  std::size_t lanes_ = 0;
  std::vector<double> constants_;  // kConstants x lanes [SI, px]
  std::vector<double> of_lens_;    // 1 where a lane has the lens; lens x lanes [-]
  std::vector<bool> present_;      // by lens
  bool usual_ = true;              // no term beyond the usual ones is used
};

// row[k] += sum_j d[j] rows[j * stride + k], k in [0, count); `n` entries of d.
void AddWeightedRows(const double* rows, std::size_t stride, const double* d, std::size_t n,
                     std::size_t count, double* row);
// F[3 k + i] += lever[i] row[k], k in [0, count).
void AddOuter(const double* lever, const double* row, std::size_t count, double* F);

}  // namespace unfurl::measure
