#include "measure/virtual_rig.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/random_vector.h"
#include "measure/spot_painter.h"

namespace unfurl::measure {

namespace {

// The parts without any mounting error but the lens' decentre, in focus.
LensCamera Assemble(const data::Lab& lab, const data::LabLens& lens, const data::LabSensor& sensor,
                    double decentre) {
  LensCamera camera;
  camera.slit_half_width = 0.5 * lab.slit.width;
  camera.slit_half_length = 0.5 * lab.slit.length;
  SensorRow& s = camera.sensor;
  s.pitch = sensor.format.pitch;
  s.pixels = sensor.format.active;
  s.blur = sensor.blur;
  // The image is inverted: u grows with the scene's X when the row is read from +X to -X.
  s.row = -Eigen::Vector3d::UnitX();
  s.column = Eigen::Vector3d::UnitY();
  if (!lens.traced()) {
    data::RigCamera model;
    model.pixels = s.pixels;
    model.lens = *data::FindLensModel(lens.model);
    model.f_px = lens.focal_length / s.pitch;
    model.u0_px = 0.5 * (s.pixels - 1) + decentre / s.pitch;
    model.e = lens.centres;
    for (std::size_t k = 0; k < lens.terms.size(); ++k) {
      model.terms_px[k] = model.f_px * lens.terms[k];
    }
    camera.model = model;
    camera.spot = lens.spot;
    return camera;
  }
  camera.glass.index = lens.index;
  camera.glass.half_width = 0.5 * lens.width;
  camera.glass.half_length = 0.5 * lens.length;
  // The front face bulges to +z (curvature < 0), the back one to -z.
  const double c = 1.0 / lens.radius;
  camera.glass.faces[0] = {
      .x0 = decentre, .z0 = -lab.slit.distance, .curvature = lens.curved == "back" ? 0.0 : -c};
  camera.glass.faces[1] = {.x0 = decentre,
                           .z0 = -lab.slit.distance - lens.thickness,
                           .curvature = lens.curved == "front" ? 0.0 : c};
  s.centre = {0.0, 0.0, -FocusedSensorDistance(camera, lens.focus_distance)};
  return camera;
}

Eigen::Vector3d Draw(Rng& rng, double sigma) { return sigma * NormalVector(&rng); }

}  // namespace

Pose NominalPose(const data::LabCamera& camera) {
  const Eigen::Vector3d Z = (camera.look_at - camera.position).normalized();
  const Eigen::Vector3d across = (Eigen::Vector3d::UnitX() - Z.x() * Z).normalized();
  const Eigen::Vector3d Y = Eigen::AngleAxisd(camera.roll, Z) * across;
  Pose X_WC = Pose::Identity();
  X_WC.linear() << Y.cross(Z), Y, Z;
  X_WC.translation() = camera.position;
  return X_WC;
}

VirtualRig MakeVirtualRig(const data::Lab& lab) {
  const Rng seed(lab.seed);
  VirtualRig rig;
  for (std::size_t i = 0; i < lab.cameras.size(); ++i) {
    Rng pose = seed.Stream("pose", i);
    Rng sensor = seed.Stream("sensor", i);
    const data::LabMounting& m = lab.mounting;
    LensCamera camera = Assemble(lab, lab.LensOf(i), lab.SensorOf(i),
                                 m.lens_decentre * seed.Stream("lens", i).Normal());
    camera.name = lab.cameras[i].name;
    camera.X_WC = NominalPose(lab.cameras[i]);
    camera.X_WC.translation() += Draw(pose, m.position);
    camera.X_WC.linear() *= RotationFromVector(Draw(pose, m.rotation));
    const double shift = m.sensor_shift * sensor.Normal();
    const double roll = m.sensor_roll * sensor.Normal();
    const double tilt = m.sensor_tilt * sensor.Normal();
    const Eigen::Matrix3d R =
        RotationFromVector({0.0, 0.0, roll}) * RotationFromVector({0.0, tilt, 0.0});
    camera.sensor.row = R * camera.sensor.row;
    camera.sensor.column = R * camera.sensor.column;
    camera.sensor.centre += shift * camera.sensor.row;
    if (camera.model) {  // has no sensor to turn: the row's shift is its offset
      camera.model->R_CW = camera.X_WC.linear().transpose();
      camera.model->p_WC = camera.X_WC.translation();
      camera.model->u0_px += shift / camera.sensor.pitch;
    }
    rig.cameras.push_back(camera);
    rig.patterns.push_back(DrawPattern(lab.SensorOf(i), seed.Stream("pattern", i)));
    rig.drift_phase.push_back(seed.Stream("drift", i).Uniform(0.0, 2.0 * std::numbers::pi));
  }
  rig.X_WM.translation() = lab.model.position;
  rig.X_WM.linear() = RotationFromVector({0.0, 0.0, lab.model.yaw}) *
                      RotationFromVector({lab.model.tilt[0], lab.model.tilt[1], 0.0});
  rig.mains_phase = seed.Stream("mains").Uniform(0.0, 2.0 * std::numbers::pi);
  rig.lead = seed.Stream("lead").Uniform(lab.strobe.lead[0], lab.strobe.lead[1]);

  // The LED's intensity follows from the pixel that it shall fill.
  const LensCamera ideal = Assemble(lab, lab.lens, lab.sensor, 0.0);
  std::vector<double> pixels(static_cast<std::size_t>(ideal.sensor.pixels), 0.0);
  SpotLight spot;
  TraceSpot(ideal, {0.0, 0.0, lab.lens.focus_distance}, &spot);
  SpotPainter(ideal.sensor.blur / ideal.sensor.pitch).Add(spot, 1.0, pixels);
  rig.flash_electrons =
      lab.led.peak * lab.sensor.full_well / *std::max_element(pixels.begin(), pixels.end());
  rig.survey_electrons = rig.flash_electrons * lab.led.survey_flash / lab.led.flash;
  return rig;
}

}  // namespace unfurl::measure
