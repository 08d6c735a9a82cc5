#include "measure/camera_bank.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "measure/lens/lens.h"

namespace unfurl::measure {

namespace {

constexpr std::size_t kLanes = 4;  // doubles of one vector
constexpr double kTiny = 1e-150;   // keeps 0 / 0 away

// One camera's reading and slopes; the compiler makes one vector operation of four of them.
struct Lane {
  double u, gx, gy, gz, front;  // front > 0: the point is in front
};

template <typename Lens, std::size_t count>
inline Lane Evaluate(const double* k, std::size_t stride, const double* p) {
  const auto at = [&](std::size_t i) { return k[i * stride]; };
  const double dx = p[0] - at(9), dy = p[1] - at(10), dz = p[2] - at(11);
  const double X = at(0) * dx + at(1) * dy + at(2) * dz;
  const double Y = at(3) * dx + at(4) * dy + at(5) * dz;
  const double Z = at(6) * dx + at(7) * dy + at(8) * dz;
  const double far_z = Z + at(12);
  const double least_z = kLeastSlope * std::abs(X), least_far = kLeastSlope * std::abs(Y);
  const double front = std::min(Z - least_z, far_z - least_far);
  // Kept finite behind the slit, so that a camera left out spoils nothing.
  const double iz = 1.0 / std::max(Z, least_z + kTiny);
  const double iy = 1.0 / std::max(far_z, least_far + kTiny);
  const double x = X * iz, y = Y * iy;
  double terms[count];
  for (std::size_t i = 0; i < count; ++i) terms[i] = at(15 + i);
  const LensImage image = Lens::template Evaluate<count>(x, y, at(13), terms);
  const double cx = image.du_dx * iz, cy = image.du_dy * iy, cz = -(cx * x + cy * y);
  return {at(14) + image.u_px, cx * at(0) + cy * at(3) + cz * at(6),
          cx * at(1) + cy * at(4) + cz * at(7), cx * at(2) + cy * at(5) + cz * at(8), front};
}

}  // namespace

CameraBank::CameraBank(std::span<const data::RigCamera> cameras)
    : lanes_((cameras.size() + kLanes - 1) / kLanes * kLanes),
      constants_(kConstants * lanes_),
      of_lens_(Lenses::kCount * lanes_),
      present_(Lenses::kCount) {
  for (std::size_t lane = 0; lane < lanes_; ++lane) {
    const data::RigCamera& c = cameras[std::min(lane, cameras.size() - 1)];
    const auto put = [&](std::size_t i, double value) { constants_[i * lanes_ + lane] = value; };
    for (std::size_t i = 0; i < 9; ++i) put(i, c.R_CW.data()[3 * (i % 3) + i / 3]);
    for (std::size_t i = 0; i < 3; ++i) put(9 + i, c.p_WC.data()[i]);
    put(12, c.e);
    put(13, c.f_px);
    put(14, c.u0_px);
    for (std::size_t i = 0; i < c.terms_px.size(); ++i) put(15 + i, c.terms_px[i]);
    const auto lens = static_cast<std::size_t>(c.lens);
    of_lens_[lens * lanes_ + lane] = 1.0;
    present_[lens] = true;
    const std::size_t usual = Lenses::With(
        c.lens, []<typename Lens>() { return static_cast<std::size_t>(Lens::kUsualTerms); });
    usual_ = usual_ && std::all_of(c.terms_px.begin() + static_cast<std::ptrdiff_t>(usual),
                                   c.terms_px.end(), [](double term) { return term == 0.0; });
  }
}

template <typename Lens, std::size_t count>
void CameraBank::AddLens(const double* p, const double* u, const double* w, double (*sum)[4],
                         double* behind) const {
  const double* mine = &of_lens_[static_cast<std::size_t>(Lens::kModel) * lanes_];
  for (std::size_t first = 0; first < lanes_; first += kLanes) {
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const std::size_t c = first + lane;
      const Lane here = Evaluate<Lens, count>(&constants_[c], lanes_, p);
      const double weight = mine[c] * w[c], used = weight > 0.0 ? 1.0 : 0.0;
      behind[lane] += here.front > 0.0 ? 0.0 : used;
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
}

void CameraBank::Accumulate(const double* p, const double* u, const double* w, Sums* sums) const {
  double sum[16][kLanes] = {};
  double behind[kLanes] = {};
  Lenses::Each([&]<typename Lens>() {
    if (!present_[static_cast<std::size_t>(Lens::kModel)]) return;
    if (usual_) {
      AddLens<Lens, Lens::kUsualTerms>(p, u, w, sum, behind);
    } else {
      AddLens<Lens, Lens::kMonomials.size()>(p, u, w, sum, behind);
    }
  });
  const auto total = [&](std::size_t i) { return sum[i][0] + sum[i][1] + sum[i][2] + sum[i][3]; };
  for (std::size_t i = 0; i < 6; ++i) {
    sums->JwJ[i] = total(i);
    sums->JJ[i] = total(6 + i);
  }
  for (std::size_t i = 0; i < 3; ++i) sums->Jwr[i] = total(12 + i);
  sums->chi_square = total(15);
  sums->in_front = behind[0] + behind[1] + behind[2] + behind[3] == 0.0;
}

template <typename Lens>
void CameraBank::ReadLens(const double* p, double* u) const {
  const double* mine = &of_lens_[static_cast<std::size_t>(Lens::kModel) * lanes_];
  for (std::size_t c = 0; c < lanes_; ++c) {
    const Lane here = Evaluate<Lens, Lens::kMonomials.size()>(&constants_[c], lanes_, p);
    const double value = here.front > 0.0 ? here.u : std::numeric_limits<double>::quiet_NaN();
    u[c] = mine[c] != 0.0 ? value : u[c];
  }
}

void CameraBank::Readings(const double* p, double* u) const {
  Lenses::Each([&]<typename Lens>() {
    if (present_[static_cast<std::size_t>(Lens::kModel)]) ReadLens<Lens>(p, u);
  });
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
