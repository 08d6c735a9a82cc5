#include "data/fit.h"

#include <algorithm>
#include <limits>

#include "data/fit_channels.h"
#include "data/fit_ladder.h"
#include "data/fit_repeat.h"
#include "data/h5.h"

namespace unfurl::data {

namespace {

// The numbers of a parameter in the order of the columns of /parameters/numbers.
constexpr const char* kParameterColumns =
    "start, low, high, value, sigma, sigma_data, sigma_white, sigma_model, model_shift in the "
    "parameter's unit; kink [1]; sigma_alone in the parameter's unit; imitated [1]; low95, high95 "
    "(all parts), low95_data, high95_data (the data alone) in the parameter's unit; dispersion [1]";
constexpr Eigen::Index kParameterNumbers = 17;  // those columns

template <typename List, typename Get>
std::vector<std::string> Texts(const List& list, Get get) {
  std::vector<std::string> out;
  out.reserve(list.size());
  for (const auto& item : list) out.push_back(get(item));
  return out;
}

// Profiles and starts; p parameters.
void WriteSearch(const FitRecord& fit, Eigen::Index p, H5Writer& w) {
  Eigen::MatrixXd points(static_cast<Eigen::Index>(fit.profiles.size()), 3 + p);
  for (std::size_t i = 0; i < fit.profiles.size(); ++i) {
    const FitRecord::ProfilePoint& q = fit.profiles[i];
    const auto row = static_cast<Eigen::Index>(i);
    points.row(row).head<3>() << q.parameter, q.deviance, q.settled ? 1.0 : 0.0;
    for (Eigen::Index j = 0; j < p; ++j) points(row, 3 + j) = q.theta[static_cast<std::size_t>(j)];
  }
  w.Write({"/profiles/points", "1",
           "index of the parameter that is held, deviance, 1 where the others settled, then all "
           "parameters, each in its unit"},
          points);
  const auto count = static_cast<Eigen::Index>(fit.starts.size());
  Eigen::MatrixXd from(count, p), to(count, p);
  std::vector<double> screened, cost;
  for (Eigen::Index i = 0; i < count; ++i) {
    const FitRecord::Start& s = fit.starts[static_cast<std::size_t>(i)];
    for (Eigen::Index j = 0; j < p; ++j) {
      const auto k = static_cast<std::size_t>(j);
      from(i, j) = s.from[k];
      to(i, j) = k < s.to.size() ? s.to[k] : std::numeric_limits<double>::quiet_NaN();
    }
    screened.push_back(s.screened);
    cost.push_back(s.cost);
  }
  w.Write({"/starts/from", "1", "parameters at each start, best end first, s x p"}, from);
  w.Write({"/starts/to", "1", "where it led, s x p"}, to);
  w.Write({"/starts/screened", "1", "mean square of the residuals over the first horizon"},
          screened);
  w.Write({"/starts/cost", "1", "half the sum of squares over the whole record; -1: failed"}, cost);
  w.Write({"/starts/message", "1", "how it ended"},
          Texts(fit.starts, [](const FitRecord::Start& s) { return s.message; }));
}

void WriteNoise(const FitRecord& fit, H5Writer& w) {
  w.Write({"/trials", "1", "names of the trials"}, fit.trials);
  Eigen::MatrixXd noise(static_cast<Eigen::Index>(fit.noise.size()), 6);
  for (std::size_t i = 0; i < fit.noise.size(); ++i) {
    const FitRecord::Noise& n = fit.noise[i];
    noise.row(static_cast<Eigen::Index>(i)) << n.trial, n.mark, n.axis, n.variance, n.share, n.rho;
  }
  w.Write({"/noise/series", "1",
           "trial, mark, axis; variance of the residuals in units of the samples' own, share of it "
           "that is correlated, correlation from one sample to the next"},
          noise);
  Eigen::MatrixXd less(static_cast<Eigen::Index>(fit.less_weight.size()), 6);
  for (std::size_t i = 0; i < fit.less_weight.size(); ++i) {
    const FitRecord::LessWeight& l = fit.less_weight[i];
    less.row(static_cast<Eigen::Index>(i)) << l.trial, l.mark, l.from, l.to, l.noise, l.weight;
  }
  w.Write({"/noise/less_weight", "1",
           "trial, mark; from, to [s]; the model's own noise there [m]; weight of the samples"},
          less);
  if (fit.gross.empty()) return;
  Eigen::MatrixXd gross(static_cast<Eigen::Index>(fit.gross.size()), 4);
  for (std::size_t i = 0; i < fit.gross.size(); ++i) {
    const FitRecord::Gross& g = fit.gross[i];
    gross.row(static_cast<Eigen::Index>(i)) << g.trial, g.mark, g.t, g.sigmas;
  }
  w.Write({"/noise/gross", "1",
           "samples put aside: trial, mark, t [s], RMS of a coordinate from its neighbours' "
           "residuals in sigmas"},
          gross);
}

std::vector<double> Row(const Eigen::MatrixXd& m, Eigen::Index row, Eigen::Index from) {
  std::vector<double> out;
  for (Eigen::Index j = from; j < m.cols(); ++j) out.push_back(m(row, j));
  return out;
}

// What WriteSearch and WriteNoise wrote.
void ReadSearch(const H5Reader& r, FitRecord* fit) {
  const Eigen::MatrixXd points = r.ReadMatrix("/profiles/points");
  for (Eigen::Index i = 0; i < points.rows(); ++i) {
    fit->profiles.push_back({static_cast<std::int32_t>(points(i, 0)), points(i, 1),
                             points(i, 2) != 0.0, Row(points, i, 3)});
  }
  const Eigen::MatrixXd from = r.ReadMatrix("/starts/from"), to = r.ReadMatrix("/starts/to");
  const auto screened = r.ReadDoubles("/starts/screened"), cost = r.ReadDoubles("/starts/cost");
  const auto message = r.ReadStrings("/starts/message");
  for (std::size_t i = 0; i < cost.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    fit->starts.push_back(
        {Row(from, row, 0), Row(to, row, 0), screened.at(i), cost[i], message.at(i)});
  }
  const Eigen::MatrixXd noise = r.ReadMatrix("/noise/series");
  for (Eigen::Index i = 0; i < noise.rows(); ++i) {
    const auto n = noise.row(i).array();
    fit->noise.push_back({static_cast<std::int32_t>(n(0)), static_cast<std::int32_t>(n(1)),
                          static_cast<std::int32_t>(n(2)), n(3), n(4), n(5)});
  }
  const Eigen::MatrixXd less = r.ReadMatrix("/noise/less_weight");
  for (Eigen::Index i = 0; i < less.rows(); ++i) {
    const auto l = less.row(i).array();
    fit->less_weight.push_back(
        {static_cast<std::int32_t>(l(0)), static_cast<std::int32_t>(l(1)), l(2), l(3), l(4), l(5)});
  }
  if (!r.Has("/noise/gross")) return;
  const Eigen::MatrixXd gross = r.ReadMatrix("/noise/gross");
  for (Eigen::Index i = 0; i < gross.rows(); ++i) {
    const auto g = gross.row(i).array();
    fit->gross.push_back(
        {static_cast<std::int32_t>(g(0)), static_cast<std::int32_t>(g(1)), g(2), g(3)});
  }
}

}  // namespace

void WriteFit(const std::string& path, const FitRecord& fit, const Provenance& provenance) {
  H5Writer w(path, kFitSchema, kFitVersion, provenance);
  w.Attribute("/", "study", fit.study);
  w.Attribute("/", "status", fit.status);
  w.Attribute("/", "message", fit.message);
  w.Attribute("/", "verdict", fit.verdict);
  w.Write({"/reasons", "1", "why the verdict is what it is"}, fit.reasons);

  const auto p = static_cast<Eigen::Index>(fit.parameters.size());
  using Parameter = FitRecord::Parameter;
  auto parameter_text = [&](const char* name, const char* what, auto member) {
    std::vector<std::string> scales;  // names label the others
    if (std::string(name) != "name") scales = {"/parameters/name"};
    w.Write({std::string("/parameters/") + name, "1", what, scales},
            Texts(fit.parameters, [&](const Parameter& q) { return q.*member; }));
  };
  parameter_text("name", "parameters' names, p", &Parameter::name);
  parameter_text("unit", "their units", &Parameter::unit);
  parameter_text("verdict", "what the trial says of each", &Parameter::verdict);
  parameter_text("reason", "in words, with numbers", &Parameter::reason);
  w.Write({"/parameters/keys",
           "1",
           "keys of the scene that each drives, separated by spaces",
           {"/parameters/name"}},
          Texts(fit.parameters, [](const Parameter& q) {
            std::string all;
            for (const std::string& key : q.keys) all += (all.empty() ? "" : " ") + key;
            return all;
          }));
  w.Write({"/parameters/with",
           "1",
           "what each is determined only in combination with",
           {"/parameters/name"}},
          Texts(fit.parameters, [](const Parameter& q) {
            std::string all;
            for (const std::string& name : q.with) all += (all.empty() ? "" : ", ") + name;
            return all;
          }));
  Eigen::MatrixXd numbers(p, kParameterNumbers);
  for (Eigen::Index j = 0; j < p; ++j) {
    const Parameter& q = fit.parameters[static_cast<std::size_t>(j)];
    numbers.row(j) << q.start, q.low, q.high, q.value, q.sigma, q.sigma_data, q.sigma_white,
        q.sigma_model, q.model_shift, q.kink, q.sigma_alone, q.imitated, q.low95, q.high95,
        q.low95_data, q.high95_data, q.dispersion;
  }
  w.Write({"/parameters/numbers", "1", std::string("p rows: ") + kParameterColumns}, numbers);
  w.Write({"/parameters/covariance", "1",
           "p x p covariance of the values, all parts; entry (i, j) in the product of the units"},
          fit.covariance);

  std::vector<double> values, sigmas;
  for (const auto& n : fit.nuisances) values.push_back(n.value), sigmas.push_back(n.sigma);
  using Nuisance = FitRecord::Nuisance;
  w.Write({"/nuisances/name", "1", "what was fitted beside the parameters"},
          Texts(fit.nuisances, [](const Nuisance& n) { return n.name; }));
  w.Write({"/nuisances/unit", "1", "their units"},
          Texts(fit.nuisances, [](const Nuisance& n) { return n.unit; }));
  w.Write({"/nuisances/value", "1", "values, each in its unit"}, values);
  w.Write({"/nuisances/sigma", "1", "standard errors, each in its unit"}, sigmas);

  const auto count = static_cast<Eigen::Index>(fit.evaluations.size());
  Eigen::MatrixXd theta(count, p);
  std::vector<std::int32_t> stage, failed, start, trial, fidelity;
  std::vector<double> cost;
  for (Eigen::Index i = 0; i < count; ++i) {
    const auto& e = fit.evaluations[static_cast<std::size_t>(i)];
    for (Eigen::Index j = 0; j < p; ++j) theta(i, j) = e.theta[static_cast<std::size_t>(j)];
    stage.push_back(e.stage);
    failed.push_back(e.failed ? 1 : 0);
    cost.push_back(e.cost);
    start.push_back(e.start);
    trial.push_back(e.trial);
    fidelity.push_back(e.fidelity);
  }
  using Evaluation = FitRecord::Evaluation;
  w.Write({"/evaluations/theta", "1", "parameters of each evaluation, e x p"}, theta);
  w.Write({"/evaluations/purpose", "1", "what it was for"},
          Texts(fit.evaluations, [](const Evaluation& e) { return e.purpose; }));
  w.Write({"/evaluations/message", "1", "of a failure"},
          Texts(fit.evaluations, [](const Evaluation& e) { return e.message; }));
  w.Write({"/evaluations/stage", "1", "stage of the horizon, from 0"}, stage);
  w.Write({"/evaluations/failed", "1", "1: the model could not be evaluated there"}, failed);
  w.Write({"/evaluations/cost", "1",
           "half the sum of squares of the whitened residuals; -1: not compared with the data"},
          cost);
  w.Write({"/evaluations/start", "1", "which of several starts; -1: not of one"}, start);
  w.Write({"/evaluations/trial", "1", "index into trials"}, trial);
  w.Write({"/evaluations/fidelity", "1",
           "0: the model; 1: with a tighter tolerance; 2: with less error of its own; 3 and more: "
           "rungs of the ladder above the lowest"},
          fidelity);
  WriteSearch(fit, p, w);
  WriteNoise(fit, w);
  WriteLadder(fit, p, w);
  WriteChannels(fit, w);

  WriteAxisNames(w);
  WriteRepeat(fit, w);
  w.Write({"/samples/marks", "1", "marks' names"}, fit.marks);
  w.Write({"/samples/t", "s", "time of each sample on the tracks' clock"}, fit.t);
  w.Write({"/samples/mark", "1", "index into marks", {"/samples/t"}}, fit.mark);
  w.Write({"/samples/trial", "1", "index into trials", {"/samples/t"}}, fit.trial);
  w.Write(
      {"/samples/measured", "m", "x, y, z in the model's frame, n x 3", {"/samples/t", kAxisNames}},
      Eigen::MatrixXd(fit.measured.transpose()));
  w.Write({"/samples/sigma", "m", "their standard deviations, n x 3", {"/samples/t", kAxisNames}},
          Eigen::MatrixXd(fit.sigma.transpose()));
  w.Write(
      {"/samples/simulated", "m", "the model at the estimate, n x 3", {"/samples/t", kAxisNames}},
      Eigen::MatrixXd(fit.simulated.transpose()));
  if (fit.model_error.cols() > 0) {
    w.Write({"/samples/model_error",
             "m",
             "the model's own error, from a finer one, n x 3",
             {"/samples/t", kAxisNames}},
            Eigen::MatrixXd(fit.model_error.transpose()));
  }
  if (fit.band.cols() > 0) {
    w.Write({"/samples/band",
             "m",
             "standard error of the simulated marks by the parameters', n x 3",
             {"/samples/t", kAxisNames}},
            Eigen::MatrixXd(fit.band.transpose()));
  }
  for (const auto& [check, value] : fit.checks) {  // "chi2_per_dof [1]": name and unit
    const std::size_t open = check.find(" [");
    const std::string units =
        open == std::string::npos ? "1" : check.substr(open + 2, check.size() - open - 3);
    w.Write({"/checks/" + check.substr(0, open), units, check}, std::vector<double>{value});
  }
  w.Commit();
}

namespace {

// The parts of a list; none of an empty text.
std::vector<std::string> SplitAt(const std::string& text, const std::string& separator) {
  std::vector<std::string> parts;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t to = std::min(text.find(separator, at), text.size());
    parts.push_back(text.substr(at, to - at));
    at = to + separator.size();
  }
  return parts;
}

void ReadParameters(const H5Reader& r, FitRecord* fit) {
  const auto names = r.ReadStrings("/parameters/name"), units = r.ReadStrings("/parameters/unit");
  const auto verdicts = r.ReadStrings("/parameters/verdict");
  const auto reasons = r.ReadStrings("/parameters/reason");
  const auto keys = r.ReadStrings("/parameters/keys"), with = r.ReadStrings("/parameters/with");
  const Eigen::MatrixXd numbers = r.ReadMatrix("/parameters/numbers");
  const std::size_t p = names.size();
  if (units.size() != p || verdicts.size() != p || reasons.size() != p || keys.size() != p ||
      with.size() != p || numbers.rows() != static_cast<Eigen::Index>(p) ||
      numbers.cols() != kParameterNumbers) {
    r.Fail("lists of different lengths", "/parameters", "write the file again with `unfurl fit`");
  }
  for (std::size_t j = 0; j < p; ++j) {
    FitRecord::Parameter q;
    q.name = names[j];
    q.unit = units[j];
    q.verdict = verdicts[j];
    q.reason = reasons[j];
    q.keys = SplitAt(keys[j], " ");
    q.with = SplitAt(with[j], ", ");
    const auto n = numbers.row(static_cast<Eigen::Index>(j));
    q.start = n(0), q.low = n(1), q.high = n(2), q.value = n(3), q.sigma = n(4);
    q.sigma_data = n(5), q.sigma_white = n(6), q.sigma_model = n(7), q.model_shift = n(8);
    q.kink = n(9), q.sigma_alone = n(10), q.imitated = n(11), q.low95 = n(12), q.high95 = n(13);
    q.low95_data = n(14), q.high95_data = n(15), q.dispersion = n(16);
    fit->parameters.push_back(std::move(q));
  }
}

void ReadEvaluations(const H5Reader& r, FitRecord* fit) {
  const Eigen::MatrixXd theta = r.ReadMatrix("/evaluations/theta");
  const auto purpose = r.ReadStrings("/evaluations/purpose");
  const auto message = r.ReadStrings("/evaluations/message");
  const auto stage = r.ReadInts("/evaluations/stage"), failed = r.ReadInts("/evaluations/failed");
  const auto cost = r.ReadDoubles("/evaluations/cost");
  for (std::size_t i = 0; i < purpose.size(); ++i) {
    FitRecord::Evaluation e;
    for (Eigen::Index j = 0; j < theta.cols(); ++j) {
      e.theta.push_back(theta(static_cast<Eigen::Index>(i), j));
    }
    e.purpose = purpose[i];
    e.message = message.at(i);
    e.stage = stage.at(i);
    e.failed = failed.at(i) != 0;
    e.cost = cost.at(i);
    fit->evaluations.push_back(std::move(e));
  }
  const auto start = r.ReadInts("/evaluations/start"), trial = r.ReadInts("/evaluations/trial");
  const auto fidelity = r.ReadInts("/evaluations/fidelity");
  for (std::size_t i = 0; i < fit->evaluations.size(); ++i) {
    fit->evaluations[i].start = start.at(i);
    fit->evaluations[i].trial = trial.at(i);
    fit->evaluations[i].fidelity = fidelity.at(i);
  }
}

}  // namespace

FitRecord ReadFit(const std::string& path) {
  const H5Reader r(path, kFitSchema, kFitVersion);
  FitRecord fit;
  fit.study = r.StringAttribute("/", "study");
  fit.status = r.StringAttribute("/", "status");
  fit.message = r.StringAttribute("/", "message");
  fit.verdict = r.StringAttribute("/", "verdict");
  fit.reasons = r.ReadStrings("/reasons");

  ReadParameters(r, &fit);
  fit.covariance = r.ReadMatrix("/parameters/covariance");

  const auto nuisance = r.ReadStrings("/nuisances/name"), unit = r.ReadStrings("/nuisances/unit");
  const auto value = r.ReadDoubles("/nuisances/value"), sigma = r.ReadDoubles("/nuisances/sigma");
  for (std::size_t i = 0; i < nuisance.size(); ++i) {
    fit.nuisances.push_back({nuisance[i], unit.at(i), value.at(i), sigma.at(i)});
  }

  ReadEvaluations(r, &fit);

  fit.marks = r.ReadStrings("/samples/marks");
  fit.t = r.ReadDoubles("/samples/t", "s");
  fit.mark = r.ReadInts("/samples/mark");
  ReadSearch(r, &fit);
  ReadLadder(r, &fit);
  ReadChannels(r, &fit);
  ReadRepeat(r, &fit);

  fit.trial = r.ReadInts("/samples/trial");
  fit.trials = r.ReadStrings("/trials");
  fit.measured = r.ReadMatrix("/samples/measured", "m").transpose();
  fit.sigma = r.ReadMatrix("/samples/sigma", "m").transpose();
  fit.simulated = r.ReadMatrix("/samples/simulated", "m").transpose();
  if (r.Has("/samples/model_error")) {
    fit.model_error = r.ReadMatrix("/samples/model_error", "m").transpose();
  }
  if (r.Has("/samples/band")) {
    fit.band = r.ReadMatrix("/samples/band", "m").transpose();
  }
  if (r.Has("/checks")) {
    for (const std::string& name : r.Children("/checks")) {
      const std::vector<double> number = r.ReadDoubles("/checks/" + name);
      if (number.size() == 1) {
        fit.checks[name + " [" + r.Units("/checks/" + name) + "]"] = number[0];
      }
    }
  }
  return fit;
}

}  // namespace unfurl::data
