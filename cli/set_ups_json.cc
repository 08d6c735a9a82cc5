#include "cli/set_ups_json.h"

#include <Eigen/Core>
#include <array>

namespace unfurl::cli {

nlohmann::ordered_json SetUpsJson(const std::vector<calib::SetUpEstimate>& set_ups) {
  const auto three = [](const Eigen::Vector3d& v) {
    return std::array<double, 3>{v.x(), v.y(), v.z()};
  };
  nlohmann::ordered_json out = nlohmann::ordered_json::array();
  for (const calib::SetUpEstimate& of : set_ups) {
    const Eigen::Matrix<double, 6, 1> sigma = of.covariance.diagonal().cwiseSqrt();
    out.push_back({{"name", of.name},
                   {"first", of.first},
                   {"points", of.points},
                   {"told", of.told},
                   {"off", of.off},
                   {"chance", of.chance},
                   {"middle_m", three(of.middle)},
                   {"shift_m", three(of.shift)},
                   {"shift_sigma_m", three(sigma.head<3>())},
                   {"turn_rad", three(of.turn)},
                   {"turn_sigma_rad", three(sigma.tail<3>())}});
  }
  return out;
}

}  // namespace unfurl::cli
