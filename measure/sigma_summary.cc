#include "measure/sigma_summary.h"

#include <cmath>

namespace unfurl::measure {

void SigmaSummary::Add(const data::Tracks& block) {
  constexpr std::array<Eigen::Index, 3> kDiagonal = {0, 3, 5};  // of xx, xy, xz, yy, yz, zz
  for (std::size_t i = 0; i < block.size(); ++i) {
    if (!data::Usable(block.status[i])) continue;
    const auto col = static_cast<Eigen::Index>(i);
    const auto F = block.shared.middleCols(col * block.shared_rank, block.shared_rank);
    for (std::size_t k = 0; k < 3; ++k) {
      readings_[k].Add(std::sqrt(block.cov(kDiagonal[k], col)));
      calibration_[k].Add(F.row(static_cast<Eigen::Index>(k)).norm());
    }
  }
}

}  // namespace unfurl::measure
