#include "tests/hard/hard_case.h"

#include <algorithm>
#include <cstdio>
#include <ctime>
#include <optional>

#include "base/error.h"
#include "data/scene.h"
#include "tests/traps.h"

namespace unfurl::sim {

// Collects every sample.
struct Watch : Observer {
  Watch(const Model& model, Outcome* to) : observables(model), outcome(to) {
    for (const data::Quantity& q : observables.quantities()) to->names_.push_back(q.name);
  }
  void OnSample(double t, double* state, const std::vector<LatchMode>& modes) override {
    outcome->times_.push_back(t);
    outcome->rows_.push_back(observables.Row(t, state, modes));
    const Balance& b = observables.balance();
    most = std::max(most, b.kinetic);
    least = std::min(least, b.kinetic);
    outcome->energy_scale = std::max(most - least, std::fabs(observables.energy_at_start()));
    outcome->residual = std::max(outcome->residual, std::fabs(observables.residual()));
  }
  Observables observables;
  Outcome* outcome;
  double least = HUGE_VAL, most = 0.0;
};

Outcome::Outcome(const Model& of, const SimulateOptions& options) : model(of) {
  Watch watch(of, this);
  report = Simulate(of, options, &watch);
}

int Outcome::Column(const std::string& name) const {
  const auto found = std::ranges::find(names_, name);
  if (found == names_.end()) throw std::out_of_range("no column " + name);
  return static_cast<int>(found - names_.begin());
}

double Outcome::Largest(const std::string& column) const {
  double largest = 0.0;
  for (std::size_t k = 0; k < rows_.size(); ++k) {
    largest = std::max(largest, std::fabs(Row(k, column)));
  }
  return largest;
}

double Outcome::Farthest(const std::string& column) const {
  double farthest = 0.0;
  for (std::size_t k = 0; k < rows_.size(); ++k) {
    farthest = std::max(farthest, std::fabs(Row(k, column) - Start(column)));
  }
  return farthest;
}

void PrintTo(const HardCase& c, std::ostream* out) { *out << c.name; }

std::function<void(const Outcome&)> Follows(const std::string& column,
                                            const std::function<double(double)>& truth,
                                            double tolerance) {
  return [=](const Outcome& run) {
    EXPECT_GT(run.EndTime(), 0.5 * run.model.duration);
    EXPECT_NEAR(run.End(column), truth(run.EndTime()), tolerance) << column;
  };
}

std::function<void(const Outcome&)> Ends(const std::string& column, double value,
                                         double tolerance) {
  return [=](const Outcome& run) { EXPECT_NEAR(run.End(column), value, tolerance) << column; };
}

std::array<double, 2> Oscillate(const std::function<double(double, double, double)>& f, double x,
                                double v, double end) {
  constexpr int kSteps = 40000;
  const double h = end / kSteps;
  for (int k = 0; k < kSteps; ++k) {
    const double t = k * h;
    const double a1 = f(t, x, v), v1 = v;
    const double v2 = v + 0.5 * h * a1, a2 = f(t + 0.5 * h, x + 0.5 * h * v1, v2);
    const double v3 = v + 0.5 * h * a2, a3 = f(t + 0.5 * h, x + 0.5 * h * v2, v3);
    const double v4 = v + h * a3, a4 = f(t + h, x + h * v3, v4);
    x += h / 6.0 * (v1 + 2.0 * v2 + 2.0 * v3 + v4);
    v += h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4);
  }
  return {x, v};
}

std::string Scene(double duration, const std::string& rest) {
  return fmt::format("[scene]\nname = \"hard\"\nduration = {:.17g}\n", duration) + rest;
}

std::string Body(const std::string& name, double mass, double inertia, const std::string& more) {
  return fmt::format("[body.{}]\nmass = {:.17g}\ninertia = {:.17g}\n", name, mass, inertia) + more;
}

std::string Pin(const std::string& name, const std::string& inner, double inner_x,
                const std::string& outer, double outer_x, const std::string& more) {
  return fmt::format(
             "[joint.{}]\ninner = \"{}\"\ninner_point = [{:.17g}, 0.0]\nouter = \"{}\"\n"
             "outer_point = [{:.17g}, 0.0]\n",
             name, inner, inner_x, outer, outer_x) +
         more;
}

std::string Weight(double g) {
  return fmt::format("[gravity]\nacceleration = [0.0, {:.17g}]\n", -g);
}

namespace {

// A million steps of some bodies are some seconds: no case hangs.
constexpr long kMostSteps = 1'000'000;
constexpr double kSamples = 200.0;  // of each run

const char* NameOf(Grade grade) {
  return grade == Grade::kEasy ? "easy" : grade == Grade::kMedium ? "medium" : "hard";
}

}  // namespace

TEST_P(HardCases, RightOrRefusedByName) {
  const HardCase& c = GetParam();
  RecordProperty("grade", NameOf(c.grade));
  const std::clock_t begin = std::clock();
  try {
    const Model model = [&] {
      const NoTraps fence;  // functions of time are tried where they may fail
      return Compile(data::ParseScene(c.toml, "hard.toml"));
    }();
    SimulateOptions options;
    options.method = c.method;
    options.rtol = c.rtol;
    options.rate = std::min(kSamples / model.duration, 1e7);
    options.max_steps = kMostSteps;
    std::optional<NoTraps> fence;
    if (c.runs_away) fence.emplace();
    const Outcome run(model, options);
    std::printf("%s: %s, %ld steps, %.3f s of CPU\n", c.name, NameOf(c.grade), run.report.steps,
                static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC);
    if (!run.report.Usable()) {
      ASSERT_FALSE(c.refused.empty()) << run.report.message;
      EXPECT_NE(run.report.message.find(c.refused), std::string::npos) << run.report.message;
      return;
    }
    ASSERT_NE(c.rule, nullptr) << "not refused";
    c.rule(run);
  } catch (const Error& error) {
    ASSERT_FALSE(c.refused.empty()) << error.what();
    EXPECT_NE(std::string(error.what()).find(c.refused), std::string::npos) << error.what();
  }
}

}  // namespace unfurl::sim
