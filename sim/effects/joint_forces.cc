#include "sim/effects/joint_forces.h"

namespace unfurl::sim {

JointForces::JointForces(const Model& model) : model_(model), rows_(model.joints.size()) {
  const JointRows& all = model.constraints.joints();
  const int first_along = static_cast<int>(2 * all.pins.size());
  const int first_angle = first_along + static_cast<int>(all.alongs.size());
  // Each kind of rows is in the order of the joints.
  std::size_t pin = 0, along = 0, angle = 0;
  for (std::size_t j = 0; j < rows_.size(); ++j) {
    const Model::Joint& joint = model.joints[j];
    Rows& rows = rows_[j];
    const auto next = [&](const auto& list, std::size_t* at) {
      return *at < list.size() && list[*at].name == joint.name ? static_cast<int>((*at)++) : -1;
    };
    const int p = next(all.pins, &pin);
    if (p >= 0) rows.pin = 2 * p;
    if (joint.coordinate.travel) {
      const int normal = next(all.alongs, &along), drive = next(all.alongs, &along);
      if (normal >= 0) rows.normal = first_along + normal;
      if (drive >= 0) rows.drive = first_along + drive;
      const int hold = next(all.angles, &angle);
      if (hold >= 0) rows.hold = first_angle + hold;
    } else {
      const int drive = next(all.angles, &angle);
      if (drive >= 0) rows.drive = first_angle + drive;
    }
  }
}

JointForces::Force JointForces::Of(int joint, const Motion& m, const double* lambda) const {
  const Rows& rows = rows_[static_cast<std::size_t>(joint)];
  Force force;
  if (rows.pin >= 0) {
    force.fx = lambda[rows.pin];
    force.fy = lambda[rows.pin + 1];
  }
  if (rows.normal >= 0) {
    // The row's gradient with respect to outer's point is sign e.
    const JointRows& all = model_.constraints.joints();
    const JointRows::Along& a =
        all.alongs[static_cast<std::size_t>(rows.normal) - 2 * all.pins.size()];
    const double f = a.sign * lambda[rows.normal];
    force.fx += f * (m.c[a.inner] * a.ax - m.s[a.inner] * a.ay);
    force.fy += f * (m.s[a.inner] * a.ax + m.c[a.inner] * a.ay);
  }
  if (rows.hold >= 0) {
    // The row's gradient with respect to outer's angle is its sign.
    const JointRows& all = model_.constraints.joints();
    const std::size_t first = 2 * all.pins.size() + all.alongs.size();
    force.hold = all.angles[static_cast<std::size_t>(rows.hold) - first].sign * lambda[rows.hold];
  }
  if (rows.drive >= 0) force.drive = lambda[rows.drive];
  return force;
}

}  // namespace unfurl::sim
