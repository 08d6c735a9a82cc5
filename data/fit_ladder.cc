#include "data/fit_ladder.h"

namespace unfurl::data {

namespace {

constexpr Eigen::Index kRoundNumbers = 6;  // before the parameters

}  // namespace

void WriteLadder(const FitRecord& fit, Eigen::Index p, H5Writer& w) {
  if (fit.rungs.empty()) return;
  std::vector<std::int32_t> runs;
  std::vector<std::string> names;
  for (const FitRecord::Rung& rung : fit.rungs) {
    runs.push_back(rung.runs);
    names.push_back(rung.name);
  }
  w.Write({"/ladder/rungs", "1", "versions of the model, the lowest first"}, names);
  w.Write({"/ladder/runs", "1", "evaluations of each, trials together", {"/ladder/rungs"}}, runs);
  Eigen::MatrixXd rounds(static_cast<Eigen::Index>(fit.rounds.size()), kRoundNumbers + p);
  for (Eigen::Index i = 0; i < rounds.rows(); ++i) {
    const FitRecord::Round& r = fit.rounds[static_cast<std::size_t>(i)];
    rounds.row(i).head(kRoundNumbers) << r.base, r.fine_cost, r.step, r.contraction,
        r.counted ? 1.0 : 0.0, r.slope ? 1.0 : 0.0;
    for (Eigen::Index j = 0; j < p; ++j) {
      rounds(i, kRoundNumbers + j) = r.theta[static_cast<std::size_t>(j)];
    }
  }
  w.Write({"/ladder/rounds", "1",
           "each look at the finest rung: index of the rung that led there; half the finest's sum "
           "of squares there, -1: failed; step from the look before in standard errors, NaN: the "
           "first; that step over the one before; 1: the cost fell; 1: the slope took it in; "
           "parameters, each in its unit"},
          rounds);
  std::vector<double> doubt;
  for (const FitRecord::Parameter& q : fit.parameters) doubt.push_back(q.sigma_doubt);
  w.Write({"/parameters/sigma_doubt",
           "1",
           "of sigma_model what lies to either side of the value, each in its parameter's unit",
           {"/parameters/name"}},
          doubt);
}

void ReadLadder(const H5Reader& r, FitRecord* fit) {
  if (!r.Has("/ladder/rungs")) return;
  const auto runs = r.ReadInts("/ladder/runs");
  const auto names = r.ReadStrings("/ladder/rungs");
  for (std::size_t i = 0; i < names.size(); ++i) fit->rungs.push_back({names[i], runs.at(i)});
  const Eigen::MatrixXd rounds = r.ReadMatrix("/ladder/rounds");
  for (Eigen::Index i = 0; i < rounds.rows(); ++i) {
    const auto n = rounds.row(i).array();
    FitRecord::Round round{
        static_cast<std::int32_t>(n(0)), n(1), n(2), n(3), n(4) != 0.0, n(5) != 0.0, {}};
    for (Eigen::Index j = kRoundNumbers; j < rounds.cols(); ++j) round.theta.push_back(n(j));
    fit->rounds.push_back(std::move(round));
  }
  const auto doubt = r.ReadDoubles("/parameters/sigma_doubt");
  for (std::size_t j = 0; j < fit->parameters.size(); ++j) {
    fit->parameters[j].sigma_doubt = doubt.at(j);
  }
}

}  // namespace unfurl::data
