#include "sim/constraints/joint_rows.h"

namespace unfurl::sim {
namespace {

// Of what a drive or a slot asks for [m/s^2], [rad/s^2].
double Acceleration(const data::TimeFunction& target, const Motion& m) {
  return m.held ? 0.0 : target.At(m.t).acceleration;
}

}  // namespace

int JointRows::Inner(int row) const {
  if (row < first_along()) return pins[row / 2].inner;
  if (row < first_angle()) return alongs[row - first_along()].inner;
  return angles[row - first_angle()].inner;
}

int JointRows::Outer(int row) const {
  if (row < first_along()) return pins[row / 2].outer;
  if (row < first_angle()) return alongs[row - first_along()].outer;
  return angles[row - first_angle()].outer;
}

const std::string& JointRows::NameOf(int row) const {
  if (row < first_along()) return pins[row / 2].name;
  if (row < first_angle()) return alongs[row - first_along()].name;
  return angles[row - first_angle()].name;
}

bool JointRows::driven() const {
  for (const Along& a : alongs) {
    if (!a.target.is_constant()) return true;
  }
  for (const Angle& a : angles) {
    if (!a.target.is_constant()) return true;
  }
  return false;
}

bool JointRows::IsDrive(int row) const {
  if (row < first_along()) return false;
  if (row < first_angle()) return alongs[row - first_along()].drive;
  return angles[row - first_angle()].drive;
}

void JointRows::FillGeometry(const Motion& m, double* g, double* jacobian) const {
  for (const Pin& pin : pins) {
    const double ci = m.c[pin.inner], si = m.s[pin.inner];
    const double co = m.c[pin.outer], so = m.s[pin.outer];
    g[0] = ci * pin.ix - si * pin.iy;
    g[1] = si * pin.ix + ci * pin.iy;
    g[2] = co * pin.ox - so * pin.oy;
    g[3] = so * pin.ox + co * pin.oy;
    if (jacobian != nullptr) {
      const double rows[12] = {-1, 0, g[1], 1, 0, -g[3], 0, -1, -g[0], 0, 1, g[2]};
      for (int k = 0; k < 12; ++k) jacobian[k] = rows[k];
      jacobian += 12;
    }
    g += 4;
  }
  for (const Along& a : alongs) {
    const double ci = m.c[a.inner], si = m.s[a.inner];
    const double co = m.c[a.outer], so = m.s[a.outer];
    const double ex = ci * a.ax - si * a.ay, ey = si * a.ax + ci * a.ay;
    const double px = ci * a.ix - si * a.iy, py = si * a.ix + ci * a.iy;
    const double qx = co * a.ox - so * a.oy, qy = so * a.ox + co * a.oy;
    const double dx = m.x[a.outer] + qx - m.x[a.inner] - px;
    const double dy = m.y[a.outer] + qy - m.y[a.inner] - py;
    const double values[8] = {ex, ey, px, py, qx, qy, dx, dy};
    for (int k = 0; k < 8; ++k) g[k] = values[k];
    g += 8;
    if (jacobian != nullptr) {
      jacobian[0] = -a.sign * ex;
      jacobian[1] = -a.sign * ey;
      // -e.p_perp + e_perp.r, with p_perp = (-py, px).
      jacobian[2] = a.sign * (ex * (py + dy) - ey * (px + dx));
      jacobian[3] = a.sign * ex;
      jacobian[4] = a.sign * ey;
      jacobian[5] = a.sign * (ey * qx - ex * qy);
      jacobian += 6;
    }
  }
  if (jacobian == nullptr) return;
  for (const Angle& a : angles) {
    const double row[6] = {0, 0, -a.sign, 0, 0, a.sign};
    for (int k = 0; k < 6; ++k) jacobian[k] = row[k];
    jacobian += 6;
  }
}

void JointRows::Residual(const Motion& m, const double* g, const double* jacobian, const double* ax,
                         const double* ay, const double* alpha, double* b) const {
  for (const Pin& pin : pins) {
    const double wi2 = m.omega[pin.inner] * m.omega[pin.inner], ai = alpha[pin.inner];
    const double wo2 = m.omega[pin.outer] * m.omega[pin.outer], ao = alpha[pin.outer];
    b[0] = wo2 * g[2] - wi2 * g[0] - (ax[pin.outer] - ao * g[3] - ax[pin.inner] + ai * g[1]);
    b[1] = wo2 * g[3] - wi2 * g[1] - (ay[pin.outer] + ao * g[2] - ay[pin.inner] - ai * g[0]);
    b += 2;
    g += 4;
    jacobian += 12;
  }
  const auto minus_Ja = [&](int i, int o) {
    return -(jacobian[0] * ax[i] + jacobian[1] * ay[i] + jacobian[2] * alpha[i] +
             jacobian[3] * ax[o] + jacobian[4] * ay[o] + jacobian[5] * alpha[o]);
  };
  for (const Along& a : alongs) {
    const double wi = m.omega[a.inner], wo = m.omega[a.outer];
    const double ex = g[0], ey = g[1], px = g[2], py = g[3], qx = g[4], qy = g[5];
    const double rx = m.vx[a.outer] - wo * qy - m.vx[a.inner] + wi * py;
    const double ry = m.vy[a.outer] + wo * qx - m.vy[a.inner] - wi * px;
    const double centripetal =
        wi * wi * (ex * (px - g[6]) + ey * (py - g[7])) - wo * wo * (ex * qx + ey * qy);
    const double coriolis = 2.0 * wi * (ex * ry - ey * rx);
    *b++ =
        Acceleration(a.target, m) - a.sign * (centripetal + coriolis) + minus_Ja(a.inner, a.outer);
    g += 8;
    jacobian += 6;
  }
  for (const Angle& a : angles) {
    *b++ = Acceleration(a.target, m) - a.sign * (alpha[a.outer] - alpha[a.inner]);
  }
}

void JointRows::AddLoad(const double* g, const double* jacobian, const double* lambda, double* fx,
                        double* fy, double* m) const {
  for (const Pin& pin : pins) {
    const double lx = lambda[0], ly = lambda[1];
    fx[pin.inner] -= lx;
    fy[pin.inner] -= ly;
    m[pin.inner] -= g[0] * ly - g[1] * lx;
    fx[pin.outer] += lx;
    fy[pin.outer] += ly;
    m[pin.outer] += g[2] * ly - g[3] * lx;
    lambda += 2;
    g += 4;
    jacobian += 12;
  }
  for (const Along& a : alongs) {
    fx[a.inner] += jacobian[0] * *lambda;
    fy[a.inner] += jacobian[1] * *lambda;
    m[a.inner] += jacobian[2] * *lambda;
    fx[a.outer] += jacobian[3] * *lambda;
    fy[a.outer] += jacobian[4] * *lambda;
    m[a.outer] += jacobian[5] * *lambda;
    ++lambda;
    jacobian += 6;
  }
  for (const Angle& a : angles) {
    m[a.inner] -= a.sign * *lambda;
    m[a.outer] += a.sign * *lambda;
    ++lambda;
  }
}

void JointRows::Positions(const Motion& m, const double* g, double* phi) const {
  for (const Pin& pin : pins) {
    phi[0] = m.x[pin.outer] + g[2] - m.x[pin.inner] - g[0];
    phi[1] = m.y[pin.outer] + g[3] - m.y[pin.inner] - g[1];
    phi += 2;
    g += 4;
  }
  for (const Along& a : alongs) {
    *phi++ = a.sign * (g[0] * g[6] + g[1] * g[7]) - a.target.At(m.t).value;
    g += 8;
  }
  for (const Angle& a : angles) {
    *phi++ = a.sign * (m.theta[a.outer] - m.theta[a.inner] - a.zero) - a.target.At(m.t).value;
  }
}

void JointRows::Velocities(const Motion& m, const double* g, const double* jacobian,
                           double* rate) const {
  for (const Pin& pin : pins) {
    const double wi = m.omega[pin.inner], wo = m.omega[pin.outer];
    rate[0] = m.vx[pin.outer] - wo * g[3] - m.vx[pin.inner] + wi * g[1];
    rate[1] = m.vy[pin.outer] + wo * g[2] - m.vy[pin.inner] - wi * g[0];
    rate += 2;
    g += 4;
    jacobian += 12;
  }
  for (const Along& a : alongs) {
    *rate++ = jacobian[0] * m.vx[a.inner] + jacobian[1] * m.vy[a.inner] +
              jacobian[2] * m.omega[a.inner] + jacobian[3] * m.vx[a.outer] +
              jacobian[4] * m.vy[a.outer] + jacobian[5] * m.omega[a.outer] - a.target.At(m.t).rate;
    jacobian += 6;
  }
  for (const Angle& a : angles) {
    *rate++ = a.sign * (m.omega[a.outer] - m.omega[a.inner]) - a.target.At(m.t).rate;
  }
}

double JointRows::DrivePower(double t, const double* lambda) const {
  double power = 0.0;
  lambda += first_along();
  for (const Along& a : alongs) power += *lambda++ * a.target.At(t).rate;
  for (const Angle& a : angles) power += *lambda++ * a.target.At(t).rate;
  return power;
}

}  // namespace unfurl::sim
