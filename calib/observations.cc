#include "calib/observations.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "base/error.h"
#include "base/statistics.h"
#include "calib/common_error.h"
#include "calib/copies.h"
#include "calib/set_up.h"
#include "data/survey_points.h"

namespace unfurl::calib {
namespace {

Eigen::Matrix3d Covariance(const data::Survey& survey, Eigen::Index i) {
  const auto c = survey.cov.col(i);
  Eigen::Matrix3d cov;
  cov << c(0), c(1), c(2), c(1), c(3), c(4), c(2), c(4), c(5);
  return cov;
}

// Three readings that agree to their last digits at a place that does so too are no second
// measurement: that many tell of a point what there is to know.
constexpr std::size_t kFewestOfACopy = 3;

// Of each point its place, and then camera and reading in turn.
MeasuredRows PointRows(const Observations& data) {
  MeasuredRows out{"point", "the place and the readings", data.ids, {}, 3 + 2 * kFewestOfACopy};
  out.rows.resize(data.ids.size());
  for (std::size_t i = 0; i < out.rows.size(); ++i) {
    const Eigen::Vector3d p = data.p.col(static_cast<Eigen::Index>(i));
    out.rows[i].assign(p.data(), p.data() + 3);
  }
  for (const Reading& r : data.readings) {
    std::vector<double>& of = out.rows[static_cast<std::size_t>(r.point)];
    of.insert(of.end(), {static_cast<double>(r.camera), r.u_px});
  }
  return out;
}

}  // namespace

int Observations::RowOf(int camera) const {
  const auto j = static_cast<std::size_t>(camera);
  if (j < pixels.size() && pixels[j] > 0) return pixels[j];
  std::vector<double> u;
  for (const Reading& r : readings) {
    if (r.camera == camera && std::isfinite(r.u_px)) u.push_back(r.u_px);
  }
  if (u.empty()) return 1;
  // A reading of another decade is a blunder and says nothing of the row.
  const double believed = 3.0 * Quantile(u, 0.9);
  double highest = 0.0;
  for (const double value : u) highest = value <= believed ? std::max(highest, value) : highest;
  return static_cast<int>(std::ceil(highest)) + 1;
}

Observations FromSurvey(const data::Survey& survey, const std::string& where) {
  Observations out;
  out.ids = survey.id;
  out.cameras = survey.cameras;
  out.pixels = survey.pixels;
  if (survey.has_lines()) {
    out.pixels.clear();
    for (std::size_t c = 0; c < survey.cameras.size(); ++c) {
      out.pixels.push_back(survey.format.Of(c).active);
      out.pitch.push_back(survey.format.Of(c).pitch);
    }
  }
  out.p = survey.p;
  for (Eigen::Index i = 0; i < survey.p.cols(); ++i) {
    const std::string& id = survey.id[static_cast<std::size_t>(i)];
    const Eigen::Matrix3d cov = Covariance(survey, i);
    const Eigen::LLT<Eigen::Matrix3d> factor(cov);
    if (!survey.p.col(i).allFinite() || !cov.allFinite() || factor.info() != Eigen::Success) {
      throw Error(fmt::format("point \"{}\" has no finite position with a positive definite "
                              "covariance",
                              id),
                  where, "give each point positive standard deviations");
    }
    out.cov.push_back(cov);
    for (Eigen::Index j = 0; j < survey.u_px.cols(); ++j) {
      if (std::isnan(survey.u_px(i, j))) continue;
      if (!std::isfinite(survey.u_px(i, j)) || !data::IsReadingSigma(survey.s_px(i, j))) {
        throw Error(fmt::format("point \"{}\", camera \"{}\": reading {} px with sigma {} px", id,
                                survey.cameras[static_cast<std::size_t>(j)], survey.u_px(i, j),
                                survey.s_px(i, j)),
                    where, "give each reading its standard deviation in pixels, or leave it empty");
      }
      out.readings.push_back(
          {static_cast<int>(i), static_cast<int>(j), survey.u_px(i, j), survey.s_px(i, j)});
    }
  }
  RefuseCopiedRows(PointRows(out), where);
  out.common = StationErrorsOf(survey, where);
  AddSetUps(survey, where, &out);
  return out;
}

Observations SelectPoints(const Observations& all, const std::vector<int>& keep) {
  Observations out;
  out.cameras = all.cameras;
  out.pixels = all.pixels;
  out.pitch = all.pitch;
  for (const CommonError& error : all.common) {
    out.common.push_back(
        {error.name, error.unit, error.sigma, error.shift(Eigen::all, keep), error.set_up});
  }
  out.set_ups = all.set_ups;
  out.set_ups_told = all.set_ups_told;
  out.p.resize(3, static_cast<Eigen::Index>(keep.size()));
  std::vector<int> renumbered(static_cast<std::size_t>(all.points()), -1);
  for (std::size_t k = 0; k < keep.size(); ++k) {
    const auto i = static_cast<std::size_t>(keep[k]);
    renumbered[i] = static_cast<int>(k);
    out.p.col(static_cast<Eigen::Index>(k)) = all.p.col(keep[k]);
    out.cov.push_back(all.cov[i]);
    out.ids.push_back(all.ids[i]);
  }
  for (Reading r : all.readings) {
    r.point = renumbered[static_cast<std::size_t>(r.point)];
    if (r.point >= 0) out.readings.push_back(r);
  }
  return out;
}

Observations SelectCamera(const Observations& all, int camera) {
  Observations out = all;
  const auto own = static_cast<std::size_t>(camera);
  out.cameras = {all.cameras[own]};
  if (own < all.pixels.size()) out.pixels = {all.pixels[own]};
  if (own < all.pitch.size()) out.pitch = {all.pitch[own]};
  out.common.clear();  // of the points, which one camera cannot adjust
  out.set_ups.clear();
  out.readings.clear();
  for (Reading r : all.readings) {
    if (r.camera != camera) continue;
    r.camera = 0;
    out.readings.push_back(r);
  }
  return out;
}

}  // namespace unfurl::calib
