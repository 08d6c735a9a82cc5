// What certificates state against what is true: scenes made at random, each against a mesh of four
// times as many segments, or of four more shapes, at a tolerance of 1e-11.
// UNFURL_CERTIFIED_SCENES sets how many, from UNFURL_FIRST_SCENE on (tests/hard/CMakeLists.txt).
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>

#include "sim/kirchhoff/kirchhoff_shapes.h"
#include "sim/methods/simulate.h"
#include "sim/record/certificate.h"
#include "sim/record/record.h"
#include "tests/hard/random_scenes.h"

namespace unfurl::sim::certificate_truth_test {
namespace {

constexpr double kLeast = 0.5, kMost = 4.0;  // stated over true error: the promise
constexpr double kReference = 1e-11;         // rtol
constexpr double kFiner = 4.0;               // segments
constexpr int kMoreShapes = 4;
// Of a quantity's range: errors below it are the reference's own.
constexpr double kNothing = 1e-8;

int FromEnvironment(const char* name, int otherwise) {
  const char* text = std::getenv(name);
  return text != nullptr ? std::atoi(text) : otherwise;
}

RandomScene Draw(int seed) {
  const auto drawn = static_cast<std::uint64_t>(seed);
  return seed % 3 == 0   ? DrawStiffScene(drawn)
         : seed % 3 == 1 ? DrawScene(drawn)
                         : DrawLoopScene(drawn);
}

data::Scene OnAFinerMesh(const data::Scene& scene) {
  data::Scene out = scene;
  for (data::SceneBeam& beam : out.beams) {
    if (beam.model == data::BeamModel::kKirchhoff) {
      beam.order = std::min(beam.order + kMoreShapes, KirchhoffShapes::kMostModes);
    } else {
      beam.segments *= static_cast<int>(kFiner);
    }
  }
  return out;
}

RecordOptions At(double rtol) {
  RecordOptions options;
  options.simulate = SimulateOptions();
  options.simulate->rtol = rtol;
  options.simulate->rate = 200.0;
  return options;
}

double FarthestApart(const std::vector<double>& a, const std::vector<double>& b) {
  double farthest = 0.0;
  for (std::size_t k = 0; k < std::min(a.size(), b.size()); ++k) {
    farthest = std::max(farthest, std::fabs(a[k] - b[k]));
  }
  return farthest;
}

TEST(CertificateTruth, StatedOverTrueError) {
  const int count = FromEnvironment("UNFURL_CERTIFIED_SCENES", 3);
  const int first = FromEnvironment("UNFURL_FIRST_SCENE", 4001);
  std::vector<double> ratios;
  int lines = 0, low = 0, high = 0, certified = 0, without = 0, unusable = 0;
  for (int seed = first; seed < first + count; ++seed) {
    const RandomScene drawn = Draw(seed);
    SCOPED_TRACE(fmt::format("seed {}\n{}", seed, drawn.toml));
    const data::Scene scene = data::ParseScene(drawn.toml, "test.toml");
    const double rtols[] = {1e-4, 1e-5, 1e-6};
    RecordOptions options = At(rtols[seed / 3 % 3]);
    options.certificate = Certificate::Make(scene, *options.simulate, {});
    const Recording run = Record(CompileModel(scene), options);
    if (!run.report.Usable()) {  // of one that is not certified the statement is what is tested
      EXPECT_FALSE(run.message.empty());
      ++unusable;
      continue;
    }
    if (!options.certificate->problem().empty()) {
      fmt::print("seed {}: not certified: {}\n", seed, options.certificate->problem());
      ++without;
      continue;
    }
    const Recording truth = Record(CompileModel(OnAFinerMesh(scene)), At(kReference));
    if (!truth.Usable()) {
      fmt::print("seed {}: no truth: {}\n", seed, truth.message);
      ++unusable;
      continue;
    }
    ++certified;
    for (const Certificate::Line& line : options.certificate->Lines()) {
      const double off = FarthestApart(run.run.Column(line.name), truth.run.Column(line.name));
      if (off < kNothing * line.range) continue;
      ++lines;
      const double ratio = (line.time + line.mesh) / off;
      ratios.push_back(ratio);
      if (ratio >= kLeast && ratio <= kMost) continue;
      ++(ratio < kLeast ? low : high);
      fmt::print("seed {} {}: stated {:.3g} + {:.3g}, true {:.3g} {}: {:.2f}\n", seed, line.name,
                 line.time, line.mesh, off, line.units, ratio);
    }
  }
  fmt::print(
      "{} lines of {} scenes; {} below {}, {} above {}; {} scenes not certified, {} of no use\n",
      lines, certified, low, kLeast, high, kMost, without, unusable);
  std::sort(ratios.begin(), ratios.end());
  for (const double part : {0.025, 0.25, 0.5, 0.75, 0.975}) {
    const auto at = static_cast<std::size_t>(part * static_cast<double>(ratios.size()));
    if (at < ratios.size())
      fmt::print("{:.1f}% of the ratios below {:.2f}\n", 100.0 * part, ratios[at]);
  }
  EXPECT_GT(lines, 3 * certified / 2);
  EXPECT_GT(certified, count * 3 / 4);
  // 95%; lines of one scene stand or fall together, so of a few scenes those of one.
  EXPECT_LE(low + high, std::max((lines + certified - 1) / certified, lines / 20));
}

}  // namespace
}  // namespace unfurl::sim::certificate_truth_test
