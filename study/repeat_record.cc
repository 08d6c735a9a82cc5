#include "study/repeat_record.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace unfurl::study {

namespace {

using correlate::Interval;
using correlate::Parameter;
using correlate::ParameterScatter;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

void Append(const Eigen::Matrix3Xd& more, Eigen::Matrix3Xd* all) {
  const Eigen::Index before = all->cols();
  all->conservativeResize(3, before + more.cols());
  all->rightCols(more.cols()) = more;
}

void AppendSamples(const data::FitRecord& one, std::int32_t trial, data::FitRecord* all) {
  std::vector<std::int32_t> index;  // of its marks among all
  for (const std::string& name : one.marks) {
    const auto at = std::find(all->marks.begin(), all->marks.end(), name);
    index.push_back(static_cast<std::int32_t>(at - all->marks.begin()));
    if (at == all->marks.end()) all->marks.push_back(name);
  }
  const auto mark_of = [&](std::int32_t m) { return index[static_cast<std::size_t>(m)]; };
  all->t.insert(all->t.end(), one.t.begin(), one.t.end());
  for (std::int32_t m : one.mark) all->mark.push_back(mark_of(m));
  all->trial.insert(all->trial.end(), one.mark.size(), trial);
  Append(one.measured, &all->measured);
  Append(one.sigma, &all->sigma);
  Append(one.simulated, &all->simulated);
  Append(one.band, &all->band);
  for (auto n : one.noise) {
    n.trial = trial, n.mark = mark_of(n.mark);
    all->noise.push_back(n);
  }
  for (auto l : one.less_weight) {
    l.trial = trial, l.mark = mark_of(l.mark);
    all->less_weight.push_back(l);
  }
  for (auto g : one.gross) {
    g.trial = trial, g.mark = mark_of(g.mark);
    all->gross.push_back(g);
  }
}

// "chi2_per_dof [1]" of the third trial: "chi2_per_dof_3 [1]".
std::string CheckOf(const std::string& name, std::size_t trial) {
  const std::size_t unit = name.find(" [");
  if (trial == 0 || unit == std::string::npos) return name;
  return fmt::format("{}_{}{}", name.substr(0, unit), trial + 1, name.substr(unit));
}

double Out(const Parameter& p, double u) { return correlate::FromInternal(p, u); }

void FillParameter(const Parameter& p, const ParameterScatter& s, double shared,
                   data::FitRecord::Parameter* to, data::FitRecord::Repeat::Parameter* repeat) {
  to->value = Out(p, s.value);
  const double slope = std::abs(correlate::Slope(p, to->value));
  to->sigma = slope * s.sigma;
  to->sigma_model = slope * std::sqrt(std::min(shared, s.sigma * s.sigma));
  to->sigma_data =
      std::sqrt(std::max(to->sigma * to->sigma - to->sigma_model * to->sigma_model, 0.0));
  to->sigma_white = to->sigma_data;
  to->sigma_alone = kNone;
  to->low95 = Out(p, s.mean95.low), to->high95 = Out(p, s.mean95.high);
  const double half = correlate::kHalf95 * to->sigma_data / slope;
  to->low95_data = Out(p, s.value - half), to->high95_data = Out(p, s.value + half);
  repeat->scatters = s.scatters, repeat->log = p.log;
  repeat->scatter = s.scatter, repeat->visible = s.visible;
  repeat->scatter_low95 = s.scatter95.low, repeat->scatter_high95 = s.scatter95.high;
  if (!s.scatters) repeat->scatter_low95 = repeat->scatter_high95 = 0.0;
  repeat->next_low95 = Out(p, s.next95.low), repeat->next_high95 = Out(p, s.next95.high);
  repeat->alike_p = s.alike_p;
}

// Row j of the matrices by trial.
void FillTrials(const Parameter& p, const ParameterScatter& s, Eigen::Index j,
                data::FitRecord::Repeat* repeat) {
  for (std::size_t i = 0; i < s.estimate.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    const double half = correlate::kHalf95 * s.own[i];
    repeat->estimate(j, k) = Out(p, s.estimate[i]);
    repeat->low95(j, k) = Out(p, s.estimate[i] - half);
    repeat->high95(j, k) = Out(p, s.estimate[i] + half);
    if (!s.scatters) continue;
    repeat->effect(j, k) = Out(p, s.effect[i]);
    repeat->effect_low95(j, k) = Out(p, s.effect95[i].low);
    repeat->effect_high95(j, k) = Out(p, s.effect95[i].high);
    repeat->left_out_p(j, k) = s.left_out[i].p;
    repeat->left_out_log_density(j, k) = s.left_out[i].log_density;
  }
}

}  // namespace

data::FitRecord JoinRecords(const data::Study& study, const std::vector<StudyFit>& trials) {
  data::FitRecord all;
  all.study = study.name;
  all.parameters = trials.front().record.parameters;
  const auto p = static_cast<Eigen::Index>(all.parameters.size());
  all.covariance = Eigen::MatrixXd::Zero(p, p);
  for (auto& q : all.parameters) {
    data::FitRecord::Parameter bare;
    bare.name = q.name, bare.unit = q.unit, bare.keys = q.keys;
    bare.start = q.start, bare.low = q.low, bare.high = q.high, bare.value = q.start;
    q = std::move(bare);
  }
  bool error = true;
  for (std::size_t i = 0; i < trials.size(); ++i) {
    const data::FitRecord& one = trials[i].record;
    const auto trial = static_cast<std::int32_t>(i);
    all.trials.push_back(study.trials[i].name);
    AppendSamples(one, trial, &all);
    error = error && one.model_error.cols() == one.measured.cols();
    for (auto n : one.nuisances) {
      n.trial = trial;
      all.nuisances.push_back(n);
    }
    for (auto c : one.channels) {
      c.trial = trial;
      all.channels.push_back(std::move(c));
    }
    for (auto e : one.evaluations) {
      e.trial = trial;
      all.evaluations.push_back(std::move(e));
    }
    for (const auto& rung : one.rungs) {
      const auto same = std::find_if(all.rungs.begin(), all.rungs.end(),
                                     [&](const auto& r) { return r.name == rung.name; });
      if (same == all.rungs.end()) {
        all.rungs.push_back(rung);
      } else {
        same->runs += rung.runs;
      }
    }
    for (const auto& [name, value] : one.checks) {
      if (!name.starts_with("evaluations")) all.checks[CheckOf(name, i)] = value;
    }
  }
  all.checks["evaluations [1]"] = static_cast<double>(all.evaluations.size());
  for (const StudyFit& fit : trials) {
    if (error) Append(fit.record.model_error, &all.model_error);
  }
  return all;
}

void AddHierarchy(const std::vector<Parameter>& parameters, const correlate::FittedTrials& fitted,
                  const correlate::Hierarchy& hierarchy, data::FitRecord* record) {
  const auto p = static_cast<Eigen::Index>(parameters.size());
  const auto k = static_cast<Eigen::Index>(fitted.used.size());
  data::FitRecord::Repeat& repeat = record->repeat;
  for (const correlate::TrialEstimate& t : fitted.problem.trials) repeat.trials.push_back(t.name);
  for (Eigen::MatrixXd* m :
       {&repeat.estimate, &repeat.low95, &repeat.high95, &repeat.effect, &repeat.effect_low95,
        &repeat.effect_high95, &repeat.left_out_p, &repeat.left_out_log_density}) {
    m->setConstant(p, k, kNone);
  }
  repeat.parameters.resize(parameters.size());
  Eigen::VectorXd slope(p);
  for (std::size_t j = 0; j < parameters.size(); ++j) {
    const auto row = static_cast<Eigen::Index>(j);
    const ParameterScatter& s = hierarchy.parameters()[j];
    FillParameter(parameters[j], s, fitted.problem.shared(row, row), &record->parameters[j],
                  &repeat.parameters[j]);
    FillTrials(parameters[j], s, row, &repeat);
    slope(row) = correlate::Slope(parameters[j], record->parameters[j].value);
  }
  record->covariance = slope.asDiagonal() * hierarchy.covariance() * slope.asDiagonal();
  repeat.unlike_p = hierarchy.unlike_p();
  repeat.alike_p = hierarchy.alike_p();
}

void AddNextTrial(const correlate::Stamps& stamps, const correlate::NextTrial& next,
                  data::FitRecord* record) {
  data::FitRecord::Repeat& repeat = record->repeat;
  for (std::size_t m = 0; m < stamps.marks.size(); ++m) {
    repeat.marks.push_back(stamps.marks[m]);
    repeat.t.insert(repeat.t.end(), stamps.t[m].begin(), stamps.t[m].end());
    repeat.mark.insert(repeat.mark.end(), stamps.t[m].size(), static_cast<std::int32_t>(m));
    Append(next.middle[m], &repeat.middle);
    Append(next.low[m], &repeat.low);
    Append(next.high[m], &repeat.high);
  }
}

}  // namespace unfurl::study
