// What every effect of the list (sim/effects/effects.h) owes, by construction: whatever is added to
// the list is held to it without a line here. Its load is the negative gradient of its energy, but
// for what its power says; its tangent is the derivative of its load; its column and its part in
// the torque margin are its load on the joint.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <set>

#include "base/random.h"
#include "effects.h"
#include "scenes.h"
#include "sim/dynamics/dynamics.h"
#include "sim/dynamics/observables.h"
#include "sim/effects/effects.h"

namespace unfurl::sim::effect_list_test {
namespace {

// Five-point differences: with steps of 1e-4 the fourth power leaves some 1e-12 of fifth
// derivatives, and rounding of loads of some 100 N leaves 1e-10.
constexpr double kStep = 1e-4;
constexpr double kNear = 1e-7;  // of the largest entry

// Everything, a suspension, and a latch that is pressed. The contact is soft, so that differences
// of 1e-4 rad resolve it; forces keep their direction, since followers have no tangent.
std::string ListScene() {
  std::string text = EverythingScene();
  text.replace(text.find("frame = 'body'"), 14, "frame = 'world'");
  return text +
         "[suspension]\nlength = 3.0\n"
         "[contact.soft]\nK = 2e4\nC = 5.0\nQ = 3.0\nepsilon = 0.02\n"
         "[body.flap]\nmass = 0.2\ninertia = 0.01\n"
         "[joint.hinge]\ninner = 'bar'\ninner_point = [0.0, 0.2]\nouter = 'flap'\n"
         "outer_point = [-0.1, 0.0]\nsign = -1\ntheta = -0.4\n"
         "[joint.hinge.latch]\ntheta_a = 0.1\ntheta_b = 0.1\nlever = 0.1\ncontact = 'soft'\n";
}

// A motion that is only a table of numbers: any body can be moved by itself.
class Free {
 public:
  explicit Free(const Model& model)
      : model_(model), y_(model.initial_state), modes_(model.initial_modes) {
    const int n = model.rigid_bodies.count;
    Dynamics(model).Update(0.0, y_.data());  // stations
    c_.resize(n), s_.resize(n);
    fx_.resize(n), fy_.resize(n), m_.resize(n);
  }
  void Shake(std::uint64_t seed, double place, double speed) {
    Rng rng(seed);
    const int n = model_.rigid_bodies.count;
    for (int s = 0; s < n; ++s) {
      if (!model_.rigid_bodies.IsDynamic(s)) continue;
      for (int d = 0; d < 3; ++d) y_[d * n + s] += place * rng.Normal();
      for (int d = 3; d < 6; ++d) y_[d * n + s] = speed * rng.Normal();
    }
  }
  double& operator[](int entry) { return y_[entry]; }
  std::vector<LatchMode>& modes() { return modes_; }
  Motion At(double t = 0.3) {
    const int n = model_.rigid_bodies.count;
    const double* y = y_.data();
    for (int s = 0; s < n; ++s) c_[s] = std::cos(y[2 * n + s]), s_[s] = std::sin(y[2 * n + s]);
    return {t,         y,         y + n,     y + 2 * n, y + 3 * n,
            y + 4 * n, y + 5 * n, c_.data(), s_.data(), modes_.data()};
  }
  // Loads in the order of the state's positions.
  template <Effect E>
  std::vector<double> Load(const E& effect, double* power = nullptr) {
    for (auto* v : {&fx_, &fy_, &m_}) std::fill(v->begin(), v->end(), 0.0);
    effect.AddLoad(At(), {fx_.data(), fy_.data(), m_.data()}, power);
    std::vector<double> all = fx_;
    all.insert(all.end(), fy_.begin(), fy_.end());
    all.insert(all.end(), m_.begin(), m_.end());
    return all;
  }
  // d(value)/d(entry), value a vector.
  template <typename Value>
  std::vector<double> Slope(int entry, Value value) {
    const double kept = y_[entry];
    std::vector<double> sum;
    for (const auto& [at, weight] : {std::pair{1.0, 8.0}, {-1.0, -8.0}, {2.0, -1.0}, {-2.0, 1.0}}) {
      y_[entry] = kept + at * kStep;
      const std::vector<double> v = value();
      sum.resize(v.size(), 0.0);
      for (std::size_t i = 0; i < v.size(); ++i) sum[i] += weight / (12.0 * kStep) * v[i];
    }
    y_[entry] = kept;
    return sum;
  }

 private:
  const Model& model_;
  std::vector<double> y_, c_, s_, fx_, fy_, m_;
  std::vector<LatchMode> modes_;
};

double Largest(const std::vector<double>& v) {
  double largest = 0.0;
  for (const double x : v) largest = std::max(largest, std::fabs(x));
  return largest;
}

// Entries of the state that move by themselves: place, or rate with `from` = 3 n.
std::vector<int> Moving(const Model& model, int from = 0) {
  const int n = model.rigid_bodies.count;
  std::vector<int> entries;
  for (int s = 0; s < n; ++s) {
    if (!model.rigid_bodies.IsDynamic(s)) continue;
    for (int d = 0; d < 3; ++d) entries.push_back(from + d * n + s);
  }
  return entries;
}

// A new effect goes into EverythingScene(), one of a joint on an angle and on a travel, or the
// tests below say nothing of it.
TEST(EffectList, EveryEffectIsTested) {
  const Model model = ModelFrom(ListScene());
  std::set<std::string> names;
  ForEachEffect(model, [&](const auto& effect) {
    EXPECT_GT(effect.count(), 0) << effect.kText.name;
    EXPECT_TRUE(names.insert(effect.kText.name).second) << effect.kText.name;
  });
  EXPECT_EQ(names.size(), kEffects);
  ForEachJointEffect(model.joint_effects, [&](const auto& effect, std::size_t) {
    bool angle = false, travel = false;
    for (int k = 0; k < effect.count(); ++k) {
      (effect.coordinate(k).travel ? travel : angle) = true;
    }
    EXPECT_TRUE(angle && travel) << effect.kText.name;
  });
  EXPECT_EQ(model.initial_modes[0].lower_contact, 1);
}

// At rest nothing is lost, and what is left is conservative.
TEST(EffectList, LoadsAreGradientsOfTheirEnergies) {
  const Model model = ModelFrom(ListScene());
  for (const int seed : {1, 2, 3}) {
    Free motion(model);
    motion.Shake(seed, 0.02, 0.0);
    ForEachEffect(model, [&](const auto& effect) {
      if (effect.kPower == PowerKind::kWork) {
        EXPECT_EQ(effect.Energy(motion.At()), 0.0) << effect.kText.name;
        return;
      }
      const std::vector<double> load = motion.Load(effect);
      const double scale = std::max(1.0, Largest(load));
      for (const int entry : Moving(model)) {
        const double slope =
            motion.Slope(entry, [&] { return std::vector{effect.Energy(motion.At())}; })[0];
        EXPECT_NEAR(load[entry], -slope, kNear * scale) << effect.kText.name << " " << entry;
      }
      EXPECT_EQ(effect.kText.energy != nullptr, Largest(load) > 0.01) << effect.kText.name;
    });
  }
}

// load . v = -dE/dt - loss, or + work; what is lost is never won back.
TEST(EffectList, PowersBalance) {
  const Model model = ModelFrom(ListScene());
  const int n = model.rigid_bodies.count;
  for (const int seed : {4, 5, 6}) {
    Free motion(model);
    motion.Shake(seed, 0.02, 1.0);
    ForEachEffect(model, [&](const auto& effect) {
      double power = 0.0, given = 0.0, stored = 0.0;
      const std::vector<double> load = motion.Load(effect, &power);
      for (const int entry : Moving(model)) {
        const double v = motion[3 * n + entry];
        given += load[entry] * v;
        stored +=
            v * motion.Slope(entry, [&] { return std::vector{effect.Energy(motion.At())}; })[0];
      }
      const bool works = effect.kPower == PowerKind::kWork;
      EXPECT_NEAR(given, -stored + (works ? power : -power), kNear * (1.0 + Largest(load)))
          << effect.kText.name;
      EXPECT_EQ(power != 0.0, effect.HasPower()) << effect.kText.name;
      EXPECT_TRUE(works || power >= 0.0) << effect.kText.name;
    });
  }
}

// K at rest, where the directions of dampers do not turn under a force; D at speed.
TEST(EffectList, TangentsAreDerivativesOfTheLoads) {
  const Model model = ModelFrom(ListScene());
  const int n = model.rigid_bodies.count;
  ForEachEffect(model, [&](const auto& effect) {
    for (const bool damping : {false, true}) {
      Free motion(model);
      motion.Shake(7, 0.02, damping || !effect.HasPower() ? 1.0 : 0.0);
      Tangent tangent(model.rigid_bodies);
      for (const bool note : {true, false}) {  // the first pass notes the pattern
        tangent.Begin(note);
        effect.AddTangent(motion.At(), &tangent);
      }
      std::vector<double> ours(9 * n * n, 0.0);
      const auto add = [&](int a, int b, const Tangent::Block& block) {
        for (int r = 0; r < 3; ++r) {
          for (int c = 0; c < 3; ++c) {
            ours[(c * n + b) * 3 * n + r * n + a] += block[3 * r + c];
            if (a != b) ours[(r * n + a) * 3 * n + c * n + b] += block[3 * r + c];
          }
        }
      };
      for (int s = 0; s < n; ++s) add(s, s, damping ? tangent.D(s) : tangent.K(s));
      for (std::size_t p = 0; p < tangent.pairs().size(); ++p) {
        const Tangent::Pair& pair = tangent.pairs()[p];
        if (pair.a >= 0) add(pair.a, pair.b, damping ? tangent.PairD(p) : tangent.PairK(p));
      }
      double largest = 0.0, worst = 0.0;
      for (const int column : Moving(model)) {
        const std::vector<double> slope =
            motion.Slope((damping ? 3 * n : 0) + column, [&] { return motion.Load(effect); });
        for (const int row : Moving(model)) {
          worst = std::max(worst, std::fabs(ours[column * 3 * n + row] + slope[row]));
          largest = std::max(largest, std::fabs(slope[row]));
        }
      }
      EXPECT_LT(worst, kNear * std::max(1.0, largest))
          << effect.kText.name << (damping ? ", damping" : ", stiffness");
    }
  });
}

// On an angle the load is the moment; the columns of a run and the torque margin have the same.
TEST(EffectList, MomentsColumnsAndMarginsAreTheLoads) {
  const Model model = ModelFrom(ListScene());
  Observables observables(model);
  Free motion(model);
  motion.Shake(8, 0.02, 0.0);
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    const Model::Joint& joint = model.joints[j];
    if (joint.coordinate.travel) continue;
    const Hinge& hinge = joint.coordinate.hinge;
    for (const double rate : {-0.7, -0.01, 0.4}) {  // closing, creeping, opening
      motion[model.index.omega(hinge.outer)] = hinge.sign * rate;
      motion[model.index.omega(hinge.inner)] = 0.0;
      ForEachJointEffect(model.joint_effects, [&]<typename E>(const E& effect, std::size_t index) {
        const int k = joint.effects[index];
        if (k < 0) return;
        std::vector<double> before = motion.Load(effect);
        // Only this joint's: the effect's others act on other pairs of bodies.
        double others = 0.0;
        for (int i = 0; i < effect.count(); ++i) {
          if (i == k) continue;
          std::vector<double> fx(model.rigid_bodies.count), fy = fx, m = fx;
          effect.coordinate(i).Apply(motion.At(), effect.Moment(i, motion.At()),
                                     {fx.data(), fy.data(), m.data()});
          others += m[hinge.outer];
        }
        const double moment = hinge.sign * (before[model.index.theta(hinge.outer)] - others);
        EXPECT_NEAR(effect.Moment(k, motion.At()), moment, 1e-12 * (1.0 + std::fabs(others)))
            << E::kKey;
        const double margin = effect.MarginMoment(k, motion.At());
        if (effect.kPower != PowerKind::kDissipated) {
          EXPECT_EQ(margin, effect.Moment(k, motion.At())) << E::kKey;
        } else if (rate < 0.0) {  // what resists closing counts in full
          EXPECT_GT(effect.Moment(k, motion.At()), 0.0) << E::kKey;
          EXPECT_GE(margin, effect.Moment(k, motion.At())) << E::kKey;
        }
      });
    }
  }
  // The run's columns: those of every effect on every joint, and every energy.
  std::vector<double> y = model.initial_state;
  const std::vector<double> row = observables.Row(0.0, y.data(), model.initial_modes);
  const auto column = [&](const std::string& name) {
    for (std::size_t q = 0; q < row.size(); ++q) {
      if (observables.quantities()[q].name == name) return row[q];
    }
    ADD_FAILURE() << "no column " << name;
    return 0.0;
  };
  Dynamics dynamics(model);
  const Motion start = dynamics.Update(0.0, y.data());
  for (const Model::Joint& joint : model.joints) {
    ForEachJointEffect(model.joint_effects, [&]<typename E>(const E& effect, std::size_t index) {
      const int k = joint.effects[index];
      if (k < 0) return;
      const char* kind = joint.coordinate.travel ? "_force" : "_moment";
      EXPECT_EQ(column(joint.name + "." + E::kKey + kind), effect.Moment(k, start));
    });
  }
  double stored = column("energy.kinetic") + column("energy.bending");
  ForEachEffect(model, [&](const auto& effect) {
    if (effect.kText.energy == nullptr) return;
    EXPECT_EQ(column(std::string("energy.") + effect.kText.energy), effect.Energy(start));
    stored += effect.Energy(start);
  });
  EXPECT_NEAR(column("energy.total"), stored, 1e-12);
}

// Held contacts give their energy up; the balance counts it as lost.
TEST(EffectList, AHeldContactHasNoEnergyToGive) {
  const Model model = ModelFrom(ListScene());
  Free motion(model);
  motion.Shake(9, 0.0, 0.0);
  const Hinge& hinge = model.latches.hinge(0);
  const double pressed = model.latches.Energy(motion.At());
  EXPECT_GT(pressed, 0.0);
  EXPECT_EQ(model.latches.HeldEnergy(motion.At()), 0.0);
  motion[model.index.omega(hinge.outer)] = hinge.sign * 1e4;  // leaves the lower stop at speed
  EXPECT_EQ(model.latches.Energy(motion.At()), 0.0);
  EXPECT_EQ(model.latches.HeldEnergy(motion.At()), pressed);
  EXPECT_EQ(Largest(motion.Load(model.latches)), 0.0);
}

}  // namespace
}  // namespace unfurl::sim::effect_list_test
