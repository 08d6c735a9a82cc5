#include "sim/kirchhoff/kirchhoff.h"

#include <algorithm>
#include <cmath>

#include "sim/dynamics/trigonometry.h"

namespace unfurl::sim {
namespace {

// Lanes of the sums over points.
constexpr int kKirchhoffLanes = 4;

}  // namespace

KirchhoffRod::KirchhoffRod(const Properties& properties, std::vector<Attachment> attachments,
                           const Strings& strings)
    : properties_(properties),
      shapes_(properties.modes, properties.ends, properties.section,
              properties.EA > 0.0 ? KirchhoffShapes::StretchesFor(properties.modes) : 0),
      attachments_(std::move(attachments)),
      strings_(strings),
      hang_cosine_(std::cos(strings.angle)),
      hang_sine_(std::sin(strings.angle)),
      total_mass_(properties.mass),
      kernel_(shapes_.kernel),
      stiffness_(shapes_.stiffness),
      stations_(PaddedSize(shapes_.points + static_cast<int>(attachments_.size()))),
      column_(shapes_.width * stations_, 0.0) {
  const double L = properties.length;
  for (double& k : kernel_) k *= properties.mass * L * L;
  for (int k = 0; k < shapes_.width; ++k) {
    stiffness_[k] *= k <= shapes_.bends ? properties.EI / L : properties.EA * L;
  }
  for (int q = 0; q < shapes_.points; ++q) {
    for (int k = 0; k < shapes_.width; ++k) {
      column_[k * stations_ + q] = shapes_.shape[q * shapes_.width + k];
    }
  }
  int station = shapes_.points;
  for (const Attachment& attachment : attachments_) {
    for (const double w : shapes_.Arm(attachment.at)) arm_.push_back(L * w);
    const Array shape = shapes_.ShapesAt(attachment.at);
    attached_shape_.insert(attached_shape_.end(), shape.begin(), shape.end());
    for (int k = 0; k < shapes_.width; ++k) column_[k * stations_ + station] = shape[k];
    ++station;
    total_mass_ += attachment.mass;
    bodies_ = bodies_ || attachment.mass > 0.0 || attachment.inertia > 0.0;
  }
}

KirchhoffRod::Work KirchhoffRod::MakeWork() const {
  Work w;
  const int points = PaddedSize(shapes_.points), width = shapes_.width;
  const int attached = static_cast<int>(attachments_.size());
  w.theta = w.cosine = w.sine = w.rate = Array(stations_, 0.0);
  w.a = w.a_rate = w.alpha = w.inverse = w.centre_x = w.centre_y = Array(width, 0.0);
  w.products = Array(shapes_.points * shapes_.points, 0.0);
  w.push = Array(4 * points, 0.0);
  w.jx = w.jy = Array(attached * width, 0.0);
  w.system = Array(width * row(), 0.0);
  w.factor = Array(width * width, 0.0);
  w.frame.resize(attached);
  w.bias.assign(2 * attached, 0.0);
  w.offset.assign(2 * attached, 0.0);
  if (stretches()) {
    w.stretch = w.stretch_rate = Array(points, 0.0);
    w.turn_x = w.turn_y = Array(shapes_.points * width, 0.0);
  }
  return w;
}

void KirchhoffRod::Update(const double* q, const double* rate, Work* work) const {
  const int points = shapes_.points, used = shapes_.count + 1, stations = stations_;
  std::copy_n(q + 2, used, work->a.data());
  std::copy_n(rate + 2, used, work->a_rate.data());
  double* __restrict theta = work->theta.data();
  double* __restrict spin = work->rate.data();
  std::fill_n(theta, stations, work->a[0]);
  std::fill_n(spin, stations, work->a_rate[0]);
  for (int k = 1; k < used; ++k) {
    const double a = work->a[k], a_rate = work->a_rate[k];
    const double* __restrict column = &column_[k * stations];
    for (int p = 0; p < stations; p += kBlock) {
      for (int l = 0; l < kBlock; ++l) {
        theta[p + l] += a * column[p + l];
        spin[p + l] += a_rate * column[p + l];
      }
    }
  }
  double* __restrict c = work->cosine.data();
  double* __restrict s = work->sine.data();
  SinCos(theta, stations, s, c);
  if (stretches()) return UpdateStretched(q, rate, work);
  for (std::size_t b = 0; b < attachments_.size(); ++b) {
    const double* __restrict arm = &arm_[b * points];
    double sums[6][kKirchhoffLanes] = {};
    for (int p = 0; p < points; p += kKirchhoffLanes) {
      for (int l = 0; l < kKirchhoffLanes; ++l) {
        const double w = spin[p + l], ac = arm[p + l] * c[p + l], as = arm[p + l] * s[p + l];
        sums[0][l] += ac;
        sums[1][l] += as;
        sums[2][l] += ac * w;
        sums[3][l] += as * w;
        sums[4][l] += ac * w * w;
        sums[5][l] += as * w * w;
      }
    }
    double sum[6];
    for (int k = 0; k < 6; ++k) sum[k] = (sums[k][0] + sums[k][1]) + (sums[k][2] + sums[k][3]);
    const Attachment& at = attachments_[b];
    const double omega = spin[points + b], ca = c[points + b], sa = s[points + b];
    const double ox = ca * at.px - sa * at.py, oy = sa * at.px + ca * at.py;
    work->frame[b] = {q[0] + sum[0] + ox,
                      q[1] + sum[1] + oy,
                      theta[points + b] + at.angle,
                      rate[0] - sum[3] - omega * oy,
                      rate[1] + sum[2] + omega * ox,
                      omega};
    work->bias[2 * b] = -sum[4] - omega * omega * ox;
    work->bias[2 * b + 1] = -sum[5] - omega * omega * oy;
    work->offset[2 * b] = ox;
    work->offset[2 * b + 1] = oy;
  }
}

void KirchhoffRod::FillProducts(Work* work) const {
  const int points = shapes_.points;
  const double* __restrict c = work->cosine.data();
  const double* __restrict s = work->sine.data();
  for (int a = 0; a < points; ++a) {
    const double ca = c[a], sa = s[a];
    const double* __restrict kernel = &kernel_[a * points];
    double* __restrict out = &work->products[a * points];
    for (int b = 0; b < points; ++b) out[b] = kernel[b] * (ca * c[b] + sa * s[b]);
  }
}

double KirchhoffRod::KineticAboutCentre(Work* work) const {
  if (stretches()) return StretchedKinetic(*work);
  FillProducts(work);
  const int points = shapes_.points;
  double sum = 0.0;
  for (int a = 0; a < points; ++a) {
    for (int b = 0; b < points; ++b) {
      sum += work->products[a * points + b] * work->rate[a] * work->rate[b];
    }
  }
  return 0.5 * sum;
}

double KirchhoffRod::AngularMomentum(Work* work) const {
  if (stretches()) return StretchedMomentum(*work);
  FillProducts(work);
  const int points = shapes_.points;
  double sum = 0.0;
  for (int a = 0; a < points; ++a) {
    for (int b = 0; b < points; ++b) sum += work->products[a * points + b] * work->rate[b];
  }
  return sum;
}

double KirchhoffRod::Bending(const Work& work) const {
  double sum = 0.0;
  for (int k = 1; k <= shapes_.bends; ++k) sum += stiffness_[k] * work.a[k] * work.a[k];
  return 0.5 * sum;
}

double KirchhoffRod::OfStrings(const Work& work) const {
  const int points = shapes_.points;
  const auto lambda = [&](int p) { return stretches() ? work.stretch[p] : 1.0; };
  double sum = 0.0;
  for (int a = 0; a < points; ++a) {
    const double xa = lambda(a) * work.cosine[a] - hang_cosine_;
    const double ya = lambda(a) * work.sine[a] - hang_sine_;
    for (int b = 0; b < points; ++b) {
      const double xb = lambda(b) * work.cosine[b] - hang_cosine_;
      const double yb = lambda(b) * work.sine[b] - hang_sine_;
      sum += kernel_[a * points + b] * (xa * xb + ya * yb);
    }
  }
  return 0.5 * strings_.gravity_per_length * sum;
}

KirchhoffRod::Frame KirchhoffRod::At(const Place& place, const double* q,
                                     const double* rate) const {
  return stretches() ? StretchedAt(place, q, rate) : BentAt(place, q, rate);
}

KirchhoffRod::Frame KirchhoffRod::BentAt(const Place& place, const double* q,
                                         const double* rate) const {
  Frame frame{q[0], q[1], 0.0, rate[0], rate[1], 0.0};
  for (int p = 0; p < shapes_.points; ++p) {
    double theta = 0.0, spin = 0.0;
    for (int k = 0; k <= shapes_.count; ++k) {
      theta += column_[k * stations_ + p] * q[2 + k];
      spin += column_[k * stations_ + p] * rate[2 + k];
    }
    const double w = properties_.length * place.arm[p];
    const double c = std::cos(theta), s = std::sin(theta);
    frame.x += w * c;
    frame.y += w * s;
    frame.vx -= w * s * spin;
    frame.vy += w * c * spin;
  }
  for (int k = 0; k <= shapes_.count; ++k) {
    frame.theta += place.shape[k] * q[2 + k];
    frame.omega += place.shape[k] * rate[2 + k];
  }
  return frame;
}

double KirchhoffRod::Curvature(double at, const double* q) const {
  double slope = 0.0;
  for (int k = 1; k <= shapes_.count; ++k) slope += shapes_.Slope(k, at) * q[2 + k];
  return slope / properties_.length;
}

}  // namespace unfurl::sim
