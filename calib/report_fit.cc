#include "calib/report_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "calib/covariance.h"
#include "calib/set_up.h"

namespace unfurl::calib {
namespace {

std::vector<CameraReport> ReportCameras(const std::vector<CameraGuess>& guesses,
                                        const std::vector<ReadingReport>& readings,
                                        const Weighting& weighting) {
  std::vector<CameraReport> out;
  for (std::size_t j = 0; j < guesses.size(); ++j) {
    CameraReport camera;
    camera.name = guesses[j].camera.name;
    camera.guess_sigma_px = guesses[j].sigma_px;
    camera.floor_px = weighting.floor_px[j];
    camera.low_px = std::numeric_limits<double>::infinity();
    camera.high_px = -camera.low_px;
    double squares = 0.0;
    for (const ReadingReport& r : readings) {
      if (r.camera != static_cast<int>(j)) continue;
      ++camera.readings;
      if (r.weight < 1.0) {
        ++camera.gross;
        continue;
      }
      squares += r.residual_px * r.residual_px;
      camera.low_px = std::min(camera.low_px, r.u_px);
      camera.high_px = std::max(camera.high_px, r.u_px);
    }
    camera.residual_rms_px = std::sqrt(squares / std::max(1, camera.readings - camera.gross));
    out.push_back(camera);
  }
  return out;
}

}  // namespace

void ReportFit(const Observations& data, const RigFit& fit, double set_up_level,
               CalibrationReport* report) {
  const RefinedBundle& full = fit.bundle;
  report->ids = data.ids;
  report->converged = full.summary.converged;
  report->chi_square = full.summary.chi_square;
  report->degrees_of_freedom = full.summary.degrees_of_freedom;
  report->survey_weight = full.summary.survey_weight;
  report->survey_factor = full.weighting.survey_factor;
  for (std::size_t k = 0; k < data.readings.size(); ++k) {
    const Reading& r = data.readings[k];
    report->readings.push_back({r.point, r.camera, r.u_px, full.summary.residual_px[k],
                                std::sqrt(full.weighting.Variance(r)),
                                full.summary.reading_weight[k], full.redundancy.reading[k]});
  }
  report->cameras = ReportCameras(fit.guesses, report->readings, full.weighting);
  const Eigen::MatrixXd covariance = CameraCovariance(full.summary.information);
  report->common = EstimatesOf(data, full.state.common, covariance);
  report->set_ups = SetUpsOf(data, full.state.common, covariance, set_up_level);
}

}  // namespace unfurl::calib
