#include "cli/tracks_views.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "base/fixed_number.h"
#include "cli/motion_panel.h"
#include "cli/space_panel.h"
#include "report/far_origin.h"

namespace unfurl::cli {

namespace {

constexpr double kViewMilli = 1e3;  // [mm/m]

// Over the two axes along which the marks move farthest.
void AddMotion(const TracksDigest& digest, report::Page* page) {
  const std::array<double, 3> origin = digest.FarOrigins();
  std::array<double, 3> range{};
  for (std::size_t k = 0; k < 3; ++k) {
    const auto [low, high] = digest.Extent(k);
    range[k] = high - low;
  }
  const std::size_t least =
      static_cast<std::size_t>(std::min_element(range.begin(), range.end()) - range.begin());
  const std::size_t a = least == 0 ? 1 : 0, b = least == 2 ? 1 : 2;
  report::Motion motion;
  motion.title = "The marks in motion";
  motion.note = "Between two samples a ring goes straight.";
  motion.x = {TracksAxisName(a, origin[a]), "m", false};
  motion.y = {TracksAxisName(b, origin[b]), "m", false};
  for (std::size_t m = 0; m < digest.marks.size(); ++m) {
    const TracksDigest::Dots& dots = digest.dots[m];
    motion.marks.push_back({digest.marks[m], true, dots.t, LessOrigin(dots.p[a], origin[a]),
                            LessOrigin(dots.p[b], origin[b]), static_cast<int>(m)});
  }
  if (SpanFrames(&motion)) page->AddMotion(std::move(motion));
}

// Of a mark with many samples as many as all marks together may show.
void AddSpace(const data::Rig& rig, const TracksDigest& digest, report::Page* page) {
  report::Space space =
      SpaceOf(rig, "The marks in space",
              "Cameras with what they see, the marks' samples coloured by what is known of each, "
              "and for some of them the ellipsoid of one sigma. Choose a sample for its rays; "
              "dashed is a reading that was rejected.");
  report::SpaceCloud cloud{"samples", {"one sigma of the place", "mm"}, {}, {}};
  report::SpaceEllipsoids ellipsoids{"uncertainty", cloud.value, {}, {}};
  constexpr std::size_t kMostEllipsoids = 150;  // more hide one another
  const std::size_t marks = std::max<std::size_t>(1, digest.marks.size());
  for (std::size_t m = 0; m < digest.marks.size(); ++m) {
    const TracksDigest::Dots& dots = digest.dots[m];
    std::vector<std::size_t> usable;
    for (std::size_t i = 0; i < dots.t.size(); ++i) {
      if (std::isfinite(dots.p[0][i])) usable.push_back(i);
    }
    const auto place = [&](std::size_t i) {
      return Eigen::Vector3d(dots.p[0][i], dots.p[1][i], dots.p[2][i]);
    };
    for (const std::size_t k :
         report::EvenlyChosen(usable.size(), report::kMostSpacePoints / marks)) {
      const std::size_t i = usable[k];
      cloud.points.push_back({PlaceOf(place(i)), kViewMilli * dots.sigma[i],
                              fmt::format("{}, {} s", digest.marks[m], FixedNumber(dots.t[i])),
                              dots.used[i], dots.left_out[i]});
    }
    for (const std::size_t k : report::EvenlyChosen(usable.size(), kMostEllipsoids / marks)) {
      const std::size_t i = usable[k];
      ellipsoids.ellipsoids.push_back(
          EllipsoidOf(place(i), dots.covariance[i], kViewMilli * dots.sigma[i]));
    }
  }
  if (cloud.points.empty()) return;
  // One scale for both.
  const auto [low, high] =
      std::minmax_element(cloud.points.begin(), cloud.points.end(),
                          [](const auto& a, const auto& b) { return a.value < b.value; });
  cloud.range = ellipsoids.range = {low->value, high->value};
  space.clouds.push_back(std::move(cloud));
  space.ellipsoids.push_back(std::move(ellipsoids));
  page->AddSpace(space);
}

}  // namespace

std::string TracksAxisName(std::size_t axis, double origin) {
  return report::NameLess(std::string(1, "xyz"[axis]), origin);
}

std::vector<double> LessOrigin(std::vector<double> values, double origin) {
  for (double& value : values) value -= origin;
  return values;
}

void AddTracksViews(const data::Rig& rig, const TracksDigest& digest, report::Page* page) {
  page->AddSection("Where that was", "Views along the axes of the rig's frame, with the cameras.");
  AddMotion(digest, page);
  AddSpace(rig, digest, page);
  const std::array<std::pair<std::size_t, std::size_t>, 2> planes = {{{0, 1}, {0, 2}}};
  const char* axes[] = {"x", "y", "z"};
  for (const auto& [a, b] : planes) {
    report::Paths paths;
    paths.title = b == 1 ? "From above" : "From the side";
    paths.x = {axes[a], "m", false};
    paths.y = {axes[b], "m", false};
    int color = 0;
    for (std::size_t m = 0; m < digest.marks.size(); ++m) {
      paths.paths.push_back({digest.marks[m], digest.dots[m].p[a], digest.dots[m].p[b],
                             report::Style::kDots, color++, true});
    }
    for (const data::RigCamera& camera : rig.cameras) {
      const auto at = [&camera](std::size_t k) {
        return camera.p_WC(static_cast<Eigen::Index>(k));
      };
      paths.paths.push_back({camera.name, {at(a)}, {at(b)}, report::Style::kDots, color++, true});
    }
    page->AddPaths(paths);
  }
}

}  // namespace unfurl::cli
