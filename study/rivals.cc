#include "study/rivals.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "base/error.h"
#include "correlate/fit/refit.h"
#include "correlate/residual/row_layout.h"
#include "study/effect_versions.h"

namespace unfurl::study {

namespace {

// The first thing in which two studies' data differ; empty: nothing.
std::string Unlike(const correlate::FitProblem& a, const correlate::FitProblem& b) {
  if (a.trials.size() != b.trials.size()) return "the number of trials";
  for (std::size_t t = 0; t < a.trials.size(); ++t) {
    const correlate::Observations &x = *a.trials[t].observations, &y = *b.trials[t].observations;
    const std::string of = " of " + a.trials[t].name;
    if (x.marks.size() != y.marks.size()) return "the marks" + of;
    for (std::size_t m = 0; m < x.marks.size(); ++m) {
      if (x.marks[m].name != y.marks[m].name) return "the marks" + of;
      if (x.marks[m].t != y.marks[m].t || x.marks[m].p != y.marks[m].p) {
        return "the samples of mark " + x.marks[m].name + of;
      }
    }
    const correlate::RowLayout p(x), q(y);
    if (p.rows != q.rows || p.unknowns != q.unknowns) return "channels, events or clocks" + of;
  }
  return {};
}

double SquaresOf(const correlate::Refitted& r) {
  double out = r.prior_squares;
  for (const Eigen::VectorXd& rows : r.whitened) out += rows.squaredNorm();
  return out;
}

double PlainSquares(const StudyFit& fit) {
  double out = 0.0;
  for (const correlate::TrialResult& t : fit.result.trials) out += t.residual.squaredNorm();
  return out;
}

// By the judge's noise: from its own estimate down to its minimum under that.
correlate::Refitted Again(const data::Study& study, const StudyFit& fit,
                          const correlate::FitResult& judge, std::size_t workers) {
  const EffectVersions versions(study, fit);
  const EffectVersion version = versions.AsItIs();
  const correlate::Refits refits(fit.problem(), fit.result, fit.binding->options, &judge);
  correlate::RefitOptions how;
  how.workers = workers;
  return refits.Refit(version.binding.problem, how);
}

using Tell = std::function<void(const std::string&)>;

std::vector<Rival> FitAll(const std::vector<data::Study>& studies, const RivalsOptions& options,
                          const Tell& tell) {
  std::vector<Rival> out;
  for (const data::Study& study : studies) {
    if (study.command) {
      throw Error("the study of a program has no rivals", study.command->where, "name a scene");
    }
    tell(study.name);
    FitStudyOptions how;
    how.workers = options.workers;
    how.allow_programs = options.allow_programs;
    Rival rival;
    rival.name = study.name;
    rival.path = study.path;
    rival.fit = Fit(study, how);
    rival.parameters = static_cast<double>(study.parameters.size());
    if (!rival.fit.Usable()) rival.message = rival.fit.result.message;
    out.push_back(std::move(rival));
    const std::string unlike = Unlike(out.front().fit.problem(), out.back().fit.problem());
    if (!unlike.empty()) {
      throw Error("it is fitted to other data: " + unlike + " differ", study.path,
                  "rivals are studies of the same trials, in the same order");
    }
  }
  return out;
}

// The least residuals show what is noise; null: none could be fitted.
const StudyFit* JudgeOf(const std::vector<Rival>& rivals) {
  const StudyFit* judge = nullptr;
  for (const Rival& r : rivals) {
    if (!r.message.empty()) continue;
    if (judge == nullptr || PlainSquares(r.fit) < PlainSquares(*judge)) judge = &r.fit;
  }
  return judge;
}

// What each comes to under the judge's noise, in the order of the rivals.
void Compare(const std::vector<correlate::Refitted>& again, std::vector<Rival>* rivals) {
  constexpr double kNever = std::numeric_limits<double>::infinity();
  std::vector<double> squares(rivals->size(), kNever), criterion(rivals->size(), kNever);
  for (std::size_t i = 0; i < rivals->size(); ++i) {
    if ((*rivals)[i].message.empty()) squares[i] = SquaresOf(again[i]);
  }
  const auto least =
      static_cast<std::size_t>(std::min_element(squares.begin(), squares.end()) - squares.begin());
  if (squares[least] == kNever) return;
  const double rows = std::max(1.0, again[least].rows);
  const double scale = std::max(1.0, squares[least] / rows);
  for (std::size_t i = 0; i < rivals->size(); ++i) {
    criterion[i] = squares[i] / scale + (*rivals)[i].parameters * std::log(rows);
  }
  const auto best = static_cast<std::size_t>(std::min_element(criterion.begin(), criterion.end()) -
                                             criterion.begin());
  double total = 0.0;
  for (const double c : criterion) total += std::exp(-0.5 * (c - criterion[best]));
  for (std::size_t i = 0; i < rivals->size(); ++i) {
    Rival& r = (*rivals)[i];
    if (!r.message.empty()) continue;
    r.probability = std::exp(-0.5 * (criterion[i] - criterion[best])) / total;
    r.deviance = (squares[i] - squares[least]) / scale;
    r.explains = Explains(r.fit);
    r.behind = correlate::CompareHeldOut(again[best].held_out, again[i].held_out);
  }
}

}  // namespace

bool Explains(const StudyFit& fit) {
  return std::all_of(fit.result.trials.begin(), fit.result.trials.end(),
                     [](const correlate::TrialResult& t) {
                       return t.goodness.outcome == correlate::Explained::kYes ||
                              t.goodness.outcome == correlate::Explained::kNoise;
                     });
}

std::vector<Rival> WeighRivals(const std::vector<data::Study>& studies,
                               const RivalsOptions& options) {
  if (studies.size() < 2) throw Error("one study has no rival", "--rival", "name another study");
  std::vector<data::Study> asked = studies;
  for (data::Study& study : asked) study.profile_levels.clear();  // intervals are not asked for
  std::size_t done = 0;
  const Tell tell = [&](const std::string& what) {
    const double steps = 2.0 * static_cast<double>(studies.size());
    if (options.progress) options.progress(static_cast<double>(done++) / steps, what);
  };
  std::vector<Rival> out = FitAll(asked, options, tell);
  const StudyFit* judge = JudgeOf(out);
  if (judge == nullptr) return out;
  std::vector<correlate::Refitted> again(out.size());
  for (std::size_t i = 0; i < out.size(); ++i) {
    if (!out[i].message.empty()) continue;
    tell(out[i].name);
    again[i] = Again(asked[i], out[i].fit, judge->result, options.workers);
    if (again[i].status == correlate::RefitStatus::kSettled) continue;
    out[i].message =
        again[i].message.empty() ? "it does not settle to a tenth of its errors" : again[i].message;
  }
  Compare(again, &out);
  std::stable_sort(out.begin(), out.end(), [](const Rival& a, const Rival& b) {
    if (a.message.empty() != b.message.empty()) return a.message.empty();
    return a.probability > b.probability;
  });
  return out;
}

}  // namespace unfurl::study
