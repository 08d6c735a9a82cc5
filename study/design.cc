#include "study/design.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/number.h"
#include "base/text.h"
#include "correlate/design/schedule.h"
#include "study/design_planner.h"
#include "study/driven_keys.h"

namespace unfurl::study {

namespace {

using correlate::Choice;

// The reckoning of a trial like the one at hand is to give that one's errors; beyond this factor to
// either side the figures are good for comparison alone, and that is said.
constexpr double kAlike = 1.25;

// Which parameters count, and which trial is the pattern.
std::vector<std::size_t> WantedOf(const DesignOptions& options, const data::Study& study) {
  std::vector<std::size_t> out;
  std::vector<std::string> names;
  for (const auto& p : study.parameters) names.push_back(p.name);
  for (std::size_t j = 0; options.wanted.empty() && j < names.size(); ++j) out.push_back(j);
  for (const std::string& name : options.wanted) {
    const auto at = std::find(names.begin(), names.end(), name);
    if (at == names.end()) {
      throw Error("the study has no parameter '" + name + "'", "DesignOptions.wanted",
                  "it has " + JoinWords(names));
    }
    out.push_back(static_cast<std::size_t>(at - names.begin()));
  }
  return out;
}

// Names of marks that the trial has.
void CheckKept(const DesignOptions& options, const correlate::Observations& record) {
  std::vector<std::string> names;
  for (const correlate::MarkSeries& m : record.marks) names.push_back(m.name);
  for (const std::string& name : options.kept) {
    if (record.FindMark(name) >= 0) continue;
    throw Error("the trial has no mark '" + name + "'", "DesignOptions.kept",
                "it has " + JoinWords(names));
  }
}

std::size_t TrialOf(const data::Study& study, const std::string& name) {
  std::vector<std::string> names;
  for (std::size_t t = 0; t < study.trials.size(); ++t) {
    if (name.empty() || study.trials[t].name == name) return t;
    names.push_back(study.trials[t].name);
  }
  throw Error("the study has no trial '" + name + "'", "DesignOptions.trial",
              "it has " + JoinWords(names));
}

// Without a strobe all marks of the trial are seen at once.
Choice ChoiceNow(const Planner& planner, const Stock& stock) {
  if (planner.strobed()) {
    return planner.ChoiceOf(planner.CycleNow(stock.marks), stock.marks.size(), stock.now);
  }
  Choice out;
  out.instruments = stock.now;
  out.slots.resize(stock.marks.size());
  for (std::size_t m = 0; m < stock.marks_at_hand; ++m) out.slots[m] = {0};
  return out;
}

// The best cycle of these marks (of the stock), and what it gives.
DesignCase BestCycle(const std::string& name, const Planner& planner, const Stock& stock,
                     const correlate::PlannedTrial& plan, const std::vector<std::size_t>& wanted,
                     const std::vector<std::size_t>& marks, const std::vector<std::size_t>& kept) {
  auto in_stock = [&](std::vector<int> cycle) {
    for (int& slot : cycle) {
      if (slot >= 0) slot = static_cast<int>(marks[static_cast<std::size_t>(slot)]);
    }
    return cycle;
  };
  correlate::ScheduleSearch search;
  search.marks = marks.size();
  search.kept = kept;
  search.now = planner.CycleNow(stock.marks);                // those at hand come first in both
  search.alike = 0.01 * static_cast<double>(wanted.size());  // a hundredth of each error
  search.cost = [&](const std::vector<int>& cycle) {
    const Choice choice = planner.ChoiceOf(in_stock(cycle), stock.marks.size(), stock.now);
    const Eigen::VectorXd sigma = correlate::PlannedErrors(planner.basis(), plan, choice, false);
    double cost = 0.0;
    for (const std::size_t j : wanted) cost += std::log(sigma(static_cast<Eigen::Index>(j)));
    return cost;
  };
  const std::vector<int> best = in_stock(correlate::FindSchedule(search));
  DesignCase out = planner.Case(name, plan, planner.ChoiceOf(best, stock.marks.size(), stock.now));
  for (const int slot : best) {
    out.cycle.push_back(slot < 0 ? "dark" : stock.marks[static_cast<std::size_t>(slot)]);
  }
  return out;
}

// Each candidate mark taken in, and the best of all together.
void WeighMarks(const Planner& planner, const Stock& stock, const correlate::PlannedTrial& plan,
                const std::vector<std::size_t>& wanted, StudyDesign* out) {
  const std::size_t own = stock.marks_at_hand;
  for (std::size_t m = own; m < stock.marks.size(); ++m) {
    if (planner.strobed()) {
      std::vector<std::size_t> marks(own);
      for (std::size_t i = 0; i < own; ++i) marks[i] = i;
      marks.push_back(m);
      out->marks.push_back(BestCycle(stock.marks[m], planner, stock, plan, wanted, marks, {own}));
    } else {
      Choice choice = ChoiceNow(planner, stock);
      choice.slots[m] = {0};
      out->marks.push_back(planner.Case(stock.marks[m], plan, choice));
    }
  }
  if (stock.marks.size() < own + 2) return;
  if (planner.strobed()) {
    std::vector<std::size_t> all(stock.marks.size());
    for (std::size_t i = 0; i < all.size(); ++i) all[i] = i;
    out->marks.push_back(BestCycle(kBestOfAll, planner, stock, plan, wanted, all, {}));
  } else {
    Choice choice = ChoiceNow(planner, stock);
    for (auto& slots : choice.slots) slots = {0};
    out->marks.push_back(planner.Case(kAllOfThese, plan, choice));
  }
}

void WeighInstruments(const Planner& planner, const Stock& stock,
                      const correlate::PlannedTrial& plan, StudyDesign* out) {
  for (std::size_t c = 0; c < stock.instruments.size(); ++c) {
    Choice choice = ChoiceNow(planner, stock);
    choice.instruments = stock.With(c);
    out->channels.push_back(planner.Case(stock.instruments[c], plan, choice));
  }
  if (stock.instruments.size() < 2) return;
  Choice choice = ChoiceNow(planner, stock);
  choice.instruments.assign(choice.instruments.size(), true);
  out->channels.push_back(planner.Case(kAllOfThese, plan, choice));
}

void WeighTrials(const DesignOptions& options, Planner& planner, StudyDesign* out) {
  for (const data::DesignTrial& trial : options.candidates.trials) {
    DesignCase found;
    found.name = trial.name;
    try {
      const correlate::Model& model = planner.Model(trial.set);
      const Stock stock = StockOf(options, planner, planner.Quantities(model), false);
      found =
          planner.Case(trial.name, planner.Plan(model, stock.content), ChoiceNow(planner, stock));
    } catch (const Error& e) {
      if (e.kind() == ErrorKind::kMachine) throw;
      if (e.where().starts_with("--set ")) {  // a key or a value that the scene does not take
        throw Error(fmt::format("{}: {}", e.where().substr(6), e.problem()), trial.where,
                    e.remedy());
      }
      found.message = e.problem();
    }
    out->trials.push_back(std::move(found));
  }
}

// The scene with all candidate marks; one that it does not take is an error at its own place.
const correlate::Model& ModelWithMarks(const DesignOptions& options, Planner* planner) {
  std::vector<std::string> set;
  for (const data::DesignMark& m : options.candidates.marks) {
    try {
      planner->Model(m.set);
    } catch (const Error& e) {
      throw Error(e.problem(), m.where, e.remedy(), e.kind());
    }
    set.insert(set.end(), m.set.begin(), m.set.end());
  }
  return planner->Model(set);
}

void NoteLimits(const Planner& planner, StudyDesign* out) {
  const std::vector<double>& alone = out->again.alone;
  for (std::size_t j = 0; j < alone.size(); ++j) {
    const std::string& name = out->tells.parameters[j];
    const double ratio = alone[j] / out->now[j], growth = planner.growth()[j];
    if (out->fit.result.trials.size() == 1 && (ratio > kAlike || ratio < 1.0 / kAlike)) {
      out->notes.push_back(fmt::format(
          "for the trial at hand the same reckoning gives {:.2g} times the error of {} that the "
          "fit found: take the figures as comparisons of one plan with another",
          ratio, name));
    }
    if (growth > kAlike) {
      out->notes.push_back(fmt::format(
          "residuals of the fit still follow one another, which makes the error of {} {:.2g} times "
          "that of independent samples; the plans take that over",
          name, growth));
    }
  }
  for (const correlate::ParameterEstimate& e : out->fit.result.parameters) {
    if (e.sigma_model <= e.sigma_data) continue;
    const auto j = static_cast<std::size_t>(&e - out->fit.result.parameters.data());
    out->notes.push_back(fmt::format(
        "the model's own error leaves {} times as much open of {} as the data do: a finer rung "
        "gives more than another trial",
        Number(e.sigma_model / e.sigma_data, 2), out->tells.parameters[j]));
  }
  if (planner.weight() > 1.0) {
    out->notes.push_back(
        fmt::format("of this long record one cycle of {:.0f} was reckoned with", planner.weight()));
  }
}

}  // namespace

void DesignOptions::Check() const {
  auto refuse = [](bool bad, const char* field, const char* remedy) {
    if (bad) throw Error("is out of its range", std::string("DesignOptions.") + field, remedy);
  };
  refuse(stretches < 1 || stretches > 1000, "stretches", "give 1 to 1000");
  refuse(!cycle.empty() && !(line_rate > 0.0 && std::isfinite(line_rate)), "line_rate",
         "give a positive number of lines a second");
}

StudyDesign DesignStudy(const data::Study& asked, const DesignOptions& options) {
  options.Check();
  data::Study study = asked;
  study.profile_levels.clear();  // intervals are not what is asked here
  StudyDesign out;
  out.trial = TrialOf(study, options.trial);
  const std::vector<std::size_t> wanted = WantedOf(options, study);
  for (const data::DesignTrial& trial : options.candidates.trials) {
    RefuseDrivenKeys(trial.set, study.parameters, trial.where);
  }
  auto tell = [&](double part, const char* what) {
    if (options.progress) options.progress(part, what);
  };

  // 1. The fit, and what tells of its parameters.
  tell(0.0, "the fit as it is");
  FitStudyOptions how;
  how.workers = options.workers;
  how.allow_programs = options.allow_programs;
  out.fit = Fit(study, how);
  if (!out.fit.Usable()) return out;
  const correlate::CameraSights* cameras =
      options.cameras.names.empty() ? nullptr : &options.cameras;
  for (const auto& t : out.fit.problem().trials) {
    if (cameras == nullptr || t.observations->frame == "rig") continue;
    throw Error("marks are in a frame of their own, not in the rig's", "DesignOptions.cameras",
                "leave the rig out, or fit to tracks as reconstructed");
  }
  out.tells =
      correlate::ContributionsOf(out.fit.problem(), out.fit.result, options.stretches, cameras);
  for (const std::size_t j : wanted) out.wanted.push_back(out.tells.parameters[j]);
  for (const auto& e : out.fit.result.parameters) out.now.push_back(e.sigma_data);

  // 2. All that could be recorded in a trial of the same scene, evaluated once.
  tell(0.6, "what could be recorded");
  Planner planner(study, options, out.fit, out.tells, out.trial);
  CheckKept(options, planner.record());
  planner.TakeCycle(&out);
  const correlate::Model& model = ModelWithMarks(options, &planner);
  const Stock stock = StockOf(options, planner, planner.Quantities(model), true);
  const correlate::PlannedTrial plan = planner.Plan(model, stock.content);

  // 3. Parts of it.
  tell(0.75, "schedules, marks, instruments");
  out.again = planner.Case("the same once more", plan, ChoiceNow(planner, stock));
  if (planner.strobed()) {
    std::vector<std::size_t> marks(stock.marks_at_hand), kept;
    for (std::size_t i = 0; i < marks.size(); ++i) {
      marks[i] = i;
      const auto& keep = options.kept;
      if (std::find(keep.begin(), keep.end(), stock.marks[i]) != keep.end()) kept.push_back(i);
    }
    out.schedule = BestCycle("the best cycle", planner, stock, plan, wanted, marks, kept);
  }
  WeighMarks(planner, stock, plan, wanted, &out);
  WeighInstruments(planner, stock, plan, &out);

  // 4. Other trials.
  tell(0.85, "other trials");
  WeighTrials(options, planner, &out);
  NoteLimits(planner, &out);
  return out;
}

}  // namespace unfurl::study
