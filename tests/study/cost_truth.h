// Real errors of the settings of `unfurl cost`: against runs far finer than its reference, of
// another model of the beams, or of another method where there is but one model.
#pragma once

#include <fmt/format.h>

#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "study/cost_bench.h"
#include "study/cost_limit.h"
#include "study/scene_cost.h"

namespace unfurl::study {

class CostTruth {
 public:
  // `finest`: segments of the finest beam of the truth; `highest`: order of its smooth beams.
  CostTruth(const data::Scene& scene, const SceneCostOptions& options, int finest, int highest)
      : scene_(scene),
        bench_(scene_, CostQuantities(scene_, options.quantities),
               options.duration > 0.0 ? options.duration : scene.duration, options.samples,
               HUGE_VAL),
        finest_(finest),
        highest_(highest) {}

  // Root mean square of a line of a setting, over the line's scale.
  double Error(const CostSetting& setting, const CostLine& line) {
    const CostMeshes meshes = MeshesOf(scene_, Some(setting.segments), Some(setting.order));
    const CostMesh* mesh = nullptr;
    const CostMeshes plain = MeshesOf(scene_, {}, {});
    for (const CostMeshes* list : {&meshes, &plain}) {
      for (const CostMesh& m : list->asked) {
        if (mesh == nullptr && m.words == setting.beams) mesh = &m;
      }
    }
    if (last_name_ != setting.Name()) {
      last_ = bench_.Run(*mesh, setting.method, setting.tolerance, {HUGE_VAL, 0.0});
      last_name_ = setting.Name();
    }
    const CostOutcome& run = last_;
    const std::size_t q = QuantityOf(line);
    const Truth& truth =
        TruthFor(!mesh->beams.empty() && mesh->beams[0].model == data::BeamModel::kKirchhoff);
    return DistanceOf(bench_.OnClock(run, q, truth.clock), truth.values[q]).rms / line.scale;
  }

  // How far the two truths are from each other, over the line's scale: what is below a few of it is
  // not tested. 0: there is one alone.
  double Doubt(const CostLine& line) {
    if (scene_.beams.empty() || MeshesOf(scene_, {}, {}).smooth.empty()) return 0.0;
    const std::size_t q = QuantityOf(line);
    return DistanceOf(TruthFor(true).values[q], TruthFor(false).values[q]).rms / line.scale;
  }

 private:
  struct Truth {
    std::vector<CostValues> values;
    CostEvents clock;
  };
  static std::vector<int> Some(int size) {
    return size > 0 ? std::vector<int>{size} : std::vector<int>{};
  }
  std::size_t QuantityOf(const CostLine& line) const {
    for (std::size_t q = 0; q < bench_.quantities().size(); ++q) {
      if (bench_.quantities()[q].name == line.quantity.name) return q;
    }
    throw std::logic_error(line.quantity.name);
  }
  CostOutcome Fine(const CostMesh& mesh, const char* method, double rtol) const {
    CostOutcome run = bench_.Run(mesh, method, rtol, {HUGE_VAL, 0.0});
    if (!run.usable) throw std::runtime_error(mesh.words + ": " + run.message);
    return run;
  }

  // Of settings with smooth beams: segments; and the other way round.
  const Truth& TruthFor(bool smooth_setting) {
    const CostMeshes meshes = MeshesOf(scene_, {}, {});
    const bool by_segments = meshes.smooth.empty() || smooth_setting;
    std::optional<Truth>& kept = by_segments ? segments_ : smooth_;
    if (kept) return *kept;
    // Another model is truth enough; else another method than what `auto` may come to.
    const char* method = meshes.smooth.empty() ? "projected" : "auto";
    constexpr double kRigid = 1e-12, kBeams = 1e-9;  // below every reference's tolerance
    kept.emplace();
    if (scene_.beams.empty()) {
      const CostOutcome run = Fine({}, "partitioned", kRigid);
      kept->clock = run.events;
      kept->values = run.values;
    } else if (!by_segments) {
      const CostOutcome run = Fine(MeshesOf(scene_, {}, {highest_}).asked[0], "auto", kBeams);
      kept->clock = run.events;
      for (std::size_t q = 0; q < run.values.size(); ++q) kept->values.push_back(run.values[q]);
    } else {
      const CostOutcome coarse = Fine(Segments(finest_ / 2), method, kBeams);
      const CostOutcome fine = Fine(Segments(finest_), method, kBeams);
      kept->clock = fine.events;
      for (std::size_t q = 0; q < fine.values.size(); ++q) {
        const CostValues a = bench_.OnClock(coarse, q, fine.events);
        CostValues b = bench_.OnClock(fine, q, fine.events);
        const auto beyond = [](const std::vector<double>& x, std::vector<double>* y) {
          y->resize(std::min(x.size(), y->size()));
          for (std::size_t i = 0; i < y->size(); ++i) (*y)[i] += ((*y)[i] - x[i]) / 3.0;
        };
        beyond(a.a, &b.a);
        beyond(a.b, &b.b);
        kept->values.push_back(std::move(b));
      }
    }
    return *kept;
  }
  CostMesh Segments(int n) const { return MeshesOf(scene_, {n}, {}).asked[0]; }

  const data::Scene scene_;
  CostBench bench_;
  int finest_, highest_;
  std::optional<Truth> segments_, smooth_;
  CostOutcome last_;  // of the setting asked for last
  std::string last_name_;
};

// What is asked of `unfurl cost`: stated over real error.
inline constexpr double kLeastRatio = 0.8, kMostRatio = 1.25;

struct CostTally {
  int resolved = 0, wrong = 0, bounds = 0, low_bounds = 0, doubtful = 0, unsettled = 0;
  double least = HUGE_VAL, most = 0.0;
  std::string worst;
};

// Every usable setting, every settled line.
inline CostTally HeldToTruth(const data::Scene& scene, const SceneCostOptions& options,
                             const SceneCost& cost, int finest, int highest) {
  CostTally tally;
  CostTruth truth(scene, options, finest, highest);
  for (const CostLine& line : cost.lines) tally.unsettled += line.settled ? 0 : 1;
  for (const CostPoint& p : cost.points) {
    for (std::size_t l = 0; p.usable && l < cost.lines.size(); ++l) {
      const CostLine& line = cost.lines[l];
      if (!line.settled || !std::isfinite(p.errors[l].rms)) continue;
      const double real = truth.Error(p.setting, line), stated = p.errors[l].rms;
      // Tenfold better than what it judges, or the truth is none.
      constexpr double kTruthBetter = 10.0;
      if (real < kTruthBetter * truth.Doubt(line) || real == 0.0) {
        ++tally.doubtful;
        continue;
      }
      const double ratio = stated / real;
      if (p.errors[l].bound) {
        ++tally.bounds;
        tally.low_bounds += ratio < kLeastRatio ? 1 : 0;
        continue;
      }
      ++tally.resolved;
      const bool wrong = ratio < kLeastRatio || ratio > kMostRatio;
      tally.wrong += wrong ? 1 : 0;
      tally.least = std::min(tally.least, ratio);
      tally.most = std::max(tally.most, ratio);
      if (wrong) {
        tally.worst = fmt::format("{}, {}: stated {:.3g}, real {:.3g}", p.setting.Name(),
                                  line.quantity.name, stated, real);
      }
    }
  }
  return tally;
}

}  // namespace unfurl::study
