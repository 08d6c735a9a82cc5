#include "measure/lens_camera.h"

#include <algorithm>
#include <cmath>

#include "measure/camera_model.h"

namespace unfurl::measure {

namespace {

// The ray behind the lens.
bool TraceGlass(const LensCamera& camera, const Eigen::Vector3d& p_C, double x, double y, Ray* ray,
                double* transmission) {
  const Glass& glass = camera.glass;
  ray->origin = {x, y, 0.0};
  ray->direction = (ray->origin - p_C).normalized();
  *transmission = 1.0;
  double n1 = 1.0;
  double n2 = glass.index;
  for (const Surface& face : glass.faces) {
    Eigen::Vector3d hit, normal, refracted;
    if (!face.Intersect(*ray, &hit, &normal)) return false;
    if (std::abs(hit.x() - face.x0) > glass.half_width || std::abs(hit.y()) > glass.half_length) {
      return false;
    }
    if (!Refract(ray->direction, normal, n1, n2, &refracted)) return false;
    *transmission *=
        Transmission(std::abs(ray->direction.dot(normal)), std::abs(refracted.dot(normal)), n1, n2);
    ray->origin = hit;
    ray->direction = refracted;
    std::swap(n1, n2);
  }
  return true;
}

// Further out than any tail of the blur reaches, the row sees nothing.
bool OnRow(double u_px, int pixels) { return u_px > -50.0 && u_px < pixels + 49.0; }

// Whether light from p_W, seen by way of the path's mirror, reaches the slit's point s_W.
bool Reaches(const LightPath& path, const Eigen::Vector3d& p_W, const Eigen::Vector3d& s_W) {
  Eigen::Vector3d from = p_W, hit;
  if (path.mirror != nullptr) {
    if (!path.mirror->Crosses(path.mirror->Mirrored(p_W), s_W, &from)) return false;
    for (const Disc& disc : path.occluders) {
      if (disc.Crosses(p_W, from, &hit)) return false;
    }
  }
  for (const Disc& disc : path.occluders) {
    if (disc.Crosses(from, s_W, &hit)) return false;
  }
  return true;
}

// By the model's formula: one bundle, spread evenly. Its flux falls off as that of a slit does,
//   width x height x Z / r^3  [sr].
bool ImageSpot(const LensCamera& camera, const Eigen::Vector3d& p_W, SpotLight* spot,
               const LightPath* path) {
  const Eigen::Vector3d s_W = camera.model->p_WC;
  if (path != nullptr && !Reaches(*path, p_W, s_W)) return false;
  const bool mirrored = path != nullptr && path->mirror != nullptr;
  const Eigen::Vector3d seen_W = mirrored ? path->mirror->Mirrored(p_W) : p_W;
  double u = 0.0;
  if (!Project(*camera.model, seen_W, &u)) return false;
  const Eigen::Vector3d p_C = camera.model->R_CW * (seen_W - s_W);
  const double r = p_C.norm(), half = 0.5 * camera.spot / camera.sensor.pitch;
  spot->flux = 2.0 * camera.slit_half_width * camera.sensor.pitch * p_C.z() / (r * r * r);
  spot->bundles[0] = {u - half, u + half, spot->flux};
  spot->count = 1;
  spot->centre_px = u;
  spot->sigma_px = half / std::sqrt(3.0);
  return OnRow(u, camera.sensor.pixels);
}

}  // namespace

bool Disc::Crosses(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                   Eigen::Vector3d* where) const {
  const double side_a = normal.dot(a - centre), side_b = normal.dot(b - centre);
  if (side_a * side_b >= 0.0) return false;
  *where = a + side_a / (side_a - side_b) * (b - a);
  return (*where - centre).squaredNorm() <= radius * radius;
}

Eigen::Vector3d Disc::Mirrored(const Eigen::Vector3d& p) const {
  return p - 2.0 * normal.dot(p - centre) * normal;
}

bool TraceThroughSlit(const LensCamera& camera, const Eigen::Vector3d& p_C, double x, double y,
                      Landing* landing) {
  Ray ray;
  if (!TraceGlass(camera, p_C, x, y, &ray, &landing->transmission)) return false;
  const SensorRow& s = camera.sensor;
  const Eigen::Vector3d normal = s.row.cross(s.column);
  const double t = normal.dot(s.centre - ray.origin) / normal.dot(ray.direction);
  const Eigen::Vector3d offset = ray.origin + t * ray.direction - s.centre;
  landing->u = 0.5 * (s.pixels - 1) + offset.dot(s.row) / s.pitch;
  landing->across = offset.dot(s.column);
  return true;
}

namespace {

// A ray that reaches the row, and how far it lands across the row per metre along the slit.
struct RowRay {
  double y = 0.0;      // of its point in the slit [m]
  double slope = 0.0;  // [-]
  Landing landing;
};

// Newton's method for the point along the slit, at `x` across it, whose ray meets the row; from
// ray->y, with one slope for all steps.
bool FindRowRay(const LensCamera& camera, const Eigen::Vector3d& p_C, double x, RowRay* ray) {
  // With one slope an error shrinks in each step by the slope's relative error. A quarter suffices
  // to get from the slit's length to the tolerance, some 1e-7 of it.
  constexpr int kMaxSteps = 12;
  const double tolerance = 1e-4 * camera.sensor.pitch;   // of where a ray meets the row [m]
  const double step_y = 3e-3 * camera.slit_half_length;  // for the derivative along the slit [m]
  Landing beside;
  ray->slope = 0.0;
  for (int step = 0; step < kMaxSteps; ++step) {
    if (!TraceThroughSlit(camera, p_C, x, ray->y, &ray->landing)) return false;
    if (ray->slope == 0.0) {
      if (!TraceThroughSlit(camera, p_C, x, ray->y + step_y, &beside)) return false;
      ray->slope = (beside.across - ray->landing.across) / step_y;
      if (std::abs(ray->slope) < 1e-3) return false;
    }
    if (std::abs(ray->landing.across) < tolerance) return true;
    ray->y -= ray->landing.across / ray->slope;
  }
  return false;
}

// An edge of a strip of the slit as it lands.
struct StripEdge {
  bool arrives = false;
  double u = 0.0, flux = 0.0;
};

// Each strip's light is spread between where its two edges land; centre and width by the moments.
bool Gather(std::span<const StripEdge> edges, SpotLight* spot) {
  double first = 0.0, second = 0.0;
  for (std::size_t i = 0; i + 1 < edges.size(); ++i) {
    const StripEdge &a = edges[i], &c = edges[i + 1];
    if (!a.arrives || !c.arrives) continue;
    Bundle& b = spot->bundles[static_cast<std::size_t>(spot->count++)];
    b.low = std::min(a.u, c.u);
    b.high = std::max(a.u, c.u);
    b.flux = 0.5 * (a.flux + c.flux);
    const double middle = 0.5 * (b.low + b.high);
    const double width = b.high - b.low;
    spot->flux += b.flux;
    first += b.flux * middle;
    second += b.flux * (middle * middle + width * width / 12.0);
  }
  if (spot->count == 0) return false;
  spot->centre_px = first / spot->flux;
  spot->sigma_px =
      std::sqrt(std::max(second / spot->flux - spot->centre_px * spot->centre_px, 0.0));
  return true;
}

}  // namespace

bool TraceSpot(const LensCamera& camera, const Eigen::Vector3d& p_W, SpotLight* spot,
               const LightPath* path) {
  spot->count = 0;
  spot->flux = 0.0;
  if (camera.model) return ImageSpot(camera, p_W, spot, path);
  const bool mirrored = path != nullptr && path->mirror != nullptr;
  const Eigen::Vector3d p_C =
      camera.X_WC.inverse() * (mirrored ? path->mirror->Mirrored(p_W) : p_W);
  if (!(p_C.z() > 0.0)) return false;

  // As if the glass were air; Newton's method mends the rest.
  const double depth = -camera.sensor.centre.z();
  RowRay ray;
  ray.y = p_C.y() * depth / (p_C.z() + depth);

  // Rays through the edges of kSlitSamples equal strips of the slit.
  std::array<StripEdge, kSlitSamples + 1> edges;
  const double strip = 2.0 * camera.slit_half_width / kSlitSamples;
  for (int i = 0; i <= kSlitSamples; ++i) {
    const double x = -camera.slit_half_width + i * strip;
    StripEdge& edge = edges[static_cast<std::size_t>(i)];
    edge.arrives = FindRowRay(camera, p_C, x, &ray) && std::abs(ray.y) <= camera.slit_half_length;
    if (path != nullptr && edge.arrives) {
      edge.arrives = Reaches(*path, p_W, camera.X_WC * Eigen::Vector3d(x, ray.y, 0.0));
    }
    if (!edge.arrives) continue;
    // Solid angle of the slit's piece that sees the row: its length along the slit is the row's
    // height over the magnification `slope`.
    const Eigen::Vector3d sight = p_C - Eigen::Vector3d(x, ray.y, 0.0);
    const double r = sight.norm();
    const double height = camera.sensor.pitch / std::abs(ray.slope);
    edge.u = ray.landing.u;
    edge.flux = height * strip * sight.z() / (r * r * r) * ray.landing.transmission;
  }
  return Gather(edges, spot) && OnRow(spot->centre_px, camera.sensor.pixels);
}

double FocusedSensorDistance(const LensCamera& camera, double distance) {
  // x = a + b z of each ray behind the lens; the variance over the slit is least at
  // z = -cov(a, b) / var(b), below the slit.
  constexpr int kRays = 64;
  const Eigen::Vector3d source(0.0, 0.0, distance);
  double sum_a = 0.0, sum_b = 0.0, sum_ab = 0.0, sum_bb = 0.0;
  int n = 0;
  for (int i = 0; i < kRays; ++i) {
    const double x = camera.slit_half_width * (2.0 * (i + 0.5) / kRays - 1.0);
    Ray ray;
    double transmission;
    if (!TraceGlass(camera, source, x, 0.0, &ray, &transmission)) continue;
    const double b = ray.direction.x() / ray.direction.z();
    const double a = ray.origin.x() - b * ray.origin.z();
    sum_a += a;
    sum_b += b;
    sum_ab += a * b;
    sum_bb += b * b;
    ++n;
  }
  return (sum_ab - sum_a * sum_b / n) / (sum_bb - sum_b * sum_b / n);
}

}  // namespace unfurl::measure
