#include "study/fit_record.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/length.h"
#include "base/number.h"
#include "base/sentence.h"
#include "base/text.h"
#include "correlate/align/nuisance.h"
#include "correlate/compare/metrics.h"
#include "correlate/fit/fit_stated.h"
#include "correlate/residual/channel.h"
#include "correlate/residual/row_layout.h"
#include "study/ladder_words.h"
#include "study/trial_words.h"

namespace unfurl::study {

namespace {

// Words for the parameters of each verdict in the summary, the worst first.
struct VerdictPhrase {
  correlate::Verdict verdict;
  const char* words;
};
constexpr VerdictPhrase kPhrases[] = {
    {correlate::Verdict::kNotDetermined, "not determined by this trial"},
    {correlate::Verdict::kCombination, "determined only in combination"},
    {correlate::Verdict::kAtBound, "at the bound"},
    {correlate::Verdict::kIfModelHolds, "known only if it holds"},
    {correlate::Verdict::kMeshLimited, "known, as well as the model's own error allows"},
    {correlate::Verdict::kDetermined, "determined"},
};

bool AnyTrial(const correlate::FitResult& r, correlate::Explained outcome) {
  return std::any_of(r.trials.begin(), r.trials.end(), [&](const correlate::TrialResult& t) {
    return t.goodness.outcome == outcome;
  });
}

// What was stated beforehand, is contradicted by the data, and moves a value out of its interval.
std::string Contradicted(const correlate::FitResult& r) {
  std::vector<std::string> names;
  for (std::size_t j = 0; j < r.parameters.size(); ++j) {
    const correlate::Stated* s = correlate::RestsOn(r, j);
    if (s != nullptr && std::find(names.begin(), names.end(), s->name) == names.end()) {
      names.push_back(s->name);
    }
  }
  return JoinWords(names);
}

// The whole in one sentence.
std::string WholeVerdict(const std::vector<correlate::Parameter>& parameters,
                         const correlate::FitResult& r, const TrialsApart& apart) {
  std::string words;
  if (AnyTrial(r, correlate::Explained::kNo)) {
    const std::string what = apart.verdict.empty() ? "the data" : apart.verdict;
    words = "the model does not explain " + what + "; ";
  }
  if (std::string names = Contradicted(r); !names.empty()) {
    words += "what was stated of " + names + " contradicts the data; ";
  }
  bool known = false;
  for (const VerdictPhrase& phrase : kPhrases) {
    std::vector<std::string> names;
    for (std::size_t j = 0; j < parameters.size(); ++j) {
      if (r.parameters[j].verdict == phrase.verdict) names.push_back(parameters[j].name);
    }
    if (names.empty()) continue;
    words += JoinWords(names) + (names.size() == 1 ? " is " : " are ") + phrase.words + "; ";
    known = known || phrase.verdict == correlate::Verdict::kMeshLimited ||
            phrase.verdict == correlate::Verdict::kDetermined;
  }
  words.resize(words.size() - 2);
  if (known && AnyTrial(r, correlate::Explained::kNoise)) {
    words += ": if the excess of the residuals is noise";
  }
  return Capitalised(words) + ".";
}

// Swings that a record may begin with as well.
void AddOtherClocks(const correlate::FitResult& r, data::FitRecord* record) {
  for (const correlate::OtherClock& other : r.other_clocks) {
    std::vector<std::string> offsets, values;
    for (std::size_t t = 0; t < other.offset.size(); ++t) {
      offsets.push_back(fmt::format("{:.6g} s in place of {:.6g} s{}", other.offset[t],
                                    r.trials[t].at.offset,
                                    r.trials.size() > 1 ? " (" + r.trials[t].name + ")" : ""));
    }
    for (std::size_t j = 0; j < other.theta.size(); ++j) {
      values.push_back(fmt::format("{:.5g}", other.theta[j]));
    }
    if (!other.elsewhere) {
      record->reasons.push_back(fmt::format(
          "The values {} explain the data as well: between the samples the model moves by what "
          "they do not show. Sample faster, or narrow the bounds to what is known.",
          JoinWords(values)));
      continue;
    }
    record->reasons.push_back(fmt::format(
        "A time offset of {} explains the data as well, with the values {}: the motion repeats "
        "itself, and the data do not tell which of its swings the record begins with. Say what is "
        "known of the clock (trial.offset).",
        JoinWords(offsets), JoinWords(values)));
  }
}

// What the search says of the minimum.
void AddSearchWords(const correlate::FitResult& r, data::FitRecord* record) {
  if (r.returns > 0) {
    record->reasons.push_back(
        fmt::format("A profile came upon a lower point; the fit was taken up again from there {}.",
                    r.returns == 1 ? std::string("once") : fmt::format("{} times", r.returns)));
  }
  constexpr double kOneSigma = 1.0;  // of deviance: less is the same minimum
  if (r.profile_below > kOneSigma) {
    record->reasons.push_back(fmt::format(
        "A profile still holds a point whose deviance is lower by {:.2g}, within the 95% region of "
        "the values given; more starts may find a better minimum.",
        r.profile_below));
  }
  if (r.elsewhere != correlate::Elsewhere::kNotLooked) {
    record->reasons.push_back(fmt::format(
        "The way from the start ended where the model did not explain the data; points over the "
        "bounds were looked at, and {} lower minimum was found from there.",
        r.elsewhere == correlate::Elsewhere::kFound ? "a" : "no"));
  }
  AddOtherClocks(r, record);
  if (r.starts.size() < 2) return;
  // Ends whose sums of squares differ by less than the noise of a fit are the same minimum.
  const double best = r.starts.front().cost;
  const auto same =
      std::count_if(r.starts.begin(), r.starts.end(), [&](const correlate::StartResult& start) {
        return start.cost >= 0.0 && start.cost - best <= 0.01 * best + 2.0;
      });
  record->reasons.push_back(
      fmt::format("{} of {} starts led to the same minimum.", same, r.starts.size()));
}

void JudgeWhole(const correlate::FitProblem& problem, const correlate::FitResult& r,
                const TrialsApart& apart, data::FitRecord* record) {
  const std::vector<correlate::Parameter>& parameters = problem.parameters;
  if (!r.Usable()) {
    record->verdict = fmt::format("No result: {}", correlate::Name(r.status));
    record->reasons.push_back(r.message);
    record->reasons.insert(record->reasons.end(), apart.reasons.begin(), apart.reasons.end());
    return;
  }
  record->verdict = WholeVerdict(parameters, r, apart);
  for (std::size_t j = 0; j < parameters.size(); ++j) {
    record->reasons.push_back(
        fmt::format("{} = {}{}: {}", parameters[j].name,
                    NumberWithError(r.parameters[j].value, r.parameters[j].sigma),
                    UnitAfter(parameters[j].unit), r.parameters[j].reason));
  }
  record->reasons.insert(record->reasons.end(), apart.reasons.begin(), apart.reasons.end());
  std::vector<std::string> names;
  for (const correlate::Parameter& p : problem.parameters) names.push_back(p.name);
  for (const correlate::Stated& s : r.stated) {
    if (!s.contradicted) continue;
    record->reasons.push_back(correlate::ContradictionWords(
        s, !s.parameter && r.trials.size() > 1
               ? " of " + r.trials[static_cast<std::size_t>(s.trial)].name
               : ""));
  }
  AddTrialWords(names, problem.trials, r, !apart.verdict.empty(), record);
  AddLadderWords(r.ladder, record);
  AddSearchWords(r, record);
}

void AddSearch(const correlate::FitResult& r, data::FitRecord* record) {
  for (std::size_t j = 0; j < r.parameters.size(); ++j) {
    for (const correlate::ProfilePoint& p : r.parameters[j].profile.points) {
      record->profiles.push_back({static_cast<std::int32_t>(j), p.deviance, p.settled, p.theta});
    }
  }
  for (const correlate::StartResult& s : r.starts) {
    record->starts.push_back({s.from, s.to, s.screened, s.cost, s.message});
  }
  for (const correlate::EvaluationRecord& e : r.evaluations) {
    record->evaluations.push_back({e.theta, e.purpose, e.message, e.stage,
                                   e.status != correlate::ModelStatus::kGood, e.start, e.trial,
                                   static_cast<std::int32_t>(e.fidelity), e.cost});
  }
  for (std::size_t rung = 0; rung < r.ladder.names.size(); ++rung) {
    record->rungs.push_back({r.ladder.names[rung], static_cast<std::int32_t>(r.ladder.runs[rung])});
  }
  for (const correlate::LadderRound& round : r.ladder.rounds) {
    record->rounds.push_back({static_cast<std::int32_t>(round.base), round.fine_cost, round.step,
                              round.contraction, round.counted, round.slope, round.theta});
  }
  record->checks["evaluations [1]"] = static_cast<double>(r.evaluations.size());
}

void AddNuisances(const correlate::TrialResult& t, std::int32_t index, data::FitRecord* record) {
  for (std::size_t i = 0; i < t.nuisances.size(); ++i) {
    const correlate::Nuisance& n = t.nuisances[i];
    record->nuisances.push_back({n.Name(), n.Unit(), correlate::ValueOf(n, t.registration),
                                 t.nuisance_sigma(static_cast<Eigen::Index>(i)), index});
  }
}

void RecordChannels(const correlate::TrialResult& t, const correlate::Observations& o,
                    std::int32_t index, data::FitRecord* record) {
  const correlate::ResidualKind::Clocks clocks = correlate::ClocksOf(o, t.reference, t.at.clock());
  const correlate::RowLayout layout(o);
  for (std::size_t k = 0; k < o.others.size(); ++k) {
    const auto* channel = dynamic_cast<const correlate::Channel*>(o.others[k].get());
    if (channel == nullptr) continue;
    const Eigen::VectorXd own = layout.OwnOf(k, t.at.own);
    const correlate::ChannelRecord& c = channel->record();
    const Eigen::VectorXd shown = channel->Simulated(channel->NumbersOf(t.prediction), clocks, own);
    record->channels.push_back({c.name,
                                c.quantity,
                                c.unit,
                                index,
                                c.t,
                                {c.y.begin(), c.y.end()},
                                {c.sigma.begin(), c.sigma.end()},
                                {shown.begin(), shown.end()}});
    for (const correlate::ChannelGross& gross : t.channel_gross) {
      if (gross.kind != k) continue;
      for (const correlate::GrossSample& g : gross.errors.samples) {
        record->channels.back().gross_t.push_back(c.t[g.index]);
        record->channels.back().gross_sigmas.push_back(g.sigmas);
      }
    }
  }
}

std::int32_t MarkIndex(const std::string& name, data::FitRecord* record) {
  for (std::size_t m = 0; m < record->marks.size(); ++m) {
    if (record->marks[m] == name) return static_cast<std::int32_t>(m);
  }
  record->marks.push_back(name);
  return static_cast<std::int32_t>(record->marks.size()) - 1;
}

void AddSamples(const correlate::TrialResult& t, const correlate::Observations& observations,
                std::int32_t index, Eigen::Index column, data::FitRecord* record) {
  const auto measured = correlate::InModelFrame(observations, t.at);
  const auto sigma = correlate::SigmasInModelFrame(observations, t.at);
  for (std::size_t m = 0; m < observations.marks.size(); ++m) {
    const std::int32_t mark = MarkIndex(observations.marks[m].name, record);
    const Eigen::Index count = measured[m].cols();
    record->measured.middleCols(column, count) = measured[m];
    record->sigma.middleCols(column, count) = sigma[m];
    for (Eigen::Index i = 0; i < count; ++i) {
      const double ahead = correlate::Ahead(observations.marks[m].t[static_cast<std::size_t>(i)],
                                            observations.Pivot(), t.reference, t.at.clock());
      record->simulated.col(column + i) =
          t.prediction.marks[m].p.col(i) - ahead * t.prediction.marks[m].v.col(i);
    }
    if (!t.model_error.empty()) {
      record->model_error.middleCols(column, count) = t.model_error.marks[m];
    }
    record->band.middleCols(column, count) = t.band[m];
    for (double stamp : observations.marks[m].t) {
      record->t.push_back(stamp);
      record->mark.push_back(mark);
      record->trial.push_back(index);
    }
    for (std::size_t axis = 0; axis < 3 && !t.noise.series.empty(); ++axis) {
      const correlate::MarkovNoise& n = t.noise.series[3 * m + axis];
      record->noise.push_back(
          {index, mark, static_cast<std::int32_t>(axis), n.variance, n.share, n.rho});
    }
    column += count;
  }
  for (const correlate::GrossSample& g : t.gross.samples) {
    record->gross.push_back(
        {index, MarkIndex(observations.marks[g.mark].name, record), g.t, g.sigmas});
  }
  for (const correlate::LessWeight& l : t.less_weight) {
    record->less_weight.push_back(
        {index, MarkIndex(l.mark, record), l.from, l.to, l.noise, l.weight});
  }
}

}  // namespace

data::FitRecord RecordOf(const data::Study& study, const correlate::FitProblem& problem,
                         const correlate::FitResult& r, const TrialsApart& apart) {
  data::FitRecord record;
  record.study = study.name;
  record.status = correlate::Name(r.status);
  record.message = r.message;
  JudgeWhole(problem, r, apart, &record);
  const auto p = static_cast<Eigen::Index>(problem.parameters.size());
  record.covariance = r.covariance.size() > 0 ? r.covariance : Eigen::MatrixXd::Zero(p, p);
  for (std::size_t j = 0; j < problem.parameters.size(); ++j) {
    const correlate::Parameter& q = problem.parameters[j];
    const correlate::ParameterEstimate& e = r.parameters[j];
    data::FitRecord::Parameter to;
    to.name = q.name, to.unit = q.unit, to.keys = study.parameters[j].keys;
    to.start = q.start, to.low = q.low, to.high = q.high;
    to.value = e.value, to.sigma = e.sigma, to.sigma_data = e.sigma_data;
    to.sigma_white = e.sigma_white, to.sigma_model = e.sigma_model;
    to.sigma_doubt = e.sigma_doubt;
    to.model_shift = e.model_shift, to.kink = e.kink, to.sigma_alone = e.sigma_alone;
    to.imitated = e.imitated, to.low95 = e.all95.low, to.high95 = e.all95.high;
    to.low95_data = e.data95.low, to.high95_data = e.data95.high;
    to.dispersion = e.profile.dispersion;
    to.verdict = correlate::Name(e.verdict), to.reason = e.reason, to.with = e.with;
    record.parameters.push_back(std::move(to));
  }
  AddSearch(r, &record);
  Eigen::Index n = 0;
  bool error = false, whole = r.Usable();
  for (std::size_t t = 0; t < r.trials.size(); ++t) {
    record.trials.push_back(r.trials[t].name);
    n += static_cast<Eigen::Index>(problem.trials[t].observations->size());
    error = error || !r.trials[t].model_error.empty();
    const std::size_t marks = problem.trials[t].observations->marks.size();
    whole =
        whole && r.trials[t].prediction.marks.size() == marks && r.trials[t].band.size() == marks;
  }
  if (!whole) n = 0;
  for (auto* m : {&record.measured, &record.sigma, &record.simulated, &record.band}) {
    m->setZero(3, n);
  }
  record.model_error.setZero(3, error ? n : 0);
  if (!whole) return record;

  Eigen::Index column = 0;
  for (std::size_t t = 0; t < r.trials.size(); ++t) {
    const auto index = static_cast<std::int32_t>(t);
    const correlate::TrialResult& trial = r.trials[t];
    AddNuisances(trial, index, &record);
    RecordChannels(trial, *problem.trials[t].observations, index, &record);
    AddSamples(trial, *problem.trials[t].observations, index, column, &record);
    column += static_cast<Eigen::Index>(problem.trials[t].observations->size());
    const std::string suffix = t == 0 ? "" : fmt::format("_{}", t + 1);
    auto check = [&](const char* name, const char* unit, double value) {
      record.checks[fmt::format("{}{} [{}]", name, suffix, unit)] = value;
    };
    check("chi2_per_dof", "1", trial.chi2_per_dof);
    check("residual_p_white", "1", trial.plain.smallest_p);
    check("residual_p_whitened", "1", trial.whitened.smallest_p);
    check("p_covariances", "1", trial.goodness.p_covariances());
    check("p_noise", "1", trial.goodness.p_noise());
    check("p_constant", "1", trial.goodness.constancy.p_value);
    check("mesh_takes", "1", trial.goodness.mesh_takes);
    check("effective_share", "1", trial.plain.effective_share);
    check("model_noise", "m", trial.model_noise);
    check("model_error_rms", "m", trial.model_error_rms);
    check("model_error_sigmas", "1", trial.model_error_sigmas);
    check("data_sigma", "m", trial.data_sigma);
  }
  return record;
}

void AddTolerances(const std::vector<correlate::ToleranceChoice>& choices,
                   data::FitRecord* record) {
  for (std::size_t t = 0; t < choices.size(); ++t) {
    const correlate::ToleranceChoice& c = choices[t];
    const std::string of = choices.size() > 1 ? " of " + record->trials[t] : "";
    auto text = [&](double sigmas) {
      return c.sigma > 0.0 ? LengthText(c.sigma * sigmas)
                           : fmt::format("{:.2g} standard deviations of the data", sigmas);
    };
    record->checks[fmt::format("rtol{} [1]", t == 0 ? "" : fmt::format("_{}", t + 1))] = c.rtol;
    const char* small = c.noise <= c.of_data ? "moves no value by more than a fifth of its error"
                                             : "is below a hundredth of what the mesh leaves";
    record->reasons.push_back(
        c.noise <= c.wanted
            ? fmt::format("Simulated{} with a tolerance of {:.0e}: its own scatter, {} RMS "
                          "at the start, {}.",
                          of, c.rtol, text(c.noise), small)
            : fmt::format("No tolerance down to 1e-9 brings the simulator's own scatter{} below "
                          "{} at the start: {:.0e} leaves {}.",
                          of, text(c.wanted), c.rtol, text(c.noise)));
  }
}

}  // namespace unfurl::study
