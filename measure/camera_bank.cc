#include "measure/camera_bank.h"

#include <algorithm>
#include <limits>

namespace unfurl::measure {

namespace {

constexpr double kNearest = 0.05;  // of a point in front of the slit, as in camera_model.cc [m]
constexpr std::size_t kLanes = 4;  // doubles of one vector

static_assert(data::kCameraTerms.size() == 10, "the bank follows camera_model.cc");

// One camera's reading and slopes; the compiler makes one vector operation of four of them.
struct Lane {
  double u, gx, gy, gz, front;
};

inline Lane Evaluate(const double* k, std::size_t stride, const double* p) {
  const auto at = [&](std::size_t i) { return k[i * stride]; };
  const double dx = p[0] - at(9), dy = p[1] - at(10), dz = p[2] - at(11);
  const double X = at(0) * dx + at(1) * dy + at(2) * dz;
  const double Y = at(3) * dx + at(4) * dy + at(5) * dz;
  const double Z = at(6) * dx + at(7) * dy + at(8) * dz;
  const double far_z = Z + at(12);
  const double front = std::min(Z, far_z);
  // Kept finite behind the slit, so that a camera left out spoils nothing.
  const double iz = 1.0 / std::max(Z, kNearest), iy = 1.0 / std::max(far_z, kNearest);
  const double x = X * iz, y = Y * iy, x2 = x * x, y2 = y * y;
  const double a = at(15), b = at(16), c = at(17), d = at(18), e = at(19);
  const double q = at(20), r = at(21), s = at(22), v = at(23), w = at(24);
  const double odd = at(13) + x2 * (a + c * x2 + d * y2) + y2 * (b + e * y2);
  const double u = at(14) + x * odd + q * x2 + r * x * y + y2 * (s + w * y) + v * x2 * y;
  const double du_dx =
      odd + x2 * (2.0 * a + 4.0 * c * x2 + 2.0 * d * y2) + 2.0 * q * x + r * y + 2.0 * v * x * y;
  const double du_dy = x * (2.0 * d * x2 * y + y * (2.0 * b + 4.0 * e * y2)) + r * x +
                       y * (2.0 * s + 3.0 * w * y) + v * x2;
  const double cx = du_dx * iz, cy = du_dy * iy, cz = -(cx * x + cy * y);
  return {u, cx * at(0) + cy * at(3) + cz * at(6), cx * at(1) + cy * at(4) + cz * at(7),
          cx * at(2) + cy * at(5) + cz * at(8), front};
}

}  // namespace

CameraBank::CameraBank(std::span<const data::RigCamera> cameras)
    : lanes_((cameras.size() + kLanes - 1) / kLanes * kLanes), constants_(kConstants * lanes_) {
  for (std::size_t lane = 0; lane < lanes_; ++lane) {
    const data::RigCamera& c = cameras[std::min(lane, cameras.size() - 1)];
    const auto put = [&](std::size_t i, double value) { constants_[i * lanes_ + lane] = value; };
    for (std::size_t i = 0; i < 9; ++i) put(i, c.R_CW.data()[3 * (i % 3) + i / 3]);
    for (std::size_t i = 0; i < 3; ++i) put(9 + i, c.p_WC.data()[i]);
    put(12, c.e);
    put(13, c.f_px);
    put(14, c.u0_px);
    for (std::size_t i = 0; i < c.terms_px.size(); ++i) put(15 + i, c.terms_px[i]);
  }
}

void CameraBank::Accumulate(const double* p, const double* u, const double* w, Sums* sums) const {
  double sum[16][kLanes] = {};
  double behind[kLanes] = {};
  for (std::size_t first = 0; first < lanes_; first += kLanes) {
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const std::size_t c = first + lane;
      const Lane here = Evaluate(&constants_[c], lanes_, p);
      const double weight = w[c], used = weight > 0.0 ? 1.0 : 0.0;
      behind[lane] += here.front > kNearest ? 0.0 : used;
      const double difference = u[c] - here.u;
      const double res = weight > 0.0 ? difference : 0.0;  // NaN where there is no reading
      const double wx = weight * here.gx, wy = weight * here.gy, wz = weight * here.gz;
      sum[0][lane] += wx * here.gx;
      sum[1][lane] += wx * here.gy;
      sum[2][lane] += wx * here.gz;
      sum[3][lane] += wy * here.gy;
      sum[4][lane] += wy * here.gz;
      sum[5][lane] += wz * here.gz;
      sum[6][lane] += used * here.gx * here.gx;
      sum[7][lane] += used * here.gx * here.gy;
      sum[8][lane] += used * here.gx * here.gz;
      sum[9][lane] += used * here.gy * here.gy;
      sum[10][lane] += used * here.gy * here.gz;
      sum[11][lane] += used * here.gz * here.gz;
      sum[12][lane] += wx * res;
      sum[13][lane] += wy * res;
      sum[14][lane] += wz * res;
      sum[15][lane] += weight * res * res;
    }
  }
  const auto total = [&](std::size_t i) { return sum[i][0] + sum[i][1] + sum[i][2] + sum[i][3]; };
  for (std::size_t i = 0; i < 6; ++i) {
    sums->JwJ[i] = total(i);
    sums->JJ[i] = total(6 + i);
  }
  for (std::size_t i = 0; i < 3; ++i) sums->Jwr[i] = total(12 + i);
  sums->chi_square = total(15);
  sums->in_front = behind[0] + behind[1] + behind[2] + behind[3] == 0.0;
}

void CameraBank::Readings(const double* p, double* u) const {
  for (std::size_t c = 0; c < lanes_; ++c) {
    const Lane here = Evaluate(&constants_[c], lanes_, p);
    u[c] = here.front > kNearest ? here.u : std::numeric_limits<double>::quiet_NaN();
  }
}

void AddWeightedRows(const double* rows, std::size_t stride, const double* d, std::size_t n,
                     std::size_t count, double* row) {
  for (std::size_t j = 0; j < n; ++j) {
    const double weight = d[j];
    const double* from = rows + j * stride;
    for (std::size_t k = 0; k < count; ++k) row[k] += weight * from[k];
  }
}

void AddOuter(const double* lever, const double* row, std::size_t count, double* F) {
  for (std::size_t k = 0; k < count; ++k) {
    F[3 * k] += lever[0] * row[k];
    F[3 * k + 1] += lever[1] * row[k];
    F[3 * k + 2] += lever[2] * row[k];
  }
}

}  // namespace unfurl::measure
