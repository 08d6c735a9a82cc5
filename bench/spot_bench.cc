// Spot estimators: accuracy on Gaussian spots of known noise against the Cramer-Rao bound, what
// each misses of the true centre of spots through glass, and what each costs in time, beside the
// time that it takes to read the same lines once from memory.
//   spot_bench speed | all | PICTURES_FOLDER
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <numbers>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/random.h"
#include "base/statistics.h"
#include "base/worker_pool.h"
#include "bench/svg_plot.h"
#include "cpu_time.h"
#include "data/lab.h"
#include "measure/sensor.h"
#include "measure/spot.h"
#include "measure/spot_bound.h"
#include "measure/spot_painter.h"
#include "measure/virtual_rig.h"

namespace {

using namespace unfurl;
using namespace unfurl::measure;

struct Named {
  const char* name;
  SpotEstimator estimator;
};
constexpr Named kEstimators[] = {
    {"thresholded centroid", SpotEstimator::kThresholdedCentroid},
    {"squared centroid", SpotEstimator::kSquaredCentroid},
    {"least squares", SpotEstimator::kLeastSquares},
    {"maximum likelihood", SpotEstimator::kMaximumLikelihood},
};
constexpr std::size_t kCount = std::size(kEstimators);

data::Lab ShippedLab(const std::vector<std::string>& overrides = {}) {
  return data::ReadLab(UNFURL_SOURCE_DIR "/data/sets/deployment/lab.toml", overrides);
}

void AddGaussian(double centre, double sigma, double electrons, std::vector<double>* pixels) {
  const int reach = static_cast<int>(std::ceil(8.0 * sigma)) + 2;
  const int middle = static_cast<int>(centre);
  for (int k = middle - reach; k <= middle + reach; ++k) {
    const double d = (k - centre) / sigma, half = 0.5 / sigma;
    const double root = std::numbers::sqrt2 / 2.0;
    (*pixels)[static_cast<std::size_t>(k)] +=
        electrons * 0.5 * (std::erf((d + half) * root) - std::erf((d - half) * root));
  }
}

// A cell of the table: one width, one brightness.
struct Cell {
  double sigma = 0.0, snr = 0.0, bound = 0.0;
  double factor[kCount] = {};  // scatter over the bound
  double honest[kCount] = {};  // scatter over the stated sigma
  double bias[kCount] = {};    // largest mean error over ten phases [px]
  double lost[kCount] = {};    // share without a usable reading
};

// Electrons of a spot whose middle pixel, centred, is `snr` times its own noise.
double Electrons(double sigma, double snr, double dark) {
  const double peak = 0.5 * (snr * snr + snr * std::sqrt(snr * snr + 4.0 * dark));
  return peak / std::erf(0.5 / sigma / std::numbers::sqrt2);
}

bool Measure(const data::LabSensor& sensor, int repeats, Cell* cell) {
  const double g = sensor.format.electrons_per_count;
  const double dark = sensor.read_noise * sensor.read_noise + g * g / 12.0;
  const double electrons = Electrons(cell->sigma, cell->snr, dark);
  const double peak = electrons * std::erf(0.5 / cell->sigma / std::numbers::sqrt2);
  if (peak > 0.93 * (sensor.full_well - sensor.dark_level)) return false;
  std::vector<SpotFinder> finders;
  for (const Named& e : kEstimators) {
    finders.emplace_back(sensor.format, SpotOptions{.estimator = e.estimator});
  }
  std::vector<double> pixels(static_cast<std::size_t>(sensor.format.active), 0.0);
  std::vector<std::uint16_t> line(sensor.format.elements());
  Background background(sensor.format);
  Rng rng(static_cast<std::uint64_t>(1000.0 * cell->sigma + cell->snr));
  for (int i = 0; i < 256; ++i) {
    ReadOut(sensor, pixels, sensor.dark_level, rng, line);
    background.Add(line);
  }
  constexpr int kPhases = 10;
  std::vector<double> error[kCount], stated[kCount];
  double by_phase[kCount][kPhases] = {};
  int of_phase[kCount][kPhases] = {};
  const PixelNoise noise{.electrons_per_count = g, .dark_variance = dark * (257.0 / 256.0) / g / g};
  for (int i = 0; i < repeats; ++i) {
    const int phase = i % kPhases;
    const double centre = 500 + 37 * (i % 29) + (phase + rng.Uniform()) / kPhases;
    std::fill(pixels.begin(), pixels.end(), 0.0);
    AddGaussian(centre, cell->sigma, electrons, &pixels);
    ReadOut(sensor, pixels, sensor.dark_level, rng, line);
    cell->bound += std::pow(CentreBound(centre, cell->sigma, electrons / g, noise), 2) / repeats;
    for (std::size_t e = 0; e < kCount; ++e) {
      const Spot spot = finders[e].Find(line, background);
      if (!Usable(spot)) {
        cell->lost[e] += 1.0 / repeats;
        continue;
      }
      error[e].push_back(spot.u_px - centre);
      stated[e].push_back(spot.s_px);
      by_phase[e][phase] += spot.u_px - centre;
      ++of_phase[e][phase];
    }
  }
  cell->bound = std::sqrt(cell->bound);
  for (std::size_t e = 0; e < kCount; ++e) {
    if (error[e].empty()) continue;
    cell->factor[e] = Rms(error[e]) / cell->bound;
    cell->honest[e] = Rms(error[e]) / Rms(stated[e]);
    for (int p = 0; p < kPhases; ++p) {
      const double mean = std::abs(by_phase[e][p] / std::max(1, of_phase[e][p]));
      cell->bias[e] = std::max(cell->bias[e], mean);
    }
  }
  return true;
}

std::vector<Cell> Gaussians(int bits, int repeats) {
  data::LabSensor sensor = ShippedLab({fmt::format("sensor.bits={}", bits)}).sensor;
  sensor.dark_drift = 0.0;
  fmt::print(
      "\n{} bits, {} repeats: scatter / bound, (scatter / stated), largest bias by phase\n\n", bits,
      repeats);
  fmt::print("| sigma [px] | peak / noise | bound [px] |");
  for (const Named& e : kEstimators) fmt::print(" {} |", e.name);
  fmt::print("\n|---|---|---|---|---|---|---|\n");
  std::vector<Cell> cells;
  for (const double sigma : {0.7, 1.0, 1.5, 2.5, 4.0, 7.0, 10.0}) {
    for (const double snr : {10.0, 30.0, 100.0, 220.0}) {
      Cell cell{.sigma = sigma, .snr = snr};
      if (!Measure(sensor, repeats, &cell)) continue;
      fmt::print("| {} | {} | {:.4f} |", sigma, snr, cell.bound);
      for (std::size_t e = 0; e < kCount; ++e) {
        fmt::print(" {:.2f} ({:.2f}) {:.4f}{} |", cell.factor[e], cell.honest[e], cell.bias[e],
                   cell.lost[e] > 0.0 ? fmt::format(" lost {:.1f}%", 100 * cell.lost[e]) : "");
      }
      fmt::print("\n");
      cells.push_back(cell);
    }
  }
  return cells;
}

// Spots through the shipped lens: what is missed of the irradiance's centroid, without noise.
struct Missed {
  double rms[kCount] = {}, largest[kCount] = {}, smooth[kCount] = {};
};
Missed ThroughGlass(int points) {
  const data::Lab lab = ShippedLab();
  const VirtualRig rig = MakeVirtualRig(lab);
  data::LabSensor still = lab.sensor;
  still.shot_noise = false;
  still.read_noise = 0.0;
  still.format.bits = 16;
  still.format.electrons_per_count = still.full_well / still.format.full_scale();
  // The estimators weigh as they would with the real noise.
  data::LineFormat known = still.format;
  known.read_noise_counts = lab.sensor.read_noise / known.electrons_per_count;
  std::vector<double> pixels(2160), miss[kCount];
  std::vector<std::uint16_t> line(known.elements());
  Rng rng(5);
  Background background(known);
  for (int i = 0; i < 2; ++i) {
    ReadOut(still, std::vector<double>(2160, 0.0), still.dark_level, rng, line);
    background.Add(line);
  }
  std::vector<SpotFinder> finders;
  for (const Named& e : kEstimators) {
    finders.emplace_back(known, SpotOptions{.estimator = e.estimator, .misfit_sigmas = 1e9});
  }
  SpotPainter painter(lab.sensor.blur / lab.sensor.format.pitch);
  for (int i = 0; i < points; ++i) {
    Eigen::Vector3d p;
    for (int k = 0; k < 3; ++k) p(k) = rng.Uniform(lab.volume_low(k), lab.volume_high(k));
    for (const LensCamera& camera : rig.cameras) {
      SpotLight light;
      if (!TraceSpot(camera, p, &light)) continue;
      if (light.centre_px < 40.0 || light.centre_px > 2119.0) continue;
      std::fill(pixels.begin(), pixels.end(), 0.0);
      painter.Add(light, rig.survey_electrons, pixels);
      ReadOut(still, pixels, still.dark_level, rng, line);
      for (std::size_t e = 0; e < kCount; ++e) {
        const Spot spot = finders[e].Find(line, background);
        if (Usable(spot)) miss[e].push_back(spot.u_px - light.centre_px);
      }
    }
  }
  Missed missed;
  fmt::print(
      "\nThrough glass, whole volume, no noise: missed of the irradiance's centroid [px]\n\n");
  fmt::print("| estimator | spots | rms | 95th percentile | largest |\n|---|---|---|---|---|\n");
  for (std::size_t e = 0; e < kCount; ++e) {
    std::vector<double> size;
    for (const double m : miss[e]) size.push_back(std::abs(m));
    missed.rms[e] = Rms(miss[e]);
    missed.largest[e] = Quantile(size, 1.0);
    fmt::print("| {} | {} | {:.4f} | {:.4f} | {:.4f} |\n", kEstimators[e].name, miss[e].size(),
               missed.rms[e], Quantile(size, 0.95), missed.largest[e]);
  }
  return missed;
}

// Lines of a trial, as they lie in memory: four marks and a dark line in turn.
struct Lines {
  data::LineFormat format;
  std::vector<std::uint16_t> counts;
  std::size_t size = 0;
};
Lines TrialLines(std::size_t bytes) {
  const data::Lab lab = ShippedLab();
  const VirtualRig rig = MakeVirtualRig(lab);
  Lines lines{.format = lab.sensor.format};
  const std::size_t elements = lines.format.elements();
  constexpr std::size_t kDistinct = 500;
  std::vector<std::uint16_t> distinct(kDistinct * elements);
  std::vector<double> pixels(2160);
  SpotPainter painter(lab.sensor.blur / lab.sensor.format.pitch);
  Rng rng(9);
  for (std::size_t i = 0; i < kDistinct; ++i) {
    std::fill(pixels.begin(), pixels.end(), 0.0);
    SpotLight light;
    const Eigen::Vector3d p(rng.Uniform(-0.9, 0.9), rng.Uniform(-0.9, 0.9), 0.0);
    if (i % 5 < 4 && TraceSpot(rig.cameras[0], p, &light)) {
      painter.Add(light, rig.flash_electrons, pixels);
    }
    ReadOut(lab.sensor, pixels, lab.sensor.dark_level, rng, {&distinct[i * elements], elements});
  }
  lines.size = bytes / (2 * elements) / kDistinct * kDistinct;
  lines.counts.resize(lines.size * elements);
  for (std::size_t i = 0; i < lines.size; i += kDistinct) {
    std::memcpy(&lines.counts[i * elements], distinct.data(), 2 * distinct.size());
  }
  return lines;
}

std::uint64_t ReadOnce(const std::uint16_t* from, std::size_t count) {
  const std::size_t words = count / 4;
  std::uint64_t sum[8] = {};
  std::size_t k = 0;
  for (; k + 8 <= words; k += 8) {
    std::uint64_t w[8];
    std::memcpy(w, from + 4 * k, sizeof w);
    for (int j = 0; j < 8; ++j) sum[j] += w[j];
  }
  return sum[0] + sum[1] + sum[2] + sum[3] + sum[4] + sum[5] + sum[6] + sum[7];
}

std::size_t FindIn(const Lines& lines, SpotEstimator estimator, std::size_t first,
                   std::size_t last) {
  const std::size_t elements = lines.format.elements();
  Background background(lines.format);
  for (std::size_t i = 4; i < 200; i += 5) {
    background.Add({&lines.counts[(first + i) * elements], elements});
  }
  SpotFinder finder(lines.format, {.estimator = estimator});
  std::size_t found = 0;
  for (std::size_t i = first; i < last; ++i) {
    const std::span<const std::uint16_t> line(&lines.counts[i * elements], elements);
    if (i % 5 == 4) {
      background.Add(line);
    } else {
      found += Usable(finder.Find(line, background));
    }
  }
  return found;
}

struct Speed {
  double read = 0.0;  // seconds per line
  double find[kCount] = {};
};
Speed Speeds() {
  constexpr std::size_t kBytes = std::size_t{600} << 20;  // more than any cache here
  constexpr std::size_t kPiece = 20000;                   // lines per estimator and round
  constexpr int kRounds = 5;
  const Lines lines = TrialLines(kBytes);
  const std::size_t elements = lines.format.elements();
  std::vector<double> read, find[kCount];
  std::uint64_t sum = 0;
  std::size_t found = 0;
  std::size_t next = 0;  // pieces follow each other, so that each comes from memory
  const auto piece = [&] {
    if (next + kPiece > lines.size) next = 0;
    const std::size_t first = next;
    next += kPiece;
    return first;
  };
  for (int round = 0; round < kRounds; ++round) {
    std::size_t first = piece();
    double start = bench::ThreadSeconds();
    sum += ReadOnce(&lines.counts[first * elements], kPiece * elements);
    read.push_back((bench::ThreadSeconds() - start) / kPiece);
    for (std::size_t e = 0; e < kCount; ++e) {
      first = piece();
      start = bench::ThreadSeconds();
      found += FindIn(lines, kEstimators[e].estimator, first, first + kPiece);
      find[e].push_back((bench::ThreadSeconds() - start) / kPiece);
    }
  }
  Speed speed;
  speed.read = Median(read);
  fmt::print("\nOne core, {} lines of {} bytes from memory, one of five dark (median of {})\n\n",
             kPiece, 2 * elements, kRounds);
  fmt::print("| what | ns per line | lines/s | of the speed of reading |\n|---|---|---|---|\n");
  fmt::print("| read once | {:.0f} | {:.0f} | 1 |\n", 1e9 * speed.read, 1.0 / speed.read);
  for (std::size_t e = 0; e < kCount; ++e) {
    speed.find[e] = Median(find[e]);
    fmt::print("| {} | {:.0f} | {:.0f} | {:.2f} |\n", kEstimators[e].name, 1e9 * speed.find[e],
               1.0 / speed.find[e], speed.read / speed.find[e]);
  }
  // Both cores: each takes a half.
  for (std::size_t workers : {1U, 2U}) {
    const auto start = std::chrono::steady_clock::now();
    ParallelFor(workers, workers, [&](std::size_t w) {
      const std::size_t share = lines.size / workers;
      FindIn(lines, SpotEstimator::kThresholdedCentroid, w * share, (w + 1) * share);
    });
    const double wall =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    fmt::print("{} thread(s), thresholded centroid, wall clock: {:.0f} lines/s\n", workers,
               static_cast<double>(lines.size) / wall);
  }
  if (sum == 0 || found == 0) fmt::print("nothing was found\n");
  return speed;
}

void Draw(const std::string& folder, const std::vector<Cell>& cells, const Missed& missed,
          const Speed& speed) {
  bench::Plot factors{.title = "Scatter over the Cramer-Rao bound, peak 100 times its noise",
                      .x_label = "sigma of the spot [px]",
                      .y_label = "scatter / bound"};
  for (std::size_t e = 0; e < kCount; ++e) {
    bench::Curve curve{.name = kEstimators[e].name};
    for (const Cell& cell : cells) {
      if (cell.snr != 100.0) continue;
      curve.x.push_back(cell.sigma);
      curve.y.push_back(cell.factor[e]);
    }
    factors.curves.push_back(curve);
  }
  bench::WriteSvg(folder + "/spot-factors.svg", factors);
  bench::Plot cost{.title = "What accuracy costs: a spot of sigma 1.5 px, peak 100 times its noise",
                   .x_label = "time per line [us]",
                   .y_label = "noise and what is missed through glass [px]"};
  for (std::size_t e = 0; e < kCount; ++e) {
    for (const Cell& cell : cells) {
      if (cell.snr != 100.0 || cell.sigma != 1.5) continue;
      // A short stroke each, so that it shows.
      const double y = std::hypot(cell.factor[e] * cell.bound, missed.rms[e]);
      const double x = 1e6 * speed.find[e];
      cost.curves.push_back({.name = kEstimators[e].name,
                             .x = {x - 0.05, x + 0.05, x, x, x},
                             .y = {y, y, y, 0.98 * y, 1.02 * y}});
    }
  }
  bench::WriteSvg(folder + "/spot-cost.svg", cost);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    const std::string what = argc > 1 ? argv[1] : "all";
    if (what == "speed") {
      Speeds();
      return 0;
    }
    constexpr int kRepeats = 4000;  // a scatter to 1.1%
    const std::vector<Cell> cells = Gaussians(12, kRepeats);
    Gaussians(8, kRepeats / 4);
    const Missed missed = ThroughGlass(400);
    const Speed speed = Speeds();
    if (what != "all") Draw(what, cells, missed, speed);
  } catch (const unfurl::Error& error) {
    std::fprintf(stderr, "spot_bench: %s\n", error.what());
    return unfurl::kExitBadInput;
  }
  return 0;
}
