// Throughput of lines, seconds of one core: exposing them, finding their spots. From readings to
// points: points_bench.
//   measure_bench [LAB.toml]
#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <ctime>
#include <functional>
#include <vector>

#include "base/error.h"
#include "cpu_time.h"
#include "data/lab.h"
#include "measure/background.h"
#include "measure/expose.h"
#include "measure/sensor.h"
#include "measure/spot.h"
#include "measure/spot_painter.h"

namespace {

using namespace unfurl;
using namespace unfurl::measure;

void Report(const char* what, double seconds, const char* unit) {
  fmt::print("{:<44} {:>9.3f} us {:>12.0f} {}/s\n", what, 1e6 * seconds, 1.0 / seconds, unit);
}

void Run(const std::string& path) {
  const data::Lab lab = data::ReadLab(path);
  const VirtualRig truth = MakeVirtualRig(lab);
  const data::LineFormat& format = lab.sensor.format;
  const LensCamera& camera = truth.cameras[0];
  Rng rng(1);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 256; ++i) {
    points.emplace_back(rng.Uniform(-0.8, 0.8), rng.Uniform(-0.8, 0.8), rng.Uniform(-0.8, 0.8));
  }

  SpotLight light;
  Report(
      "trace a spot through the lens",
      bench::SecondsEach(2000, [&](std::size_t i) { TraceSpot(camera, points[i % 256], &light); }),
      "spots");
  SpotPainter painter(lab.sensor.blur / format.pitch);
  std::vector<double> pixels(static_cast<std::size_t>(format.active), 0.0);
  Report("paint it on the pixels",
         bench::SecondsEach(2000, [&](std::size_t) { painter.Add(light, 1.0, pixels); }), "spots");
  std::vector<std::uint16_t> line(format.elements());
  std::fill(pixels.begin(), pixels.end(), 0.0);
  Report(
      "read out a line with noise",
      bench::SecondsEach(2000, [&](std::size_t) { ReadOut(lab.sensor, pixels, 900.0, rng, line); }),
      "lines");

  data::Survey survey;
  survey.p.resize(3, 64);
  survey.cov.setZero(6, 64);
  for (int i = 0; i < 64; ++i) {
    survey.id.push_back(std::to_string(i));
    survey.p.col(i) = points[static_cast<std::size_t>(i)];
  }
  // Each point: a lit and a dark line of every camera.
  const double camera_lines = 2.0 * 64.0 * static_cast<double>(truth.cameras.size());
  Report("expose a camera's line",
         bench::SecondsEach(1, [&](std::size_t) { ExposeSurvey(lab, survey, {}); }) / camera_lines,
         "lines");

  Background background(format);
  for (int i = 0; i < 64; ++i) {
    ReadOut(lab.sensor, pixels, 900.0, rng, line);
    background.Add(line);
  }
  std::vector<std::vector<std::uint16_t>> lines;
  for (const Eigen::Vector3d& p : points) {
    std::fill(pixels.begin(), pixels.end(), 0.0);
    if (TraceSpot(camera, p, &light)) painter.Add(light, truth.flash_electrons, pixels);
    ReadOut(lab.sensor, pixels, 900.0, rng, line);
    lines.push_back(line);
  }
  Report("learn the background from a dark line",
         bench::SecondsEach(2000, [&](std::size_t) { background.Add(line); }), "lines");
  SpotFinder finder(format);
  std::size_t found = 0;
  Report(
      "find and fit a line's spot",
      bench::SecondsEach(
          4000, [&](std::size_t i) { found += Usable(finder.Find(lines[i % 256], background)); }),
      "lines");

  if (found == 0) fmt::print("nothing was found\n");
}

}  // namespace

int main(int argc, char** argv) {
  try {
    Run(argc > 1 ? argv[1] : UNFURL_SOURCE_DIR "/data/sets/deployment/lab.toml");
  } catch (const unfurl::Error& error) {
    std::fprintf(stderr, "measure_bench: %s\n", error.what());
    return unfurl::kExitBadInput;
  }
  return 0;
}
