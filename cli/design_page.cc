#include "cli/design_page.h"

#include <fmt/format.h>

#include <cmath>

#include "base/sentence.h"
#include "report/page.h"
#include "study/design_advice.h"

namespace unfurl::cli {

namespace {

std::string DesignPagePercent(double share) { return fmt::format("{:.3g}%", 100.0 * share); }

std::string Times(double factor) {
  return std::isfinite(factor) ? fmt::format("x{:.3g}", factor) : "lost";
}

void AddRows(report::Page* page, const std::string& title, const std::string& note,
             const TextTable& rows) {
  if (rows.size() < 2) return;
  report::Table table;
  table.title = title;
  table.note = note;
  table.header = rows.front();
  table.rows.assign(rows.begin() + 1, rows.end());
  table.text_columns = {0};
  page->AddTable(table);
}

// Shares of information by time, at the middle of each stretch, a curve for each parameter.
void AddTimes(report::Page* page, const study::StudyDesign& d) {
  if (d.fit.result.trials.size() != 1 || d.tells.times.size() < 2) return;
  report::Chart chart;
  chart.title = "When the trial tells of them";
  chart.note = "Share of the information about each parameter, by stretch of the record.";
  chart.x = {"time", "s", false};
  chart.y = {"share", "%", false};
  for (std::size_t j = 0; j < d.tells.parameters.size(); ++j) {
    report::Series series;
    series.name = d.tells.parameters[j];
    for (const correlate::Contribution& c : d.tells.times) {
      series.x.push_back(0.5 * (c.from + c.to));
      series.y.push_back(100.0 * c.share[j]);
    }
    chart.series.push_back(std::move(series));
  }
  page->AddChart(chart);
}

}  // namespace

std::string CycleText(const std::vector<std::string>& cycle) {
  std::string out;
  for (const std::string& slot : cycle) out += (out.empty() ? "" : " ") + slot;
  return out;
}

TextTable ContributionRows(const std::vector<correlate::Contribution>& parts,
                           const std::vector<std::string>& parameters, const std::string& head) {
  TextTable rows = {{head, "readings"}};
  for (const std::string& name : parameters) {
    rows[0].push_back(name);
    rows[0].push_back("without");
  }
  for (const correlate::Contribution& c : parts) {
    rows.push_back({c.name, std::to_string(c.readings)});
    for (std::size_t j = 0; j < parameters.size(); ++j) {
      rows.back().push_back(DesignPagePercent(c.share[j]));
      rows.back().push_back(Times(c.without[j]));
    }
  }
  return rows;
}

TextTable PlanRows(const study::StudyDesign& d, const std::vector<study::DesignCase>& cases,
                   const std::string& head) {
  TextTable rows = {{head}};
  for (const std::string& name : d.tells.parameters) {
    rows[0].push_back(name + " alone");
    rows[0].push_back("together");
  }
  for (const study::DesignCase& c : cases) {
    rows.push_back({c.cycle.empty() ? c.name : fmt::format("{} ({})", c.name, CycleText(c.cycle))});
    for (std::size_t j = 0; j < d.tells.parameters.size(); ++j) {
      if (!c.message.empty()) {
        rows.back().insert(rows.back().end(), 2, j == 0 ? "does not run" : "-");
        continue;
      }
      rows.back().push_back(Times(c.alone[j] / d.now[j]));
      rows.back().push_back(Times(c.together[j] / d.now[j]));
    }
  }
  return rows;
}

void WriteDesignPage(const std::string& path, const std::string& study, const study::StudyDesign& d,
                     const data::Provenance& provenance) {
  report::Page page("What to measure next", study);
  std::vector<std::string> notes = {"The fit: " + d.fit.record.verdict};
  for (const std::string& note : d.notes) notes.push_back(Capitalised(note) + ".");
  page.AddWords(d.notes.empty() ? report::Level::kGood : report::Level::kCare, study::Advice(d),
                notes);
  page.AddSection(
      "What the trials at hand tell",
      "Share of the information about each parameter, frame, clocks, calibration and the "
      "other parameters being unknown; and by what its standard error grows without.");
  AddRows(&page, "Marks and instruments", "",
          ContributionRows(d.tells.series, d.tells.parameters, "what"));
  AddRows(&page, "Lines of the strobe", "",
          ContributionRows(d.tells.lines, d.tells.parameters, "line"));
  AddRows(&page, "Cameras", "", ContributionRows(d.tells.cameras, d.tells.parameters, "camera"));
  AddRows(&page, "Stretches of time", "",
          ContributionRows(d.tells.times, d.tells.parameters, "time"));
  AddTimes(&page, d);
  page.AddSection("What to do next",
                  "Standard error of each parameter over the one that the study has: by that trial "
                  "alone, and by it together with what is there.");
  std::vector<study::DesignCase> schedules = {d.again};
  if (!d.cycle.empty()) schedules.push_back(d.schedule);
  AddRows(&page, "The strobe", "", PlanRows(d, schedules, "cycle"));
  AddRows(&page, "Marks", "", PlanRows(d, d.marks, "with the mark"));
  AddRows(&page, "Instruments", "", PlanRows(d, d.channels, "with"));
  AddRows(&page, "Other trials", "", PlanRows(d, d.trials, "trial"));
  page.AddOrigin(provenance);
  page.Write(path);
}

}  // namespace unfurl::cli
