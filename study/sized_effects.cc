#include "study/sized_effects.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <type_traits>
#include <utility>

#include "base/cpu_time.h"
#include "base/text.h"
#include "study/rivals.h"
#include "study/trial_verdict.h"

namespace unfurl::study {
namespace {

// A search begins with this part of what would stop the scene within its duration [-].
constexpr double kNext = 1e-6;
// Friction has its whole moment at this part of a turn of 1 rad, or of the scene's length, in the
// scene's duration [-].
constexpr double kSizedCreep = 0.05;

// What a scene's masses, lengths and times are about.
struct Scale {
  double mass = 0.0, inertia = 0.0, length = 0.0, time = 0.0;  // [kg], [kg m^2], [m], [s]
};

Scale ScaleOf(const data::Scene& scene) {
  Scale out;
  out.time = scene.duration;
  for (const data::SceneBody& body : scene.bodies) {
    out.mass += body.mass;
    out.inertia += body.inertia;
  }
  for (const data::SceneBeam& beam : scene.beams) {
    out.mass += beam.mass;
    out.length += beam.length;
  }
  const auto lever = [&](const data::SceneEnd& end) {
    if (end.kind == data::SceneEnd::Kind::kBody)
      out.length += std::hypot(end.point[0], end.point[1]);
  };
  for (const data::SceneJoint& joint : scene.joints) {
    lever(joint.inner);
    lever(joint.outer);
    out.length += std::abs(joint.travel);
  }
  out.inertia += out.mass * out.length * out.length;
  return out;
}

class SizedList {
 public:
  SizedList(const data::Scene& scene, const data::Study& study, bool each)
      : scene_(scene), study_(study), each_(each), scale_(ScaleOf(scene)) {}

  std::vector<SizedEffect> Make() {
    using Kind = data::SceneJoint::Kind;
    const double T = scale_.time, I = scale_.inertia, m = scale_.mass;
    for (const Kind kind : {Kind::kRevolute, Kind::kSlider}) {
      const bool turns = kind == Kind::kRevolute;
      const double size = turns ? I : m;
      const std::string what = turns ? "joints" : "sliders";
      Joints<data::SceneDamper>(kind, "dampers of the " + what, turns ? "N m s/rad" : "N s/m",
                                "damping", kNext * size / T);
      Joints<data::SceneQuadraticDamper>(kind, "quadratic dampers of the " + what,
                                         turns ? "N m s^2/rad^2" : "N s^2/m^2", "damping",
                                         kNext * (turns ? size : size / scale_.length));
      const double whole = turns ? 1.0 : scale_.length;
      Joints<data::SceneFriction>(
          kind, "friction of the " + what, turns ? "N m" : "N", "moment",
          kNext * size * whole / (T * T), [whole, T](const data::SceneJoint&) {
            return fmt::format("friction.creep_rate={:.17g}", kSizedCreep * whole / T);
          });
      Springs(kind, what, turns ? "N m/rad" : "N/m", kNext * size / (T * T));
    }
    Clearance();
    Gravity();
    const bool none = std::none_of(scene_.beams.begin(), scene_.beams.end(),
                                   [](const data::SceneBeam& b) { return b.damping > 0.0; });
    for (const data::SceneBeam& beam : scene_.beams) {
      if (none)
        Add("damping of the beams", beam.name, "s", "beam." + beam.name + ".damping", kNext * T);
    }
    return std::move(out_);
  }

 private:
  // What comes with the effect of a joint.
  using With = std::function<std::string(const data::SceneJoint&)>;

  // Nothing says where they are at rest: at 0, or where the joints start.
  void Springs(data::SceneJoint::Kind kind, const std::string& what, const std::string& unit,
               double first) {
    const auto start = [](const data::SceneJoint& joint) {
      return joint.kind == data::SceneJoint::Kind::kRevolute ? joint.theta : joint.travel;
    };
    const auto free = [](double at) { return fmt::format("spring.free={:.17g}", at); };
    Joints<data::SceneSpring>(kind, "springs of the " + what + ", at rest at 0", unit, "stiffness",
                              first, [&](const data::SceneJoint&) { return free(0.0); });
    const bool same = std::none_of(
        scene_.joints.begin(), scene_.joints.end(),
        [&](const data::SceneJoint& joint) { return joint.kind == kind && start(joint) != 0.0; });
    if (same) return;
    Joints<data::SceneSpring>(kind, "springs of the " + what + ", at rest at the start", unit,
                              "stiffness", first,
                              [&](const data::SceneJoint& joint) { return free(start(joint)); });
  }

  // About the latched angle: of latches elsewhere no one number says both stops.
  void Clearance() {
    for (const data::SceneJoint& joint : scene_.joints) {
      if (joint.latch && (joint.latch->theta_a != 0.0 || joint.latch->theta_b != 0.0)) return;
    }
    for (const data::SceneJoint& joint : scene_.joints) {
      if (!joint.latch) continue;
      for (const char* stop : {"theta_a", "theta_b"}) {
        Add("clearance of the latches", joint.name, "rad",
            fmt::format("joint.{}.latch.{}", joint.name, stop), kNext);
      }
    }
  }

  // A table that tilts, a boom that is not level.
  void Gravity() {
    if (scene_.gravity) return;
    const double first = kNext * scale_.length / (scale_.time * scale_.time);
    for (const int axis : {0, 1}) {
      const std::size_t before = out_.size();
      Add(axis == 0 ? "gravity along x" : "gravity along y", "", "m/s^2",
          fmt::format("gravity.acceleration[{}]", axis), first, "gravity.acceleration=[0.0, 0.0]");
      if (out_.size() > before) out_.back().either_sign = true;
    }
  }

  template <typename E>
  void Joints(data::SceneJoint::Kind kind, const std::string& name, const std::string& unit,
              const std::string& key, double first, const With& with = {}) {
    const auto has = [kind](const data::SceneJoint& j) {
      if (j.kind != kind) return false;
      bool found = false;
      data::VisitJointEffects(j, [&]<typename F>(const std::optional<F>& effect) {
        if constexpr (std::is_same_v<E, F>) found = effect.has_value();
      });
      return found;
    };
    if (std::any_of(scene_.joints.begin(), scene_.joints.end(), has)) return;
    for (const data::SceneJoint& joint : scene_.joints) {
      if (joint.kind != kind || joint.drive) continue;
      const std::string table = "joint." + joint.name + ".";
      Add(name, joint.name, unit, fmt::format("{}{}.{}", table, E::kKey, key), first,
          with ? table + with(joint) : std::string());
    }
  }

  void Add(const std::string& kind, const std::string& part, const std::string& unit,
           const std::string& key, double first, const std::string& with = {}) {
    for (const data::StudyParameter& p : study_.parameters) {
      if (std::find(p.keys.begin(), p.keys.end(), key) != p.keys.end()) return;
    }
    if (!(first > 0.0) || !std::isfinite(first)) return;
    const std::string name = each_ && !part.empty() ? kind + " (" + part + ")" : kind;
    if (out_.empty() || out_.back().name != name) out_.push_back({name, unit, {}, {}, first});
    out_.back().keys.push_back(key);
    if (!with.empty()) out_.back().set.push_back(with);
  }

  const data::Scene& scene_;
  const data::Study& study_;
  bool each_;
  Scale scale_;
  std::vector<SizedEffect> out_;
};

// Deviances at sizes, from 0 on, where it is 0.
class SizeSearch {
 public:
  using Weigh = std::function<void(const std::vector<std::string>&, TrialEffect*)>;
  SizeSearch(const SizedEffect& sized, const Weigh& weigh) : sized_(sized), weigh_(weigh) {}

  TrialEffect At(double size) {
    TrialEffect e;
    e.effect = {sized_.name, false, sized_.set};
    for (const std::string& key : sized_.keys) {
      e.effect.set.push_back(fmt::format("{}={:.17g}", key, size));
    }
    e.unit = sized_.unit;
    e.size = size;
    weigh_(e.effect.set, &e);
    runs_ += e.runs;
    looks_ += e.looks;
    seconds_ += e.seconds;
    return e;
  }
  // What all of it has taken.
  void Count(TrialEffect* e) const {
    e->runs = runs_;
    e->looks = looks_;
    e->seconds = seconds_;
  }

  // At a size whose change of the fitted rows is some `wanted` [sigmas]; not fitted: none is.
  TrialEffect Seen(double wanted) {
    constexpr int kTries = 8;        // 1e16 times the first size
    constexpr double kMost = 100.0;  // a step: what is too small is seen in rounding errors alone
    constexpr double kNear = 3.0;    // of `wanted`: sees as well
    double size = sized_.first;
    TrialEffect e = At(size);
    for (int k = 1; k < kTries; ++k) {
      const bool far = !e.fitted || e.change > kMost * wanted;
      if (!far && e.change >= wanted / kNear) break;
      size *=
          far ? 1.0 / kMost : std::clamp(wanted / std::max(e.change, wanted / kMost), kNear, kMost);
      TrialEffect next = At(size);
      if (e.fitted && !next.fitted) break;
      e = std::move(next);
    }
    return e;
  }

 private:
  const SizedEffect& sized_;
  const Weigh& weigh_;
  std::size_t runs_ = 0, looks_ = 0;
  double seconds_ = 0.0;
};

// The parabola through nothing and two others.
struct Parabola {
  double vertex = 0.0, sigma = 0.0;  // where it is highest, and 1 below [size]
  Parabola(const TrialEffect& p, const TrialEffect& q) {
    const double slope_p = p.deviance / p.size, slope_q = q.deviance / q.size;
    const double bend = (slope_q - slope_p) / (q.size - p.size);
    if (!(bend < 0.0)) return;
    vertex = p.size - 0.5 * (p.size + slope_p / bend);
    sigma = 1.0 / std::sqrt(-bend);
  }
  bool found() const { return sigma > 0.0; }
};

// What is known where nothing above 0 fits better: by how much it may move the fit all the same.
TrialEffect Without(TrialEffect near, double sigma, double rows) {
  near.change_sigma = near.change / std::abs(near.size) * sigma;
  near.size = near.deviance = near.deviance_least = 0.0;
  near.change = near.change_rms = near.share = near.saved = 0.0;
  near.size_sigma = sigma;
  near.probability = ProbabilityOfEffect(0.0, rows, near);
  near.held_out = {};
  near.shifts.clear();
  near.latches.clear();
  return near;
}

}  // namespace

std::vector<SizedEffect> SizedEffectsOf(const data::Scene& scene, const data::Study& study,
                                        bool each) {
  return SizedList(scene, study, each).Make();
}

void WeighSized(const SizedEffect& sized, double rows, const SizeSearch::Weigh& weigh,
                TrialEffect* effect) {
  constexpr double kSigmas = 5.0;       // where a parabola is taken: seen well, and near
  constexpr int kRounds = 6;            // of parabolas; three are usual
  constexpr double kSettledSize = 0.3;  // of a standard error
  constexpr double kFarther = 4.0, kFarthest = 30.0;  // of the farthest size so far
  constexpr double kNone = 1e-3;                      // of its standard error: a size that is none
  SizeSearch search(sized, weigh);
  TrialEffect near = search.Seen(kSigmas / std::sqrt(rows));
  *effect = near;
  TrialEffect far = near.fitted ? search.At(2.0 * near.size) : TrialEffect();
  for (int k = 0; k < kRounds && far.fitted; ++k) {
    const Parabola way(near, far);
    if (way.found() &&
        !(sized.either_sign ? std::abs(way.vertex) > kNone * way.sigma : way.vertex > 0.0)) {
      *effect = Without(near, way.sigma, rows);
      break;
    }
    // A deviance that grows ever faster: the size is far off.
    const double most = kFarthest * std::abs(far.size);
    const double size = way.found()          ? std::clamp(way.vertex, -most, most)
                        : far.deviance > 0.0 ? kFarther * far.size
                        : sized.either_sign  ? -near.size
                                             : 0.0;
    if (size == 0.0) break;
    TrialEffect next = search.At(size);
    if (!next.fitted) break;
    const double sigma = way.found() ? way.sigma : 0.0;
    next.size_sigma = sigma;
    next.change_sigma = next.change / std::abs(size) * sigma;
    const double moved = std::min(std::abs(size - far.size), std::abs(size - near.size));
    if (next.deviance >= effect->deviance || effect->size_sigma == 0.0) *effect = next;
    if (moved < kSettledSize * sigma) break;
    if (size > near.size) near = std::move(far);
    far = std::move(next);
  }
  search.Count(effect);
}

void FitMissing(const data::Study& study, const FitStudyOptions& options,
                const std::vector<SizedEffect>& sized, std::vector<TrialEffect>* effects) {
  constexpr double kWidest = 1e3;  // of the size that was found: beyond any wrong start
  for (TrialEffect& e : *effects) {
    const auto which = std::find_if(sized.begin(), sized.end(), [&](const SizedEffect& s) {
      return s.name == e.effect.name && !e.unit.empty();
    });
    if (which == sized.end() || e.size == 0.0 || !(e.probability > kSure)) continue;
    data::Study with = study;
    with.set.insert(with.set.end(), which->set.begin(), which->set.end());
    data::StudyParameter size;
    size.name = which->name;
    size.unit = which->unit;
    size.keys = which->keys;
    size.start = e.size;
    size.high = kWidest * std::abs(e.size);
    size.low = which->either_sign ? -size.high : 0.0;
    size.where = study.path;
    with.parameters.push_back(size);
    for (std::vector<std::string>& stage : with.free) stage.push_back(size.name);
    const double start = CpuSeconds();
    const StudyFit fit = Fit(with, options);
    e.seconds += CpuSeconds() - start;
    if (!fit.Usable() || !Explains(fit)) {
      e.verdict = EffectVerdict::kCannotTell;
      e.message = "with it the model still does not explain the data";
      continue;
    }
    const correlate::ParameterEstimate& found = fit.result.parameters.back();
    e.verdict = EffectVerdict::kNeeded;
    e.size = found.value;
    e.size_sigma = found.sigma;
    e.message = "with it the model explains the data, as it is not";
    // By the noise of this fit: what the other found is of the motion that it lacks.
    double squares = 0.0, rows = 0.0;
    for (const correlate::TrialResult& t : fit.result.trials) {
      squares += t.registration.SumOfSquares();
      rows += static_cast<double>((t.registration.residual.array() != 0.0).count());
    }
    e.left = squares / std::max(1.0, rows);
  }
}

void DoubtRivals(double rows, std::vector<TrialEffect>* effects) {
  constexpr double kApart = 9.2;  // of -2 log likelihood: 100 to 1
  const auto missed = [](const TrialEffect& e) {
    return !e.unit.empty() && e.verdict == EffectVerdict::kNeeded;
  };
  const TrialEffect* best = nullptr;
  for (const TrialEffect& e : *effects) {
    if (missed(e) && (best == nullptr || e.left < best->left)) best = &e;
  }
  if (best == nullptr) return;
  // By the noise that the best has found; residuals below their sigmas tell no more than those.
  const double most = best->left + kApart * std::max(1.0, best->left) / rows;
  const std::string name = best->effect.name;
  std::vector<std::string> alike;
  for (const TrialEffect& e : *effects) {
    if (missed(e) && e.left < most) alike.push_back(e.effect.name);
  }
  for (TrialEffect& e : *effects) {
    if (!missed(e) || (alike.size() == 1 && e.effect.name == name)) continue;
    e.verdict = EffectVerdict::kCannotTell;
    e.message = e.left < most
                    ? fmt::format("the scene lacks one of {}, and the trial does not say which",
                                  JoinWords(alike))
                    : fmt::format("{} take more of what it takes: weigh it again with that", name);
  }
}

}  // namespace unfurl::study
