#include "measure/expose.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "base/dense.h"
#include "base/error.h"
#include "base/random_vector.h"
#include "base/worker_pool.h"
#include "measure/exposer.h"

namespace unfurl::measure {

namespace {

// An Exposer is made for each task: lines enough to make that cheap, few enough for all workers to
// end together.
constexpr std::size_t kLinesPerTask = 16;

// Calls task(exposer, first, end) for pieces of [0, count), in parallel.
template <typename Task>
void ForLines(const data::Lab& lab, const VirtualRig& rig, std::size_t count, std::size_t workers,
              const Task& task) {
  const std::size_t tasks = (count + kLinesPerTask - 1) / kLinesPerTask;
  ParallelFor(tasks, workers, [&](std::size_t k) {
    Exposer exposer(lab, rig);
    task(exposer, k * kLinesPerTask, std::min(count, (k + 1) * kLinesPerTask));
  });
}

data::LineFormats FormatsOf(const data::Lab& lab) {
  data::LineFormats formats{lab.sensor.format, {}};
  const bool differ = std::any_of(lab.cameras.begin(), lab.cameras.end(),
                                  [](const auto& camera) { return camera.sensor.has_value(); });
  for (std::size_t c = 0; differ && c < lab.cameras.size(); ++c) {
    formats.by_camera.push_back(lab.SensorOf(c).format);
  }
  return formats;
}

// Lines that residual charge is followed back in any camera.
std::size_t LongestMemory(const data::Lab& lab) {
  int longest = 0;
  for (std::size_t c = 0; c < lab.cameras.size(); ++c) {
    longest = std::max(longest, ResidualMemory(lab.SensorOf(c)));
  }
  return static_cast<std::size_t>(longest);
}

// What even light would read, as one does before a trial: mean of lit lines less mean of dark ones.
std::vector<float> RecordFlatField(const data::Lab& lab, const VirtualRig& rig,
                                   std::size_t workers) {
  const data::LineFormats formats = FormatsOf(lab);
  std::vector<float> response(formats.ActiveBefore(rig.cameras.size()));
  const Rng seed = Rng(lab.seed).Stream("flat field");
  ParallelFor(rig.cameras.size(), workers, [&](std::size_t c) {
    const data::LabSensor& sensor = lab.SensorOf(c);
    const data::LineFormat& format = sensor.format;
    const auto n = static_cast<std::size_t>(format.active);
    std::vector<double> light(n, lab.flat_field.level * sensor.full_well), none(n, 0.0);
    const std::vector<double>& truth = rig.patterns[c].response;
    for (std::size_t k = 0; k < truth.size(); ++k) light[k] *= truth[k];
    if (sensor.blooming > 0.0) Bloom(sensor, light);
    std::vector<double> sum(n, 0.0);
    std::vector<std::uint16_t> line(format.elements());
    const auto add = [&](std::span<const double> pixels, double sign, Rng rng) {
      ReadOut(sensor, pixels, sensor.dark_level, rng, line, &rig.patterns[c]);
      for (std::size_t k = 0; k < n; ++k) sum[k] += sign * line[format.first_active() + k];
    };
    for (int i = 0; i < lab.flat_field.lines; ++i) {
      const std::uint64_t index =
          c * static_cast<std::size_t>(lab.flat_field.lines) + static_cast<std::size_t>(i);
      add(light, 1.0, seed.Stream("lit", index));
      add(none, -1.0, seed.Stream("dark", index));
    }
    double mean = 0.0;
    for (const double s : sum) mean += s / static_cast<double>(n);
    for (std::size_t k = 0; k < n; ++k)
      response[formats.ActiveBefore(c) + k] = static_cast<float>(sum[k] / mean);
  });
  return response;
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
  header.format = FormatsOf(lab);
  header.line_rate = lab.strobe.line_rate;
  if (lab.flat_field.lines > 0) {
    header.response = RecordFlatField(lab, MakeVirtualRig(lab), 0);
  }
  return header;
}

namespace {

// The lines of a trial before they are exposed: what each of them shows, and when.
class TrialPlan {
 public:
  TrialPlan(const data::Lab& lab, const data::Run& run, const data::TrialHeader& header,
            const VirtualRig& rig)
      : rig_(rig),
        line_rate_(header.line_rate),
        scale_(1.0 + lab.strobe.clock_drift),
        half_spread_(0.5 * lab.led.flash / std::sqrt(3.0)),
        led_axis_(rig.X_WM.linear() * lab.led.axis),
        paths_(header.slots.size()) {
    for (const std::string& slot : lab.strobe.slots) {
      const auto at = std::find(header.slots.begin(), header.slots.end(), slot);
      cycle_.push_back(static_cast<std::int32_t>(at - header.slots.begin()));
    }
    for (std::size_t s = 0; s < header.slots.size(); ++s) {
      for (const std::string& mark : data::MarksOfSlot(header.slots[s])) {
        paths_[s].emplace_back(run, mark);
      }
    }
    if (run.t.size() < 2) {
      throw Error("holds no motion: fewer than two samples", "the run", "simulate again");
    }
    const double last_stamp = (run.t.back() + rig.lead) / scale_;
    lines_ =
        static_cast<std::size_t>(std::max(0.0, std::floor(last_stamp * header.line_rate + 0.5)));
  }

  std::size_t lines() const { return lines_; }
  double StampOf(std::size_t line) const { return (static_cast<double>(line) + 0.5) / line_rate_; }
  std::int32_t SlotOf(std::size_t line) const { return cycle_[line % cycle_.size()]; }

  Eigen::Vector3d PlaceOf(std::size_t slot, std::size_t mark, double stamp) const {
    return rig_.X_WM * paths_[slot][mark].At(RunTime(stamp));
  }

  // What the marks of a line send out, at the two instants of Gauss and Legendre that have the mean
  // and the spread of a flash's whole length.
  void Light(std::size_t line, std::vector<std::array<Eigen::Vector3d, 2>>* instants,
             std::vector<Exposer::Led>* leds) const {
    const double stamp = StampOf(line);
    instants->clear();
    for (const MarkPath& path : paths_[static_cast<std::size_t>(SlotOf(line))]) {
      instants->push_back({rig_.X_WM * path.At(RunTime(stamp - half_spread_)),
                           rig_.X_WM * path.At(RunTime(stamp + half_spread_))});
    }
    leds->clear();
    for (const auto& places : *instants) leds->push_back({places, led_axis_});
  }

 private:
  // Stamp s of the recorder is true time s (1 + drift); release is at true time `lead`.
  double RunTime(double stamp) const { return stamp * scale_ - rig_.lead; }

  const VirtualRig& rig_;
  double line_rate_, scale_, half_spread_;
  Eigen::Vector3d led_axis_;
  std::vector<std::vector<MarkPath>> paths_;  // of what each slot lights
  std::vector<std::int32_t> cycle_;           // slots in the order of the lines
  std::size_t lines_ = 0;
};

// The true places of the marks at the lines' stamps, without error.
class TruthRecorder {
 public:
  TruthRecorder(const data::TrialHeader& header, data::Tracks* truth)
      : header_(header), truth_(truth) {
    *truth = {};
    truth->frame = "rig";
    for (const std::string& slot : header.slots) {
      for (const std::string& mark : data::MarksOfSlot(slot)) {
        if (truth->FindMark(mark) < 0) truth->marks.push_back(mark);
      }
    }
  }

  void Add(const TrialPlan& plan, const data::TrialBlock& block) {
    for (std::size_t i = 0; i < block.size(); ++i) {
      const std::size_t slot = static_cast<std::size_t>(block.slot[i]);
      const std::vector<std::string> marks = data::MarksOfSlot(header_.slots[slot]);
      for (std::size_t m = 0; m < marks.size(); ++m) {
        truth_->t.push_back(block.t[i]);
        truth_->mark.push_back(truth_->FindMark(marks[m]));
        truth_->status.push_back(data::SampleStatus::kGood);
        points_.push_back(plan.PlaceOf(slot, m, block.t[i]));
      }
    }
  }

  void Finish() {
    const auto n = static_cast<Eigen::Index>(points_.size());
    truth_->p.resize(3, n);
    for (Eigen::Index i = 0; i < n; ++i) truth_->p.col(i) = points_[static_cast<std::size_t>(i)];
    truth_->cov.setZero(6, n);
  }

 private:
  const data::TrialHeader& header_;
  data::Tracks* truth_;
  std::vector<Eigen::Vector3d> points_;
};

}  // namespace

void ExposeTrial(const data::Lab& lab, const data::Run& run, data::TrialWriter& trial,
                 const ExposeOptions& options, data::Tracks* truth) {
  constexpr std::size_t kBlock = 512;  // lines held at once
  const VirtualRig rig = MakeVirtualRig(lab);
  const data::TrialHeader header = HeaderOf(lab);
  const TrialPlan plan(lab, run, header, rig);
  std::optional<TruthRecorder> recorder;
  if (truth != nullptr) recorder.emplace(header, truth);
  const Rng noise = Rng(lab.seed).Stream("trial");
  const std::size_t cameras = rig.cameras.size();
  const std::size_t memory = LongestMemory(lab);
  data::TrialBlock block;
  for (std::size_t first = 0; first < plan.lines(); first += kBlock) {
    const std::size_t count = std::min(kBlock, plan.lines() - first);
    block.Resize(count, header);
    for (std::size_t i = 0; i < count; ++i) {
      block.t[i] = plan.StampOf(first + i);
      block.slot[i] = plan.SlotOf(first + i);
    }
    ForLines(lab, rig, count, options.workers,
             [&](Exposer& exposer, std::size_t i, std::size_t end) {
               std::vector<std::array<Eigen::Vector3d, 2>> instants;
               std::vector<Exposer::Led> leds;
               // What the lines before have left in the pixels.
               const std::size_t line0 = first + i;
               const std::size_t before = std::min(memory, line0);
               for (std::size_t line = line0 - before; line < first + end; ++line) {
                 const double stamp = plan.StampOf(line);
                 plan.Light(line, &instants, &leds);
                 const Exposer::Line light{.leds = leds,
                                           .electrons = rig.flash_electrons,
                                           .t = stamp,
                                           .mains_phase = rig.mains_phase};
                 for (std::size_t c = 0; c < cameras; ++c) {
                   exposer.Collect(c, light);
                   if (line < line0) continue;
                   const std::size_t at = (line - first) * header.line_counts();
                   exposer.Read(c, DarkLevel(lab.SensorOf(c), stamp, rig.drift_phase[c]),
                                noise.Stream("line", line * cameras + c),
                                {&block.counts[at + header.format.ElementsBefore(c)],
                                 header.format.Of(c).elements()});
                 }
               }
             });
    trial.Append(block);
    if (recorder) recorder->Add(plan, block);
    if (options.progress) {
      options.progress(static_cast<double>(first + count) / static_cast<double>(plan.lines()));
    }
  }
  if (recorder) recorder->Finish();
}

data::Survey ExposeSurvey(const data::Lab& lab, const data::Survey& points,
                          const ExposeOptions& options) {
  constexpr double kSecondsPerPoint = 10.0;  // a surveyor's pace, for the dark level's drift

  const VirtualRig rig = MakeVirtualRig(lab);
  const data::TrialHeader header = HeaderOf(lab);
  const std::size_t n = points.size();
  const std::size_t cameras = rig.cameras.size();
  const Rng seed(lab.seed);

  data::Survey survey;
  survey.id = points.id;
  survey.set_up = points.set_up;
  survey.cameras = header.cameras;
  survey.format = header.format;
  survey.p = points.p;
  survey.cov = points.cov;
  survey.lit.resize(n * survey.line_counts());
  survey.dark.resize(survey.lit.size());
  for (std::size_t i = 0; i < n; ++i) {
    const auto col = static_cast<Eigen::Index>(i);
    auto c = survey.cov.col(col);
    if (c.isZero(0.0)) c(0) = c(3) = c(5) = lab.survey.sigma * lab.survey.sigma;
    Eigen::Matrix3d C;
    C << c(0), c(1), c(2), c(1), c(3), c(4), c(2), c(4), c(5);
    Rng station = seed.Stream("station", i);
    survey.p.col(col) += C.llt().matrixL() * NormalVector(&station);
  }
  if (lab.flat_field.lines > 0) survey.response = RecordFlatField(lab, rig, options.workers);
  const Rng noise = seed.Stream("survey");
  // The LED stands still while lines are taken, and so does what residual charge leaves of it.
  const auto expose = [&](Exposer& exposer, std::size_t c, const Exposer::Line& line, double level,
                          const Rng& rng, std::span<std::uint16_t> counts) {
    exposer.Forget();
    for (int k = 0; k <= ResidualMemory(lab.SensorOf(c)); ++k) exposer.Collect(c, line);
    exposer.Read(c, level, rng, counts);
  };
  ForLines(lab, rig, n, options.workers, [&](Exposer& exposer, std::size_t first, std::size_t end) {
    for (std::size_t i = first; i < end; ++i) {
      const Eigen::Vector3d p_W = points.p.col(static_cast<Eigen::Index>(i));
      const Exposer::Led led{.instants = {&p_W, 1}, .axis = lab.led.axis};
      // Points are minutes apart: where the mains then stand is chance.
      Rng mains = seed.Stream("survey mains", i);
      Exposer::Line lit{.leds = {&led, 1},
                        .electrons = rig.survey_electrons,
                        .t = kSecondsPerPoint * static_cast<double>(i),
                        .mains_phase = mains.Uniform(0.0, 2.0 * std::numbers::pi)};
      Exposer::Line dark = lit;
      dark.leds = {};
      dark.mains_phase = mains.Uniform(0.0, 2.0 * std::numbers::pi);
      for (std::size_t c = 0; c < cameras; ++c) {
        const double level = DarkLevel(lab.SensorOf(c), lit.t, rig.drift_phase[c]);
        const std::size_t at = survey.LineAt(i, c), elements = survey.format.Of(c).elements();
        expose(exposer, c, lit, level, noise.Stream("lit", i * cameras + c),
               {&survey.lit[at], elements});
        expose(exposer, c, dark, level, noise.Stream("dark", i * cameras + c),
               {&survey.dark[at], elements});
      }
    }
  });
  if (options.progress) options.progress(1.0);
  return survey;
}

}  // namespace unfurl::measure
