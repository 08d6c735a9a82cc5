#include "cli/calibrate_json.h"

#include <Eigen/Core>
#include <cmath>
#include <utility>

#include "cli/set_ups_json.h"
#include "data/rig.h"

namespace unfurl::cli {

using nlohmann::ordered_json;

namespace {

double Sigma(const Eigen::MatrixXd& covariance, std::size_t camera, int parameter) {
  const auto at = static_cast<Eigen::Index>(camera) * data::kCameraParameters + parameter;
  return std::sqrt(covariance(at, at));
}

// xx, xy, xz, yy, yz, zz.
ordered_json SixOf(const Eigen::Matrix3d& c) {
  return {c(0, 0), c(0, 1), c(0, 2), c(1, 1), c(1, 2), c(2, 2)};
}

}  // namespace

ordered_json LensesJson(const std::vector<calib::KnownLensEstimate>& lenses) {
  ordered_json out = ordered_json::array();
  for (const calib::KnownLensEstimate& lens : lenses) {
    ordered_json one = {{"camera", lens.camera}};
    if (lens.placed) {
      one["moved"] = {lens.moved.x(), lens.moved.y(), lens.moved.z()};
      one["moved_sigma"] = lens.moved_sigma;
      one["moved_covariance"] = SixOf(lens.moved_covariance);
      one["turned"] = lens.turned;
      one["turned_sigma"] = lens.turned_sigma;
    } else {
      for (const char* name :
           {"moved", "moved_sigma", "moved_covariance", "turned", "turned_sigma"}) {
        one[name] = nullptr;
      }
    }
    one["chi_square"] = lens.chi_square;
    one["degrees_of_freedom"] = lens.freedom;
    one["chance"] = lens.chance;
    out.push_back(std::move(one));
  }
  return out;
}

ordered_json CalibrationJson(const calib::Calibration& result, const std::string& survey,
                             const std::string& rig) {
  ordered_json summary = {{"survey", survey},
                          {"rig", rig},
                          {"verdict", result.rig.verdict},
                          {"reasons", result.rig.reasons},
                          {"model_floor_px", result.rig.model_floor_px}};
  for (std::size_t j = 0; j < result.rig.cameras.size(); ++j) {
    const data::RigCamera& camera = result.rig.cameras[j];
    const calib::CameraReport& fit = result.report.cameras[j];
    summary["cameras"].push_back({{"name", camera.name},
                                  {"position", {camera.p_WC.x(), camera.p_WC.y(), camera.p_WC.z()}},
                                  {"f_px", camera.f_px},
                                  {"f_sigma_px", Sigma(result.rig.covariance, j, 6)},
                                  {"u0_px", camera.u0_px},
                                  {"e", camera.e},
                                  {"e_sigma", Sigma(result.rig.covariance, j, 8)},
                                  {"pixels", camera.pixels},
                                  {"lens", data::NamesOf(camera.lens).name},
                                  {"terms_px", camera.terms_px},
                                  {"readings", fit.readings},
                                  {"gross", fit.gross},
                                  {"floor_px", fit.floor_px},
                                  {"residual_rms_px", fit.residual_rms_px}});
  }
  for (const auto& [name, value] : result.rig.checks) summary["checks"][name] = value;
  summary["lens_model"] = result.report.lens_model;
  summary["survey_factor"] = result.report.survey_factor;
  summary["common"] = ordered_json::array();
  for (const calib::CommonEstimate& error : result.report.common) {
    summary["common"].push_back({{"name", error.name},
                                 {"unit", error.unit},
                                 {"stated_sigma", error.stated_sigma},
                                 {"value", error.value},
                                 {"sigma", error.sigma}});
    if (!error.set_up.empty()) summary["common"].back()["set_up"] = error.set_up;
  }
  summary["set_ups"] = SetUpsJson(result.report.set_ups);
  summary["lenses"] = LensesJson(result.report.lenses);
  summary["orders"] = ordered_json::array();
  for (const calib::OrderTrial& trial : result.report.orders) {
    summary["orders"].push_back({{"name", calib::OrderName(trial)},
                                 {"loss_nats", trial.loss},
                                 {"contradiction_px", trial.contradiction_px},
                                 {"held_out_rms", trial.held_out_rms},
                                 {"floor_px", trial.largest_floor_px}});
  }
  summary["gross"] = ordered_json::array();
  for (const calib::GrossFinding& finding : result.report.gross) {
    ordered_json points = ordered_json::array();
    for (const int i : finding.points) {
      points.push_back(result.report.ids[static_cast<std::size_t>(i)]);
    }
    summary["gross"].push_back({{"kind", calib::Name(finding.kind)},
                                {"points", points},
                                {"size", finding.size},
                                {"sure", finding.sure},
                                {"text", finding.text}});
    if (finding.camera >= 0) {
      summary["gross"].back()["camera"] =
          result.rig.cameras[static_cast<std::size_t>(finding.camera)].name;
    }
  }
  summary["weak"] = ordered_json::array();
  for (const calib::WeakDirection& weak : result.report.weak) {
    summary["weak"].push_back(
        {{"camera", result.rig.cameras[static_cast<std::size_t>(weak.camera)].name},
         {"direction", weak.name},
         {"unit", weak.unit},
         {"sigma", weak.sigma},
         {"by_prior", weak.by_prior},
         {"point_rms", weak.point_rms},
         {"harmless", weak.harmless},
         {"advice", weak.advice}});
  }
  summary["advice"] = result.report.advice;
  return summary;
}

}  // namespace unfurl::cli
