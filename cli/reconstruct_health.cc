#include "cli/reconstruct_health.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/sentence.h"

namespace unfurl::cli {

namespace {

using nlohmann::ordered_json;

// What became of a fault.
std::string Remedy(const data::TrialHealth& health, std::size_t fault) {
  if (health.certain[fault] == 0) return "samples of that time have no position; recalibrate";
  return health.corrected ? "taken out; recalibrate before the next trial"
                          : "its readings are left out; recalibrate, or --correct";
}

constexpr const char* kLightKinds[] = {"led", "gain", "focus", "all_light"};

const char* Remedy(const data::TrialLight& change) {
  constexpr const char* kRemedies[] = {
      "look at its supply and what stands before it", "look at its window, filter and gain",
      "look at its lens; recalibrate if it moved", "look at the LEDs' supply and the exposure"};
  return kRemedies[change.kind];
}

void AddLight(const data::TrialHealth& health, ordered_json* json, std::string* text) {
  (*json)["light"] = ordered_json::array();
  for (const data::TrialLight& change : health.light) {
    ordered_json one = {{"words", change.words}, {"kind", kLightKinds[change.kind]}};
    if (change.camera >= 0) one["camera"] = health.cameras[static_cast<std::size_t>(change.camera)];
    if (change.mark >= 0) one["mark"] = health.marks[static_cast<std::size_t>(change.mark)];
    one["certain"] = change.certain != 0;
    one["from"] = change.from;
    one["to"] = change.to;
    one["until"] = change.until;
    one["size"] = change.size;
    one["sigma"] = change.sigma;
    (*json)["light"].push_back(one);
    *text += fmt::format("{}: {}\n", change.words, Remedy(change));
  }
}

ordered_json ReconstructHealthFinite(double value) {
  return std::isfinite(value) ? ordered_json(value) : ordered_json(nullptr);
}

constexpr const char* kVouch =
    "one more camera would show it, `unfurl check` with points before and after the trial, or two "
    "marks on one rigid body (--rigid); --camera-shift makes error bars allow for it";
constexpr const char* kNotKept = "check the cameras, and whether those marks are on one rigid body";

constexpr const char* kWrongRemedy =
    "left out, and their samples have no position; look for reflections and slips";

constexpr const char* kMisfitRemedy =
    "error bars are widened by that; look for another finder of spots than the calibration's, a "
    "mount that sways, a lens that warmed, or recalibrate";

// Of the row: as much is no sway and no other finder of spots, as for slips of a record
// (measure/record_slips.cc) [-].
constexpr double kLargeMisfit = 0.01;

std::string ScatterRemedy(const data::TrialHealth& health) {
  if (!health.scatter_unknown.empty()) return "error bars are as right as the stated sigmas are";
  if (!health.scatter_wide) return "";
  return "error bars are widened by that; state larger sigmas, and look for what shakes or blurs";
}

void AddScatter(const data::TrialHealth& health, ordered_json* json, std::string* text) {
  ordered_json& out = (*json)["scatter"];
  out = {{"words", health.scatter_words}, {"wide", health.scatter_wide}};
  if (health.scatter_unknown.empty()) {
    out["factor"] = health.scatter;
    out["sigma"] = health.scatter_sigma;
  } else {
    out["why_not"] = health.scatter_unknown;
  }
  for (std::size_t c = 0; c < health.camera_scatter.size(); ++c) {
    out["cameras"][health.cameras[c]] = {{"factor", health.camera_scatter[c]},
                                         {"sigma", health.camera_scatter_sigma[c]}};
  }
  for (Eigen::Index m = 0; m < health.mark_scatter.rows(); ++m) {
    ordered_json& of = out["marks"][health.marks[static_cast<std::size_t>(m)]];
    for (Eigen::Index c = 0; c < health.mark_scatter.cols(); ++c) {
      of[health.cameras[static_cast<std::size_t>(c)]] = health.mark_scatter(m, c);
    }
  }
  if (!health.wrong_words.empty()) {
    ordered_json& wrong = (*json)["wrong_readings"];
    wrong["words"] = health.wrong_words;
    for (std::size_t c = 0; c < health.wrong.size(); ++c) {
      wrong["cameras"][health.cameras[c]] = health.wrong[c];
    }
    *text += fmt::format("{}: {}\n", health.wrong_words, kWrongRemedy);
  }
  if (!health.misfit_words.empty()) {
    ordered_json& misfit = (*json)["misfit"];
    misfit = {{"words", health.misfit_words}, {"px", health.misfit}};
    for (std::size_t c = 0; c < health.camera_misfit.size(); ++c) {
      misfit["cameras"][health.cameras[c]] = health.camera_misfit[c];
    }
    *text += fmt::format("{}: {}\n", health.misfit_words, kMisfitRemedy);
  }
  const std::string remedy = ScatterRemedy(health);
  *text += health.scatter_words + (remedy.empty() ? "" : ": " + remedy) + "\n";
}

}  // namespace

std::string HealthText(const data::TrialHealth& health, ordered_json* summary) {
  ordered_json& json = (*summary)["health"];
  json = {{"vouched", health.unvouched.empty()},
          {"looked_at", health.unknown.empty()},
          {"corrected", health.corrected}};
  std::string text;
  if (!health.unvouched.empty()) {
    json["unvouched"] = {{"words", health.unvouched}, {"remedy", kVouch}};
    text += fmt::format("{}: {}\n", health.unvouched, kVouch);
  }
  if (!health.distances.empty()) {
    json["distances"] = {{"words", health.distances}, {"kept", health.distances_kept}};
    text += fmt::format("{}{}{}\n", health.distances, health.distances_kept ? "" : ": ",
                        health.distances_kept ? "" : kNotKept);
  }
  if (!health.unknown.empty()) json["why_not"] = health.unknown;
  json["faults"] = ordered_json::array();
  constexpr const char* kKinds[] = {"moved", "drifting", "late"};
  for (std::size_t k = 0; k < health.words.size(); ++k) {
    json["faults"].push_back(
        {{"words", health.words[k]},
         {"kind", kKinds[health.kind[k]]},
         {"camera", health.cameras[static_cast<std::size_t>(health.camera[k])]},
         {"certain", health.certain[k] != 0},
         {"from", ReconstructHealthFinite(health.from[k])},
         {"to", ReconstructHealthFinite(health.to[k])},
         {"size", health.size[k]},
         {"sigma", health.sigma[k]},
         {"slope", health.slope[k]},
         {"slope_sigma", health.slope_sigma[k]},
         {"at", health.at[k]}});
    text += fmt::format("{}: {}\n", health.words[k], Remedy(health, k));
  }
  AddLight(health, &json, &text);
  AddScatter(health, &json, &text);
  if (!health.unknown.empty() && health.unvouched.empty()) {
    text += fmt::format("the cameras' health cannot be told: {}\n", health.unknown);
  }
  return text;
}

std::string MisfitTooLarge(const data::TrialHealth& health, const data::Rig& rig) {
  int row = 0;
  for (const data::RigCamera& camera : rig.cameras) row = std::max(row, camera.pixels);
  if (!(health.misfit > kLargeMisfit * row)) return "";
  return health.misfit_words +
         ": a camera is not the one that was calibrated, is read from the other end of its row, or "
         "sees other lights: look at --picture, and check the rig with some points";
}

report::Level AddVouching(const data::TrialHealth& health, std::vector<std::string>* details) {
  if (!health.distances.empty()) details->push_back(health.distances);
  if (!health.misfit_words.empty()) {
    details->push_back(Capitalised(health.misfit_words) + ": " + kMisfitRemedy + ".");
  }
  if (!health.unvouched.empty())
    details->push_back(Capitalised(health.unvouched) + ": " + kVouch + ".");
  if (!health.distances_kept) return report::Level::kBad;
  return health.unvouched.empty() && health.misfit_words.empty() ? report::Level::kGood
                                                                 : report::Level::kCare;
}

namespace {

// "Words: remedy. "
std::string Sentence(const std::string& words, const std::string& remedy) {
  return Capitalised(words) + (remedy.empty() ? "" : ": " + remedy) + ". ";
}

// What stands over the charts.
std::string Introduction(const data::TrialHealth& health) {
  std::string text = health.unvouched.empty() ? "" : Sentence(health.unvouched, kVouch);
  if (!health.distances.empty()) {
    text += Sentence(health.distances, health.distances_kept ? "" : kNotKept);
  }
  text +=
      health.unknown.empty()
          ? "Each camera against what the others predict of its readings, with their own faults "
            "taken out, and what its spots look like. "
          : "Whether a camera moved cannot be told: " + health.unknown + ". ";
  if (!health.wrong_words.empty()) {
    text += fmt::format("Some {}: {}. ", health.wrong_words, kWrongRemedy);
  }
  if (!health.misfit_words.empty()) text += Sentence(health.misfit_words, kMisfitRemedy);
  const std::string remedy = ScatterRemedy(health);
  return text + Capitalised(health.scatter_words) + (remedy.empty() ? "" : ": " + remedy) + ".";
}

void AddScatterTable(const data::TrialHealth& health, report::Page* page) {
  if (health.camera_scatter.empty()) return;
  report::Table table;
  table.title = "Scatter of readings over what is stated";
  table.header = {"camera", "factor", "its standard deviation"};
  for (Eigen::Index m = 0; m < health.mark_scatter.rows(); ++m) {
    table.header.push_back("of " + health.marks[static_cast<std::size_t>(m)]);
  }
  table.text_columns = {0};
  for (std::size_t c = 0; c < health.camera_scatter.size(); ++c) {
    table.rows.push_back({health.cameras[c], fmt::format("{:.2f}", health.camera_scatter[c]),
                          fmt::format("{:.2f}", health.camera_scatter_sigma[c])});
    for (Eigen::Index m = 0; m < health.mark_scatter.rows(); ++m) {
      table.rows.back().push_back(
          fmt::format("{:.2f}", health.mark_scatter(m, static_cast<Eigen::Index>(c))));
    }
  }
  page->AddTable(table);
}

void AddFaults(const data::TrialHealth& health, report::Page* page) {
  if (health.words.empty() && health.light.empty()) return;
  report::Table table;
  table.title = "Faults";
  table.header = {"what is wrong", "what was done, or is to be done"};
  table.text_columns = {0, 1};
  for (std::size_t k = 0; k < health.words.size(); ++k) {
    table.rows.push_back({health.words[k], Remedy(health, k)});
  }
  for (const data::TrialLight& change : health.light) {
    table.rows.push_back({change.words, Remedy(change)});
  }
  page->AddTable(table);
}

}  // namespace

void AddHealth(const data::TrialHealth& health, report::Page* page) {
  page->AddSection("The cameras' health", Introduction(health));
  const auto chart = [&](const char* title, const char* note, const char* name, const char* unit,
                         const Eigen::MatrixXd& value, const Eigen::MatrixXd* sigma) {
    constexpr double kBand = 2.0;  // sigmas
    report::Chart out;
    out.title = title;
    out.note = note;
    out.y = {name, unit, false};
    for (std::size_t c = 0; c < health.cameras.size(); ++c) {
      const auto j = static_cast<Eigen::Index>(c);
      report::Series series;
      series.name = health.cameras[c];
      series.style = report::Style::kDots;
      series.color = static_cast<int>(c);
      bool any = false;
      for (std::size_t k = 0; k < health.t.size(); ++k) {
        const auto i = static_cast<Eigen::Index>(k);
        series.x.push_back(health.t[k]);
        series.y.push_back(value(i, j));
        any = any || std::isfinite(value(i, j));
        if (sigma != nullptr) series.half_width.push_back(kBand * (*sigma)(i, j));
      }
      if (any) out.series.push_back(std::move(series));
    }
    for (std::size_t k = 0; k < health.words.size(); ++k) {
      if (!std::isfinite(health.from[k])) continue;
      out.markers.push_back({0.5 * (health.from[k] + health.to[k]),
                             health.cameras[static_cast<std::size_t>(health.camera[k])],
                             health.camera[k]});
    }
    for (const data::TrialLight& change : health.light) {
      if (&value == &health.offset_px || (&value == &health.width_px) != (change.kind == 2))
        continue;
      const std::string of =
          change.camera >= 0 ? health.cameras[static_cast<std::size_t>(change.camera)]
          : change.mark >= 0 ? health.marks[static_cast<std::size_t>(change.mark)]
                             : "all light";
      out.markers.push_back({0.5 * (change.from + change.to), of, std::max(change.camera, 0)});
    }
    if (!out.series.empty()) page->AddTimeSeries(std::move(out));
  };
  chart("Offset of each camera", "Median of a slice, with a band of two standard deviations.",
        "offset", "px", health.offset_px, &health.sigma_px);
  chart("Brightness of the spots",
        "Over the trial's median, mark by mark: it changes with the "
        "marks' places, too.",
        "gain", "1", health.gain, nullptr);
  chart("Width of the spots", "Median of a slice; it changes with the marks' places, too.", "width",
        "px", health.width_px, nullptr);
  AddScatterTable(health, page);
  AddFaults(health, page);
}

}  // namespace unfurl::cli
