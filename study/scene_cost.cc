#include "study/scene_cost.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <map>
#include <utility>

#include "base/cpu_time.h"
#include "base/error.h"
#include "base/worker_pool.h"
#include "sim/methods/simulate.h"
#include "study/cost_bench.h"
#include "study/cost_reference.h"

namespace unfurl::study {
namespace {

// The reference's tolerance, of the tightest asked: its own error is then below 1% of any other's.
constexpr double kFiner = 0.01;
// Of beams within a budget, whose mesh is what is left: finer meshes are worth more then.
constexpr double kFinerInBudget = 0.1;
constexpr double kTightest = 1e-12;  // that rounding lets a run of some 1e5 steps keep [-]
constexpr double kPlainTolerances[] = {1e-2, 1e-3, 1e-4, 1e-5, 1e-6};
// A tighter tolerance no longer counts where it changes less than this part of what is left.
constexpr double kNoLongerCounts = 0.1;
// Ranges below this part of the widest of a kind are measured by that one: what is to stand still
// has no range to be right to a part of.
constexpr double kStill = 1e-3;
// The reference is to be known so much better than what it judges: d + u is then within 1 and 1.25
// times the error, which is between d - u and d + u, as (9 + 1) / (9 - 1) = 1.25.
constexpr double kKnownBetter = 9.0;
constexpr int kMostExtensions = 3;    // of the reference: meshes eight times as fine
constexpr double kOfReference = 0.5;  // of a budget, that the reference may take
constexpr double kOfRepeats = 0.005;  // of a budget, that one setting may be timed anew for
constexpr double kFirstLimit = 1.0;   // that every run may take, however quick the reference [s]

class CostStudy {
 public:
  CostStudy(const data::Scene& scene, const SceneCostOptions& options, double duration,
            const std::function<void(double, const std::string&)>& progress)
      : options_(options),
        progress_(progress),
        start_(CpuSeconds()),
        meshes_(MeshesOf(scene, options.segments, options.orders)),
        bench_(scene, CostQuantities(scene, options.quantities), duration, options.samples,
               start_ + options.within),
        tolerances_(options.tolerances) {
    if (tolerances_.empty()) {
      tolerances_.assign(std::begin(kPlainTolerances), std::end(kPlainTolerances));
    }
    const double tightest = *std::min_element(tolerances_.begin(), tolerances_.end());
    const bool quick = std::isfinite(options.within) && !scene.beams.empty();
    const double finer = quick ? kFinerInBudget : kFiner;
    reference_ = std::make_unique<CostReference>(bench_, scene, meshes_,
                                                 std::max(kTightest, finer * tightest));
    for (std::size_t m = 0; m < meshes_.asked.size(); ++m) {
      for (std::size_t k = 0; k < options.methods.size(); ++k) {
        chains_.push_back({m, k, options.methods[k]});
      }
    }
  }

  SceneCost Run() {
    SceneCost out;
    out.duration = bench_.duration();
    reference_->Make(options_.workers, kOfReference * options_.within, progress_);
    out.problem = reference_->problem();
    out.reference_cut = reference_->ShortOfTime();
    if (out.problem.empty()) {
      FindLines(&out);
      MakeTight();
      // In a budget one method at every tolerance says more than each method at the loosest.
      const bool budget = std::isfinite(options_.within);
      for (std::size_t rank = 0; rank < (budget ? options_.methods.size() : 1); ++rank) {
        for (std::size_t k = 0; k < tolerances_.size(); ++k) {
          Wave(k, [&](const Chain& chain) { return !budget || chain.rank == rank; });
        }
      }
      for (int k = 0; k < kMostExtensions && !Resolved(); ++k) {
        // As much again as all has taken; of a budget what is left.
        const double left = start_ + options_.within - CpuSeconds();
        if (!reference_->Extend(std::min(left, spent_ + reference_->seconds()), progress_)) break;
        FindLines(&out);
      }
      Judge(&out);
    }
    out.reference = reference_->Words();
    out.seconds = CpuSeconds() - start_;
    return out;
  }

 private:
  // A mesh and method, at one tolerance after the other.
  struct Chain {
    std::size_t mesh, rank;  // of the method among those asked
    std::string method;
    std::vector<CostOutcome> runs{};  // by tolerance, from the first on
    bool ended = false;               // a tighter one does not count
  };

  // Each mesh without an error of time stepping, to see when a tighter tolerance no longer counts.
  void MakeTight() {
    tight_.resize(meshes_.asked.size());
    if (!options_.tolerances.empty() || meshes_.asked[0].words.empty()) return;
    const bool budget =
        std::isfinite(options_.within);  // settings are worth more than knowing when
    ParallelFor(tight_.size(), options_.workers, [&](std::size_t m) {
      const CostOutcome* made = reference_->RunOn(meshes_.asked[m]);
      if (made != nullptr) {
        tight_[m] = *made;
      } else if (!budget) {
        tight_[m] = bench_.Run(meshes_.asked[m], "auto", reference_->rtol(), {Limit(), 0.0});
      }
    });
    for (const CostOutcome& run : tight_) spent_ += run.seconds;
  }

  // What is slower than the finer runs of the reference is no setting for anybody [s].
  double Limit() const { return std::max(kFirstLimit, reference_->seconds()); }

  CostDistance Apart(const CostOutcome& run, std::size_t q) const {
    return DistanceOf(bench_.OnClock(run, q, reference_->clock()), reference_->limits()[q].values);
  }

  // The next tolerance of every chain that takes part, in any order.
  void Wave(std::size_t tolerance, const std::function<bool(const Chain&)>& takes_part) {
    std::vector<Chain*> active;
    for (Chain& chain : chains_) {
      if (!chain.ended && chain.runs.size() == tolerance && takes_part(chain)) {
        active.push_back(&chain);
      }
    }
    // The quickest first, so that a budget holds as many as it can; at first every mesh with the
    // first method, then with the next.
    const auto cost = [](const Chain* c) { return c->runs.empty() ? 0.0 : c->runs.back().seconds; };
    std::stable_sort(active.begin(), active.end(), [&](const Chain* a, const Chain* b) {
      return cost(a) != cost(b) ? cost(a) < cost(b) : a->rank < b->rank;
    });
    std::atomic<std::size_t> done = 0;
    const double waves = static_cast<double>(tolerances_.size());
    ParallelFor(active.size(), options_.workers, [&](std::size_t k) {
      const double part = static_cast<double>(done++) / static_cast<double>(active.size());
      const double far = std::isfinite(options_.within)
                             ? std::min(1.0, (CpuSeconds() - start_) / options_.within)
                             : (static_cast<double>(tolerance) + part) / waves;
      if (progress_) progress_(far, Name(*active[k]));
      Next(active[k], tolerance);
    });
    for (const Chain* chain : active) {
      if (chain->runs.size() > tolerance) {
        spent_ += chain->runs.back().seconds * chain->runs.back().runs;
      }
    }
  }

  std::string Name(const Chain& chain) const {
    return SettingOf(chain, tolerances_[chain.runs.size()]).Name();
  }

  void Next(Chain* chain, std::size_t tolerance) const {
    const double left = start_ + options_.within - CpuSeconds();
    if (left <= 0.0 || (!chain->runs.empty() && chain->runs.back().seconds > left)) return;
    CostOutcome run =
        bench_.Run(meshes_.asked[chain->mesh], chain->method, tolerances_[tolerance],
                   {Limit(), std::min(options_.repeats, kOfRepeats * options_.within)});
    if (!run.usable && bench_.Over()) return;  // the budget's end is not the setting's fault
    chain->ended = run.refused || (options_.tolerances.empty() &&
                                   (run.stopped || (run.usable && !Counts(run, chain->mesh))));
    chain->runs.push_back(std::move(run));
  }

  // Whether time stepping makes a part of a run's error that counts, in any line.
  bool Counts(const CostOutcome& run, std::size_t mesh) const {
    const CostOutcome& tight = tight_[mesh];
    return !tight.usable || std::any_of(lines_.begin(), lines_.end(), [&](std::size_t q) {
      const CostLimit& limit = reference_->limits()[q];
      if (!std::isfinite(limit.error.rms)) return false;
      const double left = Apart(run, q).rms + limit.error.rms;
      const double stepping = DistanceOf(bench_.OnClock(run, q, reference_->clock()),
                                         bench_.OnClock(tight, q, reference_->clock()))
                                  .rms;
      return std::isfinite(left) && stepping > kNoLongerCounts * left;
    });
  }

  void FindLines(SceneCost* out) {
    out->lines.clear();
    out->absent.clear();
    lines_.clear();
    const std::vector<CostQuantity>& all = bench_.quantities();
    const std::vector<CostLimit>& limits = reference_->limits();
    using Group = std::pair<std::string, bool>;  // unit, and whether in time
    const auto group = [](const CostQuantity& q) {
      return Group(q.unit,
                   q.kind == CostQuantity::Kind::kMark || q.kind == CostQuantity::Kind::kSeries);
    };
    std::map<Group, double> widest;
    for (std::size_t q = 0; q < all.size(); ++q) {
      double& w = widest[group(all[q])];
      w = std::max(w, ScaleOf(all[q], limits[q].values));
    }
    for (std::size_t q = 0; q < all.size(); ++q) {
      const double own = ScaleOf(all[q], limits[q].values), most = widest[group(all[q])];
      if (limits[q].values.a.empty() || !(most > 0.0)) {
        out->absent.push_back(
            all[q].name + (limits[q].values.a.empty() ? ": the reference has none" : ": is zero"));
        continue;
      }
      CostLine line{all[q], own >= kStill * most ? own : most};
      line.reference_error = limits[q].error.rms / line.scale;
      line.settled = std::isfinite(line.reference_error);
      out->lines.push_back(std::move(line));
      lines_.push_back(q);
    }
    scales_.clear();
    for (const CostLine& line : out->lines) scales_.push_back(line.scale);
  }

  // Whether every settled error is known as well as it is to be.
  bool Resolved() const {
    for (const Chain& chain : chains_) {
      for (const CostOutcome& run : chain.runs) {
        for (std::size_t l = 0; run.usable && l < lines_.size(); ++l) {
          if (ErrorOf(run, l).bound) return false;
        }
      }
    }
    return true;
  }

  CostError ErrorOf(const CostOutcome& run, std::size_t line) const {
    const CostDistance apart = Apart(run, lines_[line]);
    const CostDistance& known = reference_->limits()[lines_[line]].error;
    CostError error;
    error.rms = (apart.rms + known.rms) / scales_[line];
    error.largest = (apart.largest + known.largest) / scales_[line];
    error.bound = !(known.rms * kKnownBetter <= apart.rms);
    return error;
  }

  CostSetting SettingOf(const Chain& chain, double rtol) const {
    const CostMesh& mesh = meshes_.asked[chain.mesh];
    CostSetting setting{chain.method, rtol, mesh.words, mesh.segments, mesh.order, mesh.set};
    setting.set.push_back("solver.method=" + chain.method);
    setting.set.push_back(fmt::format("solver.rtol={:g}", rtol));
    return setting;
  }

  CostPoint PointOf(const SceneCost& cost, const Chain& chain, std::size_t k) const {
    const CostOutcome& run = chain.runs[k];
    CostPoint point;
    point.setting = SettingOf(chain, tolerances_[k]);
    point.usable = run.usable;
    point.message = run.message;
    point.seconds = run.seconds;
    point.scatter = run.scatter;
    point.runs = run.runs;
    for (std::size_t l = 0; run.usable && l < cost.lines.size(); ++l) {
      point.errors.push_back(ErrorOf(run, l));
      if (!cost.lines[l].settled) continue;
      const CostError& error = point.errors.back();
      if (point.worst < 0 || error.rms > point.rms) {
        point.worst = static_cast<int>(l);
        point.rms = error.rms;
      }
      point.largest = std::max(point.largest, error.largest);
    }
    return point;
  }

  void Judge(SceneCost* out) const {
    for (const Chain& chain : chains_) {
      for (std::size_t k = 0; k < chain.runs.size(); ++k) {
        if (!chain.runs[k].refused) {
          out->points.push_back(PointOf(*out, chain, k));
        } else if (std::find(out->refused.begin(), out->refused.end(), chain.runs[k].message) ==
                   out->refused.end()) {
          out->refused.push_back(chain.runs[k].message);
        }
      }
      if (!chain.ended) out->left_out += tolerances_.size() - chain.runs.size();
    }
    const std::string why = bench_.FrequencyProblem();
    if (!why.empty()) out->refused.push_back("natural frequencies of some beams: " + why);
    for (CostPoint& p : out->points) {
      if (!p.usable || p.worst < 0) continue;
      p.on_front = std::none_of(out->points.begin(), out->points.end(), [&](const CostPoint& q) {
        return q.usable && q.worst >= 0 && q.seconds <= p.seconds && q.rms <= p.rms &&
               (q.seconds < p.seconds || q.rms < p.rms);
      });
    }
  }

  const SceneCostOptions& options_;
  const std::function<void(double, const std::string&)>& progress_;
  double start_;  // CPU of the process [s]
  CostMeshes meshes_;
  CostBench bench_;
  std::vector<double> tolerances_;
  std::unique_ptr<CostReference> reference_;
  std::vector<Chain> chains_;
  std::vector<CostOutcome> tight_;  // by mesh that is asked
  std::vector<std::size_t> lines_;  // quantities of the bench, by line
  std::vector<double> scales_;      // by line [its unit]
  double spent_ = 0.0;              // of CPU, on settings [s]
};

}  // namespace

void SceneCostOptions::Check() const {
  if (methods.empty()) throw Error("no method is given", "option methods", "name one");
  for (const std::string& method : methods) {
    sim::SimulateOptions run;
    run.method = sim::MethodOf(method);
    run.duration = duration;
    for (const double rtol : tolerances) {
      run.rtol = rtol;
      run.Check();
    }
    run.Check();
  }
  if (samples < 2) {
    throw Error(fmt::format("{} samples", samples), "option samples", "use 2 or more");
  }
  if (!(repeats >= 0.0) || !std::isfinite(repeats)) {
    throw Error(fmt::format("{} s is not a time", repeats), "option repeats", "use 0 s or more");
  }
  if (!(within > 0.0)) {
    throw Error(fmt::format("{} s is no budget", within), "option within",
                "give a number of seconds above 0");
  }
}

bool SceneCost::Usable() const {
  return std::any_of(points.begin(), points.end(),
                     [](const CostPoint& p) { return p.usable && p.worst >= 0; });
}

SceneCost StudySceneCost(const data::Scene& scene, const SceneCostOptions& options,
                         const std::function<void(double, const std::string&)>& progress) {
  options.Check();
  const double duration = options.duration > 0.0 ? options.duration : scene.duration;
  return CostStudy(scene, options, duration, progress).Run();
}

}  // namespace unfurl::study
