#include "study/study_cost.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <utility>

#include "base/cpu_time.h"
#include "base/error.h"
#include "base/text.h"
#include "correlate/residual/channel.h"
#include "data/scene.h"
#include "study/fit_study.h"

namespace unfurl::study {

namespace {

// Segments of the scene's beams where all have as many, else 0; the same of orders of smooth beams.
struct Beams {
  int segments = 0, order = 0;

  explicit Beams(const data::Study& study) {
    if (study.command) return;
    const data::TomlTable document = data::LoadToml(study.scene, study.set);
    const data::Scene scene = data::ReadScene(document, study.scene);
    for (const data::SceneBeam& b : scene.beams) {
      const bool smooth = b.model == data::BeamModel::kKirchhoff;
      int& mine = smooth ? order : segments;
      const int own = smooth ? b.order : b.segments;
      if (mine != 0 && mine != own) mine = -1;
      if (mine == 0) mine = own;
    }
    if (segments != 0 && order != 0) segments = order = -1;
  }
};

// "trial" of a study with one, "trial[2]" of one with several.
std::string KeyOf(const data::Study& study, std::size_t trial) {
  return study.trials.size() == 1 ? std::string("trial") : fmt::format("trial[{}]", trial);
}

// What the clock of a trial's channel shows when the record's shows t [s].
double OwnTime(const correlate::Observations& o, const data::StudyChannel& channel, double t) {
  for (const auto& kind : o.others) {
    const auto* found = dynamic_cast<const correlate::Channel*>(kind.get());
    if (found != nullptr && found->record().name == channel.name) return found->OwnTime(t);
  }
  return t + channel.delay.mean;  // a switch
}

class Settings {
 public:
  Settings(const data::Study& study, const StudyFit& fit) : study_(study), fit_(fit) {
    Rungs();
    Tolerances();
    Horizons();
    Starts();
    Marks();
    Profiles();
  }
  std::vector<StudySetting> all;

 private:
  void Add(const char* kind, std::string name, std::vector<std::string> set) {
    all.push_back({kind, std::move(name), std::move(set)});
  }

  void Rungs() {
    if (!fit_.result.ladder.used) return;
    Add("rungs", "no ladder", {"fidelity.wanted=false"});
    const Beams beams(study_);
    const bool smooth = beams.order > 0;
    const int n = smooth ? beams.order : beams.segments;
    if (n <= 0 || !study_.fidelity.rungs.empty()) return;
    auto rungs = [&](const std::vector<int>& list) {
      std::string numbers;
      for (const int k : list) numbers += (numbers.empty() ? "" : ", ") + std::to_string(k);
      Add("rungs", numbers + (smooth ? " modes" : " segments"),
          {fmt::format("fidelity.{}=[{}]", smooth ? "order" : "segments", numbers)});
    };
    if (smooth) {
      rungs({n, n + 1});
      rungs({n, n + 1, n + 2, n + 4});
    } else {
      rungs({n, 2 * n});
      rungs({n, 2 * n, 3 * n});
      if (n >= 4) rungs({n / 2, n, 2 * n});
    }
  }

  void Tolerances() {
    if (study_.command) return;
    double rtol = study_.rtol;
    for (const auto& t : fit_.binding->tolerance) {
      rtol = rtol > 0.0 ? std::min(rtol, t.rtol) : t.rtol;
    }
    for (const double factor : {10.0, 0.1}) {
      constexpr double kLoosest = 1e-2, kTightest = 1e-12;  // that a study takes
      const double other = rtol * factor;
      if (other > kLoosest || other < kTightest) continue;
      Add("tolerance", fmt::format("rtol {:.0e}", other),
          {fmt::format("model.rtol={:.0e}", other)});
    }
  }

  // Of all that a trial holds: the tracks' window is cut, and each channel's, on its own clock.
  void Horizons() {
    constexpr double kBefore = 1e-9;  // [s]: so that the first sample is in it, as it is written
    for (const double part : {0.25, 0.5}) {
      std::vector<std::string> set;
      for (std::size_t t = 0; t < study_.trials.size(); ++t) {
        const correlate::Observations& o = *fit_.problem().trials[t].observations;
        const data::StudyTrial& trial = study_.trials[t];
        const double first = o.Start(), last = o.End();
        const double from = first - kBefore, to = first + part * (last - first);
        for (const data::StudyEvent& event : trial.events) {
          if (event.time > to) return;  // no window leaves it out
        }
        if (!o.marks.empty()) {
          set.push_back(fmt::format("{}.window=[{:.9g}, {:.9g}]", KeyOf(study_, t), from, to));
        }
        for (const data::StudyChannel& channel : trial.channels) {
          const bool cut = channel.window_low < channel.window_high;
          const double low = OwnTime(o, channel, from), high = OwnTime(o, channel, to);
          set.push_back(fmt::format("{}.channel.{}.window=[{:.9g}, {:.9g}]", KeyOf(study_, t),
                                    channel.name, cut ? std::max(low, channel.window_low) : low,
                                    cut ? std::min(high, channel.window_high) : high));
        }
      }
      Add("horizon", fmt::format("the first {:.0f}%", 100.0 * part), std::move(set));
    }
  }

  void Starts() {
    if (study_.screened != 0) Add("starts", "the study's start alone", {"solver.screened=0"});
    if (study_.starts < 3) {
      Add("starts", "3 of 16 starts", {"solver.screened=16", "solver.starts=3"});
    }
  }

  void Marks() {
    for (std::size_t t = 0; t < study_.trials.size(); ++t) {
      const correlate::Observations& o = *fit_.problem().trials[t].observations;
      if (o.marks.size() < 2) continue;
      for (const correlate::MarkSeries& left_out : o.marks) {
        std::string names;
        for (const correlate::MarkSeries& m : o.marks) {
          if (m.name == left_out.name) continue;
          names += (names.empty() ? "\"" : ", \"") + m.name + "\"";
        }
        Add("marks",
            "without " + left_out.name +
                (study_.trials.size() > 1 ? " of " + study_.trials[t].name : std::string()),
            {fmt::format("{}.marks=[{}]", KeyOf(study_, t), names)});
      }
    }
  }

  void Profiles() {
    if (!study_.profile_levels.empty()) Add("profiles", "no profiles", {"profile.levels=[]"});
  }

  const data::Study& study_;
  const StudyFit& fit_;
};

// Narrower and cheaper, and as well tested.
bool Beats(const StudyCostPoint& a, const StudyCostPoint& b) {
  if (!a.usable || !a.agrees || a.seconds >= b.seconds) return false;
  if (b.mesh_tested && !a.mesh_tested) return false;
  for (std::size_t j = 0; j < a.values.size(); ++j) {
    if (!(a.values[j].Half() <= b.values[j].Half())) return false;
  }
  return true;
}

StudyCostPoint Measure(const std::string& path, std::vector<std::string> overrides,
                       const StudyCostOptions& options, const StudySetting& setting,
                       StudyFit* kept) {
  StudyCostPoint out;
  out.setting = setting;
  overrides.insert(overrides.end(), setting.set.begin(), setting.set.end());
  FitStudyOptions how;
  how.workers = options.workers;
  how.allow_programs = options.allow_programs;
  const double start = CpuSeconds();
  StudyFit fit;
  try {
    fit = Fit(data::ReadStudy(path, overrides), how);
  } catch (const Error& e) {
    if (kept != nullptr) throw;  // the study itself
    out.message = e.what();
    return out;
  }
  out.seconds = CpuSeconds() - start;
  out.usable = fit.Usable();
  out.message = fit.result.message;
  out.mesh_tested = true;
  for (const correlate::TrialResult& t : fit.result.trials) {
    out.mesh_tested = out.mesh_tested && (t.error_check == correlate::ErrorCheck::kLadder ||
                                          t.error_check == correlate::ErrorCheck::kFiner);
  }
  for (const correlate::ParameterEstimate& e : fit.result.parameters) {
    out.values.push_back({e.value, e.all95});
  }
  if (kept != nullptr) *kept = std::move(fit);
  return out;
}

// Beside the study as it is.
void Compare(const StudyCostPoint& first, StudyCostPoint* point) {
  for (std::size_t j = 0; point->usable && j < first.values.size(); ++j) {
    StudyCostValue& v = point->values[j];
    v.shift = (v.value - first.values[j].value) / first.values[j].Half();
    const correlate::Interval &a = first.values[j].interval, &b = v.interval;
    if (a.Closed() && b.Closed()) {
      point->agrees = point->agrees && a.low <= b.high && b.low <= a.high;
    }
  }
}

std::string SetText(const StudySetting& setting) {
  std::string out;
  for (const std::string& s : setting.set) {
    const bool plain = s.find_first_of(" \"[") == std::string::npos;
    out += (out.empty() ? "" : " ") + std::string("--set ") + (plain ? s : "'" + s + "'");
  }
  return out;
}

}  // namespace

double StudyCostValue::Half() const {
  return interval.Closed() ? 0.5 * (interval.high - interval.low)
                           : std::numeric_limits<double>::infinity();
}

std::vector<std::string> StudyCostKinds() {
  return {"rungs", "tolerance", "horizon", "starts", "marks", "profiles"};
}

void StudyCostOptions::Check() const {
  const std::vector<std::string> known = StudyCostKinds();
  for (const std::string& kind : vary) {
    if (std::find(known.begin(), known.end(), kind) != known.end()) continue;
    const std::string nearest = NearestName(kind, known);
    throw Error(
        "there is no setting '" + kind + "'", "StudyCostOptions.vary",
        nearest.empty() ? "choose of " + JoinWords(known) : "did you mean '" + nearest + "'?");
  }
  if (!(within > 0.0)) {
    throw Error("is out of its range", "StudyCostOptions.within", "give a number of seconds");
  }
}

StudyCost CostOfStudy(const std::string& path, const std::vector<std::string>& overrides,
                      const StudyCostOptions& options) {
  options.Check();
  const auto begin = std::chrono::steady_clock::now();
  const data::Study study = data::ReadStudy(path, overrides);
  StudyCost out;
  for (const data::StudyParameter& p : study.parameters) {
    out.parameters.push_back(p.name);
    out.units.push_back(p.unit);
  }
  auto tell = [&](double part, const std::string& what) {
    if (options.progress) options.progress(part, what);
  };

  // 1. As it is.
  tell(0.0, "as it is");
  StudyFit fit;
  out.points.push_back(Measure(path, overrides, options, {"", "as it is", {}}, &fit));
  if (!out.Usable()) return out;

  // 2. Each setting in turn.
  std::vector<StudySetting> settings = Settings(study, fit).all;
  std::erase_if(settings, [&](const StudySetting& s) {
    return !options.vary.empty() &&
           std::find(options.vary.begin(), options.vary.end(), s.kind) == options.vary.end();
  });
  fit = {};
  for (std::size_t i = 0; i < settings.size(); ++i) {
    const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - begin;
    if (passed.count() > options.within) {
      out.left_out = settings.size() - i;
      break;
    }
    tell(static_cast<double>(i + 1) / static_cast<double>(settings.size() + 1), settings[i].name);
    out.points.push_back(Measure(path, overrides, options, settings[i], nullptr));
    Compare(out.points[0], &out.points.back());
  }
  for (StudyCostPoint& point : out.points) {
    point.on_front = point.usable && point.agrees &&
                     std::none_of(out.points.begin(), out.points.end(),
                                  [&](const StudyCostPoint& other) { return Beats(other, point); });
  }
  return out;
}

const StudyCostPoint* CheapestWithin(const StudyCost& cost, double factor) {
  const StudyCostPoint* best = nullptr;
  for (const StudyCostPoint& point : cost.points) {
    if (!point.usable || !point.agrees) continue;
    if (cost.points[0].mesh_tested && !point.mesh_tested) continue;
    bool narrow = true;
    for (std::size_t j = 0; j < point.values.size(); ++j) {
      narrow = narrow && point.values[j].Half() <= factor * cost.points[0].values[j].Half();
    }
    if (narrow && (best == nullptr || point.seconds < best->seconds)) best = &point;
  }
  return best;
}

std::vector<std::string> CostAdvice(const StudyCost& cost) {
  std::vector<std::string> out;
  if (!cost.Usable()) return out;
  const StudyCostPoint& first = cost.points[0];
  for (const double factor : {0.5, 1.1, 2.0, 5.0}) {
    const StudyCostPoint* best = CheapestWithin(cost, factor);
    const std::string wide = factor == 1.1 ? std::string("as narrow as they are")
                                           : fmt::format("{} times as wide at most", factor);
    if (best == nullptr) {
      out.push_back(fmt::format("{}: none of these", wide));
    } else if (best == &first) {
      out.push_back(fmt::format("{}: the study as it is, {:.2g} s", wide, first.seconds));
    } else {
      out.push_back(fmt::format("{}: {}, {:.2g} s in place of {:.2g}: {}", wide, best->setting.name,
                                best->seconds, first.seconds, SetText(best->setting)));
    }
  }
  for (const StudyCostPoint& point : cost.points) {
    if (!point.usable || point.agrees) continue;
    out.push_back(fmt::format(
        "{}: its intervals do not meet those of the study as it is; one of the two is wrong{}",
        point.setting.name, point.mesh_tested ? "" : " (it has not looked at a finer mesh)"));
  }
  return out;
}

}  // namespace unfurl::study
