#include "study/effects.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <limits>

#include "base/cpu_time.h"
#include "base/error.h"
#include "base/statistics.h"
#include "correlate/sampled_model.h"
#include "data/toml_override.h"
#include "sim/methods/choose_method.h"
#include "study/latch_words.h"
#include "study/scene_model.h"

namespace unfurl::study {

namespace {

std::vector<std::string> With(std::vector<std::string> a, const std::vector<std::string>& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

// A run of the scene with some overrides.
struct Outcome {
  correlate::Prediction motion;
  double seconds = 0.0;  // of CPU [s]
};

class Bench {
 public:
  Bench(std::string scene, std::vector<std::string> overrides, double rtol,
        correlate::Stamps stamps)
      : scene_(std::move(scene)),
        overrides_(std::move(overrides)),
        rtol_(rtol),
        stamps_(std::move(stamps)) {}

  // What does not run is a status with a message.
  Outcome Run(const std::vector<std::string>& more, double tighter = 1.0) const {
    constexpr double kRepeatBelow = 0.2;  // [s]: shorter ones are timed three times
    constexpr int kTimes = 3;             // so that their median passes over one disturbance
    Outcome out;
    std::vector<double> seconds;
    try {
      SceneModelOptions options;
      options.scene = scene_;
      options.set = With(overrides_, more);
      options.rtol = tighter * rtol_;
      for (int k = 0; k < kTimes; ++k) {
        const SceneModel model(options, {});  // a new one: it keeps what it has computed
        const double start = CpuSeconds(CLOCK_THREAD_CPUTIME_ID);
        out.motion = model.Evaluate({}, stamps_);
        seconds.push_back(CpuSeconds(CLOCK_THREAD_CPUTIME_ID) - start);
        if (seconds.back() > kRepeatBelow) break;
      }
    } catch (const Error& e) {
      if (e.kind() == ErrorKind::kMachine) throw;  // says nothing about the effect
      out.motion.status = correlate::ModelStatus::kFailed;
      out.motion.message = e.what();
    }
    if (!seconds.empty()) out.seconds = Median(seconds);
    return out;
  }

  // The mark that differs most, by how much.
  void Compare(const correlate::Prediction& a, const correlate::Prediction& b,
               EffectChange* out) const {
    out->rms = -1.0;
    for (std::size_t m = 0; m < stamps_.marks.size(); ++m) {
      const auto distance = (a.marks[m].p - b.marks[m].p).colwise().norm();
      const double rms = distance.norm() / std::sqrt(static_cast<double>(distance.size()));
      if (rms <= out->rms) continue;
      out->rms = rms;
      out->largest = distance.maxCoeff();
      out->mark = stamps_.marks[m];
    }
  }

 private:
  std::string scene_;
  std::vector<std::string> overrides_;
  double rtol_;
  correlate::Stamps stamps_;
};

void Judge(const SceneEffectsOptions& options, double floor, EffectChange* change) {
  if (options.sigma <= 0.0) return;
  const double seen = options.part * options.sigma;
  if (change->rms > std::max(seen, floor)) {
    change->verdict = EffectVerdict::kNeeded;
  } else {
    change->verdict = floor > seen ? EffectVerdict::kCannotTell : EffectVerdict::kNotNeeded;
  }
}

// Leaves out one upon the other, the smallest first, as long as nobody could see all of it.
void Reduce(const Bench& bench, const correlate::Prediction& whole,
            const SceneEffectsOptions& options, SceneEffects* out) {
  std::vector<const EffectChange*> order;
  for (const EffectChange& c : out->effects) {
    if (c.effect.there && c.verdict == EffectVerdict::kNotNeeded) order.push_back(&c);
  }
  std::stable_sort(order.begin(), order.end(),
                   [](const EffectChange* a, const EffectChange* b) { return a->rms < b->rms; });
  out->reduced_seconds = out->seconds;
  for (const EffectChange* c : order) {
    const std::vector<std::string> set = With(out->set, c->effect.set);
    const Outcome reduced = bench.Run(set);
    if (reduced.motion.status != correlate::ModelStatus::kGood) continue;
    EffectChange together;
    bench.Compare(whole, reduced.motion, &together);
    if (together.rms > options.part * options.sigma) continue;
    out->set = set;
    out->left_out.push_back(c->effect.name);
    out->reduced_rms = together.rms;
    out->reduced_seconds = reduced.seconds;
  }
}

}  // namespace

void SceneEffectsOptions::Check() const {
  auto require = [](bool good, const char* option, const char* remedy) {
    if (!good) throw Error("is out of its range", option, remedy);
  };
  require(sigma >= 0.0 && std::isfinite(sigma), "--sigma", "give a length, or 0 for no verdicts");
  require(part > 0.0 && std::isfinite(part), "--part", "give a positive part of the sigma");
  require(rtol == 0.0 || (rtol >= 1e-12 && rtol <= 1e-2), "rtol", "stay within 1e-12 to 1e-2");
  require(duration >= 0.0 && std::isfinite(duration), "--duration", "give seconds, or 0");
}

std::string ReducedScene(const std::string& scene, const std::vector<std::string>& overrides,
                         const std::vector<std::string>& more) {
  return data::TextWithOverrides(scene, With(overrides, more));
}

SceneEffects WeighEffects(const std::string& path, const std::vector<std::string>& overrides,
                          const SceneEffectsOptions& options) {
  options.Check();
  const data::TomlTable document = data::LoadToml(path, overrides);
  const data::Scene scene = data::ReadScene(document, path);
  if (scene.marks.empty()) {
    throw Error("the scene has no marks to look at", path, "add a [mark.NAME] to what matters");
  }
  constexpr double kTolerance = 1e-6;  // where nothing is said, as of a simulation
  constexpr double kSamples = 2000.0;  // that runs are compared on: some twenty a vibration
  SceneEffects out;
  out.duration = options.duration > 0.0 ? options.duration : scene.duration;
  out.rtol = options.rtol > 0.0 ? options.rtol : scene.solver.rtol.value_or(kTolerance);
  std::vector<std::string> marks;
  for (const data::SceneMark& mark : scene.marks) marks.push_back(mark.name);
  const double step = out.duration / kSamples;
  correlate::Stamps stamps = correlate::EvenStamps(marks, 0.0, out.duration, step);
  const Bench bench(path, overrides, out.rtol, std::move(stamps));
  const std::vector<EffectSwitch> switches = EffectsOf(scene, document, options.each);
  const double runs = static_cast<double>(switches.size()) + 2.0;
  auto tell = [&](std::size_t done, const std::string& what) {
    if (options.progress) options.progress(static_cast<double>(done) / runs, what);
  };

  // 1. The scene as it is, and what its own error moves.
  tell(0, "as it is");
  const Outcome whole = bench.Run({});
  if (whole.motion.status != correlate::ModelStatus::kGood) {
    throw Error("the scene does not run: " + whole.motion.message, path, "see `unfurl simulate`");
  }
  out.seconds = whole.seconds;
  tell(1, "a tighter tolerance");
  EffectChange floor;
  const Outcome tight = bench.Run({}, sim::TighterTolerance(out.rtol) / out.rtol);
  if (tight.motion.status == correlate::ModelStatus::kGood) {
    bench.Compare(whole.motion, tight.motion, &floor);
  }
  out.floor = std::max(0.0, floor.rms);

  // 2. Each effect switched.
  for (const EffectSwitch& effect : switches) {
    tell(out.effects.size() + 2, effect.name);
    EffectChange change;
    change.effect = effect;
    const Outcome other = bench.Run(effect.set);
    change.seconds = other.seconds;
    if (other.motion.status != correlate::ModelStatus::kGood) {
      change.verdict = EffectVerdict::kFailed;  // and so it stays
      change.message = other.motion.message;
    } else {
      bench.Compare(whole.motion, other.motion, &change);
      change.latches = LatchWords(whole.motion.events, other.motion.events, step / kSamples);
      Judge(options, out.floor, &change);
    }
    out.effects.push_back(std::move(change));
  }

  // 3. As many left out together as nobody would see.
  if (options.sigma > 0.0) Reduce(bench, whole.motion, options, &out);
  return out;
}

}  // namespace unfurl::study
