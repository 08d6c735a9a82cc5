#include "correlate/design/planned_trial.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>

#include "base/dense.h"
#include "base/error.h"
#include "correlate/design/strobe.h"
#include "correlate/fit/normal_matrix.h"
#include "correlate/fit/reduced_problem.h"
#include "correlate/residual/row_layout.h"
#include "correlate/sampled_model.h"

namespace unfurl::correlate {

namespace {

// [parameters, nuisances] of a record that the model explains, by central differences whose steps
// move the data as a fit's do; the parameters' own priors left out.
Eigen::MatrixXd RowsOf(const PlanBasis& basis, const Model& model, const Observations& record) {
  FitProblem problem;
  problem.parameters = basis.problem->parameters;
  FitTrial trial;
  trial.observations = &record;
  trial.model = &model;
  problem.trials.push_back(trial);
  const TrialResult& found = basis.fit->trials[basis.trial];
  const Clock clock = found.at.clock();

  const auto workers = LocalWorkers(basis.options->workers);
  Evaluator evaluator(problem, *workers);
  evaluator.SetStamps({record.StampsAt(clock)}, 0);
  ReducedProblem::Part part;
  part.observations = &record;
  part.reference = clock;
  part.start = found.at;
  part.start.own = StartOfOwn(record);
  part.start.z = Eigen::VectorXd::Zero(record.shared_rank);
  ReducedProblem reduced({part}, basis.options->align.registration, evaluator);

  const std::vector<double> theta = basis.fit->Theta();
  std::vector<double> u;
  for (std::size_t j = 0; j < theta.size(); ++j) {
    u.push_back(ToInternal(problem.parameters[j], theta[j]));
  }
  ReducedProblem::Point point;
  Eigen::MatrixXd J;
  bool good = reduced.At(u, &point, "plan") && reduced.Sensitivity(u, point, +1, &J);
  if (good) {
    const double sigma = TypicalSigma(record);
    const double noise = sigma > 0.0 ? found.model_noise / sigma : 0.0;
    const double target =
        std::max(basis.options->difference_sigma, basis.options->noise_factor * noise);
    reduced.SetSteps(u, J, point, target);
    good = reduced.CentralSensitivity(u, point, &J);
  }
  if (!good) {
    throw Error("the model does not run beside the estimate: " + point.failure, "plan",
                "see what `unfurl simulate` says of the scene");
  }
  const Eigen::MatrixXd& N = point.registration[0].jacobian;
  Eigen::MatrixXd rows(N.rows(), J.cols() + N.cols());
  for (Eigen::Index j = 0; j < J.cols(); ++j) {
    const auto i = static_cast<std::size_t>(j);
    rows.col(j) = J.col(j).head(N.rows()) / Slope(problem.parameters[i], theta[i]);
  }
  rows.rightCols(N.cols()) = N;
  return rows;
}

// The noise of an axis, `factor` times as far from sample to sample.
MarkovNoise Spread(MarkovNoise noise, double factor) {
  noise.rho = noise.rho > 0.0 ? std::pow(noise.rho, factor) : 0.0;
  return noise;
}

// Noise of the axes of a series by name: what the fit found of it; of one that the record at hand
// does not have, the mean of all of its kind (marks), or none (channels).
std::vector<MarkovNoise> NoiseOf(const RowLayout& layout, const SeriesNoise& found,
                                 const RowSeries& wanted, bool mark) {
  std::vector<MarkovNoise> out(static_cast<std::size_t>(wanted.axes));
  if (found.series.empty()) return out;
  std::vector<double> count(out.size(), 0.0);
  std::vector<MarkovNoise> mean(out.size(), MarkovNoise{0.0, 0.0, 0.0});
  for (std::size_t s = 0; s < layout.series.size(); ++s) {
    const RowSeries& series = layout.series[s];
    if (series.axes != wanted.axes) continue;
    for (std::size_t a = 0; a < out.size(); ++a) {
      const MarkovNoise& own = found.series[layout.first_axis[s] + a];
      if (series.name == wanted.name) out[a] = own;
      mean[a].variance += own.variance;
      mean[a].share += own.share;
      mean[a].rho += own.rho;
      count[a] += 1.0;
    }
    if (series.name == wanted.name) return out;
  }
  for (std::size_t a = 0; mark && a < out.size() && count[a] > 0.0; ++a) {
    out[a] = {mean[a].variance / count[a], mean[a].share / count[a], mean[a].rho / count[a]};
  }
  return out;
}

// Samples that a mark had, had it always been seen: those of its lines in the strobe's cycle, which
// need not be evenly spread, else those of an even step.
double FlashesOf(const MarkSeries& mark, const Strobe& strobe) {
  const double span = mark.t.back() - mark.t.front();
  double step = MedianStep(mark.t);
  const auto lit = std::count(strobe.slots.begin(), strobe.slots.end(), mark.name);
  if (lit > 0) {
    step = strobe.line * static_cast<double>(strobe.slots.size()) / static_cast<double>(lit);
  }
  return step > 0.0 ? span / step + 1.0 : 1.0;
}

}  // namespace

PlannedTrial::PlannedTrial(const PlanBasis& basis, const Model& model,
                           const PlannedContent& content, double weight)
    : record_(PlanRecord(model, basis.fit->Theta(), content,
                         *basis.problem->trials[basis.trial].observations,
                         basis.fit->trials[basis.trial], *basis.options)),
      channels_(content.channels.size()),
      instruments_(channels_ + content.switches.size()),
      weight_(weight),
      parameters_(static_cast<Eigen::Index>(basis.problem->parameters.size())),
      rows_(RowsOf(basis, model, record_)) {
  const Observations& like = *basis.problem->trials[basis.trial].observations;
  const TrialResult& found = basis.fit->trials[basis.trial];
  const RowLayout layout(record_), like_layout(like);
  // Step, and part of the samples that are found, of each mark at hand, and of one more like them.
  const Strobe strobe = FindStrobe(like);
  std::vector<double> steps, usable;
  for (const MarkSeries& m : like.marks) {
    steps.push_back(MedianStep(m.t));
    usable.push_back(std::min(1.0, static_cast<double>(m.size()) / FlashesOf(m, strobe)));
  }
  const double others = std::max(1.0, static_cast<double>(steps.size()));
  const double mean_step = std::accumulate(steps.begin(), steps.end(), 0.0) / others;
  const double mean_usable = std::accumulate(usable.begin(), usable.end(), 0.0) / others;
  for (std::size_t s = 0; s < layout.series.size(); ++s) {
    const bool mark = s < content.marks.size();
    for (const MarkovNoise& n : NoiseOf(like_layout, found.noise, layout.series[s], mark)) {
      noise_.series.push_back(n);
    }
    if (!mark) continue;
    slot_.push_back(content.marks[s].slot);
    const int at = like.FindMark(content.marks[s].name);
    step_.push_back(at >= 0 ? steps[static_cast<std::size_t>(at)] : mean_step);
    usable_.push_back(at >= 0 ? usable[static_cast<std::size_t>(at)] : mean_usable);
  }
  Eigen::MatrixXd fixed = rows_;
  for (const RowSeries& s : layout.series) {
    fixed.middleRows(s.first, s.axes * static_cast<Eigen::Index>(s.size())).setZero();
  }
  for (std::size_t c = channels_; c < instruments_; ++c) {
    fixed.middleRows(layout.others[c], record_.others[c]->rows()).setZero();
  }
  fixed_ = Gram(fixed);
}

Eigen::MatrixXd PlannedTrial::MarkRows(std::size_t mark, const std::vector<int>& slots) const {
  const RowLayout layout(record_);
  const RowSeries& series = layout.series[mark];
  Observations lone;  // that mark in those lines, for the noise's sake
  MarkSeries own;
  own.name = series.name;
  std::vector<Eigen::Index> from;
  for (std::size_t i = 0; i < series.size(); ++i) {
    if (!std::binary_search(slots.begin(), slots.end(), slot_[mark][i])) continue;
    own.t.push_back((*series.t)[i]);
    from.push_back(series.Row(i));
  }
  Eigen::MatrixXd rows(3 * static_cast<Eigen::Index>(from.size()), rows_.cols());
  for (std::size_t i = 0; i < from.size(); ++i) {
    rows.middleRows(3 * static_cast<Eigen::Index>(i), 3) = rows_.middleRows(from[i], 3);
  }
  SeriesNoise noise;
  const double step = MedianStep(own.t);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const MarkovNoise& n = noise_.series[layout.first_axis[mark] + axis];
    noise.series.push_back(step_[mark] > 0.0 ? Spread(n, step / step_[mark]) : n);
  }
  own.p.resize(3, static_cast<Eigen::Index>(own.t.size()));
  lone.marks.push_back(std::move(own));
  RowWhitening(lone, noise).Apply(rows);
  return rows;
}

Eigen::MatrixXd PlannedTrial::InstrumentRows(std::size_t instrument) const {
  const RowLayout layout(record_);
  const auto& kind = record_.others[instrument];
  if (instrument >= channels_) {
    return rows_.middleRows(layout.others[instrument], kind->rows());
  }
  const std::size_t at = slot_.size() + instrument;
  const RowSeries& series = layout.series[at];
  Observations lone;  // for the noise's sake
  lone.others.push_back(kind);
  SeriesNoise noise;
  noise.series.push_back(noise_.series[layout.first_axis[at]]);
  Eigen::MatrixXd rows = rows_.middleRows(series.first, static_cast<Eigen::Index>(series.size()));
  RowWhitening(lone, noise).Apply(rows);
  return rows;
}

Eigen::MatrixXd PlannedTrial::Normal(const Choice& choice) const {
  const RowLayout layout(record_);
  Eigen::MatrixXd out = fixed_;
  for (std::size_t m = 0; m < slot_.size(); ++m) {
    if (choice.slots[m].empty()) continue;
    Eigen::MatrixXd& own = known_[{m, choice.slots[m]}];
    if (own.size() == 0) own = weight_ * usable_[m] * Gram(MarkRows(m, choice.slots[m]));
    out += own;
  }
  for (std::size_t c = 0; c < instruments_; ++c) {
    if (!choice.instruments[c]) continue;
    Eigen::MatrixXd& own = known_[{slot_.size() + c, {}}];
    if (own.size() == 0) own = Gram(InstrumentRows(c));
    out += own;
  }
  return out;
}

Eigen::MatrixXd NormalOf(const FitResult& fit) {
  std::vector<Eigen::MatrixXd> jacobian;
  for (const TrialResult& t : fit.trials) jacobian.push_back(t.registration.jacobian);
  return Gram(StackRows(fit.sensitivity, jacobian).A);
}

Eigen::VectorXd PlannedErrors(const PlanBasis& basis, const PlannedTrial& plan,
                              const Choice& choice, bool together) {
  const auto p = static_cast<Eigen::Index>(basis.problem->parameters.size());
  const Eigen::MatrixXd own = plan.Normal(choice);
  const Eigen::Index q = plan.nuisances();
  if (!together) {
    Eigen::MatrixXd H = own;
    for (Eigen::Index j = 0; j < p; ++j) {
      const Parameter& parameter = basis.problem->parameters[static_cast<std::size_t>(j)];
      if (parameter.has_prior) H(j, j) += 1.0 / (parameter.prior_sigma * parameter.prior_sigma);
    }
    return StandardErrorsOf(H, p).sigma;
  }
  const Eigen::MatrixXd known = NormalOf(*basis.fit);
  const Eigen::Index n = known.rows();
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(n + q, n + q);
  H.topLeftCorner(n, n) = known;
  H.topLeftCorner(p, p) += own.topLeftCorner(p, p);
  H.block(0, n, p, q) = own.topRightCorner(p, q);
  H.block(n, 0, q, p) = own.bottomLeftCorner(q, p);
  H.bottomRightCorner(q, q) = own.bottomRightCorner(q, q);
  // Trials of one calibration have the same draw: what it does to one it does to the others, so the
  // errors of their rows z are the same error.
  Eigen::MatrixXd ties = Eigen::MatrixXd::Zero(n + q, n + q);
  const std::string& calibration = basis.problem->trials[basis.trial].calibration;
  const Eigen::Index k = plan.draws();
  std::vector<Eigen::Index> at = {n + q - k};
  Eigen::Index column = p;
  for (std::size_t t = 0; t < basis.fit->trials.size(); ++t) {
    column += basis.fit->trials[t].registration.jacobian.cols();
    const FitTrial& trial = basis.problem->trials[t];
    const bool same =
        t == basis.trial || (!calibration.empty() && trial.calibration == calibration);
    if (same && trial.observations->shared_rank == k) at.push_back(column - k);
  }
  for (const Eigen::Index a : at) {
    for (const Eigen::Index b : at) {
      if (a != b) ties.block(a, b, k, k) += Eigen::MatrixXd::Identity(k, k);
    }
  }
  return StandardErrorsOf(H, p, &ties).sigma;
}

}  // namespace unfurl::correlate
