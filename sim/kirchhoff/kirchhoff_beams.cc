#include "sim/kirchhoff/kirchhoff_beams.h"

#include <algorithm>

namespace unfurl::sim {
namespace {

// Calls f(k, block, body, scale) for each amplitude: what stands in the body's block is scale a_k.
template <typename F>
void EachAmplitude(const KirchhoffBeams::Beam& beam, F f) {
  const double length = beam.rod.properties().length;
  const int count = beam.rod.amplitudes();
  for (int k = 0; k < count; ++k) {
    f(k, k % 3, beam.first_amplitude() + k / 3, k % 3 < 2 ? length : 1.0);
  }
}

}  // namespace

bool KirchhoffBeams::damped() const {
  return std::any_of(beams_.begin(), beams_.end(),
                     [](const Beam& b) { return b.rod.properties().damping > 0.0; });
}

bool KirchhoffBeams::stretches() const {
  return std::any_of(beams_.begin(), beams_.end(), [](const Beam& b) { return b.rod.stretches(); });
}

void KirchhoffBeams::Add(Beam beam) {
  const int rows = 3 * static_cast<int>(beam.attached.size());
  compliance_at_.push_back(compliance_size_);
  free_at_.push_back(free_size_);
  compliance_size_ += rows * rows;
  free_size_ += rows;
  beams_.push_back(std::move(beam));
}

int KirchhoffBeams::Watch(int beam, double at) {
  watched_.push_back({beam, beams_[beam].rod.PlaceAt(at)});
  return static_cast<int>(watched_.size()) - 1;
}

KirchhoffBeams::Work KirchhoffBeams::MakeWork() const {
  Work work;
  std::size_t rows = 0;
  for (const Beam& beam : beams_) {
    work.rods.push_back(beam.rod.MakeWork());
    rows = std::max(rows, 3 * beam.attached.size());
  }
  work.q = work.rate = Array(KirchhoffShapes::kMostShapes + 3, 0.0);
  work.load = Array(rows, 0.0);
  work.free = Array(free_size_, 0.0);
  work.compliance = Array(compliance_size_, 0.0);
  return work;
}

void KirchhoffBeams::Gather(const Beam& beam, const double* x, const double* y, const double* theta,
                            double* q) {
  const double* block[3] = {x, y, theta};
  const double inverse_length = 1.0 / beam.rod.properties().length;
  const int count = beam.rod.amplitudes();
  q[0] = x[beam.root];
  q[1] = y[beam.root];
  q[2] = theta[beam.root];
  for (int k = 0; k < count; ++k) {
    const double stored = block[k % 3][beam.first_amplitude() + k / 3];
    q[3 + k] = k % 3 < 2 ? stored * inverse_length : stored;
  }
}

void KirchhoffBeams::Update(double* x, double* y, double* theta, double* vx, double* vy,
                            double* omega, Work* work) const {
  for (std::size_t b = 0; b < beams_.size(); ++b) {
    const Beam& beam = beams_[b];
    Gather(beam, x, y, theta, work->q.data());
    Gather(beam, vx, vy, omega, work->rate.data());
    KirchhoffRod::Work& rod = work->rods[b];
    beam.rod.Update(work->q.data(), work->rate.data(), &rod);
    for (std::size_t k = 0; k < beam.attached.size(); ++k) {
      const KirchhoffRod::Frame& f = rod.frame[k];
      const int body = beam.attached[k];
      x[body] = f.x;
      y[body] = f.y;
      theta[body] = f.theta;
      vx[body] = f.vx;
      vy[body] = f.vy;
      omega[body] = f.omega;
    }
  }
}

void KirchhoffBeams::Solve(Load load, Work* work, double* ax, double* ay, double* alpha) const {
  work->power = 0.0;
  for (std::size_t b = 0; b < beams_.size(); ++b) {
    const Beam& beam = beams_[b];
    double* on = work->load.data();
    for (const int body : beam.attached) {
      *on++ = load.fx[body];
      *on++ = load.fy[body];
      *on++ = load.m[body];
    }
    const double centre[2] = {load.fx[beam.root], load.fy[beam.root]};
    double* free = work->free.data() + free_at_[b];
    beam.rod.Solve(centre, work->load.data(), &work->rods[b], free,
                   work->compliance.data() + compliance_at_[b], &work->power);
    for (const int body : beam.attached) {
      ax[body] = free[0];
      ay[body] = free[1];
      alpha[body] = free[2];
      free += 3;
    }
  }
}

double KirchhoffBeams::Mobility(const Work& work, int body) const {
  for (std::size_t b = 0; b < beams_.size(); ++b) {
    const std::vector<int>& attached = beams_[b].attached;
    const auto found = std::find(attached.begin(), attached.end(), body);
    if (found == attached.end()) continue;
    const auto angle = 3 * static_cast<std::size_t>(found - attached.begin()) + 2;
    const std::size_t at = static_cast<std::size_t>(compliance_at_[b]);
    return work.compliance[at + angle * (3 * attached.size() + 1)];
  }
  return 0.0;
}

void KirchhoffBeams::Accelerate(const double* fx, const double* fy, const double* m, Work* work,
                                double* ax, double* ay, double* alpha) const {
  double* block[3] = {ax, ay, alpha};
  for (std::size_t b = 0; b < beams_.size(); ++b) {
    const Beam& beam = beams_[b];
    double* on = work->load.data();
    for (const int body : beam.attached) {
      *on++ = fx[body];
      *on++ = fy[body];
      *on++ = m[body];
    }
    const int rows = 3 * static_cast<int>(beam.attached.size());
    double* q = work->q.data();
    beam.rod.Accelerate(work->load.data(), &work->rods[b], q);
    ax[beam.root] = q[0];
    ay[beam.root] = q[1];
    alpha[beam.root] = q[2];
    EachAmplitude(beam,
                  [&](int k, int c, int body, double scale) { block[c][body] = scale * q[3 + k]; });
    const double* free = work->free.data() + free_at_[b];
    const double* answer = work->compliance.data() + compliance_at_[b];
    for (const int body : beam.attached) {
      for (int c = 0; c < 3; ++c) {
        double sum = *free++;
        for (int j = 0; j < rows; ++j) sum += answer[j] * work->load[j];
        answer += rows;
        block[c][body] = sum;
      }
    }
  }
}

void KirchhoffBeams::Respond(const double* fx, const double* fy, const double* m, Work* work,
                             double* x, double* y, double* theta) const {
  double* block[3] = {x, y, theta};
  for (std::size_t b = 0; b < beams_.size(); ++b) {
    const Beam& beam = beams_[b];
    double* on = work->load.data();
    for (const int body : beam.attached) {
      *on++ = fx[body];
      *on++ = fy[body];
      *on++ = m[body];
    }
    double* change = work->q.data();
    beam.rod.Respond(work->load.data(), &work->rods[b], change);
    x[beam.root] -= change[0];
    y[beam.root] -= change[1];
    theta[beam.root] -= change[2];
    EachAmplitude(beam, [&](int k, int c, int body, double scale) {
      block[c][body] -= scale * change[3 + k];
    });
  }
}

double KirchhoffBeams::KineticAboutCentres(Work* work) const {
  double sum = 0.0;
  for (std::size_t b = 0; b < beams_.size(); ++b) {
    sum += beams_[b].rod.KineticAboutCentre(&work->rods[b]);
  }
  return sum;
}

double KirchhoffBeams::AngularMomentum(Work* work) const {
  double sum = 0.0;
  for (std::size_t b = 0; b < beams_.size(); ++b) {
    sum += beams_[b].rod.AngularMomentum(&work->rods[b]);
  }
  return sum;
}

double KirchhoffBeams::Bending(const Work& work) const {
  double sum = 0.0;
  for (std::size_t b = 0; b < beams_.size(); ++b) sum += beams_[b].rod.Bending(work.rods[b]);
  return sum;
}

double KirchhoffBeams::Stretching(const Work& work) const {
  double sum = 0.0;
  for (std::size_t b = 0; b < beams_.size(); ++b) sum += beams_[b].rod.Stretching(work.rods[b]);
  return sum;
}

double KirchhoffBeams::OfStrings(const Work& work) const {
  double sum = 0.0;
  for (std::size_t b = 0; b < beams_.size(); ++b) sum += beams_[b].rod.OfStrings(work.rods[b]);
  return sum;
}

KirchhoffRod::Frame KirchhoffBeams::FrameAt(int b, const KirchhoffRod::Place& place,
                                            const Motion& m) const {
  double q[KirchhoffShapes::kMostShapes + 3], rate[KirchhoffShapes::kMostShapes + 3];
  Gather(beams_[b], m.x, m.y, m.theta, q);
  Gather(beams_[b], m.vx, m.vy, m.omega, rate);
  return beams_[b].rod.At(place, q, rate);
}

double KirchhoffBeams::StrainAt(int b, double at, const Motion& m) const {
  double q[KirchhoffShapes::kMostShapes + 3];
  Gather(beams_[b], m.x, m.y, m.theta, q);
  return beams_[b].rod.Strain(at, q);
}

KirchhoffRod::Frame KirchhoffBeams::MotionAt(int watched, const double* state, int n) const {
  const Watched& w = watched_[watched];
  double q[KirchhoffShapes::kMostShapes + 3], rate[KirchhoffShapes::kMostShapes + 3];
  Gather(beams_[w.beam], state, state + n, state + 2 * n, q);
  Gather(beams_[w.beam], state + 3 * n, state + 4 * n, state + 5 * n, rate);
  return beams_[w.beam].rod.At(w.place, q, rate);
}

}  // namespace unfurl::sim
