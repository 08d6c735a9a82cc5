#include "sim/constraints/jacobian_entries.h"

namespace unfurl::sim {

JacobianEntries::JacobianEntries(const Model& model)
    : beams_(model.kirchhoff),
      columns_(3 * model.rigid_bodies.count),
      six_(6 * static_cast<std::size_t>(model.constraints.rows()), 0.0),
      motions_(static_cast<std::size_t>(model.kirchhoff.count())) {
  const Constraints& constraints = model.constraints;
  const int n = model.rigid_bodies.count;
  struct Place {
    int beam = -1, attachment = 0;
  };
  std::vector<Place> on_beam(static_cast<std::size_t>(n));
  for (int b = 0; b < beams_.count(); ++b) {
    const std::vector<int>& attached = beams_.beam(b).attached;
    for (std::size_t k = 0; k < attached.size(); ++k) {
      on_beam[attached[k]] = {b, static_cast<int>(k)};
    }
    const auto size = static_cast<std::size_t>(beams_.beam(b).rod.coordinates());
    motions_[b].assign(3 * size * attached.size(), 0.0);
  }
  for (int row = 0; row < constraints.rows(); ++row) {
    const int body[2] = {constraints.InnerBody(row), constraints.OuterBody(row)};
    for (int side = 0; side < 2 && constraints.IsActive(row); ++side) {
      const int six = 6 * row + 3 * side;
      const Place place = on_beam[body[side]];
      if (place.beam < 0) {
        if (!model.rigid_bodies.IsDynamic(body[side])) continue;
        for (int k = 0; k < 3; ++k) {
          rigid_.push_back({six + k, count()});
          column_.push_back(k * n + body[side]);
        }
        continue;
      }
      // No row has both its sides on one beam: its ends are apart.
      smooth_.push_back({six, count(), place.beam, place.attachment});
      AddBeam(place.beam, n);
    }
    first_.push_back(count());
  }
  value_.assign(column_.size(), 0.0);
}

void JacobianEntries::AddBeam(int beam, int n) {
  const KirchhoffBeams::Beam& b = beams_.beam(beam);
  for (int k = 0; k < 3; ++k) column_.push_back(k * n + b.root);
  for (int k = 0; k < b.rod.amplitudes(); ++k) {
    column_.push_back((k % 3) * n + b.first_amplitude() + k / 3);
  }
}

const double* JacobianEntries::At(const Dynamics& dynamics, double t, double* y) {
  dynamics.Jacobian(t, y, six_.data());
  for (const auto& [six, entry] : rigid_) value_[entry] = six_[six];
  for (int b = 0; b < beams_.count(); ++b) {
    beams_.beam(b).rod.FillMotions(dynamics.constraint_work().smooth_work.rods[b],
                                   motions_[b].data());
  }
  for (const auto& [six, entry, beam, attachment] : smooth_) {
    const KirchhoffRod& rod = beams_.beam(beam).rod;
    const int size = rod.coordinates();
    const double* motion = &motions_[beam][static_cast<std::size_t>(3 * size * attachment)];
    const double per_length = 1.0 / rod.properties().length;
    for (int i = 0; i < size; ++i) {
      const double sum = six_[six] * motion[i] + six_[six + 1] * motion[size + i] +
                         six_[six + 2] * motion[2 * size + i];
      // Two of three amplitudes are kept as lengths (KirchhoffBeams).
      value_[entry + i] = i >= 3 && i % 3 < 2 ? sum * per_length : sum;
    }
  }
  return value_.data();
}

}  // namespace unfurl::sim
