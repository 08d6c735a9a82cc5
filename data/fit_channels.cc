#include "data/fit_channels.h"

namespace unfurl::data {

void WriteChannels(const FitRecord& fit, H5Writer& w) {
  if (fit.channels.empty()) return;
  std::vector<std::string> name, quantity, unit;
  std::vector<std::int32_t> trial, channel;
  std::vector<double> t, measured, sigma, simulated;
  for (const FitRecord::Channel& c : fit.channels) {
    channel.insert(channel.end(), c.t.size(), static_cast<std::int32_t>(name.size()));
    name.push_back(c.name);
    quantity.push_back(c.quantity);
    unit.push_back(c.unit);
    trial.push_back(c.trial);
    t.insert(t.end(), c.t.begin(), c.t.end());
    measured.insert(measured.end(), c.measured.begin(), c.measured.end());
    sigma.insert(sigma.end(), c.sigma.begin(), c.sigma.end());
    simulated.insert(simulated.end(), c.simulated.begin(), c.simulated.end());
  }
  const std::string each = ", each in its channel's unit";
  w.Write({"/channels/name", "1", "channels' names"}, name);
  w.Write({"/channels/quantity", "1", "what of the model each reads"}, quantity);
  w.Write({"/channels/unit", "1", "of its readings"}, unit);
  w.Write({"/channels/trial", "1", "index into trials"}, trial);
  w.Write({"/channels/t", "s", "time of each reading on its channel's clock"}, t);
  w.Write({"/channels/channel", "1", "index into names", {"/channels/t"}}, channel);
  w.Write({"/channels/measured", "1", "readings" + each, {"/channels/t"}}, measured);
  w.Write({"/channels/sigma", "1", "their standard deviations" + each, {"/channels/t"}}, sigma);
  w.Write({"/channels/simulated",
           "1",
           "the model at the estimate behind the instrument, NaN: it has none" + each,
           {"/channels/t"}},
          simulated);
  std::vector<Eigen::Vector3d> gross;
  for (std::size_t k = 0; k < fit.channels.size(); ++k) {
    const FitRecord::Channel& c = fit.channels[k];
    for (std::size_t i = 0; i < c.gross_t.size(); ++i) {
      gross.emplace_back(static_cast<double>(k), c.gross_t[i], c.gross_sigmas[i]);
    }
  }
  if (gross.empty()) return;
  Eigen::MatrixXd table(static_cast<Eigen::Index>(gross.size()), 3);
  for (std::size_t i = 0; i < gross.size(); ++i) table.row(static_cast<Eigen::Index>(i)) = gross[i];
  w.Write({"/channels/gross", "1",
           "readings put aside: channel, t [s], distance from its neighbours' residuals in sigmas"},
          table);
}

void ReadChannels(const H5Reader& r, FitRecord* fit) {
  if (!r.Has("/channels/name")) return;
  const auto name = r.ReadStrings("/channels/name"), quantity = r.ReadStrings("/channels/quantity");
  const auto unit = r.ReadStrings("/channels/unit");
  const auto trial = r.ReadInts("/channels/trial"), channel = r.ReadInts("/channels/channel");
  const auto t = r.ReadDoubles("/channels/t", "s"), measured = r.ReadDoubles("/channels/measured");
  const auto sigma = r.ReadDoubles("/channels/sigma");
  const auto simulated = r.ReadDoubles("/channels/simulated");
  for (std::size_t k = 0; k < name.size(); ++k) {
    fit->channels.push_back({name[k], quantity.at(k), unit.at(k), trial.at(k), {}, {}, {}, {}});
  }
  for (std::size_t i = 0; i < t.size(); ++i) {
    FitRecord::Channel& c = fit->channels.at(static_cast<std::size_t>(channel.at(i)));
    c.t.push_back(t[i]);
    c.measured.push_back(measured.at(i));
    c.sigma.push_back(sigma.at(i));
    c.simulated.push_back(simulated.at(i));
  }
  if (!r.Has("/channels/gross")) return;
  const Eigen::MatrixXd gross = r.ReadMatrix("/channels/gross");
  for (Eigen::Index i = 0; i < gross.rows(); ++i) {
    FitRecord::Channel& c = fit->channels.at(static_cast<std::size_t>(gross(i, 0)));
    c.gross_t.push_back(gross(i, 1));
    c.gross_sigmas.push_back(gross(i, 2));
  }
}

}  // namespace unfurl::data
