#include "measure/expose.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <optional>

#include "base/error.h"
#include "base/worker_pool.h"
#include "measure/sensor.h"
#include "measure/spot_painter.h"

namespace unfurl::measure {

namespace {

// One camera's line while an LED shines, or none (`instants` empty). The LED's light is shared
// among the instants at which it was at these places in W.
class Exposer {
 public:
  explicit Exposer(const data::Lab& lab)
      : lab_(lab),
        painter_(lab.sensor.blur / lab.sensor.format.pitch),
        pixels_(static_cast<std::size_t>(lab.sensor.format.active)) {}

  void Line(const LensCamera& camera, std::span<const Eigen::Vector3d> instants, double electrons,
            double dark_level, Rng rng, std::span<std::uint16_t> counts) {
    std::fill(pixels_.begin(), pixels_.end(), 0.0);
    for (const Eigen::Vector3d& p_W : instants) {
      SpotLight spot;
      if (TraceSpot(camera, p_W, &spot)) {
        painter_.Add(spot, electrons / static_cast<double>(instants.size()), pixels_);
      }
    }
    ReadOut(lab_.sensor, pixels_, dark_level, rng, counts);
  }

 private:
  const data::Lab& lab_;
  SpotPainter painter_;
  std::vector<double> pixels_;
};

constexpr std::size_t kLinesPerTask = 16;

// Calls task(exposer, i) for every i in [first, last), in parallel.
template <typename Task>
void ForLines(const data::Lab& lab, std::size_t count, std::size_t workers, const Task& task) {
  const std::size_t tasks = (count + kLinesPerTask - 1) / kLinesPerTask;
  ParallelFor(tasks, workers, [&](std::size_t k) {
    Exposer exposer(lab);
    const std::size_t end = std::min(count, (k + 1) * kLinesPerTask);
    for (std::size_t i = k * kLinesPerTask; i < end; ++i) task(exposer, i);
  });
}

}  // namespace

MarkPath::MarkPath(const data::Run& run, const std::string& mark)
    : t_(run.t),
      x_(run.Column(mark + ".x")),
      y_(run.Column(mark + ".y")),
      vx_(run.Column(mark + ".vx")),
      vy_(run.Column(mark + ".vy")) {}

Eigen::Vector3d MarkPath::At(double t) const {
  if (t <= t_.front()) return {x_.front(), y_.front(), 0.0};
  if (t >= t_.back()) return {x_.back(), y_.back(), 0.0};
  const auto after = std::upper_bound(t_.begin(), t_.end(), t);
  const std::size_t i = static_cast<std::size_t>(after - t_.begin()) - 1;
  const double h = t_[i + 1] - t_[i];
  const double s = (t - t_[i]) / h;
  const double s2 = s * s, s3 = s2 * s;
  const double a0 = 2.0 * s3 - 3.0 * s2 + 1.0, b0 = (s3 - 2.0 * s2 + s) * h;
  const double a1 = 3.0 * s2 - 2.0 * s3, b1 = (s3 - s2) * h;
  return {a0 * x_[i] + b0 * vx_[i] + a1 * x_[i + 1] + b1 * vx_[i + 1],
          a0 * y_[i] + b0 * vy_[i] + a1 * y_[i + 1] + b1 * vy_[i + 1], 0.0};
}

data::TrialHeader HeaderOf(const data::Lab& lab) {
  data::TrialHeader header;
  for (const data::LabCamera& camera : lab.cameras) header.cameras.push_back(camera.name);
  for (const std::string& slot : lab.strobe.slots) {
    if (std::count(header.slots.begin(), header.slots.end(), slot) == 0) {
      header.slots.push_back(slot);
    }
  }
  header.format = lab.sensor.format;
  header.line_rate = lab.strobe.line_rate;
  return header;
}

void ExposeTrial(const data::Lab& lab, const data::Run& run, data::TrialWriter& trial,
                 const ExposeOptions& options, data::Tracks* truth) {
  constexpr std::size_t kBlock = 512;  // lines held at once
  // Gauss-Legendre: two instants have the mean and the spread of a flash's whole length.
  const double half_spread = 0.5 * lab.led.flash / std::sqrt(3.0);

  const VirtualRig rig = MakeVirtualRig(lab);
  const data::TrialHeader header = HeaderOf(lab);
  std::vector<std::optional<MarkPath>> paths(header.slots.size());
  std::vector<std::int32_t> cycle;
  for (const std::string& slot : lab.strobe.slots) {
    const auto at = std::find(header.slots.begin(), header.slots.end(), slot);
    cycle.push_back(static_cast<std::int32_t>(at - header.slots.begin()));
  }
  for (std::size_t s = 0; s < header.slots.size(); ++s) {
    if (header.slots[s] != data::kDarkSlot) paths[s].emplace(run, header.slots[s]);
  }
  if (run.t.size() < 2) {
    throw Error("holds no motion: fewer than two samples", "the run", "simulate again");
  }
  // Stamp s of the recorder is true time s (1 + drift); release is at true time `lead`.
  const double scale = 1.0 + lab.strobe.clock_drift;
  const auto run_time = [&](double stamp) { return stamp * scale - rig.lead; };
  const double last_stamp = (run.t.back() + rig.lead) / scale;
  const std::size_t lines =
      static_cast<std::size_t>(std::max(0.0, std::floor(last_stamp * header.line_rate + 0.5)));

  if (truth != nullptr) {
    *truth = {};
    truth->frame = "rig";
    for (const std::string& slot : header.slots) {
      if (slot != data::kDarkSlot) truth->marks.push_back(slot);
    }
  }
  std::vector<Eigen::Vector3d> true_points;
  const Rng noise = Rng(lab.seed).Stream("trial");
  const std::size_t cameras = rig.cameras.size();
  const std::size_t elements = header.format.elements();
  data::TrialBlock block;
  for (std::size_t first = 0; first < lines; first += kBlock) {
    const std::size_t count = std::min(kBlock, lines - first);
    block.Resize(count, header);
    for (std::size_t i = 0; i < count; ++i) {
      block.t[i] = (static_cast<double>(first + i) + 0.5) / header.line_rate;
      block.slot[i] = cycle[(first + i) % cycle.size()];
    }
    ForLines(lab, count, options.workers, [&](Exposer& exposer, std::size_t i) {
      const std::size_t line = first + i;
      const double stamp = block.t[i];
      const auto& path = paths[static_cast<std::size_t>(block.slot[i])];
      std::array<Eigen::Vector3d, 2> instants;
      if (path) {
        instants[0] = rig.X_WM * path->At(run_time(stamp - half_spread));
        instants[1] = rig.X_WM * path->At(run_time(stamp + half_spread));
      }
      for (std::size_t c = 0; c < cameras; ++c) {
        exposer.Line(rig.cameras[c], {instants.data(), path ? std::size_t{2} : std::size_t{0}},
                     rig.flash_electrons, DarkLevel(lab.sensor, stamp, rig.drift_phase[c]),
                     noise.Stream("line", line * cameras + c),
                     {&block.counts[(i * cameras + c) * elements], elements});
      }
    });
    trial.Append(block);
    for (std::size_t i = 0; truth != nullptr && i < count; ++i) {
      const std::size_t slot = static_cast<std::size_t>(block.slot[i]);
      if (!paths[slot]) continue;
      truth->t.push_back(block.t[i]);
      truth->mark.push_back(truth->FindMark(header.slots[slot]));
      truth->status.push_back(data::SampleStatus::kGood);
      true_points.push_back(rig.X_WM * paths[slot]->At(run_time(block.t[i])));
    }
    if (options.progress) {
      options.progress(static_cast<double>(first + count) / static_cast<double>(lines));
    }
  }
  if (truth != nullptr) {
    const auto n = static_cast<Eigen::Index>(true_points.size());
    truth->p.resize(3, n);
    for (Eigen::Index i = 0; i < n; ++i) {
      truth->p.col(i) = true_points[static_cast<std::size_t>(i)];
    }
    truth->cov.setZero(6, n);
  }
}

data::Survey ExposeSurvey(const data::Lab& lab, const data::Survey& points,
                          const ExposeOptions& options) {
  constexpr double kSecondsPerPoint = 10.0;  // a surveyor's pace, for the dark level's drift

  const VirtualRig rig = MakeVirtualRig(lab);
  const data::TrialHeader header = HeaderOf(lab);
  const std::size_t n = points.size();
  const std::size_t cameras = rig.cameras.size();
  const std::size_t elements = header.format.elements();
  const Rng seed(lab.seed);

  data::Survey survey;
  survey.id = points.id;
  survey.cameras = header.cameras;
  survey.format = header.format;
  survey.p = points.p;
  survey.cov = points.cov;
  survey.lit.resize(n * cameras * elements);
  survey.dark.resize(survey.lit.size());
  for (std::size_t i = 0; i < n; ++i) {
    const auto col = static_cast<Eigen::Index>(i);
    auto c = survey.cov.col(col);
    if (c.isZero(0.0)) c(0) = c(3) = c(5) = lab.survey.sigma * lab.survey.sigma;
    Eigen::Matrix3d C;
    C << c(0), c(1), c(2), c(1), c(3), c(4), c(2), c(4), c(5);
    Rng station = seed.Stream("station", i);
    const Eigen::Vector3d z(station.Normal(), station.Normal(), station.Normal());
    survey.p.col(col) += C.llt().matrixL() * z;
  }
  const Rng noise = seed.Stream("survey");
  ForLines(lab, n, options.workers, [&](Exposer& exposer, std::size_t i) {
    const Eigen::Vector3d p_W = points.p.col(static_cast<Eigen::Index>(i));
    for (std::size_t c = 0; c < cameras; ++c) {
      const double level =
          DarkLevel(lab.sensor, kSecondsPerPoint * static_cast<double>(i), rig.drift_phase[c]);
      const std::size_t at = (i * cameras + c) * elements;
      exposer.Line(rig.cameras[c], {&p_W, 1}, rig.survey_electrons, level,
                   noise.Stream("lit", i * cameras + c), {&survey.lit[at], elements});
      exposer.Line(rig.cameras[c], {}, 0.0, level, noise.Stream("dark", i * cameras + c),
                   {&survey.dark[at], elements});
    }
  });
  if (options.progress) options.progress(1.0);
  return survey;
}

}  // namespace unfurl::measure
