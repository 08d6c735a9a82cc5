#include "cli/ladder_panel.h"

#include <fmt/format.h>

#include <cmath>

namespace unfurl::cli {

void AddLadder(const data::FitRecord& fit, report::Page* page) {
  if (fit.rungs.empty()) return;
  page->AddSection(
      "The ladder",
      "The lowest rung is solved with its difference to the finest added; where that leads the "
      "difference is taken anew, until the next step is a small part of the standard error. The "
      "values are those of the finest rung.");
  report::Table rungs;
  rungs.title = "Rungs";
  rungs.header = {"rung", "runs of the model"};
  rungs.text_columns = {0};
  for (const auto& rung : fit.rungs)
    rungs.rows.push_back({rung.name, fmt::format("{}", rung.runs)});
  page->AddTable(rungs);

  report::Table rounds;
  rounds.title = "Looks at the finest rung";
  rounds.note =
      "Cost: half the finest rung's sum of squares there, with the weights of that moment. Step: "
      "from the look before, the largest of all parameters in standard errors. Where the cost did "
      "not fall the look does not count, and the fit goes back.";
  rounds.header = {"look", "led by"};
  for (const auto& p : fit.parameters) rounds.header.push_back(p.name + ", " + p.unit);
  for (const char* name : {"cost", "step", "of the one before", "counts", "slope"}) {
    rounds.header.emplace_back(name);
  }
  const std::size_t columns = rounds.header.size();
  rounds.text_columns = {1, static_cast<int>(columns) - 2, static_cast<int>(columns) - 1};
  auto number = [](double x) { return std::isfinite(x) ? fmt::format("{:.2g}", x) : ""; };
  for (std::size_t i = 0; i < fit.rounds.size(); ++i) {
    const auto& r = fit.rounds[i];
    std::vector<std::string> row = {fmt::format("{}", i + 1),
                                    fit.rungs.at(static_cast<std::size_t>(r.base)).name};
    for (double value : r.theta) row.push_back(fmt::format("{:.6g}", value));
    row.push_back(r.fine_cost < 0.0 ? "failed" : fmt::format("{:.5g}", r.fine_cost));
    row.push_back(number(r.step));
    row.push_back(number(r.contraction));
    row.emplace_back(r.counted ? "yes" : "no");
    row.emplace_back(r.slope ? "learnt" : "");
    rounds.rows.push_back(std::move(row));
  }
  page->AddTable(rounds);
}

}  // namespace unfurl::cli
